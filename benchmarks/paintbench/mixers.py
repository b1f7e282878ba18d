"""Methods that predict mixtures from recipes, and amounts from readings of mixtures whose paints
are known: Kubelka-Munk with two constants, without and with pair terms, and unmixing of -log R.

All take films as hiding what is below them. They learn from pure paints and mixtures of one source.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares, minimize

from benchmarks.rivals.baselines import shares_of, unmix

from .spectra import bounded, hiding_ratio, hiding_reflectance


@dataclass(frozen=True, kw_only=True)
class Mixtures:
    """Films of known recipes on one grid.

    Attributes:
        wavelengths: (bands,), nm.
        readings: reflectance factors, (films, bands).
        fractions: of each paint, summing to one, (films, paints).
        paints: codes.
        names: of the films.
    """

    wavelengths: Float[np.ndarray, "bands"]
    readings: Float[np.ndarray, "films bands"]
    fractions: Float[np.ndarray, "films paints"]
    paints: tuple[str, ...]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: Sequence[int] | np.ndarray) -> "Mixtures":
        """Some of the films."""
        return Mixtures(
            wavelengths=self.wavelengths,
            readings=self.readings[rows],
            fractions=self.fractions[rows],
            paints=self.paints,
            names=tuple(self.names[int(i)] for i in np.arange(len(self))[rows]),
        )


@dataclass(frozen=True, kw_only=True)
class Predicted:
    """Predicted readings, a 90 % band, and the root mean square error that each film is expected to
    have; NaN where a method states none.
    """

    readings: Float[np.ndarray, "films bands"]
    low: Float[np.ndarray, "films bands"]
    high: Float[np.ndarray, "films bands"]
    expected: Float[np.ndarray, "films"]


class Mixer(Protocol):
    """A method that knows the paints of one source."""

    name: str

    def learn(self, films: Mixtures) -> None:
        """Take pure paints and mixtures."""
        ...

    def predict(self, recipes: Float[np.ndarray, "films paints"]) -> Predicted | None:
        """Readings of mixtures, or None where the method does not predict any."""
        ...

    def amounts(
        self, readings: Float[np.ndarray, "films bands"], there: np.ndarray
    ) -> Float[np.ndarray, "films paints"] | None:
        """Fractions of the paints that are there, (films, paints) booleans."""
        ...


# How far log S of a paint is from a white's a priori, and log K from that of its masstone alone;
# and how large a pair's term is compared with the sum of the pair's own.
_LOG_S_SD = 1.0
_PAIR_SD = 0.3
# Error of a reading that all methods count with.
_ERROR = 0.01
# Of a standard normal's 90 % interval.
_NINETY = 1.645


class KubelkaMunk:
    """Two constants for each paint and band, K and S, of films that hide their ground, fitted to
    all films of the source at once; the first white's S is 1.

    With pair terms K gains c_i c_j a_ij for pairs that were both seen in a film, with a in units of
    K_i + K_j drawn to 0. Its band is the root mean square of the fit's residuals at each band.
    """

    def __init__(self, pairs: bool = False):
        self.name = "Kubelka-Munk with pair terms" if pairs else "Kubelka-Munk"
        self._with_pairs = pairs

    def learn(self, films: Mixtures) -> None:
        """Fit K and S band by band."""
        self._paints = films.paints
        fractions = films.fractions
        count = len(films.paints)
        self._pairs = [
            (a, b)
            for a in range(count)
            for b in range(a + 1, count)
            if self._with_pairs and ((fractions[:, a] > 0) & (fractions[:, b] > 0)).any()
        ]
        readings = bounded(films.readings)
        brightest = self._brightest(readings, fractions)
        bands = readings.shape[1]
        self._log_k = np.empty((bands, count))
        self._log_s = np.empty((bands, count))
        self._pair = np.zeros((bands, len(self._pairs)))
        residuals = np.empty_like(readings)
        for band in range(bands):
            residuals[:, band] = self._fit_band(band, readings[:, band], fractions, brightest)
        self._sd = np.sqrt(np.mean(residuals**2, axis=0))

    def _brightest(self, readings: np.ndarray, fractions: np.ndarray) -> int:
        """The paint whose purest film is the brightest: its S is the unit."""
        means = [
            readings[np.argmax(fractions[:, paint])].mean() if fractions[:, paint].max() > 0 else 0
            for paint in range(fractions.shape[1])
        ]
        return int(np.argmax(means))

    def _fit_band(
        self, band: int, seen: np.ndarray, fractions: np.ndarray, brightest: int
    ) -> Float[np.ndarray, "films"]:
        count = fractions.shape[1]
        purest = fractions.argmax(axis=0)
        # Where a paint is nowhere pure, its strongest mixture is a start.
        start = np.log(hiding_ratio(seen[purest]))
        free = [paint for paint in range(count) if paint != brightest]

        def unpack(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            log_s = np.zeros(count)
            log_s[free] = x[count : 2 * count - 1]
            return x[:count], log_s, x[2 * count - 1 :]

        def misfit(x: np.ndarray) -> np.ndarray:
            log_k, log_s, pair = unpack(x)
            off = (self._reading(log_k, log_s, pair, fractions) - seen) / _ERROR
            drawn = [(log_k - start) / 3.0, log_s[free] / _LOG_S_SD, pair / _PAIR_SD]
            return np.concatenate([off, *drawn])

        first = np.concatenate([start, np.zeros(count - 1 + len(self._pairs))])
        found = least_squares(misfit, first, method="trf", max_nfev=60)
        self._log_k[band], self._log_s[band], self._pair[band] = unpack(found.x)
        return self._reading(*unpack(found.x), fractions) - seen

    def _reading(
        self, log_k: np.ndarray, log_s: np.ndarray, pair: np.ndarray, fractions: np.ndarray
    ) -> np.ndarray:
        """Reflectance of thick films from the logs of K and S, (paints,) or (bands, paints)."""
        k, s = np.exp(log_k), np.exp(log_s)
        absorption = k @ fractions.T
        for number, (a, b) in enumerate(self._pairs):
            size = pair[..., number, None] * (k[..., [a]] + k[..., [b]])
            absorption = absorption + size * (fractions[:, a] * fractions[:, b])
        return hiding_reflectance(np.maximum(absorption, 1e-9) / (s @ fractions.T)).T

    def predict(self, recipes: Float[np.ndarray, "films paints"]) -> Predicted:
        """Readings, with one band for all films."""
        readings = self._reading(self._log_k, self._log_s, self._pair, recipes)
        spread = _NINETY * np.maximum(self._sd, _ERROR)
        return Predicted(
            readings=readings,
            low=readings - spread,
            high=readings + spread,
            expected=np.full(len(recipes), np.nan),
        )

    def amounts(
        self, readings: Float[np.ndarray, "films bands"], there: np.ndarray
    ) -> Float[np.ndarray, "films paints"]:
        """Fractions that meet each reading best."""
        return np.stack(
            [
                self._amounts(seen, known)
                for seen, known in zip(bounded(readings), there, strict=True)
            ]
        )

    def _amounts(self, seen: np.ndarray, known: np.ndarray) -> np.ndarray:
        members = np.flatnonzero(known)

        def fractions_of(logits: np.ndarray) -> np.ndarray:
            out = np.zeros(len(known))
            parts = np.exp(np.append(logits, 0.0))
            out[members] = parts / parts.sum()
            return out

        def off(logits: np.ndarray) -> float:
            computed = self._reading(
                self._log_k, self._log_s, self._pair, fractions_of(np.clip(logits, -12, 12))[None]
            )
            return float(np.mean((computed[0] - seen) ** 2))

        starts = [np.zeros(len(members) - 1)]
        starts += [3.0 * row for row in np.eye(len(members) - 1)]
        starts += [-3.0 * row for row in np.eye(len(members) - 1)]
        found = min(
            (minimize(off, start, method="Nelder-Mead") for start in starts), key=lambda f: f.fun
        )
        return fractions_of(np.clip(found.x, -12, 12))


class AbsorbanceUnmixing:
    """Non-negative least squares of -log R from the pure films of the paints that are there."""

    name = "NNLS of -log R"

    def learn(self, films: Mixtures) -> None:
        """Mean -log R of each paint's purest films."""
        values = -np.log(bounded(films.readings))
        purest = films.fractions.max(axis=0)
        self._pure = np.stack(
            [
                values[films.fractions[:, paint] >= purest[paint] - 1e-9].mean(axis=0)
                for paint in range(len(films.paints))
            ]
        )

    def predict(self, recipes: Float[np.ndarray, "films paints"]) -> None:
        """It does not: -log R of a tint is nowhere near the sum of its paints'."""
        return None

    def amounts(
        self, readings: Float[np.ndarray, "films bands"], there: np.ndarray
    ) -> Float[np.ndarray, "films paints"]:
        """Shares of -log R."""
        out = np.zeros(there.shape)
        for row, seen in enumerate(-np.log(bounded(readings))):
            members = np.flatnonzero(there[row])
            out[row, members] = shares_of(unmix(self._pure[members].T, seen[None])[0])[0]
        return out
