"""Do 90 % intervals hold the truth nine times in ten? Simulated films, by Laplace's approximation
and by Hamiltonian Monte Carlo.

    python -m benchmarks.paint.coverage [--films 500] [--seed 0] [--out FOLDER]

Paints: films of one to three paints of the catalogue. Fractions, thickness, gloss and model error
are drawn from
`glazefit.Prior`; k and s of the mixture are then really off by a smooth random factor of that
size. Bands: k d and s d of films of such mixtures at every third wavelength, gloss 1, no model
error. All readings come from the solver, not from the table that the posterior uses, over both
cards, with the noise of `glazefit.Noise` on the cards too.

A quantity's 90 % interval lies between its 5 and 95 % quantiles. Laplace's approximation is judged
where its own test trusts it (Pareto tail index below 0.7), where not, and where its interval and
the chain's agree (their ends, within 15 % of the width), with the chain's coverage of the same
cases; a row says what share of the cases each is. "Hides cards": films, or bands, that read alike
over both.
The binomial error of 500 films is 1.3 %. Writes a table and a plot of coverage against level.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Results, command_line, ends, quantities, quantity

NEEDS = ("matplotlib",)

GROUP = 20
STEPS, BAND_STEPS, WALKERS = 200, 200, 16
COEFFICIENTS = ("absorption", "scattering")
LEVELS = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])


@dataclass(frozen=True)
class Truth:
    """What films were simulated from."""

    paints: list[list[Any]]
    quantities: dict[str, np.ndarray]  # by name, (films,) or (films, bands)


@dataclass(frozen=True)
class Ranks:
    """Share of a posterior below the truth, for both methods, (cases,), and of what kind the cases
    are.
    """

    laplace: np.ndarray
    hmc: np.ndarray
    trusted: np.ndarray
    opaque: np.ndarray
    agrees: np.ndarray


def simulate(
    count: int, paints: int, rng: np.random.Generator, *, model_error: bool, gloss: bool
) -> tuple[list[Any], Truth]:
    """Readings of films of this many paints, and the truth."""
    from glazefit import Films, Instrument, Noise, Prior
    from glazefit.film.films import usual_cards
    from glazefit.film.model.optics import Optics
    from glazefit.film.reading import readings
    from glazejax import catalogue

    prior, instrument, noise = Prior(), Instrument(), Noise()
    known = list(catalogue.load().values())
    grid = known[0].wavelengths
    chosen = [
        [known[i] for i in rng.choice(len(known), paints, replace=False)] for _ in range(count)
    ]
    fractions = rng.dirichlet(np.full(paints, prior.concentration_known), count)
    thickness = prior.thickness * np.exp(prior.spread * rng.standard_normal(count))
    shine = rng.uniform(size=count) if gloss else np.ones(count)
    error = prior.error * np.exp(prior.error_spread * rng.standard_normal(count)) * model_error
    away = np.sqrt(3.0) * np.abs(grid[:, None] - grid) / prior.error_length
    root = np.linalg.cholesky((1.0 + away) * np.exp(-away) + 1e-9 * np.eye(grid.size))
    off = np.exp(error[:, None, None] * (rng.standard_normal((count, 2, grid.size)) @ root.T))
    optical = (
        np.stack(
            [
                [
                    sum(f * np.asarray(getattr(p, what)) for f, p in zip(fs, ps, strict=True))
                    for what in COEFFICIENTS
                ]
                for fs, ps in zip(fractions, chosen, strict=True)
            ]
        )
        * thickness[:, None, None]
        * off
    )
    black, white = usual_cards(grid)
    ground = np.broadcast_to(np.stack([black, white], axis=-1), (count, grid.size, 2))

    def read(k: np.ndarray, s: np.ndarray, shine: np.ndarray) -> np.ndarray:
        body = Optics.of(instrument).body(
            jnp.asarray(k)[..., None, None],
            jnp.asarray(s)[..., None, None],
            jnp.asarray(ground),
            1e-5,
        )
        exact = np.asarray(body) + shine[:, None, None] * instrument.seen_surface
        return np.maximum(exact + noise.sd(exact) * rng.standard_normal(exact.shape), 0.0)

    empty = np.full((count, grid.size), 1e-12)
    bare, over = read(empty, empty, np.ones(count)), read(optical[:, 0], optical[:, 1], shine)
    names = tuple(f"film {i}" for i in range(count))
    films = readings(
        Films(names, grid, bare[..., 0], bare[..., 1], over[..., 0], over[..., 1]),
        instrument,
        noise,
    )
    truth: dict[str, np.ndarray] = {
        f"fraction {i + 1}": fractions[:, i] for i in range(paints if paints > 1 else 0)
    }
    truth |= {"thickness": thickness, "gloss": shine, "model error": error}
    truth |= {
        "absorption": optical[:, 0],
        "scattering": optical[:, 1],
        "ratio": optical[:, 0] / optical[:, 1],
    }
    return films, Truth(chosen, truth)


def hidden(films: Sequence[Any]) -> np.ndarray:
    """Whether films hide their cards: they read alike within five standard deviations, (films,
    bands).
    """
    over, sd = np.stack([f.reflectance for f in films]), np.stack([f.sd for f in films])
    return over[..., 1] - over[..., 0] < 5.0 * np.sqrt((sd**2).sum(axis=-1))


def shares(posterior: Any, truth: dict[str, np.ndarray], opaque: np.ndarray) -> dict[str, Ranks]:
    """Where the truth lies in each quantity's posterior; a level of convergence is not
    asked for.
    """
    from glazefit.posterior.summary import AGREES

    blocks = len(posterior.problem.blocks)
    words = {(row.quantity, n % blocks): row.laplace for n, row in enumerate(posterior.summary())}
    found = {}
    for name, draws in posterior.draws.items():
        value = truth[name].reshape(-1)
        flat = draws.reshape(-1, draws.shape[-1])
        found[name] = Ranks(
            (posterior.laplace_draws[name] < value).mean(axis=0),
            (flat < value).mean(axis=0),
            posterior.laplace.trusted,
            opaque,
            np.array([words[name, block] == AGREES for block in range(value.size)]),
        )
    return found


def of_paints(films: Sequence[Any], truth: Truth, seed: int) -> tuple[dict[str, Ranks], np.ndarray]:
    from glazefit import Instrument, Prior
    from glazefit.film.sampling import Sampling
    from glazefit.film.solve import solve
    from glazefit.posterior.film import pose_films
    from glazefit.posterior.posterior import sample

    problem = pose_films(films, truth.paints, Instrument(), Prior())
    posterior = sample(
        *solve(problem),
        tuple(films),
        Sampling(steps=STEPS, walkers=WALKERS, seed=seed),
    )
    assert posterior.convergence is not None
    return shares(
        posterior, truth.quantities, np.all(hidden(films), axis=1)
    ), posterior.convergence.times


def of_bands(films: Sequence[Any], truth: Truth, seed: int) -> tuple[dict[str, Ranks], np.ndarray]:
    from glazefit import Instrument
    from glazefit.film.sampling import Sampling
    from glazefit.film.solve import solve
    from glazefit.posterior.bands import pose_bands
    from glazefit.posterior.posterior import sample

    thinned = [every_third(film) for film in films]
    problem = pose_bands(thinned, 1.0, Instrument())
    posterior = sample(
        *solve(problem),
        tuple(thinned),
        Sampling(steps=BAND_STEPS, walkers=WALKERS, seed=seed),
    )
    assert posterior.convergence is not None
    bands = {name: truth.quantities[name][:, ::3] for name in ("absorption", "scattering", "ratio")}
    return shares(posterior, bands, hidden(thinned).reshape(-1)), posterior.convergence.times


def every_third(film: Any) -> Any:
    from dataclasses import replace

    parts = {
        n: getattr(film, n)[::3]
        for n in ("wavelengths", "reflectance", "ground", "sd", "ground_sd")
    }
    return replace(film, **parts)


def join(parts: Sequence[dict[str, Ranks]]) -> dict[str, Ranks]:
    """Cases of all groups by quantity; fractions of any paint are cases of one quantity."""
    found: dict[str, list[Ranks]] = {}
    for part in parts:
        for name, ranks in part.items():
            found.setdefault("fraction" if name.startswith("fraction ") else name, []).append(ranks)
    fields = ("laplace", "hmc", "trusted", "opaque", "agrees")
    return {
        n: Ranks(*(np.concatenate([getattr(r, f) for r in many]) for f in fields))
        for n, many in found.items()
    }


def coverage(ranks: np.ndarray, level: float = 0.9) -> float:
    """Share of cases, of one at least, whose truth lies between the two quantiles."""
    return float(np.mean(np.abs(ranks - 0.5) <= level / 2))


def shown(where: np.ndarray, *ranks: np.ndarray) -> str:
    """Coverage of some cases by each method, and their share of all: '85.7%, 86.3% (67%)'."""
    if not where.any():
        return "no case"
    return ", ".join(f"{coverage(one[where]):.1%}" for one in ranks) + f" ({where.mean():.0%})"


def table(say: Results, title: str, found: dict[str, Ranks]) -> None:
    say(f"\n{title}")
    say(f"{'':<12}{'':>6}{'':>8}{'':>8}  {'Laplace where':<30}{'hmc, Laplace where':<44}")
    titles = (
        "trusted".rjust(16),
        "not trusted".rjust(16),
        "agree".rjust(22),
        "hides cards".rjust(22),
    )
    say(f"{'':<12}{'cases':>6}{'hmc':>8}{'Laplace':>8}" + "".join(titles))
    for name, r in found.items():
        cells = [f"{r.hmc.size:>6}", f"{coverage(r.hmc):>8.1%}", f"{coverage(r.laplace):>8.1%}"]
        for where in (r.trusted, ~r.trusted):
            cells.append(shown(where, r.laplace).rjust(16))
        for where in (r.agrees, r.opaque):
            cells.append(shown(where, r.hmc, r.laplace).rjust(22))
        say(f"{name:<12}" + "".join(cells))


def draw(found: dict[str, dict[str, Ranks]]) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    panels = figure.subplots(2, 2)
    for row, (kind, kept) in zip(panels, found.items(), strict=True):
        for panel, method in zip(row, ("hmc", "laplace"), strict=True):
            panel.fill_between([0, 1], [-0.03, 0.97], [0.03, 1.03], color="0.92", lw=0)
            panel.plot([0, 1], [0, 1], color="0.5", lw=1)
            for name, ranks in kept.items():
                values = getattr(ranks, method)
                panel.plot(
                    LEVELS,
                    [coverage(values, level) for level in LEVELS],
                    "o-",
                    ms=3,
                    lw=1.2,
                    label=name,
                )
            panel.set(
                xlabel="level of the interval",
                ylabel="share that holds the truth",
                xlim=(0, 1),
                ylim=(0, 1),
            )
            panel.set_title(
                f"{kind}: {'hmc' if method == 'hmc' else 'Laplace, trusted or not'}",
                fontsize=10,
            )
            panel.legend(frameon=False, fontsize=8, loc="upper left")
    return figure


def main() -> None:
    options = command_line(
        __doc__, films=(500, 8, "simulated films"), seed=(0, 0, "of the draw")
    ).parse_args()
    if options.quick:
        globals().update(STEPS=100, BAND_STEPS=100)
    jax.config.update("jax_enable_x64", True)
    say = Results("coverage", options.out)
    say(
        f"Coverage of 90 % intervals on {options.films} simulated films of each kind (seed "
        f"{options.seed})"
    )
    rng = np.random.default_rng(options.seed)
    groups = -(-options.films // GROUP)
    found: dict[str, dict[str, Ranks]] = {}
    for kind, solve, steps in (("paints", of_paints, STEPS), ("bands", of_bands, BAND_STEPS)):
        began = time.perf_counter()
        parts, times = [], []
        for group in range(groups):
            size = min(GROUP, options.films - group * GROUP)
            films, truth = simulate(
                size, 1 + group % 3, rng, model_error=kind == "paints", gloss=kind == "paints"
            )
            part, tau = solve(films, truth, options.seed + group)
            parts.append(part)
            times.append(tau)
            print(
                f"  {kind}: {group * GROUP + size} films, {time.perf_counter() - began:.0f} s",
                flush=True,
            )
        found[kind] = join(parts)
        key = {"paints": "", "bands": "bands_"}[kind]
        held = [100 * coverage(ranks.hmc) for ranks in found[kind].values()]
        least_and_most = {f"{key}least": min(held), f"{key}most": max(held)}
        say.record(**quantities(least_and_most, "%", 0, n=options.films))
        tau = np.concatenate(times)
        table(say, f"{kind}: {options.films} films, {WALKERS} walkers, {steps} steps", found[kind])
        say(
            f"autocorrelation times: median {np.median(tau):.0f}, 95 % below "
            f"{np.quantile(tau, 0.95):.0f} steps"
        )
        say(f"{time.perf_counter() - began:.0f} s")
    trusted = [
        100 * coverage(ranks.laplace[ranks.trusted])
        for ranks in found["paints"].values()
        if ranks.trusted.any()
    ]
    say.record(**quantities(ends("trusted", trusted), "%", 0, n=options.films))
    say.record(films=quantity(options.films, digits=0))
    say.save(draw(found))


if __name__ == "__main__":
    main()
