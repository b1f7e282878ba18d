"""What the instrument does: where the light comes from and where it is measured."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .spectra import Numbers, as_float_array, concrete


def _angle(name: str, degrees: Numbers) -> float | Float[Array, "..."]:
    """Legal angle: Python numbers stay numbers, so that they remain constants of a traced program."""
    values = concrete(degrees)
    if values is None:
        return as_float_array(degrees)
    if not (jnp.issubdtype(values.dtype, jnp.floating) or jnp.issubdtype(values.dtype, jnp.integer)):
        raise ValueError(f"{name} must be a number of degrees, not {degrees!r}")
    wrong = values[~((values >= 0) & (values < 90))]
    if wrong.size:
        raise ValueError(f"{name} must lie in [0, 90) degrees from the normal, not {wrong.flat[0]:g}")
    return as_float_array(degrees) if values.ndim or eqx.is_array(degrees) else float(values)


def _azimuth(degrees: Numbers) -> float | Float[Array, "..."]:
    """Any finite angle."""
    values = concrete(degrees)
    if values is None:
        return as_float_array(degrees)
    if not np.all(np.isfinite(values)):
        raise ValueError(f"azimuth must be a finite number of degrees, not {values[~np.isfinite(values)].flat[0]:g}")
    return as_float_array(degrees) if values.ndim or eqx.is_array(degrees) else float(values)


def _cosine(degrees: ArrayLike) -> ArrayLike:
    """Cosine of an angle in degrees; a trailing axis of bands is added to an array of angles."""
    if isinstance(degrees, float):
        return float(np.cos(np.deg2rad(degrees)))
    cosine = jnp.cos(jnp.deg2rad(as_float_array(degrees)))
    return cosine[..., None] if cosine.ndim else cosine


class Bidirectional(eqx.Module):
    """A beam in one direction, radiance measured in another: a 0:0, 45:0 or gonio instrument.

    Gives the reflectance factor pi L_out / E_in. The azimuth between the two directions matters only to paint with
    a phase function, and only where neither of them is normal.

    Args:
        incidence: angle of the beam from the normal, degrees in air, [0, 90), scalar or (...).
        viewing: angle of the view from the normal, degrees in air, [0, 90), scalar or (...).
        specular: whether the view, where `viewing` equals `incidence`, is the mirror direction; then the
            Fresnel reflectance of the outer surface is added (paper A, section 3.2, step 6).
        azimuth: degrees between the horizontal directions of the light before and after, scalar or (...): 0 is the
            side of the mirror direction, 180 back towards the light.

    Raises:
        ValueError: an angle is outside [0, 90), or an azimuth is not finite.
    """

    incidence: float | Float[Array, "..."]
    viewing: float | Float[Array, "..."]
    azimuth: float | Float[Array, "..."]
    specular: bool = eqx.field(static=True)

    def __init__(
        self, incidence: Numbers = 0.0, viewing: Numbers = 0.0, specular: bool = False, azimuth: Numbers = 0.0
    ):
        self.incidence = _angle("incidence", incidence)
        self.viewing = _angle("viewing", viewing)
        self.azimuth = _azimuth(azimuth)
        self.specular = bool(specular)

    @property
    def cos_incidence(self) -> ArrayLike:
        """Cosine of the angle of incidence in air; scalar or (..., 1)."""
        return _cosine(self.incidence)

    @property
    def cos_viewing(self) -> ArrayLike:
        """Cosine of the angle of viewing in air; scalar or (..., 1)."""
        return _cosine(self.viewing)


class Hemispherical(eqx.Module):
    """A beam in one direction, all reflected light collected: an integrating sphere.

    By reciprocity also a sphere that lights the sample evenly while a detector views it at `incidence`,
    the usual d:8 instrument.

    Args:
        incidence: angle of the beam from the normal, degrees in air, [0, 90), scalar or (...).
        specular: specular component included (SCI), which adds the Fresnel reflectance of the outer
            surface, or excluded (SCE).

    Raises:
        ValueError: the angle is outside [0, 90).
    """

    incidence: float | Float[Array, "..."]
    specular: bool = eqx.field(static=True)

    def __init__(self, incidence: Numbers = 8.0, specular: bool = True):
        self.incidence = _angle("incidence", incidence)
        self.specular = bool(specular)

    @property
    def cos_incidence(self) -> ArrayLike:
        """Cosine of the angle of incidence in air; scalar or (..., 1)."""
        return _cosine(self.incidence)


Geometry = Bidirectional | Hemispherical
