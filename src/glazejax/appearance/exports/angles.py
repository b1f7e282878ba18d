"""Appearance of a glaze from all angles, in the linear RGB of a renderer: what the exports are
fitted to.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from ...colour import CIE_1931, colour_weights, white_point
from ...paint.media import Glaze, check_glaze
from ...progress import Progress, no_progress
from ...radiative.common.fresnel import dielectric_reflectance
from ...radiative.common.quadrature import gauss
from ...spectra import Grid, validate_wavelengths
from ...stacks import Stack
from ..glaze.solve import on_grid, planned_factor
from ..glaze.table import glaze_table
from .rgb import rgb_of_xyz
from .spaces import Space, find_space

Angles: TypeAlias = Float[np.ndarray, "angles"]
"""A number an angle."""

Viewing: TypeAlias = tuple[str, str | int]
"""Illuminant and observer of colours."""

VIEWS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
"""Degrees at which colours are compared, of light and of eye."""
# Pairs of angles of which a rough surface's light is computed together.
_PAIRS = 15
# No finer than this under a rough surface: a fit leaves more.
_ROUGH_TOLERANCE = 1e-4


@dataclass(frozen=True)
class AngularColour:
    """A glaze's reflectance factor between angles in linear RGB, with the surface's own reflection
    kept apart.

    Attributes:
        cosines: (angles,), of light and eye: Gauss's nodes, then those of `VIEWS`.
        weights: (nodes,), of Gauss's nodes, for integrals over the cosine from 0 to 1.
        body: (angles, angles, 3), light by eye: what comes out of the paint. It has no azimuth.
        surface: (angles,), share that the outer surface reflects, directional-hemispherical.
        refractive_index: of the paint, the mean over the bands.
        roughness: alpha of the surface's GGX facets, 0 where it is smooth.
        space: linear RGB, see `spaces.Space`.
        light: illuminant and observer.
        error: largest error of a reflectance factor: that the table of angles has, as it estimates
            it, or under a rough surface that the solver was asked for.
    """

    cosines: Angles
    weights: Float[np.ndarray, "nodes"]
    body: Float[np.ndarray, "angles angles 3"]
    surface: Angles
    refractive_index: float
    roughness: float
    space: Space
    light: Viewing
    error: float

    @property
    def nodes(self) -> slice:
        """Angles that are Gauss's nodes."""
        return slice(0, self.weights.size)

    @property
    def views(self) -> slice:
        """Angles that are those of `VIEWS`."""
        return slice(self.weights.size, self.cosines.size)

    def directional_albedo(self) -> Float[np.ndarray, "angles 3"]:
        """Share of an even white sky seen from each angle, the surface's reflection included."""
        lit = 2.0 * self.weights * self.cosines[self.nodes]
        return np.einsum("iec,i->ec", self.body[self.nodes], lit) + self.surface[:, None]


def angular_colour(
    glaze: Glaze | Stack,
    wavelengths_nm: Grid | None = None,
    *,
    roughness: float = 0.0,
    space: str = "srgb",
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
    tolerance: float = 1e-4,
    progress: Progress = no_progress,
) -> AngularColour:
    """Compute a glaze's colour at all angles.

    Args:
        glaze: of one thickness a layer, or a stack (of a card its white half).
        wavelengths_nm: (bands,); those of the paints if left out.
        roughness: alpha of the surface, from 0 (smooth) to 1.
        space: "srgb" (linear sRGB) or "acescg".
        illuminant, observer: of the colours, see `glazejax.colour.colour_weights`; the illuminant's
            white becomes the space's.
        tolerance: absolute error wanted of a reflectance factor; 1e-4 at least under a rough
            surface.
        progress: called with the pairs of angles that are done.

    Raises:
        ValueError: a roughness outside of 0 to 1, an unknown space, or what `glaze_table` and
            `colour_weights` refuse.
    """
    linear_space = find_space(space)
    check_roughness(roughness)
    single = glaze.glaze() if isinstance(glaze, Stack) else glaze
    check_glaze(single)
    grid = validate_wavelengths(single.wavelengths if wavelengths_nm is None else wavelengths_nm)
    weights = colour_weights(grid, illuminant, observer)
    white = white_point(grid, illuminant, observer)
    single = on_grid(single, grid)
    # Gauss's cosines of light and eye: integrals over the hemisphere are right to 1e-6 of an
    # albedo.
    nodes, steps = gauss(8)
    cosines = np.concatenate([nodes[::-1], np.cos(np.deg2rad(VIEWS))])
    index = float(np.mean(np.asarray(single.refractive_index)))
    # Without the surface's own reflection, light by eye.
    if roughness > 0:
        from ...radiative.rough.surface import surface_albedo

        # Paint is the same with light and eye exchanged: half of the pairs are enough.
        first, second = np.triu_indices(cosines.size)
        spectra = np.empty((cosines.size, cosines.size, grid.size))
        for done in range(0, first.size, _PAIRS):
            progress(done, first.size, "computing pairs of angles")
            one = first[done : done + _PAIRS]
            two = second[done : done + _PAIRS]
            spectra[one, two] = spectra[two, one] = pair_spectra(
                single, cosines[one], cosines[two], roughness, tolerance
            )
        error = max(tolerance, _ROUGH_TOLERANCE)
        surface = surface_albedo(cosines, roughness=roughness, refractive_index=index)
    else:
        table = glaze_table(single, grid, tolerance=tolerance)
        spectra = np.asarray(table.reflectance_factor(cosines[:, None], cosines), float)
        error = float(table.error)
        surface = dielectric_reflectance(cosines, index)
    return AngularColour(
        cosines=cosines,
        weights=steps,
        body=rgb_of_xyz(spectra @ weights, white, linear_space),
        surface=np.asarray(surface, float),
        refractive_index=index,
        roughness=float(roughness),
        space=linear_space,
        light=(illuminant, observer),
        error=error,
    )


def pair_spectra(
    glaze: Glaze,
    cos_in: Float[np.ndarray, "pairs"],
    cos_out: Float[np.ndarray, "pairs"],
    roughness: float,
    tolerance: float,
) -> Float[np.ndarray, "..."]:
    """Reflectance factor without the surface's own reflection for pairs of angles, of a glaze
    (pairs, bands) or a batch of glazes.
    """
    axes = max(glaze.albedo.ndim - 1, glaze.optical_thickness.ndim - 1, glaze.ground.ndim)
    batch = (slice(None), *[None] * axes)
    if roughness > 0:
        from ...radiative.rough.reflectance import rough_reflectance_factor

        factor = rough_reflectance_factor(
            glaze.albedo,
            glaze.optical_thickness,
            glaze.ground,
            roughness=roughness,
            refractive_index=glaze.refractive_index,
            cos_incidence=cos_in[batch],
            cos_viewing=cos_out[batch],
            tolerance=max(tolerance, _ROUGH_TOLERANCE),
        )
        return np.asarray(factor, float)
    return planned_factor(glaze, cos_in[batch], cos_out[batch], tolerance)


def check_roughness(roughness: float) -> None:
    """Refuse what is no alpha.

    Raises:
        ValueError: it is outside of 0 to 1.
    """
    if not 0 <= roughness <= 1:
        raise ValueError(f"roughness is {roughness}; it is alpha of GGX, from 0 (smooth) to 1")
