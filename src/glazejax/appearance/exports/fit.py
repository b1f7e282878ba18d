"""Parameters of OpenPBR whose light comes nearest to a computed glaze, and how near that is."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...colour import CIE_1931
from ...paint.media import Glaze
from ...progress import Progress, counted, no_progress
from ...spectra import Grid
from ...stacks import Stack
from .angles import VIEWS, AngularColour, angular_colour
from .openpbr import Colour, OpenPBR, directional_albedo, paint_surface, reflectance_factor
from .rgb import delta_e, outside
from .spaces import LAYERINGS, Layering

# Azimuths of the comparison, half of the circle at midpoints: OpenPBR's rough body has an azimuth,
# and paint has none.
_AZIMUTHS = (np.arange(6) + 0.5) * 30.0
_FIT_AZIMUTHS = (np.arange(3) + 0.5) * 60.0
# Roughnesses of the body and tints of the coat to start from.
_ROUGHNESSES = (0.02, 0.4)
_TINTS = (0.9, 0.4)


class Errors(NamedTuple):
    """Distances of a material from the glaze.

    The sky is even and white; colours are compared at `VIEWS`, 0 to 75 degrees.
    """

    albedo: float
    """Largest difference of what is seen of the sky, in any channel, the surface's reflection
    included.
    """
    rms: float
    """Root mean square of the reflectance factor's difference, over all pairs of angles by their
    cosines, without the surface's own reflection."""
    sky: float
    """Mean CIEDE2000 under the sky."""
    sky_most: float
    """Largest CIEDE2000 under the sky."""
    lamp: float
    """Mean CIEDE2000 under a lamp at 45 degrees, without the surface's own reflection."""
    lamp_most: float
    """Largest CIEDE2000 under that lamp."""


@dataclass(frozen=True)
class OpenPBRFit:
    """Material that a fit found, and its distances from the glaze.

    Attributes:
        material: of OpenPBR, in the colour space of `truth`.
        layering: what the material was fitted with; see `glazejax.appearance.exports.openpbr`.
        truth: the computed glaze.
        errors: of the material.
        naive: what one would write without a fit: the colour seen straight on, and the index as it
            is.
        naive_errors: of that.
        outside: share of the glaze's colours, at pairs of `VIEWS`, that the space cannot hold.
    """

    material: OpenPBR
    layering: Layering
    truth: AngularColour
    errors: Errors
    naive: OpenPBR
    naive_errors: Errors
    outside: float

    def errors_with(self, layering: Layering) -> Errors:
        """Errors in a program that puts layers together in another way."""
        return material_errors(self.material, self.truth, layering)

    def __repr__(self) -> str:
        e = self.errors
        colours = f"Delta E00 {e.sky:.2g} under a sky, {e.lamp:.2g} at 45 degrees"
        return f"OpenPBRFit(albedo {e.albedo:.2g}, rms {e.rms:.2g}, {colours})"


def fit_openpbr(
    glaze: Glaze | Stack | AngularColour,
    wavelengths_nm: Grid | None = None,
    *,
    roughness: float = 0.0,
    space: str = "srgb",
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
    layering: Layering = "materialx",
    coat: bool | None = None,
    tolerance: float = 1e-4,
    progress: Progress = no_progress,
) -> OpenPBRFit:
    """Fit OpenPBR to a glaze.

    Body and coat are fitted: their colours, the body's roughness, and the coat's darkening. The
    surface is known: the index is the paint's, and its roughness the square root of alpha, so that
    the mirror reflection stays right.

    Args:
        glaze: of one thickness a layer, a stack, or what `angular_colour` has computed (then all
            but `layering` and
            `coat` counts no more).
        wavelengths_nm, roughness, space, illuminant, observer, tolerance: see `angular_colour`.
        layering: "materialx" (its node graph), "specification" or "reciprocal".
        coat: whether there is a coat, which absorbs above the body; if left out, where it makes the
            error smaller by 2 %. As MaterialX puts layers together it never does.
        progress: called with the pairs of angles, then with the fits that are done.

    Returns:
        `OpenPBRFit`: least squares of the reflectance factor in linear RGB over all pairs of
        angles, by their cosines.

    Raises:
        ValueError: an unknown layering, or what `angular_colour` refuses.
    """
    if layering not in LAYERINGS:
        raise ValueError(f"layering is {layering!r}; choose {', '.join(LAYERINGS)}")
    truth = glaze
    if not isinstance(truth, AngularColour):
        truth = angular_colour(
            truth,
            wavelengths_nm,
            roughness=roughness,
            space=space,
            illuminant=illuminant,
            observer=observer,
            tolerance=tolerance,
            progress=progress,
        )
    kinds = (False, True) if coat is None else (coat,)
    starts = len(_ROUGHNESSES) * sum(len(_TINTS) if coated else 1 for coated in kinds)
    note = counted(progress, starts, "fitting the material")
    cost = np.inf
    material = OpenPBR()
    for coated in kinds:
        trial_cost, trial = _fit_lobes(truth, layering, coated, note)
        # A coat must make the error smaller by 2 % of it, or it is left out; 1.5e-8 is half a sum
        # of squares that no coat is worth: a root mean square of 1e-4 in three channels.
        if trial_cost < cost * (1 - 0.02) ** 2 - 1.5e-8:
            cost = trial_cost
            material = trial
    material = _round_numbers(material)
    naive = naive_openpbr(truth)
    body_colours = truth.body[truth.views, truth.views]
    return OpenPBRFit(
        material=material,
        layering=layering,
        truth=truth,
        errors=material_errors(material, truth, layering),
        naive=naive,
        naive_errors=material_errors(naive, truth, layering),
        outside=float(outside(body_colours).mean()),
    )


def naive_openpbr(truth: AngularColour) -> OpenPBR:
    """Material written without a fit: the colour seen straight on, lit straight on, and the index
    as it is.
    """
    straight = truth.weights.size
    colour = np.clip(truth.body[straight, straight], 0.0, 1.0)
    surface = paint_surface(truth.refractive_index, truth.roughness)
    return replace(surface, base_color=colour_tuple(colour))


def material_errors(
    material: OpenPBR, truth: AngularColour, layering: Layering = "materialx"
) -> Errors:
    """Distances of a material of OpenPBR from a computed glaze."""
    cosines = truth.cosines
    factor = reflectance_factor(
        material,
        cosines[:, None, None],
        cosines[:, None],
        _AZIMUTHS,
        layering=layering,
        gloss=False,
    )
    lit = 2.0 * truth.weights * cosines[truth.nodes]
    missed = (factor - truth.body[:, :, None])[truth.nodes, truth.nodes]
    rms = np.sqrt(np.einsum("ioac,i,o->", missed**2, lit, lit) / missed.shape[2] / 3)
    views = truth.views
    sky = directional_albedo(material, cosines[views], layering=layering)
    true_sky = truth.directional_albedo()[views]
    lamp = truth.weights.size + VIEWS.index(45.0)
    under_sky = delta_e(sky, true_sky, truth.space)
    under_lamp = delta_e(factor[lamp, views].mean(axis=1), truth.body[lamp, views], truth.space)
    return Errors(
        albedo=float(np.max(np.abs(sky - true_sky))),
        rms=float(rms),
        sky=float(under_sky.mean()),
        sky_most=float(under_sky.max()),
        lamp=float(under_lamp.mean()),
        lamp_most=float(under_lamp.max()),
    )


def _fit_lobes(
    truth: AngularColour, layering: Layering, coated: bool, note: Callable[[], object]
) -> tuple[float, OpenPBR]:
    """The best of all starts: its cost and material; `note` is called after each.

    Unknown are the colour of the body and its roughness, then the colour of the coat and its
    darkening.
    """
    from scipy.optimize import least_squares

    surface = paint_surface(truth.refractive_index, truth.roughness, coated=coated)
    cosines = truth.cosines[truth.nodes]
    lit = 2.0 * truth.weights * cosines
    share = np.sqrt(lit)
    shares = share[:, None, None, None] * share[:, None, None] / np.sqrt(_FIT_AZIMUTHS.size)
    body = truth.body[truth.nodes, truth.nodes][:, :, None]
    low = np.array([0.0] * 4 + ([1e-3] * 3 + [0.0] if coated else []))

    def material(x: Float[np.ndarray, "unknowns"]) -> OpenPBR:
        matt = replace(surface, base_color=colour_tuple(x[:3]), base_diffuse_roughness=float(x[3]))
        if not coated:
            return matt
        return replace(matt, coat_color=colour_tuple(x[4:7]), coat_darkening=float(x[7]))

    def residuals(x: Float[np.ndarray, "unknowns"]) -> Float[np.ndarray, "residuals"]:
        factor = reflectance_factor(
            material(x),
            cosines[:, None, None],
            cosines[:, None],
            _FIT_AZIMUTHS,
            layering=layering,
            gloss=False,
        )
        return ((factor - body) * shares).ravel()

    mean = np.clip(np.einsum("ioac,i,o->c", body, lit, lit), 0.02, 0.95)
    coats = [[tint, tint, tint, 0.5] for tint in _TINTS] if coated else [[]]
    solutions = []
    for coat, rough in itertools.product(coats, _ROUGHNESSES):
        start = np.array([*mean, rough, *coat])
        solutions.append(least_squares(residuals, start, bounds=(low, 1.0)))
        note()
    best = min(solutions, key=lambda solution: solution.cost)
    return float(best.cost), material(best.x)


def _round_numbers(material: OpenPBR) -> OpenPBR:
    """Without digits that no file needs: six behind the point, so that what is written is what was
    measured.
    """
    short = {
        name: tuple(round(v, 6) for v in value) if isinstance(value, tuple) else round(value, 6)
        for name, value in material.parameters().items()
    }
    return OpenPBR(**short)  # pyright: ignore[reportArgumentType]


def colour_tuple(values: Float[np.ndarray, "3"]) -> Colour:
    """A colour as `OpenPBR` takes it."""
    red, green, blue = values.tolist()
    return red, green, blue
