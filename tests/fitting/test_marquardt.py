"""Least squares side by side: optimistix's steps, and a damped solve that is numpy's."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from glazefit.film.least_squares import GramSchmidt
from glazefit.film.marquardt import damped_solution, levenberg_marquardt

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


def problems(count=60):
    times = np.linspace(0, 4, 12) * np.ones((count, 1))
    truth = RNG.uniform((0.2, 1.0, 0.1), (1.0, 4.0, 0.9), (count, 3))
    seen = np.stack([decay(row, t, 0.0)[:12] for row, t in zip(truth, times, strict=True)])
    return RNG.uniform((0.1, 0.5, 0.2), (2.0, 6.0, 0.8), (count, 3)), times, seen


@pytest.mark.parametrize("max_steps", [1, 2, 7, 60])
def test_steps_are_those_of_optimistix(max_steps):
    start, times, seen = problems()
    solver = optx.LevenbergMarquardt(rtol=1e-4, atol=1e-5, linear_solver=GramSchmidt())

    def one(start, times, seen):
        found = optx.least_squares(
            lambda point, _: decay(point, times, seen),
            solver,
            start,
            max_steps=max_steps,
            throw=False,
        )
        return found.value, found.result == optx.RESULTS.successful

    theirs, ended = jax.vmap(one)(start, times, seen)
    ours, settled = levenberg_marquardt(
        decay, jnp.asarray(start), times, seen, rtol=1e-4, atol=1e-5, max_steps=max_steps
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-9, rtol=1e-9)
    np.testing.assert_array_equal(settled, ended)
    if max_steps == 60:
        assert 0.9 < np.mean(settled) <= 1.0


def test_what_has_settled_stays():
    """A problem's answer does not depend on how long its neighbours take."""
    start, times, seen = problems(8)
    together, _ = levenberg_marquardt(
        decay, jnp.asarray(start), times, seen, rtol=1e-4, atol=1e-5, max_steps=60
    )
    for row in range(8):
        here = slice(row, row + 1)
        alone, _ = levenberg_marquardt(
            decay,
            jnp.asarray(start[here]),
            times[here],
            seen[here],
            rtol=1e-4,
            atol=1e-5,
            max_steps=60,
        )
        np.testing.assert_allclose(alone[0], together[row], atol=1e-12)


def test_a_start_without_a_number_never_settles():
    start, times, seen = problems(3)
    start[1] = np.nan
    found, settled = levenberg_marquardt(
        decay, jnp.asarray(start), times, seen, rtol=1e-4, atol=1e-5, max_steps=60
    )
    assert settled.tolist() == [True, False, True]
    assert np.isfinite(np.asarray(found)[[0, 2]]).all()


@pytest.mark.parametrize("unknowns", [1, 2, 4, 8])
@pytest.mark.parametrize("damping", [1e-12, 1e-3, 1e6])
def test_damped_solution_is_that_of_numpy(unknowns, damping):
    matrix = RNG.standard_normal((5, 9, unknowns)) * np.logspace(0, -4, unknowns)
    right = RNG.standard_normal((5, 9))
    found = damped_solution(jnp.asarray(matrix), jnp.asarray(right), jnp.full(5, damping))
    for a, b, x in zip(matrix, right, found, strict=True):
        whole = np.concatenate([a, np.sqrt(damping) * np.eye(unknowns)])
        wanted = np.linalg.lstsq(whole, np.concatenate([b, np.zeros(unknowns)]), rcond=None)[0]
        np.testing.assert_allclose(x, wanted, rtol=1e-9, atol=1e-14)


def test_unknowns_that_change_nothing_stay():
    matrix = np.zeros((1, 3, 2))
    matrix[0, :, 0] = 1.0
    found = damped_solution(jnp.asarray(matrix), jnp.asarray([[2.0, 2.0, 2.0]]), jnp.zeros(1))
    np.testing.assert_allclose(found, [[2.0, 0.0]], atol=1e-12)
