"""H + U by fast transforms: its solutions and derivatives, in one program for all stacks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax.radiative.auxiliary import uniform
from glazejax.radiative.auxiliary.uniform import reflectance_factor, split_reflectance_factor
from glazejax.radiative.auxiliary.uniform_solver import solve
from tests.tolerances import ROUNDING

from ..checks import check_mapped, check_slopes, largest_difference
from ..slow import slow
from .cases import lapack_calls
from .test_auxiliary import ALBEDO, ANGLES, GROUND, STACKS, THICKNESS

# Beside every way to multiply, the one that makes one matrix after the other.
OWN: dict = {"variant": "decomposed", "step": 0.04}
FFT: dict = {"product": "fft"}


@pytest.mark.parametrize("corrected", [slow(False), True])
@pytest.mark.parametrize(
    ("product", "variant"),
    [("matrices", "decomposed"), ("fft", "decomposed"), ("fft", "fixed_step")],
)
def test_products_of_all_stacks_at_once_are_as_one_by_one(product, variant, corrected):
    settings = OWN | {"corrected": corrected, "variant": variant}
    each = split_reflectance_factor(*STACKS, **ANGLES, **settings, product="matrix")
    together = split_reflectance_factor(*STACKS, **ANGLES, **settings, product=product)
    for part, name in zip(together, each._fields, strict=True):
        assert largest_difference(part, getattr(each, name)) < 1e-11, name


def test_one_program_serves_all_thicknesses_and_more_room_changes_nothing(monkeypatch):
    calls = []

    def counted(batch, count, vectors, settings):
        calls.append((batch.albedo.shape[0], settings.most))
        return solve(batch, count, vectors, settings)

    monkeypatch.setattr(uniform, "solve", counted)
    thickness = np.linspace(0.02, 1.2, 41)[:, None]
    alone = reflectance_factor([[0.7]], thickness, 0.5, **OWN, **FFT)
    assert calls == [(48, 32)]  # 41 stacks of 2 to 30 segments, both filled up to a size in use
    roomy = reflectance_factor([[0.7]], thickness, 0.5, **OWN, **FFT, segments=48)
    assert calls[1:] == [(48, 48)]
    assert largest_difference(alone, roomy) < 1e-11


@pytest.mark.slow
def test_jit_vmap_and_derivatives_of_own_steps():
    q, d, g = jnp.asarray(ALBEDO[:4]), jnp.asarray(THICKNESS[:4]), jnp.asarray(GROUND[:4])

    def f(q, d, g):
        return reflectance_factor(
            q, d, g, cos_incidence=0.8, variant="decomposed", step=0.16, segments=16, **FFT
        )

    check_mapped(f, q, d, g, rtol=0, atol=ROUNDING)
    with pytest.raises(
        (RuntimeError, ValueError), match=r"thicker than 2\.56, all that segments=16 reaches"
    ):
        jax.block_until_ready(jax.jit(f)(q, d.at[0].multiply(4.0), g))
    assert not lapack_calls(f, q, d, g)

    # Of the stacks that no step takes out of its range.
    some = q[::3], d[::3], g[::3]
    check_slopes(jax.jit(f), some, modes=("rev",), eps=1e-5, rtol=1e-7, atol=1e-9)
