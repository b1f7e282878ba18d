"""Chains with gradients against closed forms, and what becomes of their files and interrupts."""

import os
import signal
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import h5py
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import Instrument, Noise, posterior_of_bands, simulate_films
from glazefit.film.films import readings
from glazefit.film.problem import FilmProblem, Quantity
from glazefit.film.sample import draw_chain
from glazefit.film.sampling import Sampling
from glazefit.film.solve import find_modes, laplace
from glazefit.posterior.bands import BandPrior, pose_bands
from glazefit.posterior.chain import count_samples
from glazefit.posterior.posterior import sample

from ..refusals import refusal
from ..slow import slow
from .problems import side_by_side

GRID = np.arange(400.0, 701.0, 50.0)
WIDE = 10.0
# Far from round, and each block otherwise.
SHARP = np.array([[[30.0, 29.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 0.2]], [[5.0, -3.0], [1.0, 4.0]]])
WHERE = np.array([[1.0, -1.0], [8.0, 8.0], [0.0, 3.0]])


def line(free, data, shared):
    """A Gaussian likelihood."""
    sharp, where = data
    return sharp @ (free - where)


def ring(free, data, shared):
    """Two places where the first unknown may be, beyond a high wall."""
    return (free[:1] ** 2 - 9.0) / 0.5


@dataclass(frozen=True)
class Normal:
    """A Gaussian prior."""

    centre: tuple[float, float]
    width: float

    def residuals(self, free, shared):
        return (free - jnp.asarray(self.centre)) / self.width

    def draws(self, rng, n, shared):
        return np.asarray(self.centre) + self.width * rng.standard_normal((n, 2))

    def covariance(self, shared):
        return self.width**2 * np.eye(2)


def problem_of(misfit, data, blocks, centre=(0.0, 0.0), width=WIDE):
    return FilmProblem(
        kind="bands",
        blocks=tuple(f"{n} nm" for n in range(blocks)),
        unknowns=("x", "y"),
        film=None,  # pyright: ignore[reportArgumentType]
        misfit=misfit,
        prior=Normal(centre, width),
        data=data,
        shared=None,
        quantities=(
            Quantity("x", False, lambda free: free[..., 0]),
            Quantity("y", False, lambda free: free[..., 1]),
        ),
        bands=1,
        fingerprint="known",
    )


def gaussians():
    return problem_of(line, (jnp.asarray(SHARP), jnp.asarray(WHERE)), 3)


def sampled(problem, **options):
    return draw_chain(problem, laplace(problem, find_modes(problem)), Sampling(**options))


def assert_same_draws(chain, other, every=1):
    """A chain is the steps of another one, or some of them."""
    for draws in ("free", "log_probability"):
        assert_array_equal(getattr(chain, draws), getattr(other, draws)[every - 1 :: every])


@pytest.mark.parametrize(("sampler", "steps"), [("hmc", 100), slow("emcee", 6000)])
def test_gaussian_posteriors_are_met(sampler, steps):
    chain = sampled(gaussians(), sampler=sampler, steps=steps, seed=1)
    assert 0.2 < chain.accepted < 1.0
    for block, (sharp, where) in enumerate(zip(SHARP, WHERE, strict=True)):
        covariance = np.linalg.inv(sharp.T @ sharp + np.eye(2) / WIDE**2)
        draws = chain.free[:, :, block].reshape(-1, 2)
        off = draws.mean(axis=0) - covariance @ sharp.T @ sharp @ where
        assert np.all(np.abs(off) < 0.06 * np.sqrt(np.diag(covariance)))
        # In coordinates in which the posterior is round.
        white = np.linalg.solve(np.linalg.cholesky(covariance), (draws - draws.mean(axis=0)).T)
        assert_allclose(np.cov(white), np.eye(2), atol=0.12)


@pytest.mark.slow
def test_two_modes_have_their_shares():
    """Against a sum over a grid; least squares finds both, and chains begin in both by their
    weight.
    """
    problem = problem_of(ring, jnp.zeros((1, 1)), 1, centre=(0.1, 0.0), width=1.0)
    x = np.linspace(-5, 5, 20001)
    weight = np.exp(-0.5 * (((x**2 - 9) / 0.5) ** 2 + (x - 0.1) ** 2))
    share = weight[x > 0].sum() / weight.sum()
    free = sampled(problem, steps=100, seed=2).free
    assert (free[..., 0] > 0).mean() == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize("sampler", ["hmc", "emcee"])
def test_a_chain_thinned_by_three_keeps_every_third_step(sampler):
    """A chain is drawn in pieces of fifty steps, which three does not divide."""
    problem = gaussians()
    asked = Sampling(sampler=sampler, steps=110, seed=3, thin=3)
    thinned = sample(problem, find_modes(problem), (), asked)
    whole = sampled(problem, sampler=sampler, steps=110, seed=3, thin=1)
    assert_same_draws(thinned.chain, whole, 3)
    # What is reported is told in steps; nothing is left out after the warm-up of gradients.
    assert thinned.convergence is not None
    assert thinned.convergence.length + thinned.convergence.discarded == 108
    assert len(thinned.free) == thinned.convergence.length // 3
    assert sampler == "emcee" or thinned.convergence.discarded == 0


THIN = 1e-3


def funnel(free, data, shared):
    """A reading of y that is the sharper the larger x is: a thousandth wide where x is 0."""
    return free[1:] * jnp.exp(free[:1]) / THIN


def circle(free, data, shared):
    """A reading of the distance from the middle, good to a thousandth."""
    return (jnp.linalg.norm(free, keepdims=True) - 3.0) / THIN


def on_graph(misfit, width):
    problem = problem_of(misfit, jnp.zeros((1, 1)), 1, width=width)
    return replace(problem, scaled=misfit)


def test_a_sheet_whose_thickness_varies_is_met():
    """The density of x is the prior's times how wide y is there, exp(-x): a normal one about -1."""
    free = sampled(on_graph(funnel, 1.0), steps=300, seed=1).free[:, :, 0]
    x, y = free[..., 0], free[..., 1]
    assert count_samples(x[..., None])[1][0] < 1.05
    assert x.mean() == pytest.approx(-1.0, abs=0.1)
    assert x.std() == pytest.approx(1.0, abs=0.1)
    assert np.std(y * np.exp(x) / THIN) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_bent_sheet_is_met_all_around():
    free = sampled(on_graph(circle, WIDE), steps=200, seed=2).free[:, :, 0]
    angle = np.arctan2(free[..., 1], free[..., 0])
    counts = np.histogram(angle, 8, (-np.pi, np.pi))[0] / angle.size
    assert_allclose(counts, 1 / 8, atol=0.03)
    assert count_samples(np.cos(angle)[..., None])[1][0] < 1.05
    assert np.std(np.linalg.norm(free, axis=-1)) == pytest.approx(THIN, rel=0.05)


def film(seed=0):
    """Of two bands, each of which has chains of its own."""
    k, s = np.array([[0.05, 0.5]]), np.ones((1, 2))
    return simulate_films(GRID[[0, -1]], k, s, names=["film"], seed=seed)


SAMPLERS = pytest.mark.parametrize("sampler", ["hmc", slow("emcee")])


@SAMPLERS
def test_resumed_chain_equals_the_uninterrupted_one_and_files_are_guarded(tmp_path, sampler):
    path = tmp_path / "c.h5"

    def draw(steps: Any = 60, seed: Any = 0, **options: Any):
        asked: dict[str, Any] = {"sampler": sampler, "walkers": 16, "thin": 2, **options}
        return posterior_of_bands(film(seed), steps=steps, **asked).chain

    whole = draw()
    draw(24, path=path)
    with refusal("a chain already", FileExistsError):
        draw(24, path=path)
    other = "emcee" if sampler == "hmc" else "hmc"
    for changed, words in (
        ({"seed": 9}, "another problem"),
        ({"thin": 3}, r"has 16 walkers and keeps every 2\. step, not 16 and 3"),
        ({"walkers": 14}, r"has 16 walkers and keeps every 2\. step, not 14 and 2"),
        ({"sampler": other}, f"no chain of {other}"),
    ):
        with refusal(words):
            draw(path=path, resume=True, **changed)
    rest = draw(path=path, resume=True)
    assert_same_draws(rest, whole)
    with refusal("no chain to resume", FileNotFoundError):
        draw(path=tmp_path / "none.h5", resume=True)
    path.write_text("no")
    with refusal("no chain of"):
        draw(path=path, resume=True)
    draw(24, path=path, overwrite=True)


@SAMPLERS
def test_interrupt_keeps_what_is_done(tmp_path, sampler):
    def stop(done, total, words, /):
        if words == "sampling" and done == 50:
            os.kill(os.getpid(), signal.SIGINT)

    path = tmp_path / "c.h5"
    asked: Any = {"sampler": sampler, "walkers": 16, "steps": 60, "thin": 1, "path": path}
    stopped = posterior_of_bands(film(), progress=stop, **asked)
    assert stopped.chain is not None
    assert stopped.chain.interrupted
    assert stopped.words().startswith("stopped early")
    assert len(stopped.chain.free) == 50
    rest = posterior_of_bands(film(), resume=True, **asked)
    assert rest.chain is not None
    assert len(rest.chain.free) == 60


@pytest.mark.parametrize(
    ("holder", "method"),
    [(h5py.Dataset, "resize"), (h5py.Group, "require_dataset")],
    ids=["rows", "state"],
)
def test_a_chain_cut_while_it_is_written_goes_on_from_before(tmp_path, holder, method):
    """Of two arrays of rows, or of a state's, only the first is written of the last piece."""
    asked = {"sampler": "emcee", "steps": 25, "thin": 5}
    path = tmp_path / "c.h5"
    whole = sampled(gaussians(), **asked)
    usual = getattr(holder, method)
    calls = []

    def cut(*args, **options):
        calls.append(args)
        if len(calls) == 8:
            raise SystemExit
        return usual(*args, **options)

    with mock.patch.object(holder, method, cut), pytest.raises(SystemExit):
        sampled(gaussians(), path=path, **asked)
    rest = sampled(gaussians(), path=path, resume=True, **asked)
    assert_same_draws(rest, whole)


def test_a_chain_is_resumed_with_its_seed(tmp_path):
    """Its random numbers follow from seed and step. A file of before seeds were kept takes any."""
    asked = {"sampler": "emcee", "steps": 5, "path": tmp_path / "c.h5"}
    sampled(gaussians(), seed=3, **asked)
    with refusal("started with the seed 3, not 0; ask for the same"):
        sampled(gaussians(), resume=True, **asked)
    sampled(gaussians(), resume=True, seed=3, **asked)
    with h5py.File(asked["path"], "a") as file:
        del file["emcee"].attrs["seed"]
    sampled(gaussians(), resume=True, **asked)


def test_interrupt_on_the_way_says_that_nothing_is_kept():
    def stop(done, total, words, /):
        os.kill(os.getpid(), signal.SIGINT)

    with refusal("stopped before its first step was kept"):
        posterior_of_bands(film(), progress=stop)


def test_weights_alone_say_whether_they_can_be_trusted():
    result = posterior_of_bands(film(), sampler="importance")
    assert result.chain is None
    assert result.words().startswith("weighted draws")
    assert "tail index" in result.words()


@pytest.mark.slow
def test_nine_of_ten_intervals_hold_the_truth():
    """Band by band, truths drawn from the prior and read with the instrument's noise."""
    films, bands = 40, GRID.size
    rng = np.random.default_rng(5)
    logs = BandPrior().draws(rng, films * bands).reshape(films, bands, 2)
    k, s = np.exp(logs[..., 0] + logs[..., 1]), np.exp(logs[..., 1])
    simulated = simulate_films(GRID, k, s, names=[f"film {n}" for n in range(films)], seed=6)
    problem = side_by_side(
        pose_bands(reading, 1.0, Instrument())
        for reading in readings(simulated, Instrument(), Noise())
    )
    posterior = sample(problem, find_modes(problem), (), Sampling(sampler="hmc", steps=40))
    for name, truth in (("absorption", k), ("scattering", s), ("ratio", k / s)):
        ranks = (posterior.draws[name] < truth.reshape(-1)).mean(axis=(0, 1))
        held = (np.abs(ranks - 0.5) < 0.45).reshape(films, bands).mean(axis=1)
        assert held.mean() == pytest.approx(0.9, abs=4 * max(held.std() / np.sqrt(films), 0.01))
