"""A paint from its own spectrum in an image: what one spectrum says of k and s, and what it leaves
open.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import ArrayLike

from glazejax import Pigment
from glazejax.geometry import Instrument
from glazejax.spectra import Bands

from ...film.model.response import film_response
from ...identify.families.templates import hiding_ratio


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
