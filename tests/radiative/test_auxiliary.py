"""The auxiliary function method with a step: right, of the order it claims, its variants alike, and
never a hang.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax import stack_reflectance_factor
from glazejax.radiative.auxiliary import uniform as auxiliary
from glazejax.radiative.auxiliary.contraction import solve_contraction
from glazejax.radiative.auxiliary.kernel_table import MOST_SEGMENTS, KernelTable
from glazejax.radiative.auxiliary.uniform import reflectance_factor, split_reflectance_factor
from glazejax.radiative.auxiliary.uniform_solver import GridSettings, solve
from glazejax.radiative.common.fresnel import cos_refracted
from tests.tolerances import ROUNDING

from ..checks import check_slopes, finite, largest_difference
from ..refusals import refusal
from ..slow import slow
from .cases import CENTRAL, NO_STACKS, TWO_LAYERS, factor, lapack_calls, reference_cases

# Interfaces and thicknesses that no step used here fits; the last three are an absent glaze, no
# scattering at all and no absorption at all.
ALBEDO = np.array(
    [[0.8, 0.4], [0.99, 0.2], [1.0, 0.5], [0.95, 0.3], [0.5, 0.9], [0.0, 0.0], [1.0, 1.0]]
)
THICKNESS = np.array(
    [
        [0.413, 0.777],
        [0.137, 0.91],
        [0.31, 0.4],
        [0.22, 0.5137],
        [0.0, 0.0],
        [0.5, 0.2],
        [0.3, 0.317],
    ]
)
GROUND = np.array([0.7, 1.0, 0.9, 0.5, 0.8, 0.8, 1.0])
INCIDENCE = np.array([0.8, 1.0, 0.3, 0.5, 0.5, 0.5, 1.0])
VIEWING = np.array([0.6, 1.0, 0.9, 0.2, 0.6, 0.6, 0.7])
ANGLES: dict = {"cos_incidence": INCIDENCE, "cos_viewing": VIEWING}
STACKS = (ALBEDO, THICKNESS, GROUND)
STEPS = (0.16, 0.04, 0.02)
factors = partial(reflectance_factor, *STACKS, **ANGLES)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return np.asarray(stack_reflectance_factor(*STACKS, **ANGLES, tolerance=1e-10))


def errors(truth, **settings) -> np.ndarray:
    """Of every stack at every step, (steps, stacks)."""
    return np.array([np.abs(factors(step=step, **settings) - truth) for step in STEPS])


def order(errors: np.ndarray) -> float:
    """Slope of the error's root mean square over the stacks against the step, over all steps."""
    size = np.log(np.sqrt(np.mean(errors[:, :4] ** 2, axis=1)))
    return float(np.polyfit(np.log(STEPS), size, 1)[0])


@pytest.mark.slow
def test_the_corrected_method_is_of_second_order(truth):
    found = errors(truth)
    assert order(found) > 1.8
    assert np.all(found <= 0.1 * np.array(STEPS)[:, None] ** 2)


@pytest.mark.slow
def test_the_printed_method_is_of_first_order(truth):
    found = errors(truth, corrected=False)
    assert 0.6 < order(found) < 1.5
    # And far behind where nothing fits.
    assert np.all(found[-1, :4] > 20 * 0.1 * STEPS[-1] ** 2) or found[-1, :4].max() > 1e-3


@pytest.mark.slow
def test_references():
    step = 0.2
    for index, cases in reference_cases().items():
        moderate = cases.optical_thickness.sum(axis=1) < 12
        q, d, ground, light, view, exact, *_ = (column[moderate] for column in cases)
        angles: dict = {"cos_incidence": light, "cos_viewing": view}
        found = reflectance_factor(q, d, ground, **angles, refractive_index=index, step=step)
        inside = cos_refracted(np.minimum(light, view), index)
        assert np.all(np.abs(found - exact) < 0.04 * (step / inside) ** 2)


@pytest.mark.parametrize("corrected", [True, slow(False)])
def test_direct_and_decomposed_agree(corrected, truth):
    step = STEPS[1]
    direct, decomposed = (
        factors(step=step, variant=variant, corrected=corrected)
        for variant in ("direct", "decomposed")
    )
    # The quadrature leaves every entry of the matrix within 1e-6; with nothing absorbed they add
    # up.
    assert largest_difference(direct, decomposed) < 2e-5
    if corrected:
        assert largest_difference(decomposed, truth) < 0.2 * step**2


def test_a_step_that_fits_makes_fixed_and_own_step_alike():
    thickness = np.array([[0.4, 0.8], [0.08, 0.96], [0.0, 0.0], [0.32, 0.4]])
    given = (ALBEDO[:4], thickness, GROUND[:4])
    fixed, own = (
        reflectance_factor(*given, step=0.04, variant=variant, corrected=False)
        for variant in ("fixed_step", "decomposed")
    )
    assert largest_difference(fixed, own) < 1e-9


def test_parts_add_up_and_mean_what_they_say():
    for corrected in (True, False):
        split = split_reflectance_factor(*STACKS, **ANGLES, step=0.04, corrected=corrected)
        whole = factors(step=0.04, corrected=corrected)
        assert largest_difference(split.ground + split.single + split.multiple, whole) < ROUNDING
        assert all(np.all(part >= 0) for part in split)
        # Neither an absent glaze nor one without albedo scatters.
        assert np.all(split.single[4:6] == 0)
        assert np.all(split.multiple[4:6] == 0)
    split = split_reflectance_factor(ALBEDO, THICKNESS, 0.0, **ANGLES, step=0.04)
    assert np.all(split.ground == 0)
    # Without a ground and with next to no albedo all is single scattering.
    faint = split_reflectance_factor(1e-4 * ALBEDO, THICKNESS, 0.0, **ANGLES, step=0.04)
    dim = stack_reflectance_factor(1e-4 * ALBEDO, THICKNESS, 0.0, **ANGLES, tolerance=1e-10)
    assert np.all(faint.multiple <= 1e-4 * faint.single)
    assert np.allclose(faint.single, dim, atol=1e-8)


def test_no_scattering_is_a_closed_form(truth):
    assert largest_difference(factors(step=0.04)[4:6], truth[4:6]) < 1e-9


def test_incidence_and_viewing_may_be_exchanged():
    back = factors(cos_incidence=VIEWING, cos_viewing=INCIDENCE, step=0.04)
    assert largest_difference(factors(step=0.04), back) < 1e-10


def test_batches_and_angles_broadcast():
    angles = np.array([0.3, 0.8, 1.0])
    table = split_reflectance_factor(
        ALBEDO[:, None, None],
        THICKNESS[:, None, None],
        0.7,
        cos_incidence=angles[:, None],
        cos_viewing=angles,
        step=0.04,
    )
    assert table.multiple.shape == (7, 3, 3)
    one = split_reflectance_factor(
        ALBEDO, THICKNESS, 0.7, cos_incidence=angles[0], cos_viewing=angles[1], step=0.04
    )
    for part, whole in zip(one, table, strict=True):
        assert largest_difference(part, whole[:, 0, 1]) < 1e-10
    assert reflectance_factor(*NO_STACKS).shape == (0,)
    assert reflectance_factor([0.5], [0.3], 0.5, step=0.1).shape == ()


@pytest.mark.slow
def test_stacks_of_many_thicknesses_are_gathered_in_their_order(monkeypatch):
    together = factors(step=0.16)
    monkeypatch.setattr(auxiliary, "_WORTH_A_BUCKET", {"fixed_step": 0})
    monkeypatch.setattr(auxiliary, "_CHUNK_ELEMENTS", 24)
    assert largest_difference(factors(step=0.16), together) < 1e-10


def test_coarse_steps_at_grazing_angles_are_finite():
    q, d = (
        np.array([[0.9, 0.5], [1.0, 0.0], [0.3, 1.0]]),
        np.array([[0.7, 1.4], [1e-12, 3.0], [6.0, 1e-3]]),
    )
    cosines = np.array([1e-4, 0.5, 1.0])
    for index, step, corrected in (
        (1.0, 0.5, True),
        (1.5, 1.0, True),
        (1.0, 1.0, False),
        (1.5, 0.5, False),
    ):
        value = reflectance_factor(
            q[:, None, None],
            d[:, None, None],
            1.0,
            refractive_index=index,
            cos_incidence=cosines[:, None],
            cos_viewing=cosines,
            step=step,
            corrected=corrected,
        )
        assert finite(value)
        assert np.all(value >= 0)


def test_rows_without_weight_do_not_grow_while_others_are_solved():
    # A slow system: each step is as long as its slowest part wants, far too long for rows that no
    # product sees.
    loss = np.geomspace(1e-7, 1.0, 80)[:, None, None]
    weight = jnp.asarray(np.r_[np.ones(80), np.zeros(3)])[:, None, None]

    def apply(x):
        own = x[:80]
        return jnp.concatenate([(1.0 - loss) * own, jnp.tile(own.sum(axis=0), (3, 1, 1))])

    found = solve_contraction(apply, weight, jnp.ones((83, 1, 1)))
    assert np.allclose(found[:80] * loss, 1.0, rtol=1e-4)
    assert np.allclose(found[80:], 1.0 + (1.0 / loss).sum(), rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{"corrected": False}, {"variant": "decomposed"}])
def test_a_thick_white_stack_is_no_nan_beside_unused_segments(settings):
    q, d = [1.0, 0.6], [1000.0, 0.2]
    parts = split_reflectance_factor(q, d, 1.0, step=1.0, **settings)
    assert sum(parts) == pytest.approx(float(stack_reflectance_factor(q, d, 1.0)), abs=0.1)


@pytest.mark.slow
def test_gradients():
    step = 0.08
    q = [[0.8, 0.4], [0.3, 0.0], [0.0, 0.0], [1.0, 0.2], [1.0, 1.0]]
    d = [[0.413, 0.777], [0.22, 0.5137], [0.31, 0.417], [0.137, 0.91], [0.22, 0.5137]]
    arguments = tuple(map(jnp.asarray, (q, d, GROUND[:5], INCIDENCE[:5], VIEWING[:5])))

    def total(*stack):
        *layers, light, view = stack
        cosines = {"cos_incidence": light, "cos_viewing": view}
        return reflectance_factor(*layers, **cosines, step=step).sum()

    def exact(*stack):
        return factor(*stack, tolerance=1e-8).sum()

    found, right = (jax.grad(f, argnums=tuple(range(5)))(*arguments) for f in (total, exact))
    for slope, wanted in zip(found, right, strict=True):
        assert largest_difference(slope, wanted) < 0.5 * step  # slopes lose one order
    # Against differences of the same discrete problem; albedos at the ends of their range may not
    # be moved.
    offsets, weights = CENTRAL
    rng = np.random.default_rng(1)
    for k in range(5):
        inside = (arguments[k] > 0.01) & (arguments[k] < 0.99) if k != 1 else True
        direction = jnp.asarray(rng.uniform(0.3, 1, arguments[k].shape) * np.asarray(inside, float))
        h = 1e-4
        moved = [
            total(*arguments[:k], arguments[k] + offset * h * direction, *arguments[k + 1 :])
            for offset in offsets
        ]
        assert np.isclose(
            np.dot(weights, moved) / h, jnp.vdot(found[k], direction), rtol=2e-7, atol=1e-8
        )


def test_gradients_of_own_steps():
    own: dict = {"variant": "decomposed", "product": "matrix"}

    def total(q, g):
        return reflectance_factor(q, THICKNESS[:2], g, step=0.16, corrected=False, **own).sum()

    q, g = jnp.asarray(ALBEDO[:2]), jnp.asarray([0.7, 0.9])
    check_slopes(total, (q, g), modes=("rev",), eps=1e-5, rtol=1e-6, atol=1e-8)


@pytest.mark.slow
def test_a_table_serves_jit_and_vmap():
    table = KernelTable(1.5, 0.08, 16)
    q, d = jnp.asarray(ALBEDO), jnp.asarray(THICKNESS)

    def f(q, d):
        return reflectance_factor(q, d, 0.6, step=0.08, table=table)

    plain = f(q, d)
    assert table.segments == 16
    # Too thick for the table: neither a wrong number nor a silent NaN, and the next call is
    # unharmed.
    words = r"thicker than 1\.28, all that KernelTable.*make a table of more segments"
    for mapped in (jax.jit(f), jax.vmap(f)):
        assert largest_difference(mapped(q, d), plain) < 1e-10
        with pytest.raises((RuntimeError, ValueError), match=words):  # whichever JAX makes of it
            jax.block_until_ready(mapped(q, d.at[0].multiply(3.0)))
        assert largest_difference(mapped(q, d), plain) < 1e-10
    f(q, d.at[0].multiply(3.0))
    assert table.segments > 40
    assert not lapack_calls(f, q, d)


def test_own_steps_compile_without_lapack():
    # The function that the library compiles, at the smallest size.
    batch, _ = auxiliary._flatten(
        {
            "albedo": ALBEDO[:1],
            "optical_thickness": THICKNESS[:1],
            "substrate_reflectance": 0.5,
            "cos_incidence": 1.0,
            "cos_viewing": 1.0,
        }
    )
    # The direct variant holds all that the decomposed one does but a gather.
    settings = GridSettings("direct", True, 1.5, 0.08, 8)
    assert not lapack_calls(lambda *given: solve(*given, (), settings), batch, jnp.full(1, 8))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"albedo": [1.2, 0.5]}, "albedo holds 1.2"),
        ({"refractive_index": 3.0}, "refractive_index holds 3.0"),
        ({"refractive_index": np.array([1.5, 1.6])}, "must be one number"),
        ({"step": 0.0}, "step is 0.0"),
        ({"variant": "magic"}, "variant 'magic' is unknown"),
        (
            {"optical_thickness": [1e6, 1.0], "step": 0.01},
            f"thickness of 1e\\+06 at step 0.01.*{MOST_SEGMENTS}",
        ),
        ({"table": KernelTable(1.4, 0.01)}, "does not fit refractive_index 1.5"),
        ({"table": KernelTable(1.5, 0.01), "variant": "direct"}, "a table is for"),
        ({"variant": "decomposed", "product": "slow"}, "product 'slow' is unknown"),
        ({"variant": "direct", "product": "fft"}, "product 'fft' .* 'decomposed'"),
        ({"variant": "direct", "product": "matrices"}, "product 'matrices' .* 'decomposed'"),
        ({"product": "matrices"}, "product 'matrices' .* 'fixed_step', .* use 'matrix'"),
        ({"segments": 100}, "segments is for own steps"),
        ({"variant": "decomposed", "segments": 0}, "segments is 0"),
        ({"variant": "decomposed", "segments": 2.5}, "segments is 2.5"),
        ({"variant": "decomposed", "segments": 100}, "needs 200 segments"),
    ],
)
def test_bad_input_says_what_and_how_to_mend(unchecked, change, message):
    with refusal(message):
        reflectance_factor(**(TWO_LAYERS | change))


@pytest.mark.parametrize(
    ("variant", "message"),
    [("decomposed", "give segments="), ("fixed_step", "table=KernelTable")],
)
def test_a_traced_thickness_is_told_what_it_needs(variant, message):
    with refusal(message):
        jax.jit(lambda d: reflectance_factor([0.5], d, 0.5, variant=variant))(jnp.ones(1))
