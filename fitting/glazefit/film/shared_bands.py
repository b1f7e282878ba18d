"""The bands of a measurement that paints are known at: cut to their range, and averaged where finer
than it helps.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands, describe_grid, lie_between

from .films import SPECTRA, Films

SEARCHED = 10.0
"""Step in nm to which finer spectra are averaged where paints are searched: errors of paints are
alike over more, and a misfit would count the less the more bands share it.
"""
FEWEST = 6
PAINTS_KNOWN = "the paints are known there only"


class SharedBands(NamedTuple):
    """Bands on which spectra and paints meet.

    Attributes:
        wavelengths: (new,), nm, ascending; means over the bands that were averaged.
        mean: from the spectra's bands to these: ``spectra @ mean``.
        notes: sentences on what was changed; empty if nothing was.
    """

    wavelengths: Float[np.ndarray, "new"]
    mean: Float[np.ndarray, "bands new"]
    notes: tuple[str, ...]

    def in_steps(self, step: float) -> "SharedBands":
        """The same averaged to steps, nm, where they are finer."""
        coarser = means_of_steps(self.wavelengths, step)
        if coarser is None:
            return self
        note = f"{self.wavelengths.size} bands averaged to steps of {step:g} nm"
        return SharedBands(self.wavelengths @ coarser, self.mean @ coarser, (*self.notes, note))

    def of(self, films: Films) -> Films:
        """The films on these bands, with the notes."""
        if not self.notes:
            return films
        arrays: dict[str, Any] = {what: getattr(films, what) @ self.mean for what in SPECTRA}
        notes = (*films.notes, *self.notes)
        return replace(films, wavelengths=self.wavelengths, notes=notes, **arrays)


def shared_bands(
    wavelengths: Bands,
    known: tuple[float, float],
    step: float = SEARCHED,
    what: str = "the spectra have",
) -> SharedBands:
    """Bands of spectra that paints are known at, averaged to steps where they are finer.

    Args:
        wavelengths: of the spectra, nm, ascending.
        known: first and last wavelength that the paints are known at, nm.
        step: nm.
        what: how an error begins.

    Raises:
        ValueError: fewer than six bands are left.
    """
    first, last = known
    used = lie_between(wavelengths, first, last)
    if used.sum() < FEWEST:
        raise ValueError(
            f"{what} {describe_grid(wavelengths)} and the paints are known from {first:g} to "
            f"{last:g} nm: {used.sum()} bands lie there, at least {FEWEST} are needed; measure "
            "there, use paints that are known at your wavelengths (--pigments, --catalogue), or "
            "check the wavelengths"
        )
    return crop_bands(wavelengths, first, last, PAINTS_KNOWN).in_steps(step)


def every_band(wavelengths: Bands) -> SharedBands:
    """The bands as they are."""
    return SharedBands(wavelengths, np.eye(wavelengths.size), ())


def crop_bands(wavelengths: Bands, low: float, high: float, why: str) -> SharedBands:
    """Bands between two wavelengths (nm); a note on what was left out and why, if anything was.

    Raises:
        ValueError: fewer than three bands are left.
    """
    used = lie_between(wavelengths, low, high)
    if used.all():
        return every_band(wavelengths)
    if used.sum() < 3:
        raise ValueError(
            f"the readings' {describe_grid(wavelengths)} and {low:g}-{high:g} nm have no three "
            f"bands in common: {why}; check the wavelengths"
        )
    grid = wavelengths[used]
    note = f"cropped to {describe_grid(grid)}: {why}"
    return SharedBands(grid, np.eye(used.size)[:, used], (note,))


def crop(films: Films, low: float, high: float, why: str) -> Films:
    """Films between two wavelengths (nm); a note says what was left out, and why.

    Raises:
        ValueError: fewer than three bands are left.
    """
    return crop_bands(films.wavelengths, low, high, why).of(films)


def average(films: Films, step: float = 5.0) -> Films:
    """Films whose bands are averaged to steps (nm), where theirs are finer; a note says so.

    By default to 5 nm: k and s of paint change little over it.
    """
    return every_band(films.wavelengths).in_steps(step).of(films)


def means_of_steps(grid: Bands, step: float) -> Float[np.ndarray, "bands new"] | None:
    """Matrix that averages bands to steps, nm; None if they are no finer than that, or were
    averaged to them before.
    """
    if grid.size < 3 or np.median(np.diff(grid)) >= 0.99 * step:
        return None
    steps, index = np.unique(np.floor(grid / step + 0.5), return_inverse=True)
    # Means of unequal numbers of bands lie nearer to each other than the steps do.
    if steps.size == grid.size:
        return None
    matrix = (index[:, None] == np.arange(index.max() + 1)).astype(float)
    return matrix / matrix.sum(axis=0)


def running_mean(wavelengths: Bands, values: Bands, width: float) -> Bands:
    """Mean over a window of this width (nm) around each band."""
    sums = np.r_[0.0, np.cumsum(values)]
    first = np.searchsorted(wavelengths, wavelengths - 0.5 * width)
    last = np.searchsorted(wavelengths, wavelengths + 0.5 * width, side="right")
    return (sums[last] - sums[first]) / (last - first)
