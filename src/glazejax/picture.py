"""Glazed pictures: coats whose thickness changes from pixel to pixel, to sRGB.

Every pixel is a glaze of its own, but all are points of one function: colour against the few
numbers that differ from pixel to pixel. That function is computed where it is needed to meet a
colour difference asked for, and interpolated in XYZ for all pixels; `full` computes every distinct
pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from . import colour
from .extras import require
from .geometry import Geometry, Hemispherical, Instrument, geometry_of
from .interpolated import MOST_AXES, at_points
from .paint.media import Glaze, Layer, Mixture, Pigment, check_map, shared_shape
from .radiative.common.chunks import pieces_of
from .radiative.common.fresnel import dielectric_reflectance
from .radiative.plan.plan import ALL, Savings, plan_stacks
from .radiative.plan.reduction import distinct
from .spectra import Numbers

# Stacks planned together where every pixel is computed.
_STACKS = 2**17


@dataclass(frozen=True)
class Picture:
    """A picture and how it came about.

    Attributes:
        srgb: (h, w, 3), encoded sRGB in [0, 1].
        xyz: (h, w, 3), CIE XYZ, Y = 1 for the perfect diffuser.
        report: what was computed and what was not, in words.
        delta_e: estimated largest CIEDE2000 difference from computing every pixel; 0 if every pixel
            was.
        computed: number of glazes whose spectrum was computed.
    """

    srgb: Float[Array, "h w 3"]
    xyz: Float[Array, "h w 3"]
    report: str
    delta_e: float
    computed: int

    def save(self, path: str | Path) -> None:
        """Write the picture to a file, of 8 bits; the ending, such as .png, says the format.

        A file that is there is replaced.

        Raises:
            ModuleNotFoundError: matplotlib is not installed.
        """
        require("matplotlib")
        from matplotlib.image import imsave

        # Rounded here: matplotlib cuts off what is between two levels.
        levels = np.round(255.0 * np.clip(np.asarray(self.srgb, np.float64), 0.0, 1.0))
        imsave(path, levels.astype(np.uint8))

    def __repr__(self) -> str:
        return f"Picture({' x '.join(map(str, self.srgb.shape[:2]))}: {self.report})"


def picture(
    coats: Sequence[Pigment | Mixture],
    thickness_maps: Sequence[Numbers],
    ground: Numbers,
    instrument: Instrument | Geometry | str | None = None,
    *,
    refractive_index: Numbers = 1.5,
    illuminant: str = "D65",
    observer: str | int = colour.CIE_1931,
    delta_e: float = 0.1,
    full: bool = False,
    savings: Savings = ALL,
) -> Picture:
    """Picture of a glaze whose coats have a thickness map each.

    Args:
        coats: paint of each coat, top first, all on the same wavelengths.
        thickness_maps: thickness of each coat in m, (h, w) or one number.
        ground: its reflectance inside the medium, in [0, 1]: one number, a spectrum (bands,), or a
            map (h, w) of grey.
        instrument: where light comes from and from where one looks, one angle each: a geometry, its
            words, or an `Instrument`, of which the geometry counts; 45:0 if left out.
        refractive_index: of all coats, one number or (bands,), in [1, 2.5].
        illuminant, observer: see `glazejax.colour.colour_weights`.
        delta_e: largest CIEDE2000 difference wanted from the full computation.
        full: compute every distinct pixel instead of interpolating.
        savings: what the solver's plan may leave out, see `glazejax.radiative.plan`.

    Returns:
        `Picture`.

    Raises:
        ValueError: maps of different shapes, none at all, a thickness that is NaN, negative or not
            in metres, another number of maps than coats, an angle for each of many directions,
            paints, fractions or an index with batch axes, or what `Glaze` and the colour functions
            refuse.

    Notes:
        Up to three maps that are not constant are interpolated, with an error checked at pixels of
        the picture. More than that, or few distinct pixels, and every distinct pixel is computed.
    """
    if not 0 < delta_e < 100:
        raise ValueError(f"delta_e is {delta_e}; it must be positive, such as 0.1")
    single = jnp.result_type(float) == jnp.float32
    inputs = _PictureInputs(
        paints=coats,
        maps=thickness_maps,
        ground=ground,
        geometry=geometry_of("45:0" if instrument is None else instrument),
        refractive_index=refractive_index,
        illuminant=illuminant,
        observer=observer,
        # For one unit of the colour difference: near black, where colour differences are most
        # sensitive, an error of 1e-5 in one of X, Y, Z makes about 0.06. Below the least that the
        # solver takes without a warning, it would warn of an argument that nobody gave.
        tolerance=min(1e-3, max(1e-5 * delta_e, 1e-6 if single else 1e-10)),
        savings=savings,
    )
    # Maps that vary are the parameters; equal pixels are computed once.
    columns = list(inputs.varying.values())
    first, inverse = distinct(columns)
    points = np.stack([column[first] for column in columns], axis=1)
    values = None
    computed = 0
    error = 0.0
    remark = ""
    # So few distinct pixels are computed one by one.
    if not full and len(first) > 256 and len(columns) <= MOST_AXES:
        # The rest is the solver's.
        values_at_points, table = at_points(
            inputs.compute, points, tolerance=0.9 * delta_e, distance=inputs.difference
        )
        computed = table.evaluations
        if table.converged:
            error = table.error
            values = values_at_points
            shape = " x ".join(map(str, table.coefficients.shape[:-1]))
            remark = f", interpolated from {shape}, estimated Delta E00 {error:.2g}"
    if values is None:
        values = inputs.compute(points)
        computed += len(points)
    # Interpolation may fall below 0 next to black.
    xyz = jnp.maximum(jnp.asarray(values), 0.0)[inverse].reshape(*inputs.shape, 3)
    report = f"{inputs.pixels} pixels, {len(first)} distinct, {computed} computed{remark}"
    return Picture(
        srgb=colour.xyz_to_srgb(xyz, inputs.white),
        xyz=xyz,
        report=report,
        delta_e=error,
        computed=computed,
    )


class _PictureInputs:
    """Inputs of the picture, checked, as NumPy arrays."""

    def __init__(
        self,
        paints,
        maps,
        ground,
        geometry,
        refractive_index,
        illuminant,
        observer,
        tolerance,
        savings,
    ):
        paints = list(paints)
        if not paints or len(paints) != len(maps):
            raise ValueError(
                f"{len(paints)} coats and {len(maps)} thickness maps: give each coat one map "
                "or number"
            )
        # One glaze of unit thickness (1 mm, so that it is legal) holds the coefficients.
        coats = [Layer(medium, 1e-3) for medium in paints]
        names = [f"of {coat.medium.name!r}" for coat in coats]
        thickness = [
            check_map("thickness", values, name, axes=(0, 2))
            for values, name in zip(maps, names, strict=True)
        ]
        ground = check_map("ground", ground, axes=(0, 1, 2))
        unit = Glaze(coats, ground if ground.ndim < 2 else 0.0, refractive_index)
        batch = unit.albedo.shape[:-2] or np.shape(unit.refractive_index)[:-1]
        if batch:
            raise ValueError(
                f"a paint, its fractions or the index have batch axes {batch}: from pixel to pixel "
                "only thickness and ground may differ; glazejax.interpolated takes a fraction"
            )
        named = [(f"thickness {name}", m) for name, m in zip(names, thickness, strict=True)]
        pictures = [(name, m) for name, m in [*named, ("ground", ground)] if m.ndim == 2]
        if not pictures:
            raise ValueError("no map: for one glaze use glazejax.reflectance")
        self.shape = shared_shape(pictures)
        self.pixels = pictures[0][1].size
        if unit.phase is not None:
            raise ValueError(
                "a picture takes paint that scatters isotropically; glazejax.reflectance follows "
                "phase"
            )
        self.albedo = np.asarray(unit.albedo, float)  # (bands, layers)
        # 1/m, from the optical thickness of 1 mm.
        self.extinction = 1e3 * np.asarray(unit.optical_thickness, float)
        self.thickness, self.ground = thickness, ground
        index = np.asarray(unit.refractive_index, float)
        incidence = np.asarray(geometry.cos_incidence, float)
        hemispherical = isinstance(geometry, Hemispherical)
        viewing = incidence if hemispherical else np.asarray(geometry.cos_viewing, float)
        sees_surface = geometry.sees_surface
        if incidence.ndim or viewing.ndim or np.ndim(sees_surface):
            raise ValueError(
                "a picture has one angle of incidence and one of viewing, not an array of them"
            )
        # The surface's own reflectance, added.
        self.surface = dielectric_reflectance(float(incidence), index) if sees_surface else 0.0
        grid = unit.wavelengths
        self.weights = colour.colour_weights(grid, illuminant, observer)
        self.white = colour.white_point(grid, illuminant, observer)
        self.plan_options: dict[str, Any] = {
            "cos_incidence": float(incidence),
            "cos_viewing": None if hemispherical else float(viewing),
            "refractive_index": index,
            "tolerance": tolerance,
            "savings": savings,
            "band_weights": self.weights,
        }
        # Maps by the number of a layer, or -1 for the ground: those that are not constant, if any.
        maps = {k: m.reshape(-1) for k, m in [*enumerate(thickness), (-1, ground)] if m.ndim == 2}
        self.varying = {k: m for k, m in maps.items() if m.min() < m.max()} or maps

    def compute(self, points: np.ndarray) -> np.ndarray:
        """XYZ by the solver, for points that hold the varying quantities, (points, varying)."""
        size = max(1, _STACKS // len(self.weights))
        return np.concatenate([self._some(piece) for piece in pieces_of(points, size)])

    def _some(self, points: np.ndarray) -> np.ndarray:
        # What does not vary is the same for all points.
        fixed = [0.0 if k in self.varying else m.flat[0] for k, m in enumerate(self.thickness)]
        thickness = np.tile(np.array(fixed), (len(points), 1))
        ground = np.asarray(self.ground.flat[0] if self.ground.ndim == 2 else self.ground)
        for column, k in zip(points.T, self.varying, strict=True):
            if k < 0:
                ground = column[:, None]
            else:
                thickness[:, k] = column
        plan = plan_stacks(
            self.albedo, self.extinction * thickness[:, None, :], ground, **self.plan_options
        )
        return (np.asarray(plan.run(), float) + self.surface) @ self.weights

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """CIEDE2000 difference of XYZ, (points,)."""
        return colour.delta_e_2000(*(colour.xyz_to_lab(xyz, self.white) for xyz in (first, second)))
