"""Prior of an unknown paint's k and s: smooth spectra of about the catalogue's size.

log k d and log s d are each a Gaussian process of the wavelength: a level, and a shape about it
with the Matern-5/2 correlation (1 + x + x^2/3) exp(-x), x = sqrt(5) |l - l'| / length. As unknowns
they are sums of the process's principal modes with standard normal weights; what the modes leave
out is less than a fiftieth of k or s.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from glazejax.spectra import Bands

from ..film.model.errors import principal_modes


@dataclass(frozen=True)
class SpectraPrior:
    """Prior of log k d and log s d of a coat of unknown paint.

    The defaults describe the twenty oil paints of the catalogue in films of 25 um. There log k d is
    -.9 with a standard deviation of 3.6, log s d .4 with 1.9; half the mean square of log k's
    difference between bands 10, 50 and 160 nm apart is .04, 1.0 and 6.4, that of log s .001, .03
    and .22. The prior lets s vary twice as much: few paints are known, and a prior that is too
    narrow misleads where one too wide only constrains less.

    Attributes:
        absorption, scattering: medians of k d and s d.
        absorption_level, scattering_level: standard deviations of the logarithm's level.
        absorption_shape, scattering_shape: standard deviations of what is added to it, band by
            band.
        length: wavelengths over which the shape changes, nm.

    Raises:
        ValueError: a value that is not positive.
    """

    absorption: float = 0.4
    scattering: float = 1.7
    absorption_level: float = 1.5
    scattering_level: float = 1.75
    absorption_shape: float = 3.5
    scattering_shape: float = 1.5
    length: float = 150.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < np.inf:
                raise ValueError(f"the spectra's {name} is {value:g}; it must be positive")

    def modes(self, wavelengths: Bands) -> Float[np.ndarray, "2 bands modes"]:
        """Slopes of log k d and of log s d by the weights of all modes: those of k d first, each
        scaled by its standard deviation, largest first; a mode is of one of the two.
        """
        distance = np.sqrt(5.0) * np.abs(wavelengths[:, None] - wavelengths) / self.length
        correlation = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)

        def principal(level_sd: float, shape: float) -> np.ndarray:
            scaled = principal_modes(level_sd**2 + shape**2 * correlation)[::-1].T
            # Variance of each band that the modes from the n-th on carry.
            remainder = np.cumsum((scaled**2)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
            return scaled[:, : max(1, np.count_nonzero(remainder > 0.02**2))]

        k = principal(self.absorption_level, self.absorption_shape)
        s = principal(self.scattering_level, self.scattering_shape)
        return np.asarray(block_diag(k, s)).reshape(2, wavelengths.size, -1)
