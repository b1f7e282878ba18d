"""Ends of a spectrometer's range, where lamp and detector give noise alone."""

from dataclasses import replace

import numpy as np

from ...spectra import MIN_PERCENT
from ..finish import MAX_DECLARED, MAX_NOISE, RawSpectra

# Where every instrument of paint has light, nm.
_LIT = (450.0, 650.0)


def without_noisy_ends(raw: RawSpectra) -> RawSpectra:
    """Spectra without the bands at either end that no reflectance gives: all up to the innermost
    that reads less than -0.01, more than 3, or no number.

    Nothing changes if there are such bands from 450 to 650 nm: a reader refuses them by name.
    """
    grid = raw.wavelengths
    values = raw.values
    lit = (grid >= _LIT[0]) & (grid <= _LIT[1])
    if not lit.any():
        return raw
    with np.errstate(invalid="ignore"):
        percent = np.median(values[:, lit].max(axis=1)) > MIN_PERCENT
        scale = raw.scale or (100.0 if percent else 1.0)
        legal = (values >= -MAX_NOISE * scale) & (values <= MAX_DECLARED * scale)
    wrong: np.ndarray = ~np.all(legal, axis=0)
    if not wrong.any() or wrong[lit].any():
        return raw
    places = np.flatnonzero(wrong)
    middle = int(np.flatnonzero(lit)[0])
    first = max((i + 1 for i in places if i < middle), default=0)
    last = min((i for i in places if i > middle), default=grid.size)
    note = f"{grid.size - last + first} bands at the ends are left out: they hold noise alone"
    return replace(
        raw,
        wavelengths=grid[first:last],
        values=values[:, first:last],
        notes=[*raw.notes, note],
    )
