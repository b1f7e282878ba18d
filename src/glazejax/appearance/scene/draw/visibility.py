"""Materials that a scene shows, so that nothing else is computed."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ....radiative.common.fresnel import dielectric_reflectance
from ..materials import Glazed, Material, SeenRanges, Span
from .rays import Bounce, PerPoint


class MaterialsInView:
    """Materials in view, and the cosines and thicknesses at which they are seen.

    Args:
        materials: of the scene.

    Attributes:
        prepared: the materials made ready by `prepare`; None for those that were not in view.
    """

    def __init__(self, materials: Sequence[Material]):
        self.materials: Sequence[Material] = materials
        self.prepared: list[Material | None] = [None] * len(materials)
        self._light: dict[int, Span] = {}
        self._view: dict[int, Span] = {}
        self._rays = 0
        self._samples = 0

    @property
    def rays_a_sample(self) -> float:
        """Rays, mirror reflections included, for one ray of the camera."""
        return self._rays / max(self._samples, 1)

    def most_mirrored(self, number: int, cos_view: PerPoint) -> PerPoint:
        """The most that the mirror reflection of a material carries; see `rays.Reflects`."""
        material = self.materials[number]
        if not material.is_mirror:
            return np.zeros(len(cos_view))
        if not isinstance(material, Glazed):
            return np.ones(len(cos_view))
        # That of the largest index bounds all bands.
        index = float(np.max(material.glaze.refractive_index))
        return np.asarray(dielectric_reflectance(cos_view, index))

    def add(self, bounces: list[Bounce]) -> None:
        """Take in what some rays meet."""
        self._samples += len(bounces[0].material)
        self._rays += sum(len(bounce.material) for bounce in bounces)
        for bounce in bounces:
            for number in np.unique(bounce.material[bounce.material >= 0]):
                mine = bounce.material == number
                lit = mine[:, None] & (bounce.strength > 0)
                key = int(number)
                # Spectra are asked for at lit points only, so that these set the ranges.
                self._view[key] = _wider(
                    self._view.get(key), bounce.cos_view[mine & lit.any(axis=1)]
                )
                self._light[key] = _wider(self._light.get(key), bounce.cos_light[lit])

    def prepare(self, wavelengths: Float[np.ndarray, "bands"], tolerance: float) -> None:
        """Make materials in view ready for the angles seen; what is ready already stays as it is.

        Args:
            wavelengths, tolerance: see `Material.prepare`.
        """
        for number, view in self._view.items():
            if self.prepared[number] is None:
                material = self.materials[number]
                depths = 0.0 if material.thickness_map is None else material.thickness_map
                ranges = SeenRanges(
                    light=_legal(self._light[number]),
                    view=_legal(view),
                    thickness=_wider(None, np.asarray(depths, float)),
                )
                self.prepared[number] = material.prepare(wavelengths, ranges, tolerance)

    def describe(self) -> str:
        """Angles of the glazes in view, in words."""
        lines = []
        for number, material in enumerate(self.materials):
            if isinstance(material, Glazed) and number in self._view:
                ends = [
                    np.rad2deg(np.arccos(_legal(pair)))[::-1]
                    for pair in (self._light[number], self._view[number])
                ]
                lines.append("{:.0f}-{:.0f}° lit, {:.0f}-{:.0f}° seen".format(*ends[0], *ends[1]))
        return "angles of the glazes: " + "; ".join(lines) if lines else ""


def _wider(span: Span | None, values: np.ndarray) -> Span:
    low, high = span or (np.inf, -np.inf)
    return float(values.min(initial=low)), float(values.max(initial=high))


def _legal(pair: Span) -> Span:
    """Range of cosines; that of an unlit material is any."""
    return (max(pair[0], 0.0), min(pair[1], 1.0)) if pair[0] <= pair[1] else (1.0, 1.0)
