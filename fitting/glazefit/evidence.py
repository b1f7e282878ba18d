"""How probable a spectrum is: errors of the instrument and of the model, and what is expected beforehand.

Measured minus computed reflectance of films that were left out of a fit is ten times what the instrument's noise
explains, smooth in the wavelength, and much the same over a black and a white card. So errors are Gaussian with

    covariance = noise^2 I + amplitude^2 (shared + (1 - shared) I)_grounds x exp(-(l - l')^2 / 2 length^2) + gloss

and the amplitude itself is uncertain: probabilities are summed over some values of it, which gives them the tails that
paint needs. The last term lets the surface's reflection vary between films.

`Nothing in the catalogue` competes on the same terms: any smooth spectrum, without a paint behind it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Discrepancy:
    """Errors of the model: smooth in wavelength, common to the grounds.

    Attributes:
        amplitude: standard deviation in reflectance.
        length: over which they stay alike, nm.
        shared: correlation between grounds, in [0, 1].
        scales, weights: factors of the amplitude, and how probable each is.
        gloss, gloss_sd: share of the surface's reflection that is seen, and how it varies between films.

    Raises:
        ValueError: a value out of range.
    """

    amplitude: float = 0.01
    length: float = 40.0
    shared: float = 0.8
    scales: tuple[float, ...] = (0.4, 1.0, 2.5)
    weights: tuple[float, ...] = (0.35, 0.45, 0.2)
    gloss: float = 0.97
    gloss_sd: float = 0.1

    def __post_init__(self) -> None:
        for name in ("amplitude", "length", "gloss", "gloss_sd"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0 and (value > 0 or name != "length")):
                raise ValueError(f"the discrepancy's {name} is {value:g}; it must be positive")
        if not 0 <= self.shared <= 1:
            raise ValueError(f"the discrepancy's shared is {self.shared:g}; a correlation lies in [0, 1]")
        if len(self.scales) != len(self.weights) or not self.scales or min(*self.scales, *self.weights) <= 0:
            raise ValueError("the discrepancy needs as many weights as scales, all positive")


@dataclass(frozen=True)
class Prior:
    """What is expected before the measurement.

    Attributes:
        thickness: median, m.
        spread: standard deviation of its logarithm.
        concentration: of the fractions' Dirichlet distribution; 1 is uniform, less prefers unequal ones.
        sizes: how probable films of one, two, three paints are.
        stacked: probability of two coats, where they are tried.
        unknown: probability that paints of the catalogue do not explain the film.

    Raises:
        ValueError: a value out of range.
    """

    thickness: float = 25e-6
    spread: float = 0.7
    concentration: float = 1.0
    sizes: tuple[float, ...] = (0.35, 0.4, 0.25)
    stacked: float = 0.3
    unknown: float = 0.05

    def __post_init__(self) -> None:
        if not 0 < self.thickness <= 0.01:
            raise ValueError(f"a usual thickness of {self.thickness:g} m is not in (0, 0.01]; it is in metres")
        if not (self.spread > 0 and self.concentration > 0 and min(self.sizes) > 0):
            raise ValueError("spread, concentration and the probabilities of sizes must be positive")
        if not (0 < self.unknown < 1 and 0 < self.stacked < 1):
            raise ValueError("the probabilities `unknown` and `stacked` lie between 0 and 1")


def smooth_kernel(wavelengths: Float[np.ndarray, "bands"], length: float) -> Float[np.ndarray, "bands bands"]:
    """Correlation exp(-(l - l')^2 / 2 length^2) of errors at two wavelengths."""
    apart = (wavelengths[:, None] - wavelengths) / length
    return np.exp(-0.5 * apart**2)


def covariance(
    noise_sd: Float[np.ndarray, "*n grounds bands"],
    wavelengths: Float[np.ndarray, "bands"],
    surface: float,
    discrepancy: Discrepancy,
    scale: float,
) -> Float[np.ndarray, "*n readings readings"]:
    """Covariance of all readings of a film, ground by ground, about what the model reads."""
    *batch, grounds, bands = noise_sd.shape
    cards = discrepancy.shared + (1.0 - discrepancy.shared) * np.eye(grounds)
    smooth = np.kron(cards, smooth_kernel(wavelengths, discrepancy.length))
    fixed = (scale * discrepancy.amplitude) ** 2 * smooth + (discrepancy.gloss_sd * surface) ** 2
    variance = noise_sd.reshape(*batch, grounds * bands) ** 2
    return fixed + variance[..., None] * np.eye(grounds * bands)


def whitening(matrix: Float[np.ndarray, "*n r r"]) -> tuple[Float[np.ndarray, "*n r r"], Float[np.ndarray, "*n"]]:
    """W with W^T W the inverse of a covariance, and log det W - (r/2) log 2 pi, the height of the Gaussian."""
    factor = np.linalg.cholesky(matrix)
    inverse = np.linalg.inv(factor)
    height = -np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return np.tril(inverse), height - 0.5 * matrix.shape[-1] * np.log(2.0 * np.pi)


def log_none(
    readings: Float[np.ndarray, "spectra grounds bands"], wavelengths: Float[np.ndarray, "bands"]
) -> Float[np.ndarray, "spectra"]:
    """Log probability density of spectra as any smooth curve between 0 and 1.

    A curve of mean .3, with a level that varies by .2 and a shape of sd .15 and correlation over 40 nm, alike over both
    grounds but not the same.
    """
    spectra, grounds, bands = readings.shape
    cards = 0.7 + 0.3 * np.eye(grounds)
    shape = 0.15**2 * smooth_kernel(wavelengths, 40.0) + 0.2**2
    matrix = np.kron(cards, shape) + np.eye(grounds * bands) * 0.002**2
    white, height = whitening(matrix)
    off = (readings.reshape(spectra, -1) - 0.3) @ white.T
    return height - 0.5 * np.sum(off**2, axis=-1)
