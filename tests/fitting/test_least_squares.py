"""Least squares side by side: optimistix's steps, and a damped solve that is numpy's."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import lsq_linear

from glazefit.film.numerics.least_squares import (
    Bounds,
    Looks,
    Surroundings,
    bounded_step,
    descend,
    descend_within,
    levenberg_marquardt,
)
from glazefit.film.numerics.linear_steps import damped_solution, normal_solution

RNG = np.random.default_rng(11)


def decay(point, times, seen):
    """Two exponentials, and a weak pull: curved, and badly conditioned where both rates
    are alike.
    """
    first, second, share = point
    return jnp.concatenate(
        [
            share * jnp.exp(-first * times) + (1 - share) * jnp.exp(-second * times) - seen,
            1e-3 * point,
        ]
    )


fit_decays = partial(levenberg_marquardt, decay, rtol=1e-4, atol=1e-5, max_steps=60)
_decays = jax.jit(jax.vmap(decay, in_axes=(0, 0, None)))


def problems(count=60):
    times = np.linspace(0, 4, 12) * np.ones((count, 1))
    truth = RNG.uniform((0.2, 1.0, 0.1), (1.0, 4.0, 0.9), (count, 3))
    seen = np.asarray(_decays(truth, times, 0.0))[:, :12]
    return RNG.uniform((0.1, 0.5, 0.2), (2.0, 6.0, 0.8), (count, 3)), times, seen


@pytest.mark.parametrize("max_steps", [1, 2, 7, 60])
def test_steps_are_those_of_optimistix(max_steps):
    start, times, seen = problems()
    solver = optx.LevenbergMarquardt(rtol=1e-4, atol=1e-5)

    # One after the other: its QR is LAPACK's, which may hang in batches.
    @jax.jit
    def one(start, times, seen):
        found = optx.least_squares(
            lambda point, _: decay(point, times, seen),
            solver,
            start,
            max_steps=max_steps,
            throw=False,
        )
        return found.value, found.result == optx.RESULTS.successful

    each = [one(*row) for row in zip(start, times, seen, strict=True)]
    theirs, ended = (np.stack(values) for values in zip(*each, strict=True))
    ours, settled = fit_decays(jnp.asarray(start), times, seen, max_steps=max_steps)
    assert_allclose(ours, theirs, atol=1e-9, rtol=1e-9)
    assert_array_equal(settled, ended)
    if max_steps == 60:
        assert 0.9 < np.mean(settled) <= 1.0


def test_a_start_without_a_number_never_settles():
    start, times, seen = problems(3)
    start[1] = np.nan
    found, settled = fit_decays(jnp.asarray(start), times, seen)
    assert settled.tolist() == [True, False, True]
    assert np.isfinite(found[::2]).all()


@pytest.mark.parametrize("unknowns", [1, 2, 4, 8])
@pytest.mark.parametrize("damping", [1e-12, 1e-3, 1e6])
def test_damped_solution_is_that_of_numpy(unknowns, damping):
    matrix = RNG.standard_normal((5, 9, unknowns)) * np.logspace(0, -4, unknowns)
    right = RNG.standard_normal((5, 9))
    found = jax.jit(damped_solution)(matrix, right, np.full(5, damping))
    for a, b, x in zip(matrix, right, found, strict=True):
        whole = np.concatenate([a, np.sqrt(damping) * np.eye(unknowns)])
        wanted = np.linalg.lstsq(whole, np.concatenate([b, np.zeros(unknowns)]), rcond=None)[0]
        assert_allclose(x, wanted, rtol=1e-9, atol=1e-14)


def test_unknowns_that_change_nothing_stay():
    matrix = np.zeros((1, 3, 2))
    matrix[0, :, 0] = 1.0
    found = jax.jit(damped_solution)(matrix, np.array([[2.0, 2.0, 2.0]]), np.zeros(1))
    assert_allclose(found, [[2.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("unknowns", [1, 7, 30])
def test_normal_equations_agree_with_numpy(unknowns):
    matrix = RNG.standard_normal((3, unknowns + 10, unknowns))
    right = RNG.standard_normal((3, unknowns + 10))
    found = jax.jit(normal_solution)(matrix, right, np.full(3, 1e-12))
    for a, b, x in zip(matrix, right, found, strict=True):
        assert_allclose(x, np.linalg.lstsq(a, b, rcond=None)[0], rtol=1e-8, atol=1e-10)


def test_the_program_calls_no_library_for_linear_algebra():
    start, times, seen = problems(8)

    @jax.jit
    def solve(start):
        return fit_decays(start, times, seen)

    text = solve.lower(start).compile().as_text()
    assert text is not None
    assert "lapack_" not in text


def test_numpys_descent_ends_where_the_cost_has_no_slope():
    """A problem whose matrix is not positive definite without damping."""
    target = np.array([1.0, -2.0, 0.5])

    def look(point):
        miss = point - target
        return Surroundings(0.5 * np.sum(miss**2), miss, np.eye(3))

    tries = []

    def solve(normal, damping, gradient):
        tries.append(damping)
        if damping < 1e-2:
            raise np.linalg.LinAlgError
        return gradient / (normal[0, 0] + damping)

    told = []
    found = descend(
        look, solve, np.zeros(3), first_step=1e3, max_steps=60, tolerance=1e-6, note=told.append
    )
    assert found.settled
    assert found.steps == len(tries)
    assert told == list(range(found.steps))
    assert_allclose(found.point, target, atol=1e-5)


def linear(matrix, right):
    """Sums of squares |A x - b|^2, side by side."""

    def look(rows, points):
        miss = np.einsum("nrm,nm->nr", matrix[rows], points) - right[rows]
        flipped = np.swapaxes(matrix[rows], 1, 2)
        return Looks(
            cost=np.sum(miss**2, axis=1),
            slope=(flipped @ miss[..., None])[..., 0],
            curvature=flipped @ matrix[rows],
        )

    start = np.zeros((len(matrix), matrix.shape[2]))
    return look, start, look(np.arange(len(matrix)), start)


def test_descent_within_bounds_follows_a_narrow_valley():
    """The first full step leads far beyond the longest, and both unknowns stop there: in other
    proportions than the valley's the step would lead up its side.
    """
    problem = linear(np.array([[[700.0, 800.0], [1.0, 0.0]]]), np.array([[0.0, -8.0]]))
    bounds = Bounds(np.full(2, -10.0), np.full(2, 10.0), longest=1.0)
    found = descend_within(*problem, bounds, promise=1e-6, max_steps=60)
    assert found.settled.all()
    assert_allclose(found.point, [[-8.0, 7.0]], atol=1e-3)


def test_descent_within_bounds_ends_at_the_best_point_inside():
    matrix = RNG.standard_normal((12, 6, 3))
    right = 2.0 * RNG.standard_normal((12, 6))
    look, start, seen = linear(matrix, right)
    bounds = Bounds(np.full(3, -0.5), np.array([0.5, 0.4, 0.3]), 0.3)
    found = descend_within(look, start, seen, bounds, promise=1e-9, max_steps=60)
    assert found.settled.all()
    for a, b, x in zip(matrix, right, found.point, strict=True):
        best = lsq_linear(a, b, (bounds.low, bounds.high), tol=1e-14).x
        assert_allclose(x, best, atol=3e-4)
    # The start is the caller's: nothing of it changes.
    assert_array_equal(start, 0.0)
    assert_array_equal(seen.cost, np.sum(right**2, axis=1))
    far, gain = bounded_step(start, seen, bounds, np.full(len(matrix), 1e-9))
    assert np.all((far >= bounds.low) & (far <= bounds.high))
    assert np.all(np.abs(far - start) <= 0.3)
    assert np.all(gain >= 0)
