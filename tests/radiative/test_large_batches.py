"""Large batches that are known go to all cores: the same numbers, slopes and precision as in one
program.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax.radiative.common import chunks
from glazejax.radiative.common.chunks import on_all_cores
from glazejax.radiative.stack import _Inputs, _plan, _prepare
from tests.tolerances import LAST_DIGITS, ROUNDING

from ..slow import slow

COUNT = 2**14 + 7


@pytest.fixture(autouse=True)
def three_cores(monkeypatch):
    monkeypatch.setattr(chunks, "cores", lambda: 3)


@pytest.fixture
def stacks():
    rng = np.random.default_rng(0)
    return rng.uniform(0, 1, (COUNT, 1)), rng.uniform(0, 3, (COUNT, 1)), rng.uniform(0, 1, COUNT)


def factor(albedo, thickness, ground):
    return gj.stack_reflectance_factor(albedo, thickness, ground, cos_viewing=0.7, tolerance=1e-2)


def hemispherical(albedo, thickness, ground):
    return gj.stack_hemispherical_reflectance(albedo, thickness, ground, tolerance=1e-2)


@pytest.fixture
def parts(monkeypatch) -> list[int]:
    """Where the parts of batches begin that go to threads."""
    begun, in_threads = [], chunks.in_threads
    monkeypatch.setattr(
        chunks, "in_threads", lambda work, starts: begun.extend(starts) or in_threads(work, starts)
    )
    return begun


@pytest.mark.parametrize("reflectance", [factor, slow(hemispherical)])
def test_value_is_that_of_one_program(stacks, parts, reflectance):
    together = reflectance(*stacks)
    assert len(parts) == 3
    assert together.shape == (COUNT,)
    # Sums in chunks of another size round otherwise.
    assert_allclose(together, jax.jit(reflectance)(*stacks), rtol=0, atol=LAST_DIGITS)


def test_slopes_are_those_of_one_program(stacks, parts):
    """By jvp and by reverse, through parts that know their numbers while the slopes are traced."""
    stacks = tuple(map(jnp.asarray, stacks))
    weights = jnp.linspace(0.5, 1.5, COUNT)
    slopes = jax.value_and_grad(lambda *given: jnp.sum(weights * factor(*given)), (0, 1, 2))
    value, found = slopes(*stacks)
    assert len(parts) == 3
    exact_value, exact = jax.jit(slopes)(*stacks)
    assert_allclose(value, exact_value, rtol=1e-13)
    for one, other in zip(found, exact, strict=True):
        assert_allclose(one, other, rtol=0, atol=ROUNDING)
    along = jax.jvp(factor, stacks, stacks)[1]
    total = (
        sum(jnp.sum((a * b).reshape(COUNT, -1), axis=1) for a, b in zip(found, stacks, strict=True))
        / weights
    )
    assert_allclose(along, total, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("double", [True, False])
def test_threads_share_one_program(double):
    """In the precision of another thread it would be one program more."""
    traced = []

    def counted(batch):
        traced.append(batch.dtype)
        return 2 * batch

    with jax.enable_x64(double):
        assert_array_equal(on_all_cores(counted, jnp.ones(10), least=1), 2)
        assert traced == [jnp.result_type(float)]


def test_small_or_traced_batches_stay_whole(stacks, parts):
    jax.vmap(factor)(*(a[:, None] for a in stacks))
    factor(*(a[:64] for a in stacks))
    assert not parts


@pytest.mark.parametrize("size", [3, 4, 5, 7, 8, 100])
def test_every_entry_comes_once_whatever_the_size(size):
    batch = {"x": jnp.arange(float(size)), "y": jnp.arange(2.0 * size).reshape(size, 2)}
    found = on_all_cores(_twice, batch, 2.0, least=1)
    assert_array_equal(found["x"], 2 * batch["x"])
    assert_array_equal(found["y"], 2 * batch["y"])


def _twice(batch, factor):
    return jax.tree.map(lambda x: factor * x, batch)


def test_small_arrays_of_a_large_batch_leave_nothing_behind():
    """A plan holds arrays of the whole batch, and plans are kept."""

    def prepare(count):
        q, depth = np.full((count, 1, 2), 0.5), np.full((1, 64, 2), 1.0)
        return _prepare(_Inputs(q, depth, 0.5, 1.5, 1.0, 1.0), 1e-6, "ordinates")

    before = _plan.cache_info().misses
    stack, _, batch = prepare(128)
    assert batch == (128, 64)
    assert stack.albedo.shape == (2**13, 2)
    assert _plan.cache_info().misses == before
    prepare(127)
    assert _plan.cache_info().misses == before + 1
