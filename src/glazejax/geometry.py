"""Geometry of an instrument: where the light comes from and where it is measured.

One `Instrument` is a geometry and a refractive index. `parse_geometry` reads the words for a
geometry, the same on the command line and in Python: ``d:8``, ``de:8``, ``45:0`` and so on.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from .geometry_words import split_geometry
from .radiative.common.fresnel import dielectric_reflectance
from .radiative.common.inputs import INDEX_RANGE
from .spectra import Numbers, as_float_array, concrete


def _angle(name: str, degrees: Numbers, *, from_normal: bool = True) -> float | Float[Array, "..."]:
    """Legal angle, from the normal or any finite one: Python numbers stay numbers, so that they
    remain constants of a traced program.
    """
    values = concrete(degrees)
    if values is None:
        return as_float_array(degrees)
    if not (
        jnp.issubdtype(values.dtype, jnp.floating) or jnp.issubdtype(values.dtype, jnp.integer)
    ):
        raise ValueError(f"{name} must be a number of degrees, not {degrees!r}")
    legal = (values >= 0) & (values < 90) if from_normal else np.isfinite(values)
    wrong = values[~legal]
    if wrong.size:
        rule = (
            "lie in [0, 90) degrees from the normal"
            if from_normal
            else "be a finite number of degrees"
        )
        raise ValueError(f"{name} must {rule}, not {wrong.flat[0]:g}")
    return as_float_array(degrees) if values.ndim or eqx.is_array(degrees) else float(values)


def _degrees(angle: ArrayLike) -> str:
    """An angle in words; a range of angles where there are several."""
    values = np.unique(np.asarray(angle))
    return f"{values[0]:g}°" if values.size == 1 else f"{values[0]:g}° to {values[-1]:g}°"


def _cosine(degrees: ArrayLike) -> ArrayLike:
    """Cosine of an angle in degrees; a trailing axis of bands is added to an array of angles."""
    if isinstance(degrees, float):
        return float(np.cos(np.deg2rad(degrees)))
    cosine = jnp.cos(jnp.deg2rad(as_float_array(degrees)))
    return cosine[..., None] if cosine.ndim else cosine


class Bidirectional(eqx.Module):
    """A beam in one direction, radiance measured in another: a 0:0, 45:0 or gonio instrument.

    Gives the reflectance factor pi L_out / E_in. The azimuth between the two directions matters
    only to paint with a phase function, and only where neither of them is normal.

    Args:
        incidence: angle of the beam from the normal, degrees in air, [0, 90), scalar or (...).
        viewing: angle of the view from the normal, degrees in air, [0, 90), scalar or (...).
        specular: whether the view, where `viewing` equals `incidence`, is the mirror direction;
            then the Fresnel reflectance of the outer surface is added (paper A, section 3.2, step
            6).
        azimuth: degrees between the horizontal directions of the light before and after, scalar or
            (...): 0 is the side of the mirror direction, 180 back towards the light.

    Raises:
        ValueError: an angle is outside [0, 90), or an azimuth is not finite.
    """

    incidence: float | Float[Array, "..."]
    viewing: float | Float[Array, "..."]
    azimuth: float | Float[Array, "..."]
    specular: bool = eqx.field(static=True)

    def __init__(
        self,
        incidence: Numbers = 0.0,
        viewing: Numbers = 0.0,
        specular: bool = False,
        azimuth: Numbers = 0.0,
    ):
        self.incidence = _angle("incidence", incidence)
        self.viewing = _angle("viewing", viewing)
        self.azimuth = _angle("azimuth", azimuth, from_normal=False)
        self.specular = bool(specular)

    @property
    def cos_incidence(self) -> ArrayLike:
        """Cosine of the angle of incidence in air; scalar or (..., 1)."""
        return _cosine(self.incidence)

    @property
    def cos_viewing(self) -> ArrayLike:
        """Cosine of the angle of viewing in air; scalar or (..., 1)."""
        return _cosine(self.viewing)

    @property
    def sees_surface(self) -> bool | Bool[Array, "..."]:
        """Test whether readings contain the surface's mirror reflection: asked for, and in view;
        scalar or (..., 1).
        """
        if not self.specular:
            return False
        # Angles that JAX traces are compared by the program, not here.
        incidence, viewing, azimuth = (
            jnp.asarray(a) for a in (self.incidence, self.viewing, self.azimuth)
        )
        # At normal incidence every azimuth is that of the mirror direction.
        mirror = (incidence == viewing) & ((jnp.remainder(azimuth, 360.0) == 0) | (incidence == 0))
        return mirror[..., None] if mirror.ndim else mirror

    @property
    def notation(self) -> str:
        """Notation that `parse_geometry` reads, such as ``45:0``; single angles only, and no
        azimuth. It asks for the mirror reflection where that is in view.
        """
        mirror = ":specular" if np.any(self.sees_surface) else ""
        return f"{float(self.incidence):g}:{float(self.viewing):g}{mirror}"

    def describe(self) -> str:
        """The geometry in words."""
        in_view = np.any(self.sees_surface)
        mirrored = "mirror reflection included" if in_view else "no mirror reflection"
        return f"light at {_degrees(self.incidence)}, view at {_degrees(self.viewing)}, {mirrored}"


class Hemispherical(eqx.Module):
    """A beam in one direction, all reflected light collected: an integrating sphere.

    By reciprocity also a sphere that lights the sample evenly while a detector views it at
    `incidence`, the usual d:8 instrument.

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

    @property
    def sees_surface(self) -> bool:
        """Test whether readings contain the surface's mirror reflection."""
        return self.specular

    @property
    def notation(self) -> str:
        """Notation that `parse_geometry` reads, such as ``d:8``; a single angle only."""
        return f"{'d' if self.specular else 'de'}:{float(self.incidence):g}"

    def describe(self) -> str:
        """The geometry in words."""
        return (
            f"an integrating sphere at {_degrees(self.incidence)}, specular "
            f"{'in' if self.specular else 'ex'}cluded"
        )


Geometry = Bidirectional | Hemispherical


@functools.lru_cache(maxsize=256)
def parse_geometry(text: str, *, argument: str = "geometry") -> Geometry:
    """Read the words for a geometry.

    Args:
        text: ``d:8`` or ``di:8``, an integrating sphere with the mirror reflection, ``de:8``
            without it, and by reciprocity ``8:d``, ``8:di``, ``8:de``; or the angles of light and
            view, ``45:0``, ``0:45``, ``30:30``. With equal angles, ``30:30:specular`` sees the
            mirror reflection. Any angle in [0, 90) degrees will do.
        argument: what ``text`` was given as, such as ``--instrument``; errors begin with it.

    Raises:
        ValueError: other words, an angle out of range, or a mirror reflection that is not in view.
    """
    sphere, angles, specular = split_geometry(text, argument)
    if sphere is not None:
        # Of a sphere only the beam's angle counts, by reciprocity that of the detector.
        return Hemispherical(angles[0], sphere)
    return Bidirectional(angles[0], angles[1], specular)


@dataclass(frozen=True)
class Instrument:
    """An instrument in front of paint with a smooth surface.

    Attributes:
        geometry: what it does, single angles; by default d:8, an integrating sphere with the mirror
            reflection.
        refractive_index: of paint and of the cards' surface, in [1, 2.5].

    Raises:
        ValueError: an index out of range, several angles, or words in place of a geometry.
    """

    geometry: Geometry = field(default_factory=Hemispherical)
    refractive_index: float = 1.5

    def __post_init__(self) -> None:
        low, high = INDEX_RANGE
        if not low <= self.refractive_index <= high:
            raise ValueError(
                f"refractive index {self.refractive_index:g} is outside [{low:g}, {high:g}]"
            )
        if isinstance(self.geometry, str):
            raise ValueError(
                f"an instrument has a geometry, not {self.geometry!r}: use "
                f"Instrument.parse({self.geometry!r})"
            )
        for name, angle in vars(self.geometry).items():
            if np.ndim(angle):
                raise ValueError(
                    f"an instrument has one angle of each kind, but {name} is an array of shape "
                    f"{np.shape(angle)}: make an instrument for each"
                )

    @classmethod
    def parse(cls, text: str, refractive_index: float = 1.5) -> "Instrument":
        """The instrument of these words.

        Raises:
            ValueError: see `parse_geometry`.

        Example:
            >>> Instrument.parse("de:8").describe()
            'an integrating sphere at 8°, specular excluded'
        """
        return cls(parse_geometry(text), refractive_index)

    @property
    def cos_incidence(self) -> float:
        """Cosine of the angle of incidence in air."""
        return float(np.cos(np.deg2rad(float(np.asarray(self.geometry.incidence)))))

    @property
    def surface(self) -> float:
        """Fresnel reflectance of the outer surface at the angle of incidence, R_s, whether it is
        measured or not.
        """
        return float(dielectric_reflectance(self.cos_incidence, self.refractive_index))

    @property
    def seen_surface(self) -> float:
        """Surface's addition to a reading: R_s, or 0 if its mirror reflection is excluded or out of
        view.
        """
        return self.surface if self.geometry.sees_surface else 0.0

    def describe(self) -> str:
        """The geometry in words, as `Hemispherical.describe` and `Bidirectional.describe` give
        them.
        """
        return self.geometry.describe()


def resolve_instrument(
    instrument: "Instrument | Geometry | str | None" = None,
    refractive_index: float = 1.5,
) -> Instrument:
    """The instrument that an `instrument=` argument names.

    Args:
        instrument: a whole one, a geometry, or its words, such as ``"45:0"``; by default d:8 with
            the mirror reflection.
        refractive_index: where `instrument` is no whole one.

    Raises:
        ValueError: words that name no geometry, see `parse_geometry`.
        TypeError: anything else.
    """
    if isinstance(instrument, Instrument):
        return instrument
    return Instrument(
        Hemispherical() if instrument is None else geometry_of(instrument), refractive_index
    )


def geometry_of(instrument: "Instrument | Geometry | str") -> Geometry:
    """The geometry that an `instrument=` argument names, where the paint brings its own index.

    Args:
        instrument: a whole one, a geometry, or its words, such as ``"45:0"``.

    Raises:
        ValueError: words that name no geometry, see `parse_geometry`.
        TypeError: anything else.
    """
    if isinstance(instrument, Bidirectional | Hemispherical):
        return instrument
    if isinstance(instrument, Instrument):
        return instrument.geometry
    if isinstance(instrument, str):
        return parse_geometry(instrument, argument="instrument")
    raise TypeError(
        f"instrument is {instrument!r}: give a geometry, such as Bidirectional(45, 0), its words, "
        'such as "45:0", or a glazejax.Instrument'
    )
