"""What an instrument reads on one film: the forward model of a recovery, per wavelength."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.geometry import Instrument

from .optics import Optics

# Optical thicknesses k d and s d that a fit may take. A clear film reads as bare card to 1e-5 at
# the lower ends; at the upper ones every film is opaque.
LOWEST = (1e-6, 1e-5)
HIGHEST = (100.0, 400.0)

FIT_TOLERANCE = 1e-5


def body_reflectance(
    absorption: Float[Array, "*#batch"],
    scattering: Float[Array, "*#batch"],
    ground: Float[Array, "*#batch"],
    instrument: Instrument,
    tolerance: float = FIT_TOLERANCE,
) -> Float[Array, "*batch"]:
    """Reflectance of a film on a Lambertian ground, without the part from the outer surface.

    Args:
        absorption, scattering: optical thicknesses k d and s d, (...), their sum > 0.
        ground: internal reflectance of the card, (...).
        instrument: geometry and refractive index.
        tolerance: of the solver.
    """
    optics = Optics.of(instrument)
    return optics.body(absorption[..., None], scattering[..., None], ground, tolerance)


class ReflectanceTable(NamedTuple):
    """Reflectance of films on a grid of (log k d, log s d), for every ground at once.

    Over a Lambertian ground the reflectance is black + gain rho/(1 - back rho), exactly: the first
    light that reaches the ground and leaves, times all its round trips.
    """

    log_absorption: Float[Array, "k"]
    log_scattering: Float[Array, "s"]
    black: Float[Array, "k s"]
    gain: Float[Array, "k s"]
    back: Float[Array, "k s"]

    @classmethod
    def blank(cls, sizes: tuple[int, int]) -> "ReflectanceTable":
        """A table of this shape that says nothing."""
        return cls(*map(jnp.zeros, sizes), *[jnp.zeros(sizes)] * 3)


SIZES = (80, 44)
"""Values of k d and of s d in a table, unless others are asked for."""


def tabulate(instrument: Instrument, sizes: tuple[int, int] = SIZES) -> ReflectanceTable:
    """Table that starts a fit, from three grounds a film; `sizes` values of k d and s d."""
    k = jnp.linspace(np.log(1e-5), np.log(0.8 * HIGHEST[0]), sizes[0])
    s = jnp.linspace(np.log(1e-4), np.log(0.8 * HIGHEST[1]), sizes[1])
    kd, sd = jnp.meshgrid(jnp.exp(k), jnp.exp(s), indexing="ij")
    grounds = jnp.asarray([0.0, 0.5, 1.0])
    values = body_reflectance(kd[..., None], sd[..., None], grounds, instrument, 1e-4)
    black = values[..., 0]
    half = values[..., 1] - values[..., 0]
    white = values[..., 2] - values[..., 0]
    # half = .5 gain/(1 - .5 back), white = gain/(1 - back).
    ratio = jnp.clip(white, 1e-12) / jnp.clip(half, 1e-12)
    back = jnp.clip((ratio - 2.0) / (ratio - 1.0), 0.0, 0.99)
    return ReflectanceTable(
        log_absorption=k,
        log_scattering=s,
        black=black,
        gain=jnp.clip(white, 0.0) * (1.0 - back),
        back=back,
    )
