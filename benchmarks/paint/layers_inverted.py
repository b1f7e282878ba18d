"""Stacks of coats found again: do 90 % intervals hold the truth nine times in ten, and what is not
known?

    python -m benchmarks.paint.layers_inverted [--stacks 40] [--unknown 8] [--seed 0] [--out FOLDER]

Known paints: a glaze of one paint of the catalogue over a body of two, thicknesses, fractions,
gloss and the paints' error drawn from what `glazefit.posterior_of_coats` takes for likely
(thicknesses about 8 and 30 um); k and s of each coat are then really off by smooth random factors
of that size, those of each paint by what it states, and readings by the model's own smooth error.
Unknown paint: a coat whose k d and s d are drawn from
`glazefit.SpectraPrior`, over 30 um of a known paint, read over two grounds or over one; and, in
their place, paints of the catalogue, which no prior drew. Readings come from the public solver at
an error of 1e-6, over a black and a white ground, every 50 nm, with the noise of `glazefit.Noise`.

A quantity counts as known if its interval is less than .9 as wide as before the measurement. The
error behind a share is by counting stacks, whose quantities hang together: the standard deviation
of their shares over the root of their number.
"""

import itertools
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Quantity, Results, command_line, ends, quantities, quantity
from benchmarks.rivals.baselines import spectra_of

# Laplace is trusted of few stacks, of a small run's of none.
NEEDS_SIZE = ("trusted",)

GRID = np.arange(400.0, 701.0, 50.0)
GROUNDS = np.array([0.03, 0.93])
GLAZE, BODY = 8e-6, 30e-6
STEPS, UNKNOWN_STEPS, WALKERS = 200, 200, 16
# Kinds of stacks of an unknown paint, by the names of what is recorded of them.
UNKNOWN = {
    "two_grounds": "two grounds",
    "one_ground": "one ground",
    "shelf": "a paint of the catalogue, two grounds",
}
# Noise of a ground that is not there.
NOTHING = 1e3


class Simulated(NamedTuple):
    """Films, what is known of their coats, and the truth by quantity, (films,)."""

    films: list[Any]
    coats: list[list[Any]]
    truth: dict[str, np.ndarray]


class Found(NamedTuple):
    """Where the truth lies in a quantity's posterior, and how wide that is over the prior's, each
    (stacks,).
    """

    hmc: np.ndarray
    laplace: np.ndarray
    width: np.ndarray
    trusted: np.ndarray


def smooth_errors(
    rng: np.random.Generator,
    size: np.ndarray,
    coats: int,
    length: float,
    grid: np.ndarray = GRID,
) -> np.ndarray:
    """Factors of k and s, (films, coats, 2, bands), off by these shares."""
    from glazefit.film.model.errors import smooth_kernel

    root = np.linalg.cholesky(smooth_kernel(grid, length) + 1e-9 * np.eye(grid.size))
    return np.exp(
        size[:, None, None, None] * (rng.standard_normal((size.size, coats, 2, grid.size)) @ root.T)
    )


def real_spectra(rng: np.random.Generator, chosen: list[list[Any]]) -> np.ndarray:
    """k and s of each film's paints, (films, paints, 2, bands), off by errors that they state."""
    from glazefit.film.model.errors import ModelError, stated_modes

    spectra = []
    for paints in chosen:
        modes = stated_modes(paints, ModelError(unstated=0.0))
        off = np.tensordot(rng.standard_normal(len(modes)), modes, 1)
        spectra.append(spectra_of(paints) * np.exp(off))
    return np.array(spectra)


def with_model_errors(
    rng: np.random.Generator, exact: np.ndarray, grid: np.ndarray = GRID
) -> np.ndarray:
    """Readings, (films, bands, grounds), with the model's own smooth error."""
    from glazefit.film.model.errors import ModelError, draw_model_errors

    law = ModelError()
    off = draw_model_errors(rng, len(exact), exact.shape[-1], grid, law)
    # They are drawn for a reflectance of 0.
    return exact + np.swapaxes(off, 1, 2) * law.model_sd(exact) / law.amplitude


def read(
    rng: np.random.Generator, optical: np.ndarray, gloss: np.ndarray, grounds: np.ndarray, tag: str
) -> list[Any]:
    """Readings of films with these k d and s d, (films, coats, 2, bands), each over so many
    grounds.
    """
    from glazefit import Instrument, Noise, Reading
    from glazejax import stack_hemispherical_reflectance

    instrument, noise = Instrument(), Noise()
    k, s = (np.moveaxis(optical[:, :, i], 1, -1)[:, :, None] for i in (0, 1))
    body = stack_hemispherical_reflectance(
        jnp.asarray(s / (k + s)),
        jnp.asarray(k + s),
        jnp.asarray(GROUNDS),
        refractive_index=1.5,
        cos_incidence=instrument.cos_incidence,
        tolerance=1e-6,
    )
    exact = np.asarray(body) + gloss[:, None, None] * instrument.seen_surface
    exact = with_model_errors(rng, exact)
    seen = np.maximum(exact + noise.sd(exact) * rng.standard_normal(exact.shape), 0.0)
    under, names = np.broadcast_to(GROUNDS, seen.shape[1:]), ("black", "white")
    films = []
    for n, reading in enumerate(seen):
        # White stays where there is one ground.
        sd = np.where((np.arange(2) == 0) & (grounds[n] == 1), NOTHING, noise.sd(reading))
        films.append(Reading(f"{tag} {n}", GRID, reading, under, sd, np.zeros_like(reading), names))
    return films


def shown_spread(spread: float, paints: int) -> float:
    """Standard deviation of the log of thickness times strength, of a film of so many paints with
    uniform fractions; `spread` is that of the thickness.
    """
    from glazefit.film.model.variation import STRENGTH

    return float(np.hypot(spread, STRENGTH * np.sqrt(2.0 / (paints + 1))))


def known_paints(count: int, rng: np.random.Generator) -> Simulated:
    """A glaze of one paint over a body of two."""
    from glazefit import CoatPrior, Prior
    from glazejax import catalogue

    prior = Prior()
    shelf = [p.resample(GRID) for p in catalogue.load().values()]
    chosen = [[shelf[i] for i in rng.choice(len(shelf), 3, replace=False)] for _ in range(count)]
    # As readings show them.
    spreads = np.array([shown_spread(prior.spread, paints) for paints in (1, 2)])
    thick = np.array([GLAZE, BODY]) * np.exp(spreads * rng.standard_normal((count, 2)))
    share, gloss = (
        rng.dirichlet(np.full(2, prior.concentration_known), count),
        rng.uniform(size=count),
    )
    error = prior.error * np.exp(prior.error_spread * rng.standard_normal(count))
    paints = real_spectra(rng, chosen)
    body = np.einsum("fp,fpcb->fcb", share, paints[:, 1:])
    optical = np.stack([paints[:, 0], body], axis=1) * thick[:, :, None, None]
    optical = optical * smooth_errors(rng, error, 2, prior.error_length)
    spread = prior.spread
    coats = [[CoatPrior(p[:1], GLAZE, spread), CoatPrior(p[1:], BODY, spread)] for p in chosen]
    truth = {"thickness of coat 1": thick[:, 0], "fraction 1 of coat 2": share[:, 0]}
    truth |= {"thickness of coat 2": thick[:, 1], "gloss": gloss, "model error": error}
    return Simulated(read(rng, optical, gloss, np.full(count, 2), "stack"), coats, truth)


def unknown_paint(count: int, rng: np.random.Generator) -> Simulated:
    """A coat of unknown paint over a known one: over two grounds, over one, and with real paints
    over two.
    """
    from glazefit import CoatPrior, Prior, SpectraPrior
    from glazejax import catalogue

    prior, spectra = Prior(), SpectraPrior()
    shelf = [p.resample(GRID) for p in catalogue.load().values()]
    films = 3 * count
    apart = np.sqrt(5.0) * np.abs(GRID[:, None] - GRID) / spectra.length
    alike = (1.0 + apart + apart**2 / 3.0) * np.exp(-apart)
    drawn = []
    for median, level, shape in (
        (spectra.absorption, spectra.absorption_level, spectra.absorption_shape),
        (spectra.scattering, spectra.scattering_level, spectra.scattering_shape),
    ):
        root = np.linalg.cholesky(level**2 + shape**2 * alike)
        drawn.append(median * np.exp(rng.standard_normal((films, GRID.size)) @ root.T))
    top = np.stack(drawn, axis=1)
    real = spectra_of([shelf[i] for i in rng.choice(len(shelf), count, replace=count > len(shelf))])
    top[2 * count :] = (
        np.maximum(real, 1.0) * 25e-6 * np.exp(rng.standard_normal((count, 1, 1)) - 1.0)
    )
    below = [shelf[i] for i in rng.choice(len(shelf), films)]
    error = prior.error * np.exp(prior.error_spread * rng.standard_normal(films))
    under = real_spectra(rng, [[paint] for paint in below])[:, 0]
    optical = np.stack([top, under * BODY], axis=1)
    optical[:, 1:] *= smooth_errors(rng, error, 1, prior.error_length)
    gloss = rng.uniform(size=films)
    coats = [[CoatPrior(), CoatPrior([paint], BODY)] for paint in below]
    truth = {"gloss": gloss, "model error": error}
    for b, wavelength in enumerate(GRID):
        k, s = optical[:, 0, :, b].T
        truth |= {
            f"{n} at {wavelength:g} nm": v
            for n, v in (("absorption", k), ("scattering", s), ("ratio", k / s))
        }
    return Simulated(read(rng, optical, gloss, np.repeat([2, 1, 2], count), "coat"), coats, truth)


def side_by_side(problems: Iterable[Any]) -> Any:
    """Problems of one structure, one prior and the same known fractions as one, their blocks one
    after another: what all share is the first one's. Paints differ: fractions are called by number.
    """
    first, *others = problems
    for other, what in itertools.product(others, ("mean", "sd")):
        assert np.array_equal(getattr(first.shared, what), getattr(other.shared, what))
    paints: Counter[str] = Counter()
    reported = []
    for asked in first.quantities:
        name = asked.name
        if name.startswith("fraction "):
            _, of, coat = name.partition(" of coat ")
            paints[coat] += 1
            name = f"fraction {paints[coat]}{of}{coat}"
        reported.append(asked._replace(name=name))
    # Paints state different numbers of errors.
    stated = [problem.data.stated for problem in (first, *others)]
    most = max(modes.shape[1] for modes in stated)
    blocks_data = [
        problem.data._replace(
            stated=jnp.pad(modes, ((0, 0), (0, most - modes.shape[1]), *3 * ((0, 0),)))
        )
        for problem, modes in zip((first, *others), stated, strict=True)
    ]
    data = jax.tree.map(lambda *arrays: jnp.concatenate(arrays), *blocks_data)
    blocks = tuple(block for problem in (first, *others) for block in problem.blocks)
    return replace(first, blocks=blocks, data=data, quantities=tuple(reported))


def posed_stacks(films: list[Any], coats: list[list[Any]]) -> Any:
    """Problem of some films of coats side by side."""
    from glazefit import Instrument, Prior, SpectraPrior
    from glazefit.posterior.film import pose_stack

    settings = Instrument(), Prior(), SpectraPrior()
    return side_by_side(
        pose_stack(film, stack, *settings) for film, stack in zip(films, coats, strict=True)
    )


def find(simulated: Simulated, steps: int, seed: int) -> tuple[dict[str, Found], Any]:
    """Where the truth lies in each posterior, and the chain's autocorrelation times."""
    from glazefit.film.sampling import Sampling
    from glazefit.film.solve import solve
    from glazefit.posterior.posterior import sample

    films = simulated.films
    problem, modes = solve(posed_stacks(films, simulated.coats))
    posterior = sample(
        problem,
        modes,
        tuple(films),
        Sampling(steps=steps, walkers=WALKERS, seed=seed),
    )
    before = problem.prior_draws(np.random.default_rng(seed), 4000)[:, None]
    found = {}
    for asked in problem.quantities:
        if asked.name not in simulated.truth:
            continue
        scale = np.log if asked.logarithmic else np.asarray
        value = simulated.truth[asked.name]
        draws = asked.values(posterior.free).reshape(-1, value.size)
        low, high = np.quantile(scale(draws), (0.05, 0.95), axis=0)
        first, last = np.quantile(scale(asked.values(before)), (0.05, 0.95))
        found[asked.name] = Found(
            (draws < value).mean(axis=0),
            (asked.values(posterior.laplace.sample) < value).mean(axis=0),
            (high - low) / (last - first),
            posterior.laplace.trusted,
        )
    return found, posterior.convergence


class Share(NamedTuple):
    """In %, with its error; NaN of no case."""

    value: float
    error: float

    def __str__(self) -> str:
        return "none" if np.isnan(self.value) else f"{self.value:.0f}% +- {self.error:.0f}%"

    def quantities(self, name: str, n: int) -> dict[str, Quantity]:
        """To be recorded: NAME and NAME_error, of so many stacks; nothing of no case."""
        if np.isnan(self.value):
            return {}
        return quantities({name: self.value, f"{name}_error": self.error}, "%", 0, n=n)


class Row(NamedTuple):
    """A line of the table: how many cases, how often the truth is held, and how often Laplace is
    trusted.
    """

    cases: int
    known: float
    hmc: Share
    hmc_known: Share
    laplace: Share
    trusted: Share
    trusts: float


def held(ranks: np.ndarray, where: np.ndarray | None = None) -> Share:
    """Share of cases, (stacks, quantities), in the 90 % interval, with its error by counting
    stacks.
    """
    hits = np.abs(ranks - 0.5) <= 0.45
    chosen = np.ones(hits.shape, bool) if where is None else where
    stacks = chosen.any(axis=1)
    if not stacks.any():
        return Share(np.nan, np.nan)
    each, weight = (hits & chosen).sum(axis=1)[stacks], chosen.sum(axis=1)[stacks]
    share = each.sum() / weight.sum()
    # Of a ratio of sums over stacks; nobody's error is smaller than that of one miss.
    off = np.sum((each - share * weight) ** 2) ** 0.5 / weight.sum()
    return Share(100 * share, 100 * max(off, 1.0 / (stacks.sum() + 1)))


def table(
    say: Results, title: str, found: dict[str, list[Found]], rows: np.ndarray | slice = slice(None)
) -> dict[str, Row]:
    """A line for each quantity, with all of its bands, and one for all of them; what they state."""
    say(f"\n{title}")
    say(
        f"{'':<22}{'cases':>6}{'known':>6}{'hmc':>13}{'where known':>13}{'Laplace':>13}{'where trusted':>20}"
    )
    whole = [one for many in found.values() for one in many]
    stated = {}
    for name, many in (found | {"all": whole}).items():
        hmc, laplace, width, trusted = (
            np.stack([getattr(one, field) for one in many], axis=1)[rows] for field in Found._fields
        )
        known = width < 0.9
        row = stated[name] = Row(
            cases=hmc.size,
            known=known.mean(),
            hmc=held(hmc),
            hmc_known=held(hmc, known),
            laplace=held(laplace),
            trusted=held(laplace, trusted),
            trusts=trusted.mean(),
        )
        sure = f"{row.trusted} ({row.trusts:.0%})"
        say(
            f"{name:<22}{row.cases:>6}{row.known:>6.0%}{row.hmc!s:>13}{row.hmc_known!s:>13}"
            f"{row.laplace!s:>13}{sure:>20}"
        )
    return stated


def record_known(say: Results, rows: dict[str, Row], stacks: int) -> None:
    """What texts quote of known paints."""
    whole = rows["all"]
    coats = [row.hmc.value for name, row in rows.items() if " of coat " in name]
    say.record(
        **whole.hmc.quantities("all", stacks),
        **quantities(ends("coats", coats), "%", 0, n=stacks),
        **rows["model error"].hmc.quantities("model", stacks),
        **whole.laplace.quantities("laplace", stacks),
        **whole.trusted.quantities("trusted", stacks),
        trusts=quantity(100 * whole.trusts, "%", digits=0, n=stacks),
        **quantities({"stacks": stacks, "cases": whole.cases}, digits=0),
    )


def by_name(found: dict[str, Found]) -> dict[str, list[Found]]:
    """Bands of one spectrum together."""
    gathered: dict[str, list[Found]] = {}
    for name, one in found.items():
        what = name.partition(" at ")[0]
        title = {"absorption": "k d", "scattering": "s d", "ratio": "k/s"}.get(what, what)
        gathered.setdefault(title, []).append(one)
    return gathered


def main() -> None:
    options = command_line(
        __doc__,
        stacks=(40, 2, "of known paints"),
        unknown=(8, 1, "of an unknown paint, of each of three kinds"),
        seed=(0, 0, "of the draw"),
    ).parse_args()
    if options.quick:
        globals().update(STEPS=100, UNKNOWN_STEPS=100)
    jax.config.update("jax_enable_x64", True)
    say = Results("layers_inverted", options.out)
    say(
        "Stacks of coats found again: how often 90 % intervals hold the truth (seed "
        f"{options.seed})"
    )
    rng = np.random.default_rng(options.seed)
    for simulate, count, steps in (
        (known_paints, options.stacks, STEPS),
        (unknown_paint, options.unknown, UNKNOWN_STEPS),
    ):
        began = time.perf_counter()
        found, state = find(simulate(count, rng), steps, options.seed)
        if simulate is known_paints:
            title = f"Known paints: a glaze over a body of two, {count} stacks, {steps} steps"
            record_known(say, table(say, title, by_name(found)), count)
        else:
            for n, (key, kind) in enumerate(UNKNOWN.items()):
                title = f"Unknown paint over a known one, {kind}: {count} stacks, {steps} steps"
                rows = table(say, title, by_name(found), slice(n * count, (n + 1) * count))
                say.record(**rows["all"].hmc.quantities(key, count))
        times = state.length / state.times
        say(
            f"length in autocorrelation times: median {np.median(times):.0f}, least "
            f"{times.min():.0f}"
        )
        say(f"{time.perf_counter() - began:.0f} s, compilation included")
        say.save()


if __name__ == "__main__":
    main()
