"""Colour difference as a length: the quadratic form of CIEDE2000 around a colour, or a spectrum."""

import numpy as np
from jaxtyping import Float

from glazejax.colour import delta_e_2000, lab
from glazejax.spectra import Bands


def lab_metric(colour: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Matrix M such that ``M @ step`` is as long as the CIEDE2000 difference of a small step around
    a colour.

    The squared difference of six small steps, by colour-science, gives the quadratic form; M is its
    Cholesky factor.
    """
    size = 0.02
    unit = size * np.eye(3)
    colour = np.asarray(colour, float)

    def square(move: Float[np.ndarray, "3"]) -> np.ndarray:
        # Symmetric around the colour: the formula takes its weights at the mean of both.
        return (delta_e_2000(colour - move / 2, colour + move / 2) / size) ** 2

    form = np.zeros((*colour.shape[:-1], 3, 3))
    for i in range(3):
        form[..., i, i] = square(unit[i])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        cross = (square(unit[i] + unit[j]) - form[..., i, i] - form[..., j, j]) / 2
        form[..., i, j] = form[..., j, i] = cross
    return np.swapaxes(np.linalg.cholesky(form + 1e-9 * np.eye(3)), -1, -2)


def reading_metric(
    wavelengths: Bands, readings: Float[np.ndarray, "spectra bands"]
) -> Float[np.ndarray, "spectra colours bands"]:
    """T for each spectrum, so that |T d| is Delta E00 (D65, 10 degrees) to the spectrum moved by a
    small d.

    Where the bands give no colour, a hundred times the root mean square.
    """
    count, bands = readings.shape
    try:
        base = np.asarray(lab(wavelengths, readings, observer=10))
    except ValueError:
        return np.tile(100.0 / np.sqrt(bands) * np.eye(bands), (count, 1, 1))
    shifted = readings[:, None] + 1e-3 * np.eye(bands)
    by_reading = (np.asarray(lab(wavelengths, shifted, observer=10)) - base[:, None]) / 1e-3
    return lab_metric(base) @ np.swapaxes(by_reading, 1, 2)
