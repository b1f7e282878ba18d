"""Tables 1 to 4 of paper A (Shinozawa et al. 2013), its numbers next to ours, as ratios.

    python -m benchmarks.papers.paper_tables [--out FOLDER] [--repetitions N]

Both sides are compiled, in double precision, and share the solver of the linear systems, so that
they differ by how the matrix comes about. Times: warm medians of programs run in turn; compilation
left out. The paints are of the paper's four pigments, by other hands. Writes a table.
"""

import functools
import itertools
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Results, command_line, ends, percent, quantities, quantity
from benchmarks.timing import REPEATED, Programs, interleaved
from glazejax import catalogue, colour, stack_reflectance_factor
from glazejax.radiative.auxiliary import assembly, uniform
from glazejax.radiative.auxiliary.kernel_table import KernelTable
from glazejax.radiative.auxiliary.uniform import reflectance_factor

WAVELENGTHS = np.arange(380.0, 781.0, 10.0)
INDEX, GROUND, THICKNESS = 1.5, 1.0, 12e-6
PAINTS = {
    "a": "lead-tin yellow/hyperdoc-gum-arabic-LTY",
    "b": "vermilion/revigo-Vermillion",
    "c": "viridian/revigo-ViridianGreen",
    "d": "ultramarine/revigo-UltramarineBlue",
}
"""Exemplars of the catalogue of pigments: the oils where it has them. Lead-tin yellow is in no oil.
"""
# No reading shows how strongly lead-tin yellow scatters, and so how thick a glaze of it is
# optically. This yellow scatters five times as much: it shows what depends on that.
THICKER = "chrome yellow/revigo-ChromeYellow"
# The paper's glazes hold 2.3 % of pigment by volume (section 2.2); the catalogue's films are
# masstones, of some ten times that. k and s of all its sources are in one unit.
THINNING = 0.1
PAIRS = tuple(itertools.combinations(PAINTS, 2))
STEPS = (0.01, 0.02, 0.03, 0.04)
SIZES = (30, 60, 90, 120)
DEGREES = np.arange(0, 91, 5)

# Tables 1, 2 and 3 (seconds) and 4 (mean, variance) of the paper.
PAPER_DIRECT = (31.10, 99.44, 185.40, 294.21)
PAPER_DECOMPOSED = (1.64, 2.56, 3.23, 3.92)
PAPER_SHORTENED = (0.0379, 0.0410, 0.0408, 0.0372, 0.0379, 0.0655)
PAPER_REUSED = (0.9769, 0.9836, 0.9842, 0.9843, 0.9765, 0.9476)
PAPER_COARSE = (
    (0.2881, 0.2051),
    (0.3047, 0.2119),
    (0.2798, 0.2015),
    (0.0083, 0.0082),
    (0.0259, 0.0252),
    (0.0803, 0.0739),
)
PAPER_FIXED = (
    (0.0203, 0.0199),
    (0.0092, 0.0091),
    (0.0139, 0.0137),
    (0.0018, 0.0018),
    (0.0055, 0.0055),
    (0.0480, 0.0457),
)

METHODS: dict[str, dict[str, Any]] = {
    "conventional": {"variant": "direct", "corrected": False},
    # With the matrix made, as the paper has it; `benchmarks.solver.auxiliary_products` has the faster way
    # without.
    "own step, decomposed": {"variant": "decomposed", "corrected": False, "product": "matrix"},
    "fixed step": {"variant": "fixed_step", "corrected": False, "product": "matrix"},
    "fixed step, corrected": {"variant": "fixed_step", "corrected": True, "product": "matrix"},
}
CONVENTIONAL, OWN, FIXED, CORRECTED = METHODS
COUNTED, TABLE = "fixed step, table counted", "table alone"
"""What is timed besides: the fixed step with a table that it makes itself, and making one."""
SHORTENED = {
    "conventional": (FIXED, CONVENTIONAL),
    "conventional_counted": (COUNTED, CONVENTIONAL),
    "corrected": (CORRECTED, CONVENTIONAL),
    "own_over_conventional": (OWN, CONVENTIONAL),
    "own": (FIXED, OWN),
    "own_counted": (COUNTED, OWN),
}
"""Methods whose times are compared: the one over the other."""


class Work(NamedTuple):
    """Stacks and how many they are."""

    albedo: np.ndarray  # (wavelengths, 2)
    thickness: np.ndarray


def work(**others: str) -> dict[str, Work]:
    """Albedo and optical thickness of the six pairs, by name.

    Args:
        others: exemplars in place of those of `PAINTS`, by letter.
    """
    paints = catalogue.load("pigments")
    albedo, thickness = {}, {}
    for letter, name in {**PAINTS, **others}.items():
        paint = paints[name]
        # Where a paint was not measured the values of its last band go on: below 400 nm, and the
        # oils beyond 700 nm.
        k, s = (
            THINNING * np.interp(WAVELENGTHS, paint.wavelengths, np.asarray(values, np.float64))
            for values in (paint.absorption, paint.scattering)
        )
        albedo[letter], thickness[letter] = s / (k + s), (k + s) * THICKNESS
    return {
        f"{i}/{j}": Work(
            np.stack([albedo[i], albedo[j]], 1), np.stack([thickness[i], thickness[j]], 1)
        )
        for i, j in PAIRS
    }


def spread_of_scattering(name: str) -> float:
    """The factor within which an exemplar's s is known: one standard deviation of its log."""
    paint = catalogue.load("pigments")[name]
    share = np.asarray(paint.scattering_sd) / np.asarray(paint.scattering)
    return float(np.exp(np.median(share)))


def decompose(
    step: jax.Array, count: jax.Array, most: int, refractive_index: float
) -> assembly.Operator:
    """What `assembly.direct` makes, from its numbers."""
    toeplitz, hankel, *ground = assembly.decomposed_numbers(step, count, most, refractive_index)
    return assembly.Operator(assembly.toeplitz_plus_hankel(toeplitz, hankel), *ground)


ASSEMBLIES = {"direct": assembly.direct, "decomposed": decompose}


@functools.partial(jax.jit, static_argnums=(2, 3))
def coefficient_matrix(step: jax.Array, count: jax.Array, most: int, variant: str) -> jax.Array:
    """The paper's A of every stack, eq. (26), at n = 1.5 and a ground of 1."""
    operator = ASSEMBLIES[variant](step, count, most, INDEX)
    shared = 2.0 * GROUND / (1.0 - GROUND * operator.k)[:, None, None]
    # Entry [segment, node], as the operator's.
    return operator.matrix + shared * operator.m_integrated.T[:, :, None] * operator.m.T[:, None, :]


def table_1(say: Results, repetitions: int) -> None:
    count = WAVELENGTHS.size
    say(
        "\nTable 1. Assembly of A, n = 1.5, ground 1, dh = .02: decomposed over direct, time\n"
        f"a spectrum of {count} matrices a call, {repetitions} repetitions\n"
        f"{'Q':>4} {'paper':>8} {'here':>8}   {'direct':>12} {'decomposed':>12}   largest "
        "difference of an entry"
    )
    # Every wavelength's own step, near .02.
    steps = jnp.asarray(0.02 * np.linspace(0.98, 1.02, count))
    for size, direct, decomposed in zip(SIZES, PAPER_DIRECT, PAPER_DECOMPOSED, strict=True):
        counts = jnp.full(count, size)
        programs: Programs = {
            variant: functools.partial(coefficient_matrix, steps, counts, size, variant)
            for variant in ("direct", "decomposed")
        }
        seconds = interleaved(programs, repetitions)
        difference = float(jnp.max(jnp.abs(programs["direct"]() - programs["decomposed"]())))
        ratio = seconds["decomposed"] / seconds["direct"]
        say(
            f"{size:4d} {decomposed / direct:8.2%} {ratio:8.2%}   "
            f"{1e6 * seconds['direct'] / count:9.0f} us "
            f"{1e6 * seconds['decomposed'] / count:9.0f} us   {difference:.1e}"
        )


def spectrum(pair: Work, step: float, method: str, **more) -> jax.Array:
    return reflectance_factor(
        pair.albedo,
        pair.thickness,
        GROUND,
        refractive_index=INDEX,
        step=step,
        **METHODS[method],
        **more,
    )


def with_new_table(pair: Work, step: float) -> jax.Array:
    """The fixed step's spectrum, its table made for it and used for its wavelengths only."""
    return spectrum(pair, step, FIXED, table=KernelTable(INDEX, step))


def new_table(pair: Work, step: float) -> KernelTable:
    """The table that a spectrum by the fixed step needs, no longer than that."""
    settings = uniform.GridSettings("fixed_step", False, INDEX, step)
    count = np.asarray(uniform._segments(pair.thickness.sum(axis=1), settings))
    return KernelTable(INDEX, step, uniform._rounded_up(int(count.max())))


def reuse(pair: Work, table: KernelTable) -> float:
    """Share of the numbers of H and U that are needed, 3Q - 1 a wavelength, and need not be
    computed.
    """
    counts = np.maximum(np.round(pair.thickness.sum(axis=1) / table.step).astype(int), 2)
    return 1.0 - table.grow(int(counts.max())) / int(np.sum(3 * counts - 1))


def seconds_of(pairs: dict[str, Work], repetitions: int, budget: float) -> dict[tuple, float]:
    """Seconds of a spectrum by pair, step and method; programs of one pair and step in turn."""
    seconds: dict[tuple, float] = {}
    for name, pair in pairs.items():
        for step in STEPS:
            programs: Programs = {
                method: functools.partial(spectrum, pair, step, method) for method in METHODS
            }
            programs[COUNTED] = functools.partial(with_new_table, pair, step)
            programs[TABLE] = functools.partial(new_table, pair, step)
            measured = interleaved(programs, repetitions, budget=budget)
            seconds |= {(name, step, method): value for method, value in measured.items()}
        print(f"{name} timed", file=sys.stderr, flush=True)
    return seconds


def say_paints(say: Results) -> None:
    """Which they are, their bands and scale, and how well the yellow's s is known."""
    paints = catalogue.load("pigments")
    say("paints, exemplars of the catalogue of pigments; k and s of the paper's are not printed:")
    for letter, name in PAINTS.items():
        bands = paints[name].wavelengths
        say(f"  {letter} {name}, {bands[0]:g}-{bands[-1]:g} nm")
    say(
        "Beyond its bands a paint's end values go on.\n"
        f"k and s are multiplied by {THINNING:g}: the catalogue's are of masstones 25 um thick, "
        "the paper's glazes hold\n"
        "2.3 % of pigment."
    )
    spread = spread_of_scattering(PAINTS["a"])
    say(
        "Readings of lead-tin yellow show k/s alone: its s is that of other families, known to a "
        f"factor of {spread:.1f}"
    )
    say.record(scattering_factor=quantity(spread, digits=1))
    say("(one standard deviation). Mean h of 12 um of it, by exemplar:")
    for name in paints:
        if name.startswith("lead-tin yellow/"):
            h = work(a=name)["a/b"].thickness[:, 0].mean()
            say(f"  {name} {h:.2f}")


def say_depths(say: Results, pairs: dict[str, Work]) -> None:
    depths = {name: pair.thickness.sum(axis=1) for name, pair in pairs.items()}
    say(
        "h, mean and largest: "
        + ", ".join(f"{n} {h.mean():.2f} {h.max():.2f}" for n, h in depths.items())
    )


def say_ratios(
    say: Results, pairs: dict[str, Work], seconds: dict[tuple, float]
) -> dict[str, list[np.floating]]:
    """A row for each comparison: the mean over the steps of the ratio, as the paper averages."""
    rows = {}
    for key, (method, base) in SHORTENED.items():
        row = [np.mean([seconds[n, h, method] / seconds[n, h, base] for h in STEPS]) for n in pairs]
        say(f"{f'here: {method} over {base}':<62}" + "".join(f"{value:9.2%}" for value in row))
        rows[key] = row
    return rows


def record_ratios(
    say: Results, rows: Mapping[str, Sequence[float | np.floating]], *keys: str
) -> None:
    """Least and most of some comparisons over the pairs; a key `own_thicker` takes the row `own`."""
    for key in keys:
        row = rows[key.removesuffix("_thicker")]
        digits = 0 if key.startswith("own") else 1
        percent = [100 * value for value in row]
        say.record(**quantities(ends(key, percent), "%", digits, n=len(percent)))


def tables_2_and_3(
    say: Results, pairs: dict[str, Work], repetitions: int, budget: float
) -> dict[tuple, float]:
    say(
        "\nTables 2 and 3. Spectrum of two layers at 0/0 degrees, 41 wavelengths: time\n"
        "conventional: own step, A by quadrature (table 1's direct). The paper's table 2 has the "
        "decomposed A there.\n"
        f"at most {repetitions} repetitions, at least 3. Fixed step: its table of H and U is kept "
        "from call to call, so\n"
        "that making it is not counted. Table counted: each spectrum makes a table of its own, "
        "once for its 41\n"
        "wavelengths, in the time. The paper's times hold such tables, too."
    )
    seconds = seconds_of(pairs, repetitions, budget)
    for method in (*METHODS, COUNTED, TABLE):
        say(f"\n{method}, ms")
        say("  step" + "".join(f"{name:>9}" for name in pairs) + "     mean")
        for step in STEPS:
            row = [1e3 * seconds[name, step, method] for name in pairs]
            say(f"{step:6.2f}" + "".join(f"{value:9.1f}" for value in (*row, np.mean(row))))

    say("\nratios, mean of the four steps" + " " * 32 + "".join(f"{name:>9}" for name in pairs))
    say(
        f"{'paper: fixed step over own step, decomposed':<62}"
        + "".join(f"{v:9.2%}" for v in PAPER_SHORTENED)
    )
    rows = say_ratios(say, pairs, seconds)
    compared = ("own", "own_counted", "conventional", "conventional_counted")
    record_ratios(say, rows, *compared, "own_over_conventional")
    record_ratios(say, {"paper": PAPER_SHORTENED}, "paper")
    together = []
    for step in STEPS:
        fixed, own = (sum(seconds[name, step, method] for name in pairs) for method in (FIXED, OWN))
        together.append((fixed + max(seconds[name, step, TABLE] for name in pairs)) / own)
    say(
        "one table for all pairs, counted once: fixed step over own step, decomposed, "
        f"{np.mean(together):.2%} of the time of all"
    )
    say.record(own_together=percent(np.mean(together)))
    say(f"{'paper: reuse rate':<62}" + "".join(f"{v:9.2%}" for v in PAPER_REUSED))
    kept = {step: KernelTable(INDEX, step) for step in STEPS}
    fresh = [
        np.mean([reuse(pair, KernelTable(INDEX, step)) for step in STEPS])
        for pair in pairs.values()
    ]
    onward = [np.mean([reuse(pair, kept[step]) for step in STEPS]) for pair in pairs.values()]
    say(
        f"{'here: reuse rate, a fresh table for each pair':<62}"
        + "".join(f"{v:9.2%}" for v in fresh)
    )
    say(
        f"{'here: reuse rate, table kept from pair to pair':<62}"
        + "".join(f"{v:9.2%}" for v in onward)
    )
    say(
        "(With a fresh table 41 wavelengths reuse 40/41 = 97.56 % at most, all of one thickness; "
        "the paper has more.)"
    )
    return seconds


def rgb(pair: Work, method: str, step: float) -> np.ndarray:
    """24-bit sRGB under D65 at all angles, (19, 19, 3); whole numbers."""
    # At 90 degrees the surface lets nothing in or out; the limit, black, is computed a hair below.
    cosines = np.maximum(np.cos(np.radians(DEGREES)), 1e-6)
    given = (pair.albedo[:, None, None], pair.thickness[:, None, None], GROUND)
    angles: dict = {"cos_incidence": cosines[:, None], "cos_viewing": cosines}
    if method == "exact":
        factor = stack_reflectance_factor(*given, refractive_index=INDEX, tolerance=1e-9, **angles)
    else:
        factor = reflectance_factor(
            *given, refractive_index=INDEX, step=step, **METHODS[method], **angles
        )
    return np.round(
        255 * np.asarray(colour.srgb(WAVELENGTHS, np.moveaxis(np.asarray(factor), 0, -1)))
    )


def table_4(say: Results, pairs: dict[str, Work]) -> None:
    say(
        "\nTable 4. Absolute difference of 24-bit RGB over 19 x 19 angles, 0 to 90 degrees: mean "
        "(variance)\n"
        "90 degrees, where the surface is a mirror, counts as its limit: black. sRGB under D65, "
        "0-255, rounded."
    )
    head = f"{'':<46}" + "".join(f"{name:>17}" for name in pairs)
    ours: dict[str, list[tuple[float, float]]] = {}
    for pair in pairs.values():
        reference, exact = rgb(pair, OWN, 0.01), rgb(pair, "exact", 0.0)

        def compare(name: str, found: np.ndarray, wanted: np.ndarray) -> None:
            off = np.abs(found - wanted)
            ours.setdefault(name, []).append((float(off.mean()), float(off.var())))

        coarse, fixed = rgb(pair, OWN, 0.04), rgb(pair, FIXED, 0.01)
        compare("here: coarsened to own step .04", coarse, reference)
        compare("here: fixed step .01", fixed, reference)
        compare("own step .01", reference, exact)
        compare("own step .04", coarse, exact)
        compare("fixed step .01", fixed, exact)
        for step in (0.01, 0.04):
            compare(
                f"fixed step {step:.2f}, corrected".replace("0.", "."),
                rgb(pair, CORRECTED, step),
                exact,
            )

    def row(name: str, values) -> None:
        say(f"{name:<46}" + "".join(f"{mean:8.4f} ({spread:6.4f})" for mean, spread in values))

    say("\nagainst own step .01, as in the paper")
    say(head)
    row("paper: coarsened to own step .04", PAPER_COARSE)
    row("paper: fixed step .01", PAPER_FIXED)
    for name in list(ours)[:2]:
        row(name, ours[name])
    say("\nagainst the default solver at a tolerance of 1e-9")
    say(head)
    for name in list(ours)[2:]:
        row(name, ours[name])
    coarse, fixed = (dict(zip(pairs, values, strict=True)) for values in list(ours.values())[:2])
    paper = [dict(zip(pairs, values, strict=True)) for values in (PAPER_COARSE, PAPER_FIXED)]
    say.record(
        ac_fixed=quantity(fixed["a/c"][0], digits=3),
        ac_coarse=quantity(coarse["a/c"][0], digits=3),
        bc_fixed=quantity(fixed["b/c"][0], digits=3),
        bc_paper=quantity(paper[1]["b/c"][0], digits=4),
        ab_coarse_paper=quantity(paper[0]["a/b"][0]),
    )


def thicker_yellow(say: Results, names: list[str], repetitions: int, budget: float) -> None:
    """What would change if a glaze of the yellow were thicker optically: another yellow for it."""
    pairs = {name: pair for name, pair in work(a=THICKER).items() if name in names}
    say(f"\nThe same with a thicker yellow: {THICKER} in place of a")
    say_depths(say, pairs)
    say(f"{'ratios, mean of the four steps':<62}" + "".join(f"{name:>9}" for name in pairs))
    rows = say_ratios(say, pairs, seconds_of(pairs, repetitions, budget))
    record_ratios(say, rows, "own_thicker", "own_counted_thicker", "conventional_thicker")
    say("mean difference of 24-bit RGB against own step .01, as in table 4")
    found = {name: rgb(pair, OWN, 0.01) for name, pair in pairs.items()}
    for key, words, method, step in (
        ("ac_coarse_thicker", "coarsened to own step .04", OWN, 0.04),
        ("ac_fixed_thicker", "fixed step .01", FIXED, 0.01),
    ):
        off = {n: np.abs(rgb(pair, method, step) - found[n]).mean() for n, pair in pairs.items()}
        say(f"{'here: ' + words:<62}" + "".join(f"{value:9.4f}" for value in off.values()))
        say.record(**{key: quantity(off["a/c"], digits=3)})


def default_solver(
    say: Results, pairs: dict[str, Work], seconds: dict[tuple, float], repetitions: int
) -> None:
    """The default solver on tables 2 and 3's work compared with the conventional method at dh = .01."""
    albedo, thickness = (np.stack([getattr(p, k) for p in pairs.values()]) for k in Work._fields)

    def solve(tolerance: float, **pair):
        return stack_reflectance_factor(
            pair.get("albedo", albedo),
            pair.get("thickness", thickness),
            GROUND,
            tolerance=tolerance,
        )

    truth = np.asarray(solve(1e-10))
    errors = {
        (step, method): max(
            float(np.max(np.abs(np.asarray(spectrum(pair, step, method)) - right)))
            for pair, right in zip(pairs.values(), truth, strict=True)
        )
        for step in STEPS
        for method in METHODS
    }
    wanted = 0.1 * errors[0.01, CONVENTIONAL]
    tolerance, error = next(
        (t, e)
        for t in 10.0 ** -np.arange(2, 11)
        if (e := float(np.max(np.abs(solve(t) - truth)))) <= wanted
    )
    programs: Programs = {"all": functools.partial(solve, tolerance)}
    programs |= {
        name: functools.partial(solve, tolerance, albedo=p.albedo, thickness=p.thickness)
        for name, p in pairs.items()
    }
    measured = interleaved(programs, max(repetitions, 60))
    conventional = sum(seconds[name, 0.01, CONVENTIONAL] for name in pairs)
    fixed = sum(seconds[name, 0.01, FIXED] for name in pairs)
    say("\nLargest error of the reflectance factor over all pairs and wavelengths, 0/0 degrees")
    say("  step" + "".join(f"{method:>24}" for method in METHODS))
    for step in STEPS:
        say(f"{step:6.2f}" + "".join(f"{errors[step, method]:24.1e}" for method in METHODS))
    one = sum(measured[name] for name in pairs)
    say(
        f"\nDefault solver (tolerance {tolerance:.0e}) over the conventional method at dh = .01, "
        "the six pairs\n"
        f"  error ratio {error / errors[0.01, CONVENTIONAL]:.3f} ({error:.1e})\n"
        f"  time ratio  {measured['all'] / conventional:.4%}, all pairs in one call; "
        f"{one / conventional:.4%}, one by one\n"
        f"  over the fixed step: {measured['all'] / fixed:.2%}; {one / fixed:.2%}"
    )
    say.record(
        default_errors=quantity(errors[0.01, CONVENTIONAL] / error, digits=0),
        default_time=percent(measured["all"] / conventional, 2),
        default_time_one_by_one=percent(one / conventional, 2),
    )
    counted = sum(seconds[name, 0.01, COUNTED] for name in pairs)
    for key, timed, method in (
        ("conventional", CONVENTIONAL, CONVENTIONAL),
        ("own", OWN, OWN),
        ("fixed", COUNTED, FIXED),
    ):
        total = sum(seconds[name, 0.01, timed] for name in pairs)
        say.record(
            **{
                f"{key}_ms": quantity(1e3 * total / len(pairs), "ms", digits=1),
                f"{key}_error": quantity(errors[0.01, method], digits=1, form="e"),
            }
        )
        if timed != COUNTED:
            say.record(**{f"{key}_times": quantity(total / counted, "times", form="g")})


def main() -> None:
    options = command_line(__doc__, None, **REPEATED).parse_args()
    if options.quick:
        globals().update(
            SIZES=SIZES[:1], PAPER_DIRECT=PAPER_DIRECT[:1], PAPER_DECOMPOSED=PAPER_DECOMPOSED[:1]
        )
        globals().update(STEPS=(0.01, 0.04))
    jax.config.update("jax_enable_x64", True)
    pairs = work()
    say = Results("paper_tables", options.out)
    say(
        "Tables of paper A (Shinozawa, Kurumisawa, Takata, Joe 2013) and the same here, double "
        "precision"
    )
    say_paints(say)
    say("Two layers of 12 um, n = 1.5, ground 1, 380-780 nm.")
    say_depths(say, pairs)
    say(
        "\ndirect: every entry by its own quadrature, 4 Gauss nodes in the segment and 14 in ln "
        "mu (14 + 6 for U), the\n"
        "fewest that leave each entry within 1e-6, where MATLAB's dblquad stops by default; "
        "decomposed: exponential\n"
        "integrals, exact. Both solve by conjugate gradients to 1e-11."
    )
    table_1(say, options.repetitions)
    seconds = tables_2_and_3(say, pairs, options.repetitions, options.budget)
    table_4(say, pairs)
    default_solver(say, pairs, seconds, options.repetitions)
    yellow = ["a/c"] if options.quick else ["a/b", "a/c", "a/d"]
    thicker_yellow(say, yellow, options.repetitions, options.budget)
    say.save()


if __name__ == "__main__":
    main()
