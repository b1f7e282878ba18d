"""Edges, extremes, batches and bulk use: finite, right, and never a hang."""

import functools
import itertools
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given
from numpy.testing import assert_allclose

from glazejax import stack_reflectance_factor
from glazejax.radiative.common.directions import half_range
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.common.rounding import Rounding, warn_of_rounding
from glazejax.radiative.ordinates.resolution import resolve_known
from glazejax.radiative.stack import Method
from tests.tolerances import ROUNDING

from ..checks import finite, largest_difference
from ..fresh import run_python
from ..refusals import refusal
from ..slow import slow
from .cases import (
    EDGE_ALBEDO,
    EDGE_COSINE,
    EDGE_GROUND,
    EDGE_THICKNESS,
    LAYERS,
    NO_STACKS,
    TWO_LAYERS,
    factor,
    flux,
    lapack_calls,
    random_cases,
    stacks_of_all_kinds,
)

pytestmark = pytest.mark.optimised


def with_slopes(solve, count: int):
    """The sum of what is solved for, with its slopes by all arguments."""
    by_all = tuple(range(count))
    return jax.jit(jax.value_and_grad(lambda *stack: solve(*stack, tolerance=1e-4).sum(), by_all))


_value_and_gradient, _flux = with_slopes(factor, 5), with_slopes(flux, 4)

unit = st.one_of(st.sampled_from(EDGE_ALBEDO), st.floats(0, 1))
depth = st.one_of(st.sampled_from(EDGE_THICKNESS), st.floats(0, 1e6))
cosine = st.one_of(st.sampled_from(EDGE_COSINE), st.floats(1e-4, 1))


DARKER = max(1e-9, ROUNDING)
"""Slope by an albedo, per thickness, or by a ground, that rounding may leave where there
is none.
"""


@pytest.mark.slow
@given(
    st.lists(unit, min_size=LAYERS, max_size=LAYERS),
    st.lists(depth, min_size=LAYERS, max_size=LAYERS),
    st.floats(0, 1),
    cosine,
    cosine,
)
@example([1.0] * 5, [1e6] * 5, 1.0, 1e-4, 1.0)
@example([0.0] * 5, [0.0] * 5, 0.0, 1.0, 1.0)
@example([1 - 1e-15, 1e-300, 1.0, 0.0, 0.5], [1e3, 1e-12, 1e-6, 1e6, 0.0], 1.0, 1e-4, 1e-4)
@example([0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1e-290, 0.0], 0.0, 1e-4, 1e-4)
@pytest.mark.single
def test_any_stack_is_finite_and_conserves_energy(albedo, thickness, ground, ci, cv):
    q, d = jnp.array([albedo]), jnp.array([thickness])
    g, ci, cv = jnp.array([ground]), jnp.array([ci]), jnp.array([cv])
    value, slopes = _value_and_gradient(q, d, g, ci, cv)
    body = _flux(q, d, g, ci)
    assert finite((value, slopes, body))
    assert value >= -ROUNDING
    assert -ROUNDING <= body[0] <= 1 - dielectric_reflectance(float(ci[0]), 1.5) + ROUNDING
    # More scattering in place of absorption, or a paler ground, never darkens.
    assert jnp.all(slopes[0] >= -DARKER * (1 + d))
    assert slopes[2][0] >= -DARKER


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize(
    ("index", "least_cosine"), [(1.0, 2e-3), (1.02, 1e-4), (1.5, 1e-4), (2.5, 1e-4)]
)
def test_errors_stay_below_the_tolerance(index, least_cosine, tolerance):
    """Against the finest tolerance. Thin layers that absorb, in white that does not, are the worst
    case; where there is no surface, thin layers seen aslant.
    """
    stacks = stacks_of_all_kinds(400, least_cosine)
    exact = factor(*stacks, refractive_index=index, tolerance=1e-10)
    found = factor(*stacks, refractive_index=index, tolerance=tolerance)
    assert largest_difference(found, exact) < tolerance


@pytest.mark.slow
def test_errors_stay_below_the_tolerance_for_an_array_of_indices():
    """Which takes directions of its own."""
    stacks = stacks_of_all_kinds(300, 0.05)
    exact = factor(*stacks, refractive_index=2.5, tolerance=1e-10)
    found = factor(*stacks, refractive_index=np.full(300, 2.5), tolerance=1e-8)
    assert largest_difference(found, exact) < 1e-8


@pytest.mark.slow
@pytest.mark.single
@pytest.mark.parametrize("method", ["ordinates", "manyflux"])
def test_two_hundred_layers_of_one_paint_are_one_layer(method):
    parts = np.random.default_rng(1).dirichlet(np.ones(200), 6)
    depth = np.array([1e-3, 0.1, 1.0, 10.0, 100.0, 1000.0])
    albedo = np.array([0.3, 0.9, 0.99, 0.5, 0.9, 0.8])
    given = {"cos_incidence": 0.7, "cos_viewing": 0.3, "method": method, "tolerance": 1e-4}
    whole = stack_reflectance_factor(albedo[:, None], depth[:, None], 0.4, **given)
    many = stack_reflectance_factor(
        np.repeat(albedo[:, None], 200, axis=1), depth[:, None] * parts, 0.4, **given
    )
    assert largest_difference(many, whole) < max(1e-10, 10 * ROUNDING)


@pytest.mark.single
@pytest.mark.parametrize("index", [1.5, slow(1.0)])
def test_every_combination_of_edges(index):
    edges = list(
        itertools.product(EDGE_ALBEDO, EDGE_THICKNESS, EDGE_GROUND, EDGE_COSINE, EDGE_COSINE)
    )
    a, t, g, ci, cv = map(jnp.asarray, np.array(edges).T)
    q = jnp.stack([a, jnp.full_like(a, 0.6), a, a, a], axis=1)
    d = jnp.stack([t, jnp.full_like(a, 0.2), t, t, t], axis=1)
    solve = functools.partial(factor, refractive_index=index, tolerance=1e-4)
    value, pull = jax.vjp(solve, q, d, g, ci, cv)
    assert finite((value, pull(jnp.ones_like(value))))
    assert jnp.all(value >= -ROUNDING)


@pytest.mark.slow
def test_beams_on_nodes_are_nothing_special():
    for index in (1.0, 1.5):
        nodes = half_range(index, resolve_known(1e-6, index))
        inside = nodes.cosines[nodes.reflectance < 1]
        beams = np.sqrt(np.maximum(1 - index**2 * (1 - inside**2), 0))
        beams = beams[beams > 1e-4]

        def f(cos, index=index):
            return factor([0.9, 0.4], [0.3, 1.0], 0.8, cos, cos, refractive_index=index)

        on = f(beams)
        around = 0.5 * (f(beams * (1 - 1e-5)) + f(np.minimum(beams * (1 + 1e-5), 1)))
        assert finite(jax.grad(lambda c: f(c).sum())(jnp.asarray(beams)))
        assert largest_difference(on, around) < 1e-7


@pytest.mark.single
def test_jit_vmap_loop_and_chunks_agree():
    stacks = random_cases(700)
    whole = factor(*stacks)  # several chunks, the last one filled up
    assert largest_difference(jax.jit(factor)(*stacks), whole) < ROUNDING
    few = [jnp.asarray(array[695:]) for array in stacks]  # of the last chunk
    looped = [float(factor(*stack)) for stack in zip(*few, strict=True)]
    for values in (jax.vmap(factor)(*few), looped):
        assert largest_difference(values, whole[695:]) < ROUNDING


def test_batches_broadcast():
    q = np.full((3, 1, 2), 0.5)
    out = stack_reflectance_factor(
        q, [0.1, 0.2], np.linspace(0, 1, 4), cos_viewing=np.array([[0.5], [0.6], [0.7]])
    )
    assert out.shape == (3, 4)
    assert stack_reflectance_factor(*NO_STACKS).shape == (0,)


@pytest.mark.slow
@pytest.mark.parametrize("index", [1.5, "array"])
def test_compiled_programs_hold_no_lapack_call(index):
    q, d, g, ci, cv = (jnp.asarray(a) for a in random_cases(2000))

    def f(q, d, g, ci, cv):
        n = 1.5 if index == 1.5 else 1.4 + 0.1 * g
        options = {"refractive_index": n, "tolerance": 1e-3}
        return (factor(q, d, g, ci, cv, **options) + flux(q, d, g, ci, **options)).sum()

    for program in (f, jax.value_and_grad(f, argnums=(0, 1, 2))):
        assert not lapack_calls(program, q, d, g, ci, cv)


_MEMORY = """
import resource
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp, numpy as np
from glazejax import stack_reflectance_factor
rng = np.random.default_rng(0)
size = 200_000
q, d = (jnp.asarray(rng.uniform(0, high, (size, 2))) for high in (1, 2))
f = lambda q, d: stack_reflectance_factor(q, d, 0.8, tolerance=1e-4).sum()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
jax.block_until_ready(jax.jit(jax.grad(f, argnums=(0, 1)))(q, d))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


@pytest.mark.slow
def test_memory_stays_bounded():
    # All at once the layers' matrices alone would take 200 000 x 2 x 11 x 11 x 8 bytes = 370 MiB
    # each, eight times.
    assert float(run_python(_MEMORY, timeout=240).stdout) < 600


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"albedo": [1.2, 0.5]}, "albedo holds 1.2"),
        ({"albedo": [float("nan"), 0.5]}, "albedo holds nan"),
        ({"optical_thickness": [-0.1, 0.5]}, "optical_thickness holds -0.1"),
        ({"optical_thickness": [float("inf"), 0.5]}, "optical_thickness holds inf"),
        ({"substrate_reflectance": 85.0}, "substrate_reflectance holds 85.0.*percent"),
        ({"refractive_index": 0.9}, "refractive_index holds 0.9"),
        ({"cos_incidence": 45.0}, "cos_incidence holds 45.0.*cosine"),
        ({"cos_viewing": 0.0}, "cos_viewing holds 0.0"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"method": "magic"}, "method 'magic' is unknown"),
        ({"albedo": [0.5, 0.5, 0.5]}, "3 layers .* 2"),
        ({"albedo": 0.5}, "last axis of layers"),
        ({"albedo": "a"}, "albedo is 'a'; it must be a real number"),
        ({"albedo": [0.5, 0.5j]}, "albedo is complex, such as"),
        ({"albedo": [[0.5], [0.5, 0.5]]}, "albedo is no array of numbers"),
        ({"albedo": np.ma.array([0.9, 0.5], mask=[False, True])}, "albedo has masked values"),
        ({"optical_thickness": None}, "optical_thickness is None"),
        ({"substrate_reflectance": None}, "substrate_reflectance is None"),
        ({"cos_viewing": None}, "cos_viewing is None"),
        ({"cos_incidence": None}, "cos_incidence is None"),
        ({"refractive_index": None}, "refractive_index is None"),
        ({"refractive_index": "1.5"}, "refractive_index is '1.5'"),
        ({"tolerance": "1e-3"}, "tolerance is '1e-3'"),
        ({"tolerance": [1e-3]}, r"tolerance is \[0.001\]; it must be one number"),
        ({"substrate_reflectance": [0.1] * 3, "cos_viewing": [0.5] * 2}, "do not broadcast"),
    ],
)
def test_bad_input_says_what_and_how_to_mend(unchecked, change, message):
    with refusal(message):
        stack_reflectance_factor(**(TWO_LAYERS | change))


@pytest.mark.single
@pytest.mark.parametrize(
    "method",
    [
        pytest.param(method, marks=pytest.mark.slow if method == "auxiliary" else [])
        for method in get_args(Method)
    ],
)
def test_traced_values_out_of_range_are_nan_and_the_others_as_they_are(method):
    """In a compiled program, where nothing can be raised; each stack of a batch for itself."""
    names = ("substrate_reflectance", "refractive_index", "cos_incidence", "cos_viewing")
    usual = [0.5, 0.9, 1.0, 0.5, 0.5, 1.5, 0.7, 0.9]
    wrong = [(0, 1.2), (1, -0.1), (2, -1.0), (3, np.inf), (4, 1.2), (4, -0.1), (5, 0.9), (5, 2.6)]
    wrong += [(6, 1.1), (6, 0.0), (7, 1.1), (7, -0.2), (0, np.nan)]
    rows = np.tile(usual, (len(wrong) + 1, 1))
    for row, (column, value) in zip(rows, wrong, strict=False):
        row[column] = value

    @jax.jit
    def seen(table):
        rest = dict(zip(names, table[:, 4:].T, strict=True))
        return stack_reflectance_factor(
            table[:, :2], table[:, 2:4], **rest, tolerance=1e-2, method=method
        )

    values = np.asarray(seen(jnp.asarray(rows)))
    assert np.all(np.isnan(values[:-1]))
    assert values[-1] == pytest.approx(0.07685, abs=1e-4)


_ROUNDING = """
import warnings
import numpy as np
from glazejax import stack_hemispherical_reflectance as hemispherical
from glazejax.radiative import manyflux

def said(function, absorbed, thickness, **how):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        value = function([1 - absorbed], [thickness], 0.5, **how)
    words = " ".join(str(one.message) for one in caught)
    assert all(one.filename == "<string>" for one in caught)
    return float(value), float(words.split("about ")[1].split()[0]) if words else 0.0, words

for absorbed, thickness in [(0, 1e3), (0, 1e5), (2.0**-20, 1e4), (2.0**-20, 3e5)]:
    true, error, words = said(hemispherical, absorbed, thickness, tolerance=1e-4)
    assert words == ""
    for function, how in [
        (hemispherical, {"method": "auxiliary"}),
        (hemispherical, {"method": "manyflux"}),
        (manyflux.manyflux_hemispherical_reflectance, {"solution": "doubling"}),
        (manyflux.manyflux_hemispherical_reflectance, {"solution": "modes"}),
    ]:
        value, error, words = said(function, absorbed, thickness, tolerance=1e-4, **how)
        assert abs(value - true) < 2 * max(error, 1e-4), (absorbed, thickness, how, value - true)
        if error:
            assert "jax_enable_x64" in words and ("'ordinates'" in words) == ("method" in how)
        assert error or (absorbed, thickness) != (0, 1e5)
        if absorbed:
            assert not said(function, 0.1, thickness, tolerance=1e-4, **how)[2]
"""


@pytest.mark.slow
def test_single_precision_says_what_rounding_leaves_of_layers_that_absorb_nothing():
    run_python(_ROUNDING, timeout=240, env={"JAX_ENABLE_X64": "0"})


def test_what_rounding_leaves_grows_with_the_depth_that_light_reaches():
    def said(albedo, thickness, tolerance=1e-4):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            warn_of_rounding(Rounding(1e-6, 1e4), albedo, thickness, tolerance)
        return [float(str(one.message).split("about ")[1].split()[0]) for one in caught]

    assert said([1.0], [1e3]) == [1e-3]
    assert said([1.0], [1e7]) == [1e-2]  # no further
    assert said([1.0, 1.0], [5e2, 5e2]) == [1e-3]  # as one layer
    assert said([[0.5], [1 - 1e-6]], [1e9]) == [5e-4]  # the worst stack
    assert not said([0.5], [1e9])
    assert not said([1.0], [1e3], tolerance=1e-3)
    assert not said([1.0], [10.0], tolerance=1e-9)  # single precision has no more than 1e-5
    assert not said(np.zeros((0, 1)), [1e9])
    assert not jax.jit(lambda q: jnp.asarray(said(q, [1e9])))(jnp.ones(1)).size


def test_a_traced_tolerance_is_told_to_be_static(unchecked):
    def seen(tolerance):
        return stack_reflectance_factor([0.5], [1.0], 0.5, tolerance=tolerance)

    with refusal(r"tolerance is traced.*static_argnames='tolerance'"):
        jax.jit(seen)(1e-3)


_BULK = """
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp, numpy as np
from glazejax import stack_reflectance_factor
rng = np.random.default_rng()
q, d = (jnp.asarray(rng.uniform(0, high, (2000, 3))) for high in (1, 3))
g = jnp.full(2000, 0.8)
f = lambda q, d, g: stack_reflectance_factor(q, d, g, tolerance=1e-4).sum()
print(float(jax.jit(jax.value_and_grad(f, argnums=(0, 1, 2)))(q, d, g)[0]))
"""


@pytest.mark.slow
def test_ten_fresh_processes_finish(tmp_path):
    """JAX may hang on a batch of LAPACK calls at any run; they share what is compiled."""
    cache = {
        "JAX_COMPILATION_CACHE_DIR": str(tmp_path),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }

    def run(limit):
        return float(run_python(_BULK, timeout=limit, env=cache).stdout)

    first = run(900)
    with ThreadPoolExecutor(2) as pool:
        assert np.isfinite([first, *pool.map(run, [240] * 9)]).all()


@pytest.mark.slow
@pytest.mark.single
def test_inside_the_loops_of_jax():
    """In scan, map and cond, under a checkpoint and its gradient, in one program: as one by one."""
    grounds, depth = jnp.linspace(0.1, 0.9, 3), jnp.array([0.5, 2.0])

    def one(ground, depth):
        return stack_reflectance_factor([0.6, 0.98], depth, ground, tolerance=1e-3)

    @jax.jit
    def looped(depth):
        _, scanned = jax.lax.scan(lambda last, ground: (last, one(ground, depth)), 0.0, grounds)
        mapped = jax.lax.map(lambda ground: one(ground, depth), grounds)
        chosen = jax.lax.cond(depth[0] > 0, lambda d: one(grounds[1], d), jnp.sum, depth)
        slope = jax.grad(jax.checkpoint(lambda d: one(grounds[1], d)))(depth)
        return scanned, mapped, chosen, slope

    alone = jnp.array([one(ground, depth) for ground in grounds])
    slope = jax.grad(lambda d: one(grounds[1], d))(depth)
    for values, expected in zip(looped(depth), (alone, alone, alone[1], slope), strict=True):
        assert_allclose(values, expected, rtol=max(1e-7, ROUNDING))
