"""Programs for an NVIDIA GPU, on a machine that may have none: they lower for it, call no host and
move no data.

That they run there, and how fast, only a GPU tells: `JAX_PLATFORMS=cuda python -m pytest`,
docs/gpu.md.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import glazejax as gj
from glazejax import (
    colour,
    profile_reflectance_factor,
    split_reflectance_factor,
    stack_hemispherical_reflectance,
    stack_reflectance_factor,
)

from .cuda import assert_runs_there, lowered, trouble, watch
from .glazes import coated
from .slow import slow


def stacks(layers: int, count: int = 5):
    rng = np.random.default_rng(layers)
    shape = (count, layers)
    given = rng.uniform(0, 1, shape), rng.uniform(0.1, 2, shape), rng.uniform(0, 1, count)
    return tuple(jnp.asarray(a) for a in given)


def factor(q, d, ground, **options):
    return stack_reflectance_factor(
        q, d, ground, cos_incidence=0.8, cos_viewing=0.6, tolerance=1e-4, **options
    )


def flux(q, d, ground):
    return stack_hemispherical_reflectance(q, d, ground, cos_incidence=0.8, tolerance=1e-4)


def with_slopes(solve):
    """The sum of what is solved for, with its slopes."""
    return jax.value_and_grad(lambda *stack: solve(*stack).sum(), argnums=(0, 1, 2))


def graded(q, d, ground):
    k, s = (1.0 - q[:, None]) * (1.0 + jnp.linspace(0.0, 1.0, 5)), q[:, None] * jnp.ones(5)
    return profile_reflectance_factor(k, s, d, ground, tolerance=1e-3)


@pytest.mark.parametrize("layers", [2, slow(1), slow(9)])
def test_stacks_and_their_gradients(layers):
    inputs = stacks(layers)
    for f in (factor, flux):
        assert_runs_there(f, *inputs)
        assert_runs_there(with_slopes(f), *inputs)


@pytest.mark.slow
def test_the_index_and_the_cosines_too():
    q, d, ground = stacks(2)

    def f(index, light, view):
        return stack_reflectance_factor(
            q,
            d,
            ground,
            refractive_index=index,
            cos_incidence=light,
            cos_viewing=view,
            tolerance=1e-4,
        ).sum()

    assert_runs_there(jax.value_and_grad(f, argnums=(0, 1, 2)), 1.5, 0.8, 0.6)


def test_many_stacks_go_through_in_chunks():
    assert_runs_there(factor, *stacks(2, 20_000))


@pytest.mark.parametrize("method", ["auxiliary", "manyflux"])
def test_the_other_methods(method):
    assert_runs_there(lambda *a: factor(*a, method=method), *stacks(2, 3))


@pytest.mark.slow
def test_split_and_graded_layers():
    q, d, ground = stacks(2, 3)
    assert_runs_there(lambda *a: split_reflectance_factor(*a, tolerance=1e-4), q, d, ground)

    assert_runs_there(graded, q[:, 0], d[:, 0], ground)


def test_single_precision_stays_single():
    with jax.enable_x64(False):
        inputs = [jnp.asarray(a, jnp.float32) for a in stacks(2)]
        for program in (factor, with_slopes(factor)):
            text = lowered(program, *inputs)
            assert trouble(text) == []
            assert "f64" not in text, (
                "some of it is computed in double precision, which most GPUs are slow at"
            )


@pytest.mark.parametrize("method", ["ordinates", "auxiliary", "manyflux", "graded"])
def test_products_keep_all_digits_of_single_precision(method):
    # By default a GPU multiplies numbers of 10 bits: a tolerance of 1e-4 came out at 1.2e-4, its
    # slopes at 2e-3.
    # JAX 0.9 takes traces of double precision for single ones where a program maps over a batch.
    jax.clear_caches()
    with jax.enable_x64(False):
        q, d, ground = (jnp.asarray(a, jnp.float32) for a in stacks(2, 2))
        inputs = (q[:, 0], d[:, 0], ground) if method == "graded" else (q, d, ground)
        solve = graded if method == "graded" else functools.partial(factor, method=method)
        text = lowered(with_slopes(solve), *inputs)
    products = [line for line in text.splitlines() if "dot_general" in line]
    assert products
    assert [line for line in products if "precision = [HIGHEST, HIGHEST]" not in line] == []


@pytest.mark.parametrize("geometry", [gj.Bidirectional(45, 0), gj.Hemispherical(8)])
def test_reflectance_of_a_glaze_and_its_colour(geometry):
    def srgb(thickness):
        glaze = coated(0.85, UltramarineBlue=thickness, ChromeYellow=30e-6)
        return colour.srgb(glaze.wavelengths, gj.reflectance(glaze, geometry))

    assert_runs_there(srgb, 10e-6)
    assert_runs_there(jax.jacfwd(srgb), 10e-6)


def test_the_programs_of_a_picture(monkeypatch):
    paints = gj.catalogue.load()
    chosen = [paints[name] for name in ("UltramarineBlue", "ChromeYellow")]
    thickness = [np.linspace(1e-6, 2e-5, 48).reshape(6, 8), np.full((6, 8), 3e-5)]
    gj.picture  # noqa: B018  loads the modules, lazily
    import glazejax.picture
    import glazejax.radiative.stack  # noqa: F401

    programs = watch(monkeypatch, "glazejax")
    gj.picture(chosen, thickness, 0.85)
    assert programs.seen
    assert programs.trouble == {}


@pytest.mark.parametrize("gradient", [False, True])
def test_a_second_call_moves_nothing_between_host_and_device(gradient):
    program = jax.jit(with_slopes(factor) if gradient else factor)
    inputs = jax.device_put(stacks(2))
    jax.block_until_ready(program(*inputs))
    with jax.transfer_guard("disallow"):
        found = program(*inputs)
    jax.block_until_ready(found)
