"""This program on the same work: its methods, and a converged run that errors are
measured against.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers import Work
from glazejax import stack_reflectance_factor
from glazejax.radiative.auxiliary import uniform as auxiliary
from glazejax.radiative.common.directions import Resolution
from glazejax.radiative.ordinates import solver as ordinates

TOLERANCES = tuple(10.0**-k for k in range(2, 11))
STEPS = (0.16, 0.08, 0.04, 0.02, 0.01)

# Half as many directions again as for the finest tolerance: their sums are right to 2e-14.
CONVERGED = {1.0: Resolution(0, 32, crowding=7.5), 1.5: Resolution(2, 30, crowding=7.5)}


def spectrum(work: Work, index: float, tolerance: float) -> Callable[[Any, Any, Any], Any]:
    """Reflectance factor in the work's geometry as a function of albedo, optical thickness and
    ground; not compiled.
    """
    return functools.partial(
        stack_reflectance_factor,
        refractive_index=index,
        cos_incidence=work.cos_incidence,
        cos_viewing=work.cos_viewing,
        tolerance=tolerance,
    )


def reflectance(
    work: Work,
    index: float,
    tolerance: float,
    *,
    gradient: bool = False,
    single: bool = False,
    device: Any = None,
) -> Callable[[], object]:
    """The compiled program with its inputs on the device; a call gives all wavelengths.

    Args:
        work: what to solve.
        index: refractive index.
        tolerance: of `stack_reflectance_factor`, which picks the directions.
        gradient: also the derivatives by albedo, optical thickness and ground, wavelength by
            wavelength: those of the sum over the wavelengths.
        single: in float32.
        device: where to compute; JAX's default if None.
    """

    values = spectrum(work, index, tolerance)

    def value_and_sum(*inputs):
        value = values(*inputs)
        return value.sum(), value

    program = jax.jit(
        jax.value_and_grad(value_and_sum, argnums=(0, 1, 2), has_aux=True) if gradient else values
    )
    with jax.enable_x64(not single):
        ground = np.full(len(work.albedo), work.ground)
        inputs = [
            jax.device_put(jnp.asarray(a), device)
            for a in (work.albedo, work.optical_thickness, ground)
        ]

    def run() -> object:
        with jax.enable_x64(not single):
            found = program(*inputs)
        return (found[0][1], found[1]) if gradient else found

    return run


def stepped(
    work: Work, step: float, *, variant: auxiliary.Variant, corrected: bool, device: Any = None
) -> Callable[[], object]:
    """Paper A's method on a uniform grid at n = 1.5; the tables of a fixed step are made before, as
    in the paper.
    """
    return _outside_jit(
        functools.partial(
            auxiliary.reflectance_factor, step=step, variant=variant, corrected=corrected
        ),
        work,
        device,
    )


def graded(work: Work, tolerance: float, *, device: Any = None) -> Callable[[], object]:
    """`stack_reflectance_factor` by the method "auxiliary" at n = 1.5."""
    return _outside_jit(
        functools.partial(stack_reflectance_factor, tolerance=tolerance, method="auxiliary"),
        work,
        device,
    )


def _outside_jit(function: Callable[..., object], work: Work, device: Any) -> Callable[[], object]:
    """Call of a function that chooses its grid by the thickness before its compiled part."""
    angles = {"cos_incidence": work.cos_incidence, "cos_viewing": work.cos_viewing}
    with jax.default_device(device):
        given = work.albedo, work.optical_thickness, np.full(len(work.albedo), work.ground)
        inputs = [jnp.asarray(a) for a in given]

    def run() -> object:
        with jax.default_device(device):
            return function(*inputs, refractive_index=1.5, **angles)

    return run


def converged(work: Work, index: float) -> np.ndarray:
    """Reflectance factors in float64, with half as many directions again as for the finest
    tolerance; n = 1 or 1.5.
    """
    with jax.enable_x64(True):
        alike = [
            jnp.full(len(work.albedo), a)
            for a in (work.ground, work.cos_incidence, work.cos_viewing)
        ]
        ground, incidence, viewing = alike
        stack = ordinates.StackArrays(
            jnp.asarray(work.albedo),
            jnp.asarray(work.optical_thickness),
            ground,
            index,
            incidence,
            viewing,
        )
        return np.asarray(ordinates.reflectance(stack, CONVERGED[index]))
