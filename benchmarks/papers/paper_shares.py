"""Why paper A's fixed step saves less here than in the paper, and where it saves as much.

    python -m benchmarks.papers.paper_shares [--out FOLDER] [--repetitions N]

First the share of the assembly of H, U and M in the time of a spectrum: what an own step pays for
every wavelength and the fixed step for none. Then many glazes, wavelengths and angles through one
table of the fixed step. The paints, layers and methods are those of `benchmarks.papers.paper_tables`;
programs that are compared run in turn.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.papers.paper_tables import (
    ASSEMBLIES,
    CONVENTIONAL,
    CORRECTED,
    FIXED,
    GROUND,
    INDEX,
    METHODS,
    OWN,
    PAPER_SHORTENED,
    STEPS,
    Work,
    spectrum,
    work,
)
from benchmarks.results import Results, command_line, ends, percent, quantities
from benchmarks.timing import REPEATED, Programs, interleaved
from glazejax.radiative.auxiliary import assembly, uniform
from glazejax.radiative.auxiliary.kernel_table import KernelTable
from glazejax.radiative.auxiliary.uniform_solver import GridSettings

CHOSEN = ("a/b", "b/c", "c/d")
"""Every paint once, vermilion and viridian twice."""
ENDS = (STEPS[0], STEPS[-1])
GLAZES = (1, 10, 100)
INCIDENCES = np.cos(np.radians(np.arange(0.0, 86.0, 5.0)))
"""All at once; the matrix is the same for all of them."""
QUOTED = {(100, 1): "hundred", (10, INCIDENCES.size): "angles"}


@functools.partial(jax.jit, static_argnums=(2, 3))
def assembled(steps: jax.Array, counts: jax.Array, most: int, variant: str) -> jax.Array:
    """The matrices of all stacks, one after the other as the solver makes them, each used for one
    product.
    """

    def one(stack: tuple[jax.Array, jax.Array]) -> jax.Array:
        made = ASSEMBLIES[variant](stack[0][None], stack[1][None], most, INDEX)
        return made.matrix[0] @ jnp.ones(most) + made.m[:, 0] + made.m_integrated[:, 0] + made.k[0]

    return jax.lax.map(one, (steps, counts))


@functools.partial(jax.jit, static_argnums=2)
def looked_up(vectors: tuple[jax.Array, jax.Array], ones: jax.Array, most: int) -> jax.Array:
    """H + U of the fixed step from the table, used for one product with every wavelength."""
    return (
        assembly.toeplitz_plus_hankel(vectors[0][:most], vectors[1][: 2 * most - 1]) @ ones[:most]
    )


def assembly_alone(pair: Work, step: float, method: str) -> Callable[[], object]:
    """What of a spectrum's program makes the matrices: the same groups of wavelengths, padded
    alike.
    """
    variant = METHODS[method]["variant"]
    depth = pair.thickness.sum(axis=1)
    count = np.asarray(uniform._segments(depth, GridSettings(variant, False, INDEX, step)))
    calls: list[Callable[[], object]] = []
    for rows, most in uniform._buckets(count, uniform._WORTH_A_BUCKET[variant]):
        if variant == "fixed_step":
            table = KernelTable(INDEX, step, most)
            vectors = (jnp.asarray(table.toeplitz), jnp.asarray(table.hankel))
            calls.append(functools.partial(looked_up, vectors, jnp.ones((most, rows.size)), most))
            continue
        for some in ([row] for row in rows) if most >= uniform._ALONE else (rows,):
            own = jnp.asarray(depth[some] / count[some]), jnp.asarray(count[some])
            calls.append(functools.partial(assembled, *own, most, variant))
    return lambda: [call() for call in calls]


def shares(say: Results, pairs: dict[str, Work], repetitions: int, budget: float) -> None:
    """Assembly over the whole, before and after the step is fixed."""
    say(
        "Time of the assembly over that of a whole spectrum, 41 wavelengths, 0/0 degrees; mean "
        f"of {', '.join(CHOSEN)}.\n"
        "Assembly: H, U, M and one product with the matrix, so that the compiler does not leave "
        "it out; a program of\n"
        "its own, so that a share is good to some per cent."
    )
    methods = (CONVENTIONAL, OWN, FIXED)
    say(
        f"{'step':>6}"
        + "".join(f"{m:>24}" for m in methods)
        + f"{'fixed over own step':>24}{'without assembly':>20}"
    )
    means = {}
    for step in ENDS:
        found: dict[str, list[float]] = {m: [] for m in (*methods, "ratio", "left")}
        for pair in (pairs[name] for name in CHOSEN):
            programs: Programs = {}
            for method in methods:
                programs[method] = functools.partial(spectrum, pair, step, method)
                programs[method + " alone"] = assembly_alone(pair, step, method)
            seconds = interleaved(programs, repetitions, budget=budget)
            for method in methods:
                found[method].append(seconds[method + " alone"] / seconds[method])
            found["ratio"].append(seconds[FIXED] / seconds[OWN])
            found["left"].append(1 - found[OWN][-1])
        means[step] = {name: np.mean(values) for name, values in found.items()}
        cells = zip(means[step].values(), (24,) * 4 + (20,), strict=True)
        say(f"{step:6.2f}" + "".join(f"{value:{width}.1%}" for value, width in cells))
    for key, name in (("assembly", OWN), ("fixed", "ratio"), ("without", "left")):
        shares = [100 * mean[name] for mean in means.values()]
        say.record(**quantities(ends(key, shares), "%", 0, n=len(shares)))
    say.record(paper=percent(1 - max(PAPER_SHORTENED)))
    say("")
    printed = ", ".join(f"{v:.1%}" for v in PAPER_SHORTENED)
    say(
        f"paper: fixed over own step {printed}: its assembly takes at least "
        f"{1 - max(PAPER_SHORTENED):.0%} of the time,\n"
        "for it computes each number of H and U by a quadrature. Last column: what an own step "
        "would take if its\n"
        "assembly cost nothing."
    )


def many(say: Results, pairs: dict[str, Work], repetitions: int, budget: float) -> None:
    """Many glazes, wavelengths and angles through one table."""
    rng = np.random.default_rng(3)
    names = list(pairs)
    say(
        "\nMany glazes at once through one table: random pairs, each layer .5 to 1.5 times as "
        "thick; 41 wavelengths\n"
        f"{'step':>6}{'glazes':>8}{'incidences':>12}{'own step':>14}"
        f"{'fixed step':>14}{'ratio':>9}{'fixed, corrected':>20}"
    )
    step = ENDS[0]
    for glazes in GLAZES:
        chosen = [pairs[name] for name in rng.choice(names, glazes)]
        factor = rng.uniform(0.5, 1.5, (glazes, 1, 2))
        batch = Work(
            np.stack([p.albedo for p in chosen]), np.stack([p.thickness for p in chosen]) * factor
        )
        for angles in (1, INCIDENCES.size) if glazes == 10 else (1,):
            given = {} if angles == 1 else {"cos_incidence": INCIDENCES}
            # Angles on an axis of their own, so that a matrix serves them all.
            one = (
                batch
                if angles == 1
                else Work(batch.albedo[..., None, :], batch.thickness[..., None, :])
            )
            programs: Programs = {
                method: functools.partial(spectrum, one, step, method, **given)
                for method in (OWN, FIXED, CORRECTED)
            }
            seconds = interleaved(programs, repetitions, budget=budget)
            each = {m: 1e3 * s / glazes for m, s in seconds.items()}
            key = QUOTED.get((glazes, angles))
            if key is not None:
                say.record(**{key: percent(each[FIXED] / each[OWN])})
            say(
                f"{step:6.2f}{glazes:8d}{angles:12d}{each[OWN]:11.1f} ms{each[FIXED]:11.2f} ms"
                f"{each[FIXED] / each[OWN]:9.1%}{each[CORRECTED]:17.2f} ms"
            )
    say("ms a glaze, all its wavelengths and incidences.")


def main() -> None:
    """Command line."""
    options = command_line(__doc__, None, **REPEATED).parse_args()
    if options.quick:
        globals().update(CHOSEN=CHOSEN[1:])
    jax.config.update("jax_enable_x64", True)
    say = Results("paper_shares", options.out)
    say(
        "Paper A, tables 2 and 3: where the time goes, before and after the step is fixed\n"
        f"Two layers of 12 um, n = {INDEX:g}, ground {GROUND:g}, paints as in paper_tables.txt\n"
    )
    pairs = work()
    shares(say, pairs, options.repetitions, options.budget)
    many(say, pairs, options.repetitions, options.budget)
    say.save()


if __name__ == "__main__":
    main()
