"""Paints whose strength is not known: charts of shades, prints and washes, where neither film nor
ground is given.

What is left of a paint when its strength varies is the shape of its absorbance. With a lighting
that is not known either, and little paint,

    -log R(l) = offset + strength * absorbance(l) + error(l)

so that two spectra of one paint are related by a straight line, band by band. The error, correlated
over the bands, is what reference shades of one paint leave when they are fitted to each other; its
covariance is learnt from them. An offset and a positive strength are fitted by generalised least
squares; the size of what is left, compared between paints, gives their probabilities.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import ArrayLike, Float

# Darkest reading that is believed; a camera's dark level.
_DARKEST = 0.004
_ROUNDS = 3
# White noise added to the learnt covariance, as a share of its mean variance.
_RIDGE = 1e-3


@dataclass(frozen=True)
class ShadeMatch:
    """How spectra compare with the paints of a library.

    Attributes:
        names: of the paints.
        misfit: of the best reference shade of each paint, relative to the spectrum's own size,
            (spectra, paints).
        probability: posterior of each paint, (spectra, paints).
    """

    names: tuple[str, ...]
    misfit: Float[np.ndarray, "spectra paints"]
    probability: Float[np.ndarray, "spectra paints"]

    @property
    def best(self) -> list[str]:
        """Most probable paint of each spectrum."""
        return [self.names[i] for i in self.probability.argmax(axis=1)]


class ShadeLibrary:
    """Paints known by some shades each.

    Args:
        names: of the paints, all different.
        wavelengths: (bands,), nm.
        shades: reflectance, (paints, shades, bands), two shades of each paint at least.
    """

    def __init__(
        self, names: list[str] | tuple[str, ...], wavelengths: ArrayLike, shades: ArrayLike
    ):
        self.names = tuple(names)
        self.wavelengths = np.asarray(wavelengths)
        self._absorbance = _absorbance(np.asarray(shades, dtype=np.float64))
        self._white = _learn(self._absorbance)
        self._sharpness = self._learn_sharpness()

    def match(self, spectra: ArrayLike) -> ShadeMatch:
        """Compare spectra, (spectra, bands) on the library's wavelengths, with every paint."""
        absorbance = _absorbance(np.asarray(spectra, dtype=np.float64))
        misfit = _misfit(absorbance, self._absorbance, self._white).min(axis=-1)
        return ShadeMatch(self.names, misfit, _probability(misfit, self._sharpness))

    def _learn_sharpness(self) -> float:
        """Exponent of the misfit in the likelihood under which reference shades are most probable.

        Independent errors in n bands would give n/2; errors that the covariance does not describe
        leave fewer.
        """
        paints, shades, _ = self._absorbance.shape
        every = []
        for held in range(shades):
            others = [i for i in range(shades) if i != held]
            misfit = _misfit(self._absorbance[:, held], self._absorbance[:, others], self._white)
            every.append(misfit.min(axis=-1))
        misfit = np.concatenate(every)
        own = np.tile(np.arange(paints), shades)
        exponents = np.geomspace(0.5, self.wavelengths.size, 60)
        score = [
            np.log(_probability(misfit, n)[np.arange(own.size), own] + 1e-12).mean()
            for n in exponents
        ]
        return float(exponents[int(np.argmax(score))])


def _absorbance(reflectance: np.ndarray) -> np.ndarray:
    return -np.log(np.maximum(reflectance, _DARKEST))


def _learn(
    absorbance: Float[np.ndarray, "paints shades bands"],
) -> Float[np.ndarray, "bands bands"]:
    """Whitening matrix of what lines between shades of one paint leave, as shares of its size."""
    _, shades, bands = absorbance.shape
    white = np.eye(bands)
    pairs = [(i, k) for i in range(shades) for k in range(shades) if i != k]
    for _ in range(_ROUNDS):
        left = []
        for i, k in pairs:
            offset, strength = _line(
                absorbance[:, k] @ white.T, absorbance[:, i] @ white.T, white.sum(axis=1)
            )
            off = absorbance[:, k] - offset[:, None] - strength[:, None] * absorbance[:, i]
            left.append(off / np.sqrt(np.mean(off**2, axis=1, keepdims=True) + 1e-6))
        stacked = np.concatenate(left)
        covariance = stacked.T @ stacked / len(stacked)
        covariance += np.eye(bands) * (_RIDGE * np.trace(covariance) / bands)
        white = np.linalg.inv(np.linalg.cholesky(covariance))
    return white


def _line(y: np.ndarray, x: np.ndarray, one: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Offset and strength of y = offset + strength x in whitened bands, row by row."""
    unit = one / (one @ one)
    x_free, y_free = x - np.outer(x @ unit, one), y - np.outer(y @ unit, one)
    strength = np.sum(x_free * y_free, axis=1) / np.maximum(np.sum(x_free**2, axis=1), 1e-30)
    return (y - strength[:, None] * x) @ unit, strength


def _misfit(
    spectra: Float[np.ndarray, "spectra bands"],
    shades: Float[np.ndarray, "paints shades bands"],
    white: Float[np.ndarray, "bands bands"],
) -> Float[np.ndarray, "spectra paints shades"]:
    """Share of a spectrum's whitened variation that the line through a shade does not explain, in
    [0, 1].
    """
    one = white.sum(axis=1)
    one = one / np.linalg.norm(one)
    y, x = spectra @ white.T, shades @ white.T
    y = y - np.outer(y @ one, one)
    x = x - (x @ one)[..., None] * one
    product = np.einsum("sb,pkb->spk", y, x, optimize=True)
    # A paint's absorbance cannot be negative: against the grain explains nothing.
    explained = np.maximum(product, 0.0) ** 2 / np.maximum(np.sum(x**2, axis=-1), 1e-30)
    whole = np.maximum(np.sum(y**2, axis=1), 1e-30)[:, None, None]
    return np.clip(1.0 - explained / whole, 1e-9, 1.0)


def _probability(
    misfit: Float[np.ndarray, "spectra paints"], exponent: float
) -> Float[np.ndarray, "spectra paints"]:
    """Equal paints a priori, and Gaussian errors of a size that is not known: likelihood
    misfit^-exponent.
    """
    height = -exponent * np.log(misfit)
    height -= height.max(axis=1, keepdims=True)
    weight = np.exp(height)
    return weight / weight.sum(axis=1, keepdims=True)
