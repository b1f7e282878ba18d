"""Spectra that no paints explain: gathered window by window, then brought to a few that may be
paints of their own, the purest first.

The purest are found by successive projection (Araujo et al., Chemom. Intell. Lab. Syst. 57 (2001)
65): the spectrum farthest from the bare ground comes first, each next one is farthest from all that
films of those before it, thinner and mixed, would read.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from scipy.optimize import nnls

from glazejax import Pigment
from glazejax.geometry import Instrument
from glazejax.spectra import Bands

from ..store.chunk import Unexplained
from .features import SpectraFeatures, SpectraReadings, group_means, nearest, spread_out
from .spots import spot_pigment

SPOTS = 10
"""Spectra that are offered as paints, at most."""
# Cosine of two spectra of -log R that have one shape, and of those that are averaged.
_ALIKE = 0.97
# Added to reflectances, so that noise near black does not decide.
_BLACK = 0.01


def gather(
    readings: SpectraReadings,
    features: SpectraFeatures,
    places: Int[np.ndarray, "spectra 2"],
) -> Unexplained:
    """Spectra of one window in groups of like ones; the groups' middles reach its extremes.

    Args:
        readings: that no set explains.
        features: by which they are compared, `survey.Features`.
        places: (y, x) of each.
    """
    if not len(readings):
        return Unexplained.nothing()
    # Groups of a window, and how far spectra of one group lie from its middle, in standard
    # deviations of paint's errors.
    chosen = spread_out(features, 64, 2.0)
    which, _ = nearest(features, features[chosen])
    used, pixels = np.unique(which, return_counts=True)
    return Unexplained(
        pixels=pixels,
        readings=group_means(readings, which),
        places=places[chosen[used]],
    )


@dataclass(frozen=True)
class UnexplainedSpot:
    """A spectrum that may be a paint's.

    Attributes:
        name: of the paint that it would be.
        pixels: of all unexplained spectra of its shape.
        place: (y, x) of a pixel where it lies.
        reading: at the working bands.
    """

    name: str
    pixels: int
    place: tuple[int, int]
    reading: Bands


def choose_spots(
    unexplained: Unexplained,
    bare: Bands,
    mapped: float,
    paint_names: Sequence[str] = (),
) -> list[UnexplainedSpot]:
    """The purest of spectra that no paints explain.

    Args:
        unexplained: of all windows.
        bare: what the ground reads without paint; 1 where films hide it.
        mapped: pixels that were mapped: a spot needs a share of them.
        paint_names: names that paints have already.
    """
    if not len(unexplained.pixels):
        return []
    # Groups that are compared at a time.
    largest = np.argsort(-unexplained.pixels, kind="stable")[:2000]
    pixels = unexplained.pixels[largest]
    depth = np.log((bare + _BLACK) / (np.maximum(unexplained.readings[largest], 0.0) + _BLACK))
    size = np.linalg.norm(depth, axis=1)
    shape = depth / np.maximum(size, 1e-9)[:, None]
    cosines = shape @ shape.T
    # Share of the mapped pixels, and number, that a spot needs.
    enough = (cosines > _ALIKE) @ pixels >= max(4, 2e-4 * mapped)
    names = (name for n in itertools.count(1) if (name := f"Spot{n}") not in paint_names)
    spots: list[UnexplainedSpot] = []
    ends = np.zeros((depth.shape[1], 0))
    while len(spots) < SPOTS:
        residuals = np.array([nnls(ends, spectrum)[1] for spectrum in depth]) if ends.size else size
        residuals = np.where(enough, residuals, 0.0) / np.sqrt(depth.shape[1])
        purest = int(np.argmax(residuals))
        # Root mean square of -log R below which spots before it explain a spectrum.
        if residuals[purest] < 0.12:
            break
        # Those that are averaged: one shape, and nearly the length of the purest.
        averaged = (cosines[purest] > 0.995) & (size > 0.9 * size[purest])
        weight = np.where(averaged, pixels, 0) / pixels[averaged].sum()
        y, x = unexplained.places[largest[purest]].tolist()
        spots.append(
            UnexplainedSpot(
                name=next(names),
                pixels=int(pixels[cosines[purest] > _ALIKE].sum()),
                place=(y, x),
                reading=weight @ unexplained.readings[largest],
            )
        )
        ends = np.column_stack([ends, weight @ depth])
    return spots


def spot_paints(
    spots: Mapping[str, Bands],
    wavelengths: Bands,
    ends: tuple[float, float],
    paints: Sequence[Pigment],
    instrument: Instrument,
) -> list[Pigment]:
    """Paints that read as spots do where they hide their ground: k/s from the spectrum, s pooled
    over the paints that are known; see `spot_pigment`.

    Args:
        spots: readings by name.
        wavelengths: of their readings, nm.
        ends: first and last wavelength of the image: beyond the outermost readings k and s go on
            as there.
        paints: of the catalogue.
        instrument: that read the image.
    """
    grid = np.unique(np.clip([ends[0], *wavelengths, ends[1]], *ends))
    pigments = []
    for name, spot in spots.items():
        # No hiding paint reads less than its surface, or more than all light.
        reading = np.clip(spot, instrument.seen_surface, 1.0)
        reading = np.interp(grid, wavelengths, reading)
        pigments.append(spot_pigment(name, grid, reading, paints, instrument))
    return pigments
