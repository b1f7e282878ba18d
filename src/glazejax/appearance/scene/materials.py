"""Materials of a scene, and how each answers to one light at one point.

A material says what light does to it in two functions: ``direct``, what a light sends to the eye,
for pairs of points and lights, and ``mirror``, what a mirror reflection carries. All of them are
equinox modules, hence pytrees: a picture can be differentiated by their spectra.
"""

from typing import Any, Literal, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...paint.media import Glaze, check_map
from ...radiative.common.fresnel import (
    conductor_reflectance,
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)
from ...radiative.common.inputs import check_choice
from ...spectra import Bands, Numbers, as_float_array, concrete, describe_grid, same_grid
from .. import shading
from ..glaze.solve import check_layer, on_grid
from ..glaze.table import GlazeTable, glaze_table

ThicknessMap: TypeAlias = Float[Array | np.ndarray, "h w"]
"""Thickness over the texture coordinates, first row on top, m."""

PointSpectra: TypeAlias = Float[Array, "points bands"]
"""Spectra of points."""

PairSpectra: TypeAlias = Float[Array, "pairs bands"]
"""Spectra of pairs of a point and a light."""

PerPair: TypeAlias = Float[Array, "pairs"]
"""A number a pair of a point and a light."""

Span: TypeAlias = tuple[float, float]
"""Least and largest of some values."""

FresnelModel = Literal["exact", "hall", "cook-torrance"]
"""How the reflectance of a metal depends on the angle."""


class Angles(eqx.Module):
    """Cosines of pairs of a point and a light, (pairs,) each, and thicknesses at the points."""

    light: PerPair
    """N.L"""
    view: PerPair
    """N.V"""
    between: PerPair
    """V.L"""
    thickness: PerPair
    """m; 0 where the material has no map."""


class SeenRanges(eqx.Module):
    """Part of a material that a scene shows: ranges of cosines and thicknesses."""

    light: Span
    view: Span
    thickness: Span


def check_spectrum(what: str, spectrum: Numbers, wavelengths: Bands) -> None:
    """Refuse a spectrum that does not fit the scene; values that JAX traces pass.

    Raises:
        ValueError: another number of bands, or a value that is below 0 or not finite.
    """
    if np.shape(spectrum) not in ((), wavelengths.shape):
        raise ValueError(
            f"{what} has shape {np.shape(spectrum)}, but the scene has {describe_grid(wavelengths)}"
        )
    numbers = concrete(spectrum)
    if numbers is not None and not np.all((numbers >= 0) & np.isfinite(numbers)):
        raise ValueError(
            f"{what} holds {float(np.min(numbers)):g}; it must be finite and 0 or more"
        )


class Material(eqx.Module):
    """Base of all materials."""

    def check(self, name: str, wavelengths: Bands) -> None:
        """Refuse spectra that do not fit the scene.

        Raises:
            ValueError: names the material and the value.
        """
        for what, spectrum in self.spectra().items():
            check_spectrum(f"{what} of material {name!r}", spectrum, wavelengths)

    def spectra(self) -> dict[str, Any]:
        """Spectra by name, (bands,) or one number each."""
        raise NotImplementedError

    def prepare(self, wavelengths: Bands, seen: SeenRanges, tolerance: float) -> "Material":
        """Material that `direct` and `mirror` are asked of; most are ready as they are."""
        return self

    @property
    def thickness_map(self) -> ThicknessMap | None:
        """Thickness in m over the texture coordinates, first row on top; None if there is none."""
        return None

    @property
    def is_mirror(self) -> bool:
        """Test whether other things are seen in it."""
        return False

    def direct(self, angles: Angles) -> PairSpectra:
        """Share of a light's spectrum that reaches the eye, the cosine of its fall included."""
        raise NotImplementedError

    def mirror(self, cos_view: Float[Array, "points"]) -> PointSpectra:
        """Share of the light from the mirror direction that reaches the eye."""
        raise NotImplementedError


class Lambert(Material):
    """Perfectly diffuse.

    Args:
        reflectance: (bands,) or one number.
    """

    reflectance: Float[Array, "..."] = eqx.field(converter=as_float_array)

    def spectra(self) -> dict[str, Any]:
        """Its reflectance."""
        return {"reflectance": self.reflectance}

    def direct(self, angles: Angles) -> PairSpectra:
        """Source: paper B, first term of (4)."""
        return shading.lambert(self.reflectance, angles.light)


class Phong(Material):
    """A diffuse body with a highlight of the colour of the light.

    Args:
        body: diffuse reflectance, (bands,) or one number.
        specular: strength of the highlight.
        exponent: its sharpness.
    """

    body: Float[Array, "..."] = eqx.field(converter=as_float_array)
    specular: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.3)
    exponent: Float[Array, ""] = eqx.field(converter=as_float_array, default=40.0)

    def spectra(self) -> dict[str, Any]:
        """The body's reflectance."""
        return {"body": self.body}

    def check(self, name: str, wavelengths: Bands) -> None:
        """Refuse spectra that do not fit the scene, and highlights below nothing.

        Raises:
            ValueError: names the material and the value.
        """
        super().check(name, wavelengths)
        for what, value in (("specular", self.specular), ("exponent", self.exponent)):
            number = concrete(value)
            if number is not None and (number.ndim or not 0 <= number < np.inf):
                raise ValueError(
                    f"{what} of material {name!r} is {number}; it must be one number, 0 or more"
                )

    def direct(self, angles: Angles) -> PairSpectra:
        """Source: paper B, (4) and (24)."""
        # R_v = 2 (N.V) N - V.
        mirrored = 2.0 * angles.view * angles.light - angles.between
        return shading.phong(
            self.body, 1.0, angles.light, mirrored, specular=self.specular, exponent=self.exponent
        )


class Conductor(Material):
    """A metal: polished, a mirror of its Fresnel reflectance, or rough, after Torrance and Sparrow.

    Args:
        refractive_index, extinction: n and k, (bands,) or one number each.
        roughness: angle beta in degrees at which half of the facets are left (paper B, (7)); 0 for
            polished.
        fresnel: how it reflects away from the normal: "exact", or an estimate from its reflectance
            at the normal, "hall" or "cook-torrance" (paper B, (11)-(23)).
    """

    refractive_index: Float[Array, "..."] = eqx.field(converter=as_float_array)
    extinction: Float[Array, "..."] = eqx.field(converter=as_float_array)
    roughness: float = eqx.field(static=True, default=0.0)
    fresnel: FresnelModel = eqx.field(static=True, default="exact")

    def __check_init__(self) -> None:
        check_choice("fresnel", self.fresnel, FresnelModel)
        if not 0 <= self.roughness < 60:
            raise ValueError(
                f"roughness must be 0 (polished) to 60 degrees, not {self.roughness:g}"
            )

    def spectra(self) -> dict[str, Any]:
        """Refractive index and extinction."""
        return {"refractive_index": self.refractive_index, "extinction": self.extinction}

    @property
    def is_mirror(self) -> bool:
        """Polished metal is."""
        return self.roughness == 0

    def mirror(self, cos_view: Float[Array, "points"]) -> PointSpectra:
        """Fresnel reflectance. Source: paper B, (11)-(23)."""
        return self._reflectance(jnp.clip(cos_view, 0.0, 1.0)[:, None])

    def _reflectance(self, cosine: Float[Array, "points 1"]) -> PointSpectra:
        n = self.refractive_index
        k = self.extinction
        if self.fresnel == "exact":
            return jnp.asarray(conductor_reflectance(cosine, n, k))
        normal = jnp.asarray(conductor_reflectance(1.0, n, k))
        if self.fresnel == "cook-torrance":
            return jnp.asarray(cook_torrance_reflectance(jnp.maximum(cosine, 1e-6), normal))
        # Hall's average metal, of index 1, reflects the mean over the bands (23).
        average = jnp.asarray(hall_extinction(jnp.mean(normal)))
        return jnp.asarray(hall_reflectance(cosine, normal, average))

    def direct(self, angles: Angles) -> PairSpectra:
        """The glossy lobe of a rough metal; nothing of a polished one. Source: paper B, (5)-(8)."""
        if self.is_mirror:
            return jnp.zeros_like(angles.light)[:, None]
        # H is (V + L) / |V + L|, and |V + L|^2 = 2 + 2 V.L.
        cos_facet = jnp.sqrt(jnp.clip(0.5 * (1.0 + angles.between), 1e-12, 1.0))
        cos_half = (angles.view + angles.light) / (2.0 * cos_facet)
        fresnel = self._reflectance(cos_facet[:, None])
        width = float(np.deg2rad(self.roughness))
        return shading.torrance_sparrow(
            fresnel, 1.0, angles.light, angles.view, cos_half, cos_facet, width=width
        )


class _GlazedSurface:
    """Base of a glaze and of its table; no module, so that each keeps its own order of fields."""

    thickness: ThicknessMap | None
    gloss: bool

    @property
    def thickness_map(self) -> ThicknessMap | None:
        """Thickness in m over the texture coordinates."""
        return self.thickness

    @property
    def is_mirror(self) -> bool:
        """Under gloss it is."""
        return self.gloss


class Glazed(_GlazedSurface, Material):
    """Layers of paint on a ground, under one surface, by the many-layer solver.

    Args:
        glaze: without batch axes.
        thickness: (h, w), m, of one layer over the texture coordinates, first row on top; None if
            it is even.
        layer: which layer that is, 0 for the top one.
        gloss: whether the surface mirrors what is around.
        roughness: of the surface, GGX's alpha from 0 (smooth) to 1, as Mitsuba counts it; above 0
            for `path_trace` alone.
    """

    glaze: Glaze
    thickness: ThicknessMap | None = None
    layer: int = eqx.field(static=True, default=0)
    gloss: bool = eqx.field(static=True, default=True)
    roughness: float = eqx.field(static=True, default=0.0)

    def __check_init__(self) -> None:
        if not 0 <= self.roughness <= 1:
            raise ValueError(
                f"roughness must be 0 (smooth) to 1, GGX's alpha, not {self.roughness:g}"
            )

    def check(self, name: str, wavelengths: Bands) -> None:
        """Refuse another grid, what no table can be made of, or a map that is none.

        Raises:
            ValueError: names the material and the value.
        """
        if self.glaze.coats and not same_grid(self.glaze.wavelengths, wavelengths):
            raise ValueError(
                f"the glaze of material {name!r} has {describe_grid(self.glaze.wavelengths)}, but "
                f"the scene has {describe_grid(wavelengths)}: bring its paints there with "
                ".resample(wavelengths)"
            )
        try:
            on_grid(self.glaze, wavelengths)
            if self.thickness is not None:
                check_layer(self.glaze, self.layer)
                check_map("thickness", self.thickness)
        except ValueError as error:
            raise ValueError(f"material {name!r}: {error}") from None

    def prepare(self, wavelengths: Bands, seen: SeenRanges, tolerance: float) -> "GlazedTable":
        """Its reflectance factor as a table, for the angles and thicknesses that are seen."""
        table = glaze_table(
            self.glaze,
            wavelengths,
            angles=(_degrees(seen.light), _degrees(seen.view)),
            thickness=None if self.thickness is None else np.array(seen.thickness),
            layer=self.layer,
            tolerance=tolerance,
        )
        # Arrays all of them: plain numbers would be constants of a program compiled for this glaze
        # alone.
        return GlazedTable(jax.tree.map(jnp.asarray, table), self.thickness, self.gloss)


class GlazedTable(_GlazedSurface, Material):
    """A glaze whose reflectance factor is tabulated; made by `Glazed.prepare`."""

    table: GlazeTable
    thickness: ThicknessMap | None
    gloss: bool = eqx.field(static=True)

    def direct(self, angles: Angles) -> PairSpectra:
        """Reflectance factor times the cosine of the fall."""
        factor = self.table.reflectance_factor(
            angles.light, angles.view, angles.thickness if self.table.varies else None
        )
        return shading.lambert(factor, angles.light)

    def mirror(self, cos_view: Float[Array, "points"]) -> PointSpectra:
        """Fresnel reflectance of the surface."""
        return self.table.mirror(cos_view)


def _degrees(cosines: Span) -> Span:
    """Range of angles in degrees that holds a range of cosines, and never so narrow that rounding
    shows.
    """
    low, high = np.rad2deg(np.arccos(np.clip(cosines, 0.0, 1.0))[::-1])
    # A table reaches so many degrees beyond the angles seen.
    return max(float(low) - 0.05, 0.0), min(float(high) + 0.05, 90.0)
