"""Spots of an image as paints: those that the user names, and the purest of what no paints explain.
Spectra of the latter are gathered window by window, then brought to a few.

The purest are found by successive projection (Araujo et al., Chemom. Intell. Lab. Syst. 57 (2001)
65): the spectrum farthest from the bare ground comes first, each next one is farthest from all that
films of those before it, thinner and mixed, would read.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Int
from scipy.optimize import nnls

from glazejax import Pigment
from glazejax.geometry import Instrument
from glazejax.spectra import Bands

from ...film.model.response import film_response
from ...identify.families.templates import hiding_ratio
from ..store.chunk import Unexplained
from .features import SpectraFeatures, SpectraReadings, group_means, nearest, spread_out

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
        features: by which they are compared, `features.Features`.
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


def choose_spots(
    unexplained: Unexplained,
    bare: Bands,
    mapped: float,
    paint_names: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """The purest of spectra that no paints explain.

    Args:
        unexplained: of all windows.
        bare: what the ground reads without paint; 1 where films hide it.
        mapped: pixels that were mapped: a spot needs a share of them.
        paint_names: names that paints have already.

    Returns:
        Of each ``name``, of the paint that it would be; ``pixels``, of all unexplained spectra of
        its shape; ``place``, (y, x) of a pixel where it lies; and ``reading`` at the working bands.
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
    spots: list[dict[str, Any]] = []
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
        spots.append(
            {
                "name": next(names),
                "pixels": int(pixels[cosines[purest] > _ALIKE].sum()),
                "place": unexplained.places[largest[purest]].tolist(),
                "reading": weight @ unexplained.readings[largest],
            }
        )
        ends = np.column_stack([ends, weight @ depth])
    return spots


def spot_pigment(
    name: str,
    wavelengths: Bands,
    spectrum: ArrayLike,
    pigments: Sequence[Pigment],
    instrument: Instrument,
) -> Pigment:
    """A paint whose thick, hiding film reads a spectrum.

    The spectrum fixes k/s at every wavelength. It does not fix how strongly the paint
    scatters: s is the median of the catalogue's, the same at all wavelengths, with a standard
    deviation of half of it.

    Args:
        name: of the paint.
        wavelengths: (bands,), nm.
        spectrum: reflectance as fractions, (bands,).
        pigments: of the catalogue.
        instrument: that read the spectrum.

    Raises:
        ValueError: a spectrum of another length, or readings that no hiding film has.
    """
    read = np.asarray(spectrum, float)
    if read.shape != wavelengths.shape:
        raise ValueError(
            f"the spot {name!r} has {read.size} readings, the image {wavelengths.size} bands"
        )
    body = read - instrument.seen_surface
    wrong = read[~((body > -0.02) & (read < 1.2))]
    if wrong.size:
        raise ValueError(
            f"the spot {name!r} reads {wrong[0]:g}; a hiding paint reads from "
            f"{instrument.seen_surface:.3f} (its surface) to 1.2: is the spot in focus, and the "
            "image calibrated?"
        )
    ratio = hiding_ratio(film_response(instrument), body[None])[0]
    scattering = (
        float(np.median([np.median(np.asarray(p.scattering)) for p in pigments]))
        if pigments
        else 1e5
    )
    s = np.full(wavelengths.shape, scattering)
    # Relative standard deviations: .5 of s, which a hiding film leaves open, and .05 more of k.
    return Pigment(
        name,
        wavelengths,
        ratio * s,
        s,
        absorption_sd=ratio * s * np.hypot(0.5, 0.05),
        scattering_sd=0.5 * s,
        provenance="spectrum of a spot in the image, taken as thick paint",
    )


def with_spots(
    paints: Sequence[Pigment],
    spots: Mapping[str, ArrayLike],
    wavelengths: Bands,
    instrument: Instrument,
) -> list[Pigment]:
    """Paints, and spots as further ones; see `spot_pigment`.

    Args:
        paints: of the catalogue.
        spots: their spectra by name.
        wavelengths: of these, nm.
        instrument: that read them.
    """
    return [
        *paints,
        *(
            spot_pigment(name, wavelengths, spectrum, paints, instrument)
            for name, spectrum in spots.items()
        ),
    ]
