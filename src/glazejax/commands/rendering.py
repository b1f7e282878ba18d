"""A glaze compared with its ground, its layers alone, and a ladder of
layers.

The ladder repeats one layer of the glaze n times and sets three ways of using the same paint side
by side:

glaze
    n coats, one over the other, solved as a stack. Equal coats that share one refractive index are
    the same as one coat of n times the thickness, so each step costs no more than the glaze itself.
multiply
    what the blend mode of that name does in digital painting, band by band: one coat alone on the
    bare ground turns R_ground into R_1, so each coat lets through R_1/R_ground of what is below,
    and n of them show R_n = R_0 (R_1/R_ground)^n. R_0 is what lies below the coats: the ground
    itself if there is one layer only. Multiplying never brightens: a ratio above 1 counts as 1.
mixing
    n portions of the same paint stirred into opaque paint that by itself looks like what lies below
    the layer. One portion of colour meets as much of that opaque paint as brings the mixture
    nearest (Delta E 1976) to the first coat; coefficients of mixed paint add.

All three begin with the same R_0; over bare ground, multiply has the same first coat too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from ..colour import CIE_1931, lab, srgb
from ..geometry import Geometry
from ..paint.media import MAX_THICKNESS, Glaze, Layer, Pigment
from ..reflectance import reflectance
from ..spectra import Bands

Counts: TypeAlias = Int[np.ndarray, "steps"]
"""Numbers of coats."""

Reflectances: TypeAlias = Float[np.ndarray, "... bands"]
"""Spectra of any number of things."""

Steps: TypeAlias = Float[np.ndarray, "steps bands"]
"""Spectra of the steps of a ladder."""


@dataclass(frozen=True)
class Ladder:
    """Spectra against the number of coats, three ways.

    Attributes:
        counts: (steps,), numbers of coats, 0 first.
        glaze, multiply, mixing: (steps, bands), reflectance; see the module.
        capped: whether the thickest coats were cut off at the thickest layer possible, 10 mm.
    """

    counts: Counts
    glaze: Steps
    multiply: Steps
    mixing: Steps
    capped: bool


@dataclass(frozen=True)
class Rendering:
    """Spectra of a glaze and of what it is compared with, all as the same instrument sees them.

    Attributes:
        wavelengths: (bands,), nm.
        glaze: (bands,), reflectance of the whole stack.
        ground: (bands,), of the bare ground under the same smooth surface.
        alone: (layers, bands), of each layer alone on the ground.
        ladder: one layer repeated.
        illuminant, observer: of every colour, full names.
    """

    wavelengths: Bands
    glaze: Bands
    ground: Bands
    alone: Float[np.ndarray, "layers bands"]
    ladder: Ladder
    illuminant: str
    observer: str

    @property
    def light(self) -> dict[str, Any]:
        """Arguments of the colour functions."""
        return {"illuminant": self.illuminant, "observer": self.observer}

    @property
    def eye(self) -> str:
        """Illuminant and observer in words, such as ``D65, CIE 1931 2° observer``."""
        return (
            f"{self.illuminant}, {self.observer.replace(' Degree Standard Observer', '° observer')}"
        )

    def lab(self, spectra: Reflectances) -> Float[np.ndarray, "... 3"]:
        """CIE L*a*b* of spectra."""
        return np.asarray(lab(self.wavelengths, spectra, **self.light))

    def rgb(self, spectra: Reflectances, *, clip: bool = True) -> Float[np.ndarray, "... 3"]:
        """Encoded sRGB of spectra."""
        return np.asarray(srgb(self.wavelengths, spectra, clip=clip, **self.light))


def render(
    glaze: Glaze,
    geometry: Geometry,
    *,
    layer: int,
    coat: float,
    coats: int = 40,
    illuminant: str = "D65",
    observer: str = CIE_1931,
    tolerance: float = 1e-6,
) -> Rendering:
    """Compute a glaze, its ground, its layers and its ladder in one batch of the solver.

    Args:
        glaze: one glaze, without batch axes, of one layer at least.
        geometry: what the instrument does.
        layer: which layer the ladder repeats, counted from 0 at the top.
        coat: thickness of one coat of the ladder in m.
        coats: longest stack of the ladder.
        illuminant, observer: of every colour, full names; mixing is matched under them to the first
            coat.
        tolerance: of the solver.

    Raises:
        ValueError: what `reflectance` and `lab` refuse.
    """
    grid = glaze.wavelengths
    count = len(glaze.coats)
    thickness = np.array([float(each.thickness) for each in glaze.coats])
    counts = np.arange(coats + 1)
    # Rows of one batch: the whole stack, the bare ground, each layer alone, one coat alone, then
    # the ladder.
    coat_alone = np.where(np.arange(count) == layer, coat, 0.0)
    ladder = np.tile(thickness, (coats + 1, 1))
    ladder[:, layer] = np.minimum(counts * coat, MAX_THICKNESS)
    rows = np.concatenate(
        [np.stack([thickness, 0 * thickness]), np.diag(thickness), coat_alone[None], ladder]
    )
    # Values of (1 - albedo)^(1/4) that fill whole rows of bands: the fourth root, because the
    # reflectance of opaque paint starts as 1 - c sqrt(1 - albedo). Of 400 entries at least, linear
    # interpolation between them leaves an error of R of 1e-5.
    size = -(-400 // grid.size) * grid.size
    paleness = np.linspace(0.0, 1.0, size).reshape(-1, grid.size)
    values = np.asarray(reflectance(_batch(glaze, rows, paleness), geometry, tolerance=tolerance))
    spectra = values[: len(rows)]
    # Reflectance of opaque paint falls as it grows less pale; the last, of black, is what the outer
    # surface reflects, if the instrument includes that.
    opaque = paleness.ravel(), values[len(rows) :].ravel()
    ground = spectra[1]
    steps = spectra[3 + count :]
    # R_0 (R_1/R)^n, each without the reflection from the surface, which no coat below it can
    # change.
    surface = opaque[1][-1]
    bare, first, below = np.clip(spectra[[1, 2 + count, 3 + count]] - surface, 0.0, None)
    ratio = np.minimum(first, bare) / np.where(bare > 0, bare, 1.0)
    multiply = surface + below * np.where(bare > 0, ratio, 1.0) ** counts[:, None]
    medium = glaze.coats[layer].medium
    portion = np.stack([np.asarray(medium.absorption), np.asarray(medium.scattering)]) * coat
    colour = partial(lab, grid, illuminant=illuminant, observer=observer)
    mixing = _mixing(*opaque, portion, steps[0], steps[1], counts, colour)
    return Rendering(
        wavelengths=grid,
        glaze=spectra[0],
        ground=ground,
        alone=spectra[2 : 2 + count],
        ladder=Ladder(
            counts=counts,
            glaze=steps,
            multiply=multiply,
            mixing=mixing,
            capped=coats * coat > MAX_THICKNESS,
        ),
        illuminant=illuminant,
        observer=observer,
    )


def _batch(
    glaze: Glaze,
    thickness: Float[np.ndarray, "stacks layers"],
    paleness: Float[np.ndarray, "rows bands"],
) -> Glaze:
    """Every stack wanted as one glaze with a batch axis; the last rows are opaque paints on a white
    ground.
    """
    bands = glaze.wavelengths.size
    opaque = len(paleness)
    # The thickest coat possible is what makes this extinction opaque.
    extinction = 1e4 / MAX_THICKNESS
    coats = []
    for i, coat in enumerate(glaze.coats):
        mine = thickness[:, i]
        k, s = (
            np.broadcast_to(c, (len(mine), bands))
            for c in (coat.medium.absorption, coat.medium.scattering)
        )
        # An opaque paint is the uppermost layer of its row, and the only one.
        there = float(i == 0)
        k = np.concatenate([k, there * extinction * paleness**4])
        s = np.concatenate([s, there * extinction * (1 - paleness**4)])
        depth = np.concatenate([mine, np.full(opaque, there * MAX_THICKNESS)])
        coats.append(Layer(Pigment(coat.medium.name, glaze.wavelengths, k, s), depth))
    ground = np.broadcast_to(glaze.ground, (len(thickness), bands))
    return Glaze(coats, np.concatenate([ground, np.ones((opaque, bands))]), glaze.refractive_index)


def _mixing(
    paleness: Float[np.ndarray, "entries"],
    opaque: Float[np.ndarray, "entries"],
    portion: Float[np.ndarray, "2 bands"],
    base: Bands,
    first: Bands,
    counts: Counts,
    colour: Callable[..., Any],
) -> Steps:
    """n portions of paint, given as k d and s d, stirred into an opaque paint that looks like
    `base`; `colour` gives the Lab of spectra.
    """
    absorbing = portion[0]
    depth = portion.sum(axis=0)
    below = np.interp(base, opaque[::-1], paleness[::-1]) ** 4

    def mix_part(n: Int[np.ndarray, "... 1"], amount: Float[np.ndarray, "... 1"]) -> Reflectances:
        pale = ((n * absorbing + amount * below) / (n * depth + amount)) ** 0.25
        return np.interp(pale, paleness, opaque)

    scale = float(depth.max()) or 1.0
    amounts = scale * np.logspace(-4, 6, 2001)[:, None]
    one_portion = mix_part(np.ones(1, int), amounts)
    distance = np.linalg.norm(np.asarray(colour(one_portion)) - np.asarray(colour(first)), axis=-1)
    mixed = mix_part(counts[:, None], amounts[distance.argmin()])
    mixed[0] = base  # What is below may be brighter than any paint; then only this step shows it.
    return mixed
