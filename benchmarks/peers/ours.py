"""This program on the same work: the public function, and a converged run that errors are measured against."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers import Work
from glazejax import stack_reflectance_factor
from glazejax.radiative import ordinates
from glazejax.radiative.directions import Resolution

TOLERANCES = tuple(10.0**-k for k in range(2, 11))

# Three times the directions of the finest tolerance: further ones change the last digit.
CONVERGED = {1.0: Resolution(44, 0, crowded=True), 1.5: Resolution(36, 30, crowded=False)}


def reflectance(
    work: Work,
    index: float,
    tolerance: float,
    *,
    gradient: bool = False,
    single: bool = False,
    device: Any = None,
    method: str = "ordinates",
) -> Callable[[], object]:
    """The compiled program with its inputs on the device; a call gives all wavelengths.

    Args:
        work: what to solve.
        index: refractive index.
        tolerance: of `stack_reflectance_factor`, which picks the directions.
        gradient: also the derivatives by albedo, optical thickness and ground, wavelength by wavelength: those of
            the sum over the wavelengths.
        single: in float32.
        device: where to compute; JAX's default if None.
        method: of `stack_reflectance_factor`.
    """

    def spectrum(albedo, thickness, ground):
        return stack_reflectance_factor(
            albedo,
            thickness,
            ground,
            refractive_index=index,
            cos_incidence=work.cos_incidence,
            cos_viewing=work.cos_viewing,
            tolerance=tolerance,
            method=method,  # pyright: ignore[reportArgumentType]
        )

    def value_and_sum(*inputs):
        value = spectrum(*inputs)
        return value.sum(), value

    program = jax.jit(jax.value_and_grad(value_and_sum, argnums=(0, 1, 2), has_aux=True) if gradient else spectrum)
    with jax.enable_x64(not single):
        ground = np.full(len(work.albedo), work.ground)
        inputs = [jax.device_put(jnp.asarray(a), device) for a in (work.albedo, work.optical_thickness, ground)]

    def run() -> object:
        with jax.enable_x64(not single):
            found = program(*inputs)
        return (found[0][1], found[1]) if gradient else found

    return run


def converged(work: Work, index: float) -> np.ndarray:
    """Reflectance factors with three times the directions of the finest tolerance, in float64; index 1 or 1.5."""
    with jax.enable_x64(True):
        alike = [jnp.full(len(work.albedo), a) for a in (work.ground, work.cos_incidence, work.cos_viewing)]
        ground, incidence, viewing = alike
        stack = ordinates.Stack(
            jnp.asarray(work.albedo), jnp.asarray(work.optical_thickness), ground, index, incidence, viewing
        )
        return np.asarray(ordinates.reflectance(stack, CONVERGED[index]))
