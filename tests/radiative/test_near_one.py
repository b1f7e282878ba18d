"""An index of almost one: errors at grazing angles, slopes by the index, and a tolerance finer than
there is.
"""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import stack_reflectance_factor
from glazejax.radiative.common.directions import Resolution, half_range, resolve
from glazejax.radiative.ordinates import solver as ordinates
from glazejax.radiative.ordinates.resolution import resolve_known

from ..checks import largest_difference
from ..slow import slow
from .cases import factor, flux

# Far more directions, whose rise is followed down to a cosine of 1e-5.
FINE = Resolution(64, 12, reach=12.5)
INDICES = (1.0, 1 + 1e-9, 1 + 1e-7, 1 + 1e-5, 1 + 1e-4)


def grazing_stacks(least: float) -> ordinates.StackArrays:
    """A hundred of two layers, thin to opaque, albedo up to 1 - 1e-6, cosines down to ``least``,
    evenly in the logarithm.
    """
    rng = np.random.default_rng(0)
    albedo = 1 - 10 ** rng.uniform(-6, 0, (100, 2))
    thickness = 10 ** rng.uniform(-3, 1.5, (100, 2))
    cosines = 10 ** rng.uniform(np.log10(least), 0, (2, 100))
    cosines[:, 0] = least
    ground = rng.choice([0.0, 0.5, 1.0], 100)
    albedo, thickness, ground, light, view = map(jnp.asarray, (albedo, thickness, ground, *cosines))
    return ordinates.StackArrays(albedo, thickness, ground, None, light, view)


@jax.jit
def solved(stacks: ordinates.StackArrays, index, directions):
    stacks = stacks._replace(refractive_index=jnp.broadcast_to(index, stacks.ground.shape))
    return ordinates.reflectance(stacks, directions)


def worst(stacks, index, directions, truth):
    found = solved(stacks, index, jax.tree.map(jnp.asarray, directions))
    return largest_difference(found, truth)


@pytest.mark.slow
@pytest.mark.parametrize("least", [0.05, 4e-4])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_error_of_grazing_light_and_view_stays_below_the_tolerance(least, tolerance):
    # Both of a cosine of 4e-4: the reflectance factor is some 150 then, and its error is still an
    # absolute one.
    stacks = grazing_stacks(least)
    for index in INDICES:
        fine = half_range(np.float64(index), FINE if index > 1 else FINE._replace(total=0))
        truth = solved(stacks, index, jax.tree.map(jnp.asarray, fine))
        known = half_range(index, resolve_known(tolerance, index, least))
        assert worst(stacks, index, known, truth) <= tolerance, f"known index of {index}"
        traced = half_range(np.float64(index), resolve(tolerance, 1.0, 2.5, least))
        assert worst(stacks, index, traced, truth) <= tolerance, f"traced index of {index}"


@pytest.mark.slow
def test_thin_layers_seen_aslant_stay_below_the_tolerance():
    # One of 6000 random stacks with cosines from 0.05 on, which all get the same directions.
    albedo, thickness = [0.99999922, 0.49685725, 1.0], [0.00398201, 0.00089455, 0.00040152]

    stack = albedo, thickness, 0.5, [0.11253014, 0.05], [0.15220655, 0.05]
    coarse, fine = (factor(*stack, refractive_index=1.0, tolerance=t)[0] for t in (1e-8, 1e-10))
    assert float(coarse) == pytest.approx(float(fine), abs=1e-8)


# Far from one, and too near to tell from it, they are as at its neighbours.
@pytest.mark.parametrize(
    "index",
    [1.0, *(slow(1 + excess) for excess in (1e-9, 1e-6, 1e-3))],
)
def test_cosines_of_a_call_decide(index):
    """Light and view both graze, or an unknown cosine may: what the solver gets, by its error."""

    def aslant(light, view, tolerance=1e-4):
        return factor([0.9], [1.0], 0.5, light, view, refractive_index=index, tolerance=tolerance)

    fine = aslant(4e-4, 4e-4, 1e-6)
    for found in (aslant(4e-4, 4e-4), jax.jit(aslant)(4e-4, 4e-4)):
        assert float(found) == pytest.approx(float(fine), abs=1e-4)


def glancing(thickness, cosines, tolerance):
    """A layer that absorbs nothing, at index one, lit and seen along the same cosines."""
    stack = [1.0], thickness, 0.5, cosines, cosines
    return np.asarray(factor(*stack, refractive_index=1.0, tolerance=tolerance))


def test_the_most_grazing_cosine_of_a_call_decides():
    """Beside a steep cosine a grazing one gives what it gives without: the same directions, so the
    same number but for rounding.
    """
    both, alone = (
        glancing([[0.01], [0.01]], np.array([first, 4e-4]), 1e-4)[1] for first in (0.9, 4e-4)
    )
    assert both == pytest.approx(alone, rel=1e-12)


@pytest.mark.parametrize("finest", [1e-7, slow(1e-10)])
def test_cosines_between_two_decades_stay_below_the_tolerance(finest):
    """Directions are chosen for the decade below. At this tolerance thin layers that absorb nothing
    use four fifths of it; the reference's own error is at most a thousandth of it.
    """
    cosines, thickness = np.array([1.1e-3, 1.1e-3, 1.4e-3]), [[3e-4], [3e-3], [3e-4]]
    coarse, fine = (glancing(thickness, cosines, tolerance) for tolerance in (1e-4, finest))
    assert largest_difference(coarse, fine) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(("index", "traced"), [(1.0, False), (1 + 1e-8, True), (1 + 1e-6, True)])
def test_flux_of_grazing_light_stays_below_the_tolerance(index, traced):
    """What leaves a medium into which light has grazed comes from just below its face, and grazes
    too: 30 times the tolerance was missed where only the view's cosine chose directions.
    """
    cosines = np.array([1e-5, 1e-4, 4e-4, 1e-3, 3e-3, 0.01, 0.03])

    def body(light, tolerance):
        stack = [0.97, 0.5], [0.3, 1.0], 0.5, light
        return flux(*stack, refractive_index=index, tolerance=tolerance)

    call = jax.jit(body, static_argnums=1) if traced else body
    assert_allclose(call(cosines, 1e-4), body(cosines, 1e-7), atol=1e-4, rtol=0)


@pytest.mark.slow
@pytest.mark.parametrize("hemispherical", [False, True])
def test_slopes_by_an_index_of_one_and_just_above(hemispherical):
    """Bare ground, empty layers and a black one are there."""
    albedo = jnp.array([[0.5, 0.9], [0.99, 0.2], [0.3, 0.8], [0.6, 0.6], [0.0, 0.7]])
    thickness = jnp.array([[1.0, 2.0], [5.0, 0.4], [0.0, 3.0], [0.0, 0.0], [0.2, 0.9]])
    ground = jnp.array([0.3, 0.0, 0.8, 0.6, 1.0])
    light, view = jnp.array([1.0, 0.8, 0.5, 0.9, 0.7]), jnp.array([0.7, 1.0, 0.6, 0.4, 0.9])

    solve, cosines = (flux, [light]) if hemispherical else (factor, [light, view])

    @jax.jit
    def f(index):
        stack = albedo, thickness, ground, *cosines
        return solve(*stack, refractive_index=index, tolerance=1e-8)

    slope = jax.jit(lambda n: jax.jvp(f, (n,), (jnp.ones_like(n),))[1])
    at = lambda excess: jnp.full(5, 1.0 + excess)  # noqa: E731
    # R(n) = R(1) + a e + b e^(3/2) + ..., e = n^2 - 1: the secant goes to the slope as the root of
    # the step.
    values = [np.asarray(f(at(e))) for e in (0.0, 1e-6, 4e-6, 1.6e-5)]
    secants = [
        (value - values[0]) / e for value, e in zip(values[1:], (1e-6, 4e-6, 1.6e-5), strict=True)
    ]
    once = [2 * secants[0] - secants[1], 2 * secants[1] - secants[2]]
    # What is left goes as e^(3/2) log e.
    assert_allclose(slope(at(0.0)), once[0], rtol=2e-3, atol=2e-3)
    assert np.max(np.abs(np.asarray(slope(at(0.0))) - secants[0])) > 0  # no difference in disguise
    # At 1.0001 and above there are neighbours on both sides.
    for excess, step in ((1e-4, 5e-6), (0.5, 1e-3)):
        central, wide = (
            np.asarray(f(at(excess + h)) - f(at(excess - h))) / (2 * h) for h in (step, 2 * step)
        )
        assert_allclose(slope(at(excess)), (4 * central - wide) / 3, rtol=2e-5, atol=1e-5)


@pytest.mark.slow
def test_slope_at_one_in_closed_form():
    """A ground that absorbs nothing but a little, bare: R = T(n)^2 rho/(n^2 (1 - rho K)),
    by hand.
    """
    rho = 0.6

    def f(n):
        return stack_reflectance_factor([0.0], [0.0], rho, refractive_index=n, tolerance=1e-8)

    # K = 2 int R mu dmu = (7/6) (n - 1) * 2 to first order, T = 1 to second: d/dn = rho (7/3) rho -
    # 2 rho.
    expected = rho * (7 / 3 * rho - 2.0)
    assert float(jax.jit(jax.grad(f))(1.0)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("method", "finest"),
    [("ordinates", 1e-10), slow("auxiliary", 1e-8)],
)
def test_a_tolerance_finer_than_there_is_is_said(method, finest):
    def call(tolerance):
        return stack_reflectance_factor([0.5], [1.0], 0.3, tolerance=tolerance, method=method)

    with pytest.warns(
        UserWarning, match=f"tolerance is 1e-14, but {finest:g} is the least there is with method"
    ):
        finer = call(1e-14)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert float(call(finest)) == float(finer)


def test_single_precision_says_what_it_cannot():
    with jax.enable_x64(False), warnings.catch_warnings():
        warnings.simplefilter("error")
        stack_reflectance_factor([0.5], [1.0], 0.3)  # the default is not a wish
        with pytest.raises(UserWarning, match="1e-05 is the least there is in single precision"):
            stack_reflectance_factor([0.5], [1.0], 0.3, tolerance=1e-8)
