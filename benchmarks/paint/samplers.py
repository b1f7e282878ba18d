"""Effective draws a second of each sampler of a posterior, with R-hat and coverage.

    python -m benchmarks.paint.samplers [--films 6] [--seed 0] [--out FOLDER]

Problems: films of two paints; a film band by band; a coat of unknown paint over a known one, over two
grounds. Films are sampled one by one, each from modes that are known, first once to compile: seconds
are those of the second time, with its way from the beginning to the first draw that is kept. Effective
draws are those of the quantity that is worst mixed, over all chains, by ArviZ's estimate, which a
chain that never met the others lowers; so they can be compared between samplers. Held is the share
of truths within 90 % intervals, over all quantities: few films, and a hint only.

hmc and importance are `glazefit.film`'s, emcee is as it is there. aies is NumPyro's affine
invariant ensemble in JAX, where numpyro is installed: from the same draws of Laplace's approximation,
with emcee's steps, of which the first half is left out; bands as one problem. NumPyro compiles in
every run: of its seconds those of a run of two steps are taken off.
"""

import importlib.util
import time
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.paint.calibration_ranks import KINDS, Posed
from benchmarks.results import Results, command_line, progress, quantity

SETTINGS: dict[str, dict[str, Any]] = {
    "hmc": {"sampler": "hmc"},
    "emcee": {"sampler": "emcee", "steps": 2000},
    "importance": {"sampler": "importance"},
}
NEEDS = ("arviz",)
PARTS_NEED = ("numpyro",)

TITLES = {
    "film": "films of two paints",
    "bands": "a film band by band",
    "two grounds": "a coat of unknown paint, two grounds",
}
# Samplers whose numbers are recorded, and how their names begin.
RECORDED = {
    "two grounds": ("", ("hmc", "emcee", "aies")),
    "bands": ("bands_", ("hmc", "emcee")),
}
# Of the generator that draws films: two paints.
TWO_PAINTS = 1


class Measured(NamedTuple):
    """Of one film."""

    seconds: float
    effective: float
    apart: float
    held: float


def one_of(posed: Posed, film: int) -> Posed:
    """One film of some that were posed side by side."""
    from dataclasses import replace

    blocks = len(posed.problem.blocks) // len(posed.films)
    rows = slice(film * blocks, (film + 1) * blocks)
    data = jax.tree.map(lambda a: a[rows], posed.problem.data)
    problem = replace(posed.problem, data=data, blocks=posed.problem.blocks[rows])
    modes = type(posed.modes)(*(a[rows] for a in posed.modes))
    truth = {name: values[rows] for name, values in posed.truth.items()}
    return Posed(problem, posed.films[film : film + 1], modes, truth)


def measured(posed: Posed, settings: dict[str, Any], seed: int) -> Measured:
    """A film's posterior, sampled twice; the second time counts."""
    from glazefit.film.sampling import Sampling
    from glazefit.posterior.posterior import sample

    # The first run compiles.
    sample(posed.problem, posed.modes, posed.films, Sampling(seed=seed, **settings))
    began = time.perf_counter()
    posterior = sample(posed.problem, posed.modes, posed.films, Sampling(seed=seed + 1, **settings))
    seconds = time.perf_counter() - began
    shown = posterior.problem.shown(posterior.free)
    held = share_held(shown, posed.truth)
    if posterior.chain is None:
        good = posterior.laplace.trusted.all()
        effective = float(np.min(posterior.laplace.effective)) if good else 0.0
        return Measured(seconds, effective, float("nan"), held)
    state = posterior.convergence
    assert state is not None
    return Measured(
        seconds,
        effective_draws(posterior.problem, shown),
        float(np.max(state.apart)),
        held,
    )


def share_held(draws: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> float:
    """Share of truths within their 90 % intervals; draws are (steps, chains, blocks)."""
    held = [
        np.abs((draws[name] < values).mean(axis=(0, 1)) - 0.5) <= 0.45
        for name, values in truth.items()
        if name in draws
    ]
    return float(np.mean(held))


def effective_draws(problem: Any, draws: Mapping[str, np.ndarray]) -> float:
    """Of the quantity that is worst mixed; draws are (steps, chains, blocks)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        least = np.inf
        for quantity in problem.quantities:
            values = draws[quantity.name]
            scaled = np.log(values) if quantity.logarithmic else values
            for block in range(scaled.shape[-1]):
                least = min(least, float(arviz.ess(np.swapaxes(scaled[..., block], 0, 1))))
    return least


def measured_aies(posed: Posed, steps: int, seed: int) -> Measured:
    """NumPyro's affine invariant ensemble on one film; seconds without its compilation."""
    from numpyro.infer import AIES, MCMC  # pyright: ignore[reportMissingImports]

    from glazefit.film.sampling import Sampling
    from glazefit.film.solve import laplace
    from glazefit.posterior.chain import count_samples

    problem = posed.problem
    blocks, dims = len(problem.blocks), problem.dims

    def potential(flat: jax.Array) -> jax.Array:
        free = flat.reshape(blocks, dims)
        rows = jax.vmap(lambda f, d: problem.residuals(f, d, problem.shared))(free, problem.data)
        half = 0.5 * jnp.sum(rows**2)
        return jnp.where(jnp.isnan(half), jnp.inf, half)

    # Twice as many as unknowns, as NumPyro advises.
    chains = max(Sampling().walkers_for(problem.dims), 2 * blocks * dims)
    approximate = laplace(problem, posed.modes, seed=seed)
    start = approximate.gaussians.draws(chains, np.random.default_rng(seed)).reshape(chains, -1)

    def run(steps: int) -> tuple[float, np.ndarray]:
        sampler = MCMC(
            AIES(potential_fn=potential),
            num_warmup=steps // 2,
            num_samples=steps - steps // 2,
            num_chains=chains,
            chain_method="vectorized",
            progress_bar=False,
        )
        began = time.perf_counter()
        sampler.run(jax.random.key(seed), init_params=jnp.asarray(start))
        samples = np.asarray(sampler.get_samples(group_by_chain=True))
        return time.perf_counter() - began, samples

    # The first run of all compiles what later ones share; each compiles its own loop again.
    run(2)
    compiling, _ = run(2)
    whole, samples = run(steps)
    seconds = max(whole - compiling, 1e-3)
    free = np.swapaxes(samples, 0, 1).reshape(-1, chains, blocks, dims)
    draws = problem.shown(free)
    flat = np.concatenate(
        [draws[q.name].reshape(len(free), chains, -1) for q in problem.quantities], 2
    )
    return Measured(
        seconds=seconds,
        effective=effective_draws(problem, draws),
        apart=float(np.max(count_samples(flat)[1])),
        held=share_held(draws, posed.truth),
    )


def main() -> None:
    options = command_line(
        __doc__, films=(6, 1, "of each problem"), seed=(0, 0, "of the draw")
    ).parse_args()
    if options.quick:
        # With fewer, one draw of each walker is kept, whose R-hat is infinite.
        SETTINGS["emcee"]["steps"] = 400
        SETTINGS["hmc"]["steps"] = 10
    jax.config.update("jax_enable_x64", True)
    have_numpyro = importlib.util.find_spec("numpyro") is not None
    say = Results("samplers", options.out, "emcee", *(["numpyro"] if have_numpyro else []))
    say(
        f"Effective draws a second by sampler, medians of {options.films} films (seed "
        f"{options.seed})"
    )
    for kind in TITLES:
        rng = np.random.default_rng([options.seed, list(KINDS).index(kind)])
        posed = KINDS[kind](options.films, rng, TWO_PAINTS)
        say(f"\n{TITLES[kind]}")
        say(f"{'':<12}{'seconds':>9}{'effective':>11}{'a second':>10}{'R-hat':>7}{'held':>6}")
        key, recorded = RECORDED.get(kind, ("", ()))
        rates = {}
        for name in (*SETTINGS, *(["aies"] if have_numpyro else [])):
            found = []
            for film in range(options.films):
                progress(f"{kind}, {name}: {film} of {options.films}")
                own = one_of(posed, film)
                found.append(
                    measured_aies(own, SETTINGS["emcee"]["steps"], options.seed)
                    if name == "aies"
                    else measured(own, SETTINGS[name], options.seed)
                )
            progress()
            seconds, effective, apart, _ = np.median(found, axis=0)
            rates[name] = effective / seconds
            say(
                f"{name:<12}{seconds:>9.2f}{effective:>11.0f}{rates[name]:>10.0f}{apart:>7.2f}"
                f"{np.mean([one.held for one in found]):>6.0%}"
            )
            if name in recorded:
                say.record(
                    **{
                        f"{key}{name}_rate": quantity(rates[name], digits=0, n=options.films),
                        f"{key}{name}_apart": quantity(apart, n=options.films),
                    }
                )
        if recorded:
            times = rates["hmc"] / rates["emcee"]
            say.record(**{f"{key}times": quantity(times, "times", form="g")})
    if not have_numpyro:
        say("\nNumPyro's AIES was not measured: numpyro is not installed.")
    say.save()


if __name__ == "__main__":
    main()
