"""Interpolation of smooth parameters: error as asked, slopes of the solver, few points, and errors
that help.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax.chebyshev_table import Mirrored
from glazejax.radiative.common import chunks

from .checks import finite
from .refusals import refusal

check_near = partial(assert_allclose, rtol=0)

GRID = np.arange(400.0, 701.0, 60.0)
TOLERANCE = 1e-4
RANGES = {"thickness": (0.0, 40e-6), "share": (0.0, 1.0)}
BLACK = gj.Pigment("black", GRID, 3e5 + 0 * GRID, 2e4 + 0 * GRID)
WHITE = gj.Pigment("white", GRID, 3e2 * (GRID / 400) ** -3, 2e5 - 200 * GRID)


def spectrum(thickness, share):
    """A coat of grey on a brown ground; weights that JAX traces are not checked."""
    weights = jnp.stack([jnp.asarray(share), 1 - jnp.asarray(share)], axis=-1)
    glaze = gj.Glaze(
        [gj.Layer(gj.Mixture([BLACK, WHITE], weights), thickness)], np.linspace(0.2, 0.7, GRID.size)
    )
    return gj.reflectance(glaze, gj.Bidirectional(45, 0), tolerance=1e-6)


@pytest.fixture(scope="module")
def table():
    return gj.interpolated(spectrum, RANGES, tolerance=TOLERANCE)


def random_places(count):
    """Thicknesses and shares in the ranges of the table."""
    rng = np.random.default_rng(0)
    return rng.uniform(0, 40e-6, count), rng.uniform(0, 1, count)


def paint(**columns) -> np.ndarray:
    """Two channels that behave as reflectances do: a logarithm at zero, saturation where opaque."""
    first, last = (1e6 * np.asarray(list(columns.values())[k]) for k in (0, -1))
    thin = np.where(first > 0, first * np.log(np.maximum(first, 1e-300)), 0.0)
    return np.stack(
        [
            np.exp(-0.7 * first) / (1 + last),
            0.3 + 0.05 * thin * np.exp(-first) - 0.2 * np.exp(-3 * last),
        ],
        1,
    )


def test_ranges_order_and_error_are_said(table):
    assert table.converged
    assert 0 < table.error <= TOLERANCE
    assert table.ranges == RANGES
    assert table.names == ("thickness", "share")
    assert table.shape == GRID.shape
    assert "share 0 to 1" in repr(table)
    assert "estimated error" in repr(table)


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 40e-6), st.floats(0, 1))
def test_value_is_the_solvers_anywhere(table, thickness, share):
    exact = spectrum(np.full(64, thickness), np.full(64, share))[0]
    check_near(table(thickness, share), exact, atol=TOLERANCE)


def test_slopes_are_the_solvers(table):
    """By both parameters, over the range and as the whole row of a Jacobian."""
    rng = np.random.default_rng(3)
    at = (jnp.asarray(rng.uniform(2e-6, 39e-6, 64)), jnp.asarray(rng.uniform(0.1, 1, 64) ** 2))
    for k, scale in enumerate((40e-6, 1.0)):
        change = tuple(jnp.full(64, scale if j == k else 0.0) for j in (0, 1))
        exact = jax.jvp(spectrum, at, change)[1]
        found = jax.jvp(table, at, change)[1]
        # Slopes over the whole range; a polynomial loses about its degree in accuracy.
        check_near(found, exact, atol=100 * TOLERANCE)
        assert np.max(np.abs(exact)) > 0.1
    total = jax.grad(lambda x: jnp.sum(table(x, at[1])))(at[0])
    assert_allclose(total, jnp.sum(jax.jvp(table, at, (jnp.ones(64), jnp.zeros(64)))[1], axis=1))


def test_slopes_are_finite_at_the_ends_and_go_on_beyond_them(table):
    for end in ((0.0, 0.0), (40e-6, 1.0)):
        assert finite(jax.jacobian(lambda x: table(*x))(jnp.array(end)))
    curved = jax.hessian(lambda x: table(x, 0.4)[0])(1e-5)
    assert np.isfinite(curved)
    assert curved != 0


def test_table_is_a_pytree_whose_coefficients_can_be_learned(table):
    (leaf,) = jax.tree.leaves(table)
    slope = jax.grad(lambda t: jnp.sum(t(1e-5, 0.5)))(table).coefficients
    step = jnp.zeros_like(leaf).at[1, 2, 0].set(1.0)
    moved = jax.tree.map(lambda c: c + step, table)
    assert_allclose(jnp.sum(moved(1e-5, 0.5) - table(1e-5, 0.5)), slope[1, 2, 0], atol=1e-12)


def test_jit_vmap_pieces_and_names_are_the_same(table):
    thickness, share = random_places((3, 2001))
    share = share[0]
    whole = table(thickness, share)
    assert whole.shape == (3, 2001, GRID.size)
    one_by_one = jax.vmap(jax.vmap(table), (0, None))(thickness, share)
    # Batches multiply matrices of another shape, in another order of sums.
    check_near(whole, one_by_one, atol=1e-12)
    check_near(whole, jax.jit(table)(thickness, share), atol=1e-12)
    assert_array_equal(whole, table(share=share, thickness=thickness))
    slopes = jax.grad(lambda x: jnp.sum(table(x, share)))(thickness)
    few = jax.grad(lambda x: jnp.sum(table(x, share[:5])))(thickness[:, :5])
    assert_allclose(slopes[:, :5], few, rtol=1e-9)


def test_many_points_go_to_all_cores(table, monkeypatch):
    at = random_places(2**16 + 3)
    monkeypatch.setattr(chunks, "cores", lambda: 2)
    check_near(table(*at), jax.jit(table)(*at), atol=1e-13)


def test_float32_is_the_same_to_rounding(table):
    at = random_places(500)
    single = table.astype(jnp.float32)(*at)
    assert single.dtype == jnp.float32
    check_near(single, table(*at), atol=3e-6)


def test_traced_values_outside_are_moved_to_the_end_with_its_slope(table):
    assert_array_equal(jax.jit(table)(50e-6, 0.5), jax.jit(table)(40e-6, 0.5))
    assert np.isnan(jax.jit(table)(jnp.nan, 0.5)).all()
    assert float(jax.jit(jax.grad(lambda x: table(x, 0.3)[0]))(60e-6)) == 0.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((-1e-6, 0.5), "thickness is -1e-06, outside the table's range 0 to 4e-05"),
        ((np.array([1e-6, np.nan]), 0.5), "thickness is nan"),
        ((1e-6, 1.2), "share is 1.2, outside the table's range 0 to 1"),
        ((1e-6,), "give each parameter once"),
        ((1e-6, 0.5, 0.5), "give each parameter once"),
    ],
)
def test_values_outside_are_named(table, values, words):
    with refusal(words):
        table(*values)
    with refusal("by name"):
        table(1e-6, shade=0.5)


def test_what_the_function_refuses_is_passed_on():
    with refusal("thickness"):
        gj.interpolated(
            lambda thickness: spectrum(thickness, 0 * thickness), {"thickness": (-1e-6, 1e-5)}
        )
    with refusal("not finite at x -1"):
        gj.interpolated(lambda x: np.sqrt(np.where(x < 0, np.nan, x)), {"x": (-1, 1)})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ranges": {}}, "1 to 3 parameters, not 0"),
        ({"ranges": dict.fromkeys("abcd", (0, 1))}, "1 to 3 parameters, not 4: a, b, c, d"),
        ({"ranges": {"x": (1, 1)}}, "range 1 to 1 of 'x'"),
        ({"ranges": {"x": (0, np.nan)}}, "range 0 to nan of 'x'"),
        ({"ranges": {"x": 1.0}}, r"must be \(low, high\)"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"samples": {"y": [0.5]}}, "samples are of y"),
        ({"samples": {"x": [1.5]}}, "x is 1.5"),
        ({"samples": {"x": []}}, "samples have 0 values of x"),
        (
            {"ranges": {"x": (0, 1), "y": (0, 1)}, "samples": {"x": [0.1, 0.2], "y": [0.3]}},
            "samples have 2, 1 values of x, y: give each parameter as many",
        ),
        ({"samples": {"x": ["a"]}}, r"samples of 'x' must be known numbers, not \['a'\]"),
        ({"ranges": {"x": ("low", "high")}}, r"the range of 'x' must be known numbers"),
        ({"function": lambda x: np.float64(1.0)}, "jax.vmap"),
    ],
)
def test_what_is_wrong_is_named(change, words):
    with refusal(words):
        gj.interpolated(**{"function": paint, "ranges": {"x": (0, 1)}} | change)


def test_what_is_no_number_is_named(unchecked, table):
    with refusal("thickness is '2um'; it must be a number"):
        table("2um", 0.5)


def test_ranges_go_by_name(unchecked):
    with refusal(r"ranges is \(0.0, 5.0\); write them by name, such as"):
        gj.interpolated(paint, (0.0, 5.0))  # pyright: ignore[reportArgumentType]


def test_a_table_is_built_outside_jit():
    with refusal("outside jit"):
        jax.jit(lambda y: gj.interpolated(lambda x: y * x[:, None], {"x": (0, 1)})(0.5))(1.0)


def test_a_function_of_single_numbers_is_wrapped():
    falling = jax.jit(jax.vmap(lambda x: jnp.exp(-x)))
    table = gj.interpolated(falling, {"x": (-1, 2)}, tolerance=1e-8)
    assert table.shape == ()
    x = np.linspace(-1, 2, 7)
    check_near(table(x), np.exp(-x), atol=1e-8)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_error_is_as_asked_and_points_are_few(axes: int, tolerance: float):
    high = dict(zip("xyz"[:axes], (40e-6, 5e-6, 30e-6), strict=False))
    ranges = {name: (0, top) for name, top in high.items()}
    table = gj.interpolated(paint, ranges, tolerance=tolerance)
    assert table.error <= tolerance
    rng = np.random.default_rng(1)
    points = {name: rng.uniform(0, top, 5000) for name, top in high.items()}
    check_near(table(**points), paint(**points), atol=tolerance)
    assert table.evaluations < {1: 700, 2: 3200, 3: 20000}[axes]


def test_what_is_steep_at_the_upper_end_is_met_too():
    def steep(share):
        return 1 / (1 + 300 * (1 - share))

    table = gj.interpolated(steep, {"share": (0, 1)}, tolerance=1e-4)
    assert table.converged
    assert isinstance(table.axes[0], Mirrored)
    share = 1 - np.geomspace(1e-5, 1, 3000)
    check_near(table(share), steep(share), atol=1e-4)


def test_check_points_come_from_the_samples_and_distance_counts():
    """A kink where no sample lies does not matter; a distance that ignores a channel does not
    refine for it.
    """
    table = gj.interpolated(
        lambda x: np.stack([np.exp(-x), (x > 2.9).astype(float)], axis=1),
        {"x": (0.0, 3.0)},
        tolerance=1e-6,
        distance=lambda a, b: np.abs(a - b)[:, 0],
        samples={"x": np.linspace(0, 2, 50)},
    )
    assert table.converged
    assert table.coefficients.shape[0] < 129


def test_what_cannot_be_reached_is_said():
    table = gj.interpolated(lambda x: (x > 0.37).astype(float), {"x": (0, 1)}, tolerance=1e-6)
    assert table.error > 1e-6
    assert not table.converged
    assert "not the 1e-06 asked for" in repr(table)
