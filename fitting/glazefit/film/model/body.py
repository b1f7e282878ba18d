"""What an instrument reads on one film: the forward model of a recovery, per wavelength."""

from jaxtyping import Array, Float

from glazejax.geometry import Instrument

from .optics import Optics

# Optical thicknesses k d and s d that a fit may take. A clear film reads as bare card to 1e-5 at
# the lower ends; at the upper ones every film is opaque.
LOWEST = (1e-6, 1e-5)
HIGHEST = (100.0, 400.0)


def body_reflectance(
    absorption: Float[Array, "*#batch"],
    scattering: Float[Array, "*#batch"],
    ground: Float[Array, "*#batch"],
    instrument: Instrument,
    tolerance: float = 1e-5,
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
