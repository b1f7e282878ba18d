"""Simulation-based calibration: where truths that the prior drew lie among the posterior's draws.

    python -m benchmarks.paint.calibration_ranks [--draws 500] [--kinds film bands ...] [--seed 0] [--out FOLDER]

A truth is drawn from the prior, read with the instrument's noise, and its posterior sampled. Over
many truths the share of draws below the truth is uniform in [0, 1] if posteriors are right (Talts,
Betancourt, Simpson, Vehtari and Gelman, arXiv:1804.06788). A heap at both ends says that posteriors
are too narrow, one in the middle that they are too wide, one at one end that they are shifted.

film: one to three paints of the catalogue, off by what they state, read with the model's own error;
all else drawn from `glazefit.Prior`. Thicknesses and fractions are ranked as the readings show
them, times the strength of their paints: what strength adds is drawn, not measured. bands: k d and
s d of every band drawn from the prior of `posterior_of_bands`, each band by itself. coats: a glaze of a
known paint over a body of two. unknown, two grounds and unknown, one ground: a coat whose k d and s d
are drawn from `glazefit.SpectraPrior` over 30 um of a known paint.

Each kind with the default sampler, of stacks with fewer steps or chains. `--draws` is how many truths of each kind are drawn; the solver's
kinds get fewer, as their titles say. Errors behind shares count films, whose quantities hang
together. Writes a table and the histograms.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.paint.layers_inverted import (
    held,
    known_paints,
    posed_stacks,
    real_spectra,
    shown_spread,
    side_by_side,
    smooth_errors,
    unknown_paint,
    with_model_errors,
)
from benchmarks.results import Results, command_line, percent, progress, quantity

NEEDS = ("matplotlib",)
NEEDS_SIZE = ("one_ground_apart",)

GROUP = 25
BINS = 10
BANDS = np.arange(400.0, 701.0, 50.0)
# Of the kinds that take long, this share of the draws that were asked for.
SHARES = {"film": 1.0, "bands": 1.0, "two grounds": 0.25, "one ground": 0.25, "coats": 0.25}
# And fewer steps, or chains, than the default.
FEWER = {
    "two grounds": {"steps": 100, "walkers": 16},
    "one ground": {"steps": 100, "walkers": 16},
    "bands": {"steps": 100, "walkers": 16},
}


class Posed(NamedTuple):
    """Problems of some films side by side, and the truth of each quantity, (blocks,)."""

    problem: Any
    films: tuple[Any, ...]
    modes: Any
    truth: dict[str, np.ndarray]


class Ranks(NamedTuple):
    """Of one group: shares of draws below the truth, by quantity, (films,), and R-hat, (films,); and
    of Laplace's draws, (films, quantities), NaN where it does not trust itself.
    """

    below: dict[str, np.ndarray]
    apart: np.ndarray
    laplace: np.ndarray


def simulate(
    count: int, paints: int, rng: np.random.Generator
) -> tuple[list[Any], list[list[Any]], dict[str, np.ndarray]]:
    """Readings of films of this many paints of the catalogue over both cards, by the solver; the
    paints of each, and the truth by quantity, (films,) or (films, bands).
    """
    from glazefit import Films, Instrument, Noise, Prior
    from glazefit.film.films import readings, usual_cards
    from glazefit.film.model.optics import Optics
    from glazejax import catalogue

    prior, instrument, noise = Prior(), Instrument(), Noise()
    known = list(catalogue.load().values())
    grid = known[0].wavelengths
    chosen = [
        [known[i] for i in rng.choice(len(known), paints, replace=False)] for _ in range(count)
    ]
    fractions = rng.dirichlet(np.full(paints, prior.concentration_known), count)
    spread = shown_spread(prior.spread, paints)
    thickness = prior.thickness * np.exp(spread * rng.standard_normal(count))
    shine = rng.uniform(size=count)
    error = prior.error * np.exp(prior.error_spread * rng.standard_normal(count))
    off = smooth_errors(rng, error, 1, prior.error_length, grid)[:, 0]
    mixed = np.einsum("fp,fpcb->fcb", fractions, real_spectra(rng, chosen))
    optical = mixed * thickness[:, None, None] * off
    ground = np.broadcast_to(np.stack(usual_cards(grid), axis=-1), (count, grid.size, 2))

    def read(k: np.ndarray, s: np.ndarray, shine: np.ndarray, *, painted: bool) -> np.ndarray:
        body = Optics.of(instrument).body(
            jnp.asarray(k)[..., None, None],
            jnp.asarray(s)[..., None, None],
            jnp.asarray(ground),
            1e-5,
        )
        exact = np.asarray(body) + shine[:, None, None] * instrument.seen_surface
        exact = with_model_errors(rng, exact, grid) if painted else exact
        return np.maximum(exact + noise.sd(exact) * rng.standard_normal(exact.shape), 0.0)

    empty = np.full((count, grid.size), 1e-12)
    bare = read(empty, empty, np.ones(count), painted=False)
    over = read(optical[:, 0], optical[:, 1], shine, painted=True)
    names = tuple(f"film {i}" for i in range(count))
    cards = (bare[..., 0], bare[..., 1], over[..., 0], over[..., 1])
    films = readings(Films(names, grid, *cards), instrument, noise)
    truth = {f"fraction {i + 1}": fractions[:, i] for i in range(paints if paints > 1 else 0)}
    return films, chosen, truth | {"thickness": thickness, "gloss": shine, "model error": error}


def films(count: int, rng: np.random.Generator, group: int) -> Posed:
    from glazefit import CoatPrior, Instrument, Prior, SpectraPrior
    from glazefit.film.solve import solve
    from glazefit.posterior.film import pose_stack

    made, paints, truth = simulate(count, 1 + group % 3, rng)
    settings = Instrument(), Prior(), SpectraPrior()
    problems = (
        pose_stack(film, [CoatPrior(chosen)], *settings, kind="paints")
        for film, chosen in zip(made, paints, strict=True)
    )
    problem, modes = solve(side_by_side(problems))
    return Posed(problem, tuple(made), modes, truth)


def bands(count: int, rng: np.random.Generator, group: int) -> Posed:
    from glazefit import Instrument, Noise, simulate_films
    from glazefit.film.films import readings
    from glazefit.film.solve import solve
    from glazefit.posterior.bands import BandPrior, pose_bands

    logs = BandPrior().draws(rng, count * BANDS.size).reshape(count, BANDS.size, 2)
    k, s = np.exp(logs[..., 0] + logs[..., 1]), np.exp(logs[..., 1])
    names = [f"film {n}" for n in range(count)]
    made = simulate_films(BANDS, k, s, names=names, seed=int(rng.integers(2**31)))
    read = readings(made, Instrument(), Noise())
    problem, modes = solve(side_by_side(pose_bands(film, 1.0, Instrument()) for film in read))
    truth = {"absorption": k.ravel(), "scattering": s.ravel(), "ratio": (k / s).ravel()}
    return Posed(problem, tuple(read), modes, truth)


def coats(count: int, rng: np.random.Generator, group: int) -> Posed:
    return posed_stack(known_paints(count, rng))


def two_grounds(count: int, rng: np.random.Generator, group: int) -> Posed:
    return posed_stack(unknown_paint(count, rng), slice(0, count))


def one_ground(count: int, rng: np.random.Generator, group: int) -> Posed:
    return posed_stack(unknown_paint(count, rng), slice(count, 2 * count))


def posed_stack(simulated: Any, rows: slice = slice(None)) -> Posed:
    from glazefit.film.solve import solve

    made = simulated.films[rows]
    problem, modes = solve(posed_stacks(made, simulated.coats[rows]))
    truth = {name: values[rows] for name, values in simulated.truth.items()}
    return Posed(problem, tuple(made), modes, truth)


KINDS: dict[str, Callable[[int, np.random.Generator, int], Posed]] = {
    "film": films,
    "bands": bands,
    "two grounds": two_grounds,
    "one ground": one_ground,
    "coats": coats,
}


def ranked(posed: Posed, options: Any) -> Ranks:
    """Posteriors of a group, and where the truths lie in them."""
    from glazefit.posterior.posterior import sample

    posterior = sample(posed.problem, posed.modes, posed.films, options)
    state = posterior.convergence
    assert state is not None
    blocks = len(posed.problem.blocks)
    films = len(posed.films)
    below = {}
    laplace = []
    by_laplace = posterior.problem.shown(posterior.laplace.sample)
    for name, draws in posterior.problem.shown(posterior.free).items():
        if name in posed.truth:
            rough = (by_laplace[name] < posed.truth[name]).mean(axis=0)
            rough = np.where(posterior.laplace.trusted, rough, np.nan)
            laplace.append(rough.reshape(films, -1))
            shares = (draws < posed.truth[name]).mean(axis=(0, 1))
            # Bands of a film, where each is a block, are quantities that hang together.
            for n, one in enumerate(shares.reshape(films, blocks // films).T):
                below[f"{name} {n}" if blocks > films else name] = one
    apart = np.broadcast_to(state.apart, blocks).reshape(films, -1).max(axis=1)
    return Ranks(below, apart, np.concatenate(laplace, axis=1))


def gathered(groups: list[Ranks]) -> dict[str, np.ndarray]:
    """Ranks by what is asked, (films, quantities); fractions of any paint and all bands of one
    spectrum together.
    """
    by_group: list[dict[str, np.ndarray]] = []
    for group in groups:
        mine: dict[str, list[np.ndarray]] = {}
        for name, values in group.below.items():
            word = name.split()[0]
            title = {"absorption": "k d", "scattering": "s d", "ratio": "k/s", "model": "error"}
            kind = "thickness" if word == "thickness" else title.get(word, word)
            mine.setdefault(kind, []).append(values)
        by_group.append({kind: np.stack(values, axis=1) for kind, values in mine.items()})
    # Films of one paint have no fractions: their rows are empty.
    kinds = dict.fromkeys(kind for mine in by_group for kind in mine)
    none = [np.full((len(group.apart), 1), np.nan) for group in groups]
    return {
        kind: padded([mine.get(kind, empty) for mine, empty in zip(by_group, none, strict=True)])
        for kind in kinds
    }


def padded(parts: list[np.ndarray]) -> np.ndarray:
    """Groups of films below each other; NaN where one has fewer quantities."""
    wide = max(part.shape[1] for part in parts)
    fill = [np.pad(p, ((0, 0), (0, wide - p.shape[1])), constant_values=np.nan) for p in parts]
    return np.concatenate(fill)


def table(say: Results, kind: str, found: dict[str, np.ndarray]) -> None:
    """A line for each quantity, and one for all, which is recorded."""
    say(f"{'':<11}{'cases':>6}{'held':>13}  in tenths of the posterior, from below, % of cases")
    whole = np.concatenate(list(found.values()), axis=1)
    for name, ranks in (found | {"all": whole}).items():
        there = np.isfinite(ranks)
        counts = np.histogram(ranks[there], bins=BINS, range=(0.0, 1.0))[0]
        shares = " ".join(f"{100 * n / there.sum():4.0f}" for n in counts)
        share = held(np.where(there, ranks, 0.5), there)
        say(f"{name:<11}{there.sum():>6}{share!s:>13}  {shares}")
        if name == "all":
            say.record(**share.quantities(kind.replace(" ", "_"), len(ranks)))


def draw(found: dict[str, dict[str, np.ndarray]]) -> Any:
    from matplotlib.figure import Figure

    most = max(map(len, found.values()))
    figure = Figure(figsize=(2.3 * most, 1.9 * len(found)), layout="constrained")
    panels = figure.subplots(len(found), most, squeeze=False)
    for row, (kind, quantities) in zip(panels, found.items(), strict=True):
        for panel in row[len(quantities) :]:
            panel.set_axis_off()
        for panel, (name, ranks) in zip(row, quantities.items(), strict=False):
            there = ranks[np.isfinite(ranks)]
            panel.hist(there, bins=BINS, range=(0, 1), density=True, color="C0", alpha=0.7)
            # Two standard errors, as if only films counted.
            off = 2.0 * np.sqrt((BINS - 1.0) / len(ranks))
            panel.axhspan(max(0.0, 1.0 - off), 1.0 + off, color="0.5", alpha=0.2, lw=0)
            panel.axhline(1.0, color="0.4", lw=0.8)
            panel.set(xlim=(0, 1), yticks=[], title=f"{kind}: {name}")
            panel.title.set_fontsize(8)
            panel.tick_params(labelsize=7)
    return figure


def main() -> None:
    draws, seed = (500, 4, "truths of each kind"), (0, 0, "of the draw")
    parser = command_line(__doc__, draws=draws, seed=seed)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    from glazefit.film.sampling import Sampling

    say = Results("calibration_ranks", options.out)
    say(f"Where truths drawn from the prior lie in their posteriors (seed {options.seed})")
    found = {}
    for kind in options.kinds:
        began = time.perf_counter()
        count = max(4, round(options.draws * SHARES[kind]))
        rng = np.random.default_rng([options.seed, list(KINDS).index(kind)])
        groups = []
        for group in range(-(-count // GROUP)):
            progress(f"{kind}: {group * GROUP} of {count}")
            posed = KINDS[kind](min(GROUP, count - group * GROUP), rng, group)
            few: dict[str, Any] = {"steps": 10} if options.quick else FEWER.get(kind, {})
            groups.append(ranked(posed, Sampling(seed=options.seed + group, **few)))
        progress()
        found[kind] = gathered(groups)
        apart = np.concatenate([group.apart for group in groups])
        say(f"\n{kind}: {count} films, 90 % intervals")
        table(say, kind, found[kind])
        trusted = padded([group.laplace for group in groups])
        there = np.isfinite(trusted)
        share = held(np.where(there, trusted, 0.5), there)
        say(f"Laplace holds {share} of {there.sum()} values where it trusts itself")
        met, middle = np.mean(apart < 1.05), np.median(apart)
        say(
            f"R-hat: below 1.05 in {met:.0%} of films, median {middle:.2f}; "
            f"{time.perf_counter() - began:.0f} s, compilation included"
        )
        if kind == "two grounds":
            say.record(films=quantity(count, digits=0))
        if kind == "one ground":
            say.record(one_ground_met=percent(met, n=count))
            # Chains of a few steps have no R-hat.
            if np.isfinite(middle):
                say.record(one_ground_apart=quantity(middle, n=count))
        # Each kind takes long; what is done is kept.
        say.save(draw(found))


if __name__ == "__main__":
    main()
