"""A plan leaves out what it says, and never changes a result by more than its share of the
tolerance.
"""

from typing import Any

import hypothesis.extra.numpy as hnp
import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.radiative.plan import bounds, closed_form
from glazejax.radiative.plan.plan import ALL, Savings, plan_stacks

from ..refusals import refusal
from ..slow import slow
from .cases import NO_STACKS

NONE = Savings(*(False for _ in Savings._fields))
STACKS, LAYERS = 64, 3
# One tolerance and few shapes: every test uses the programs that the first one compiled.
TOLERANCE = 1e-6


def random_scene(seed: int) -> dict[str, Any]:
    """Stacks of which every saving finds some: empty, opaque, equal and almost absorbing layers,
    black grounds.
    """
    rng = np.random.default_rng(seed)
    shape = (STACKS, LAYERS)
    kind = rng.integers(0, 3, (STACKS, 1))
    albedo = np.select(
        [kind == 0, kind == 1], [10 ** rng.uniform(-9, -1, shape), rng.uniform(0, 1, shape)], 1.0
    )
    albedo = np.where(rng.random(shape) < 0.2, rng.choice([0.0, 0.5, 1 - 1e-4], shape), albedo)
    thickness = np.where(rng.random(shape) < 0.2, 0.0, 10 ** rng.uniform(-3, 2, shape))
    ground = np.where(rng.random(STACKS) < 0.3, 0.0, rng.uniform(0, 1, STACKS))
    cosines = rng.uniform(0.02, 1, (2, STACKS))
    twice = rng.integers(0, STACKS, STACKS // 4)
    for array in (albedo, thickness, ground, *cosines):
        array[: len(twice)] = array[twice]
    cosines[:, : len(twice)] = cosines[::-1, : len(twice)]
    return {
        "albedo": albedo,
        "optical_thickness": thickness,
        "substrate_reflectance": ground,
        "cos_incidence": cosines[0],
        "cos_viewing": cosines[1],
    }


def direct(
    scene: dict[str, Any], hemispherical: bool = False, tolerance: float = TOLERANCE
) -> np.ndarray:
    solve = stack_hemispherical_reflectance if hemispherical else stack_reflectance_factor
    scene = {
        name: value
        for name, value in scene.items()
        if not (hemispherical and name == "cos_viewing")
    }
    return np.asarray(solve(**scene, tolerance=tolerance))


@pytest.mark.parametrize("hemispherical", [False, True])
@given(seed=st.integers(0, 2**31))
@settings(max_examples=15)
def test_savings_stay_within_the_tolerance(hemispherical: bool, seed: int):
    scene = random_scene(seed)
    exact = direct(scene, hemispherical)
    asked: dict[str, Any] = scene | ({"cos_viewing": None} if hemispherical else {})
    for savings in (
        NONE,
        ALL,
        NONE._replace(hidden=True),
        NONE._replace(layers=True, scattering=True),
    ):
        values = np.asarray(plan_stacks(**asked, tolerance=TOLERANCE, savings=savings).run())
        assert_allclose(values, exact, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("layers", 1e-12),
        ("equal", 1e-12),
        ("reciprocity", 1e-12),
        ("groups", 1e-12),
        ("unwanted", 1e-12),
        ("hidden", 0.3 * TOLERANCE),
    ],
)
def test_each_saving_alone(name: str, share: float):
    scene = random_scene(3)
    off = plan_stacks(**scene, tolerance=TOLERANCE, savings=NONE).run()
    plan = plan_stacks(**scene, tolerance=TOLERANCE, savings=NONE._replace(**{name: True}))
    assert_allclose(plan.run(), off, rtol=0, atol=share)


def test_bound_on_what_is_hidden_holds_and_is_not_idle():
    """A white ground under everything, against black, for stacks of all kinds: the bound is above,
    and not far.
    """
    rng = np.random.default_rng(0)
    shape = (256, LAYERS)
    pale = rng.random((256, 1)) < 0.3
    albedo = np.where(pale, 1 - 10 ** rng.uniform(-3, -1, shape), rng.uniform(0, 0.9, shape))
    thickness = 10 ** rng.uniform(-2, 0.7, shape)
    cosines = rng.uniform(0.02, 1, (2, 256))
    scene: dict = {
        "albedo": albedo,
        "optical_thickness": thickness,
        "cos_incidence": cosines[0],
        "cos_viewing": cosines[1],
    }
    change = np.subtract(*(direct(scene | {"substrate_reflectance": g}) for g in (1.0, 0.0)))
    ends = [closed_form.end(c, np.full(256, 1.5)) for c in cosines]
    prefixes = [
        bounds.hidden_change(albedo[:, :m], thickness[:, :m], np.full(256, 1.5), *ends)
        for m in range(1, LAYERS + 1)
    ]
    assert np.all(prefixes[-1] >= change)
    bound = np.min(
        prefixes, axis=0
    )  # what lies below the first layers includes what lies below all
    assert np.all(bound >= change)
    # Where it matters, the bound sees a good part of the optical depth that the light has passed.
    faint = ~pale[:, 0] & (change > 1e-9) & (change < 1e-4)
    assert faint.sum() > 20
    assert np.median(np.log(bound[faint]) / np.log(change[faint])) > 0.4


@pytest.mark.slow
def test_bound_on_what_is_hidden_is_nearly_reached():
    """White of endless depth below a clear layer adds more than half of the bound: half the bound
    would not hold.
    """
    n, clear, depth = (
        np.array([1.0, 1.5, 2.0]),
        np.array([[0.0], [1e-5], [0.0]]),
        np.array([[3.0], [3.5], [4.0]]),
    )
    nothing = np.zeros((3, 1))
    white = (
        np.concatenate([clear, nothing + 1.0], axis=1),
        np.concatenate([depth, nothing + 1e5], axis=1),
    )
    change = stack_reflectance_factor(*white, 0.0, refractive_index=n, tolerance=TOLERANCE)
    ends = closed_form.end(np.ones(3), n)
    bound = bounds.hidden_change(clear, depth, n, ends, ends)
    assert np.all(change <= bound)
    assert np.all(2.0 * change > bound)


@pytest.mark.slow
def test_bound_on_what_is_scattered_again_is_nearly_reached():
    """A thin layer that scatters little over white: what the closed form leaves out is more than
    half of the bound.

    The ground lights the layer from below and, mirrored by the surface, from above.
    """
    n, albedo, depth, cosine = 2.4, 1e-3, 1e-3, np.ones(1)
    rows = np.array([[albedo]]), np.array([[depth]])
    first = closed_form.without_multiple_scattering(*rows, np.ones(1), n, cosine, cosine)
    whole = stack_reflectance_factor([albedo], [depth], 1.0, refractive_index=n, tolerance=1e-9)
    left_out = float(whole) - float(first.reflectance[0])
    end = closed_form.end(cosine, np.full(1, n))
    bound = float(
        bounds.scattered_beyond_first(*rows, first.ground_radiosity, np.full(1, n), end, end)[0]
    )
    assert bound / 2.0 < left_out <= bound


def test_decay_rate_is_rounded_down():
    q = np.concatenate([[0, 1e-9, 1 - 1e-12, 1.0], np.linspace(0, 1, 1001)])
    rate = bounds.decay_rate(q)
    assert np.all((rate >= 0) & (rate < 1))
    assert rate[q == 1].max() == 0
    positive = rate > 0
    # q artanh(kappa)/kappa = 1 grows with kappa: at a rate rounded down it is at most one.
    assert np.all(q[positive] * np.arctanh(rate[positive]) / rate[positive] <= 1 + 1e-12)


@pytest.mark.parametrize(
    ("index", "hemispherical"),
    [
        (1.5, False),
        (1.02, True),
        slow(1.0, False),
        slow(2.4, True),
    ],
)
def test_closed_form_without_scattering_is_exact(index: float, hemispherical: bool):
    """Bare and absorbing stacks against the solver."""
    thickness = np.array([[0.0], [1e-3], [0.3], [2.0]])
    scene: dict = {
        "albedo": 0 * thickness,
        "optical_thickness": thickness,
        "substrate_reflectance": np.array([1.0, 0.9, 0.5, 1.0]),
        "refractive_index": index,
        "cos_incidence": 0.6,
    }
    plan = plan_stacks(**scene, cos_viewing=None if hemispherical else 0.31, tolerance=1e-8)
    assert plan.report().closed == 4
    exact = direct(scene | {"cos_viewing": 0.31}, hemispherical, tolerance=1e-8)
    assert_allclose(plan.run(), exact, rtol=0, atol=1e-8)


def test_report_counts_what_is_left_out():
    albedo = np.array([[0.9, 0.9, 0.2], [0.9, 0.9, 0.2], [0.3, 0.99, 0.5], [0.0, 0.0, 0.0]])
    thickness = np.array([[1.0, 1.0, 0.0], [0.5, 1.5, 0.0], [60.0, 1.0, 1.0], [0.5, 0.5, 0.5]])
    plan = plan_stacks(albedo, thickness, [0.5, 0.5, 0.8, 0.5])
    report = plan.report()
    assert (report.stacks, report.equal, report.closed, report.solved) == (4, 1, 1, 2)
    assert (report.hidden_layers, report.hidden_grounds) == (2, 1)
    assert report.groups == ((1, 2),)
    assert "2 layers are hidden" in plan.describe()
    assert "1 layer" in repr(plan)
    assert_allclose(plan.run()[0], plan.run()[1], rtol=1e-15)


def test_exchanged_directions_are_solved_once():
    cosines = np.array([0.3, 0.7, 1.0])
    plan = plan_stacks([0.8], [1.0], 0.5, cos_incidence=cosines[:, None], cos_viewing=cosines)
    assert plan.report().solved == 6
    values = np.asarray(plan.run())
    assert_array_equal(values, values.T)


def test_entries_not_wanted_are_nan_and_not_computed():
    scene = random_scene(1)
    wanted = np.arange(STACKS) % 2 == 0
    plan = plan_stacks(**scene, wanted=wanted)
    values = np.asarray(plan.run())
    assert plan.report().unwanted == STACKS // 2
    assert_array_equal(np.isnan(values), ~wanted)
    assert_allclose(values[wanted], direct(scene)[wanted], rtol=0, atol=TOLERANCE)
    off = plan_stacks(**scene, wanted=wanted, savings=NONE)
    assert_array_equal(np.isnan(np.asarray(off.run())), ~wanted)


@given(weights=hnp.arrays(float, (16, 2), elements=st.floats(-1, 1)), power=st.floats(0, 12))
@settings(max_examples=10, suppress_health_check=[HealthCheck.filter_too_much])
def test_bands_left_out_do_not_move_the_sums(weights: np.ndarray, power: float):
    x = np.linspace(0, 1, 16)
    weights = weights * np.exp(-power * (x[:, None] * 4) ** 2)
    scene: dict = {
        "albedo": np.stack([0.9 * x, 1 - x**2], -1),
        "optical_thickness": [2.0, 1.0],
        "substrate_reflectance": 0.9,
        "cos_incidence": 0.7,
        "cos_viewing": 1.0,
    }
    plan = plan_stacks(**scene, band_weights=weights, tolerance=1e-3)
    off = np.asarray(plan_stacks(**scene, tolerance=1e-3, savings=NONE).run())
    change = np.abs((np.asarray(plan.run()) - off) @ weights)
    assert np.all(change <= 1e-3 * np.abs(weights).sum(axis=0) + 1e-15)


def test_bands_at_the_ends_of_the_visible_are_left_out():
    x = np.linspace(-3, 3, 32)
    plan = plan_stacks(
        [0.8],
        [1.0],
        np.full(32, 0.5) + 0.01 * x,
        band_weights=np.exp(-2 * x[:, None] ** 2),
        tolerance=1e-3,
    )
    assert plan.report().bands > 5
    assert np.all(np.isfinite(plan.run()))


def test_groups_by_depth_and_blocks():
    rng = np.random.default_rng(0)
    thickness = np.where(np.arange(8) < rng.integers(1, 9, (900, 1)), 0.3, 0.0)
    plan = plan_stacks(
        rng.uniform(0.2, 0.9, (900, 8)),
        thickness,
        0.5,
        savings=ALL._replace(hidden=False),
        tolerance=1e-3,
    )
    report = plan.report()
    assert [layers for layers, _ in report.groups] == [3, 6, 8]
    assert sum(stacks for _, stacks in report.groups) == 900
    assert report.solved_layers < 900 * 8 * 0.8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"albedo": [1.2]}, "albedo holds 1.2"),
        ({"albedo": np.ma.array([0.5], mask=True)}, "albedo has masked values"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"band_weights": np.ones((3, 1))}, "band_weights"),
    ],
)
def test_what_is_wrong_is_named(change: dict[str, Any], words: str):
    with refusal(words):
        plan_stacks(
            **({"albedo": [0.5], "optical_thickness": [1.0], "substrate_reflectance": 0.5} | change)
        )


def test_a_plan_needs_numbers():
    with refusal("outside jit"):
        jax.jit(lambda q: plan_stacks(q, [1.0], 0.5).run())(np.array([0.5]))


def test_no_stacks_and_bare_ground():
    assert plan_stacks(*NO_STACKS).run().shape == (0,)
    bare = plan_stacks(np.zeros(0), np.zeros(0), 0.5)
    assert_allclose(
        bare.run(),
        direct({"albedo": [0.0], "optical_thickness": [0.0], "substrate_reflectance": 0.5}),
        atol=TOLERANCE,
    )
