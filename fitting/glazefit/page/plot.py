"""Axes of a page's plots: where wavelengths and numbers lie, in hundredths of a plot's width and
height.

Lines are SVG that is stretched to any width; numbers at the axes are words of the page, of its
size.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from glazejax.spectra import Bands


@dataclass(frozen=True, kw_only=True)
class PlotAxes:
    """Axes of a plot over the wavelength.

    Attributes:
        grid: wavelengths, nm, ascending.
        low, high: ends of the upright axis.
        most: numbers at an axis.
    """

    grid: Bands
    low: float
    high: float
    most: int = 7

    @property
    def across(self) -> list[tuple[float, str]]:
        """Places and words of the numbers below the plot."""
        first, last = self._ends
        return [(self._x(nm), f"{nm:g}") for nm in _round_numbers(first, last, self.most)]

    @property
    def up(self) -> list[tuple[float, str]]:
        """Places, from below, and words of the numbers on the left."""
        return [
            (100.0 - self._y(value), f"{value:.10g}".replace("-", "\u2212"))
            for value in _round_numbers(self.low, self.high, self.most)
        ]

    def line(self, values: Iterable[float | None]) -> str:
        """Points of a spectrum, `x,y` each; bands without a number are left out."""
        return " ".join(f"{x:.2f},{y:.2f}" for x, y in self._points(values))

    def dots(self, values: Iterable[float | None]) -> str:
        """A path that is drawn as a dot at each band."""
        return "".join(f"M{x:.2f} {y:.2f}h.01" for x, y in self._points(values))

    def around(self, values: Iterable[float | None], halves: Iterable[float | None]) -> str:
        """Points of the outline of a band about a spectrum, from half its widths."""
        middle = np.array(values, dtype=float)
        half = np.array(halves, dtype=float)
        back = " ".join(reversed(self.line(middle + half).split()))
        return f"{self.line(middle - half)} {back}"

    def _points(self, values: Iterable[float | None]) -> Iterator[tuple[float, float]]:
        for nm, value in zip(self.grid.tolist(), values, strict=True):
            if value is not None and np.isfinite(value):
                yield self._x(nm), self._y(value)

    @property
    def _ends(self) -> tuple[float, float]:
        margin = 0.02 * float(np.ptp(self.grid)) or 1.0
        return float(self.grid[0]) - margin, float(self.grid[-1]) + margin

    def _x(self, nm: float) -> float:
        first, last = self._ends
        return 100.0 * (nm - first) / (last - first)

    def _y(self, value: float) -> float:
        clipped = min(max(value, self.low), self.high)
        return 100.0 * (self.high - clipped) / (self.high - self.low)


def _round_numbers(low: float, high: float, most: int) -> list[float]:
    """Round numbers from one to another, at most so many."""
    scale = 10.0 ** np.floor(np.log10((high - low) / most))
    step = next(s for s in (scale, 2 * scale, 5 * scale, 10 * scale) if (high - low) / s < most)
    first = np.ceil(low / step - 1e-9)
    last = np.floor(high / step + 1e-9)
    # Without a sign of zero.
    return [float(n * step) + 0.0 for n in np.arange(first, last + 1)]
