"""From a reader's raw numbers to a table of reflectance: one place for the rules that all formats
share.

Quantity and units: what the user says, else what the file says (`quantity`), else what sizes show:
a file has one unit, percent if its brightest spectrum exceeds 2. A few highlights of 2 in a library
of fractions do not pass for percent, and dark spectra of percent are named. Values above 1 stay,
with a note: fluorescence, highlights and calibration against a grey white all give them. Negative
values down to -0.01 are an instrument's noise about black and become 0, with a note; further below
they are an error. Ends of the range where a detector reads noise are left out, with a note; so is
what marks missing data. Bands are sorted by wavelength. Names are made different by numbers.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Literal, Unpack

import numpy as np
from jaxtyping import Float, Int

from ..spectra import (
    MAX_DECLARED,
    MIN_PERCENT,
    ranges,
    scale_by_size,
    validate_wavelengths,
)
from .quantity import Stated, check_reflectance, meaning, nanometres, not_stated, read_units
from .source import naming
from .spectra_table import Bands, Rows, SpectraTable, Stored, list_names

# Dark signal of a spectrometer is known to about this.
MAX_NOISE = 0.01
# No reading is below: some mark missing data by -1.23e34.
DELETED = -1e30
# What files leave in place of missing data without a word.
USUAL_MARK = -9999.0
# Names of the usual numbers that stand for a reflectance of 1.
UNITS = {1.0: "fraction", 100.0: "percent"}
# Where the detectors of all instruments of paint have light, nm.
DETECTED = (380.0, 850.0)
# The same of those that software exports.
SPECTROMETER = (450.0, 650.0)


@dataclass(frozen=True)
class RawSpectra:
    """Numbers as a reader found them.

    Attributes:
        wavelengths: (bands,), in any order, one at least.
        names: one a row, one at least; they may repeat or be empty.
        values: (rows, bands), float64, fraction or percent or scaled; NaN where missing. They
            become fractions in place.
        format: what the file is.
        notes: what the reader noticed.
        wavelength_unit: as the file states it; empty where it does not.
        quantity: what the file says of the values, such as ``%R``; empty where it says nothing.
        scale: number that stands for a reflectance of 1, if the file says so.
        missing: ``refuse`` values that are not finite; or ``drop`` bands that have none in any
            spectrum, and then spectra that lack one; where most do, bands that some lack.
        attributes: what else the file says of each row.
        lit: wavelengths (nm) between which every reading must be legal.
        lowest: value (fraction) below which it is no noise any more.
        highest: value (fraction) above which the unit must be wrong.
    """

    wavelengths: Bands
    names: Sequence[str]
    values: Rows
    format: str
    notes: Sequence[str] = ()
    wavelength_unit: str = "nm"
    quantity: str = ""
    scale: float | None = None
    missing: Literal["refuse", "drop"] = "refuse"
    attributes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    lit: tuple[float, float] = DETECTED
    lowest: float = -MAX_NOISE
    highest: float = MAX_DECLARED


def finish(raw: RawSpectra, path: Path, **stated: Unpack[Stated]) -> SpectraTable:
    """Check raw spectra and express them as fractions on an ascending grid.

    Args:
        raw: what a reader found.
        path: file, for the errors.
        stated: what the user says, before the file.

    Raises:
        ValueError: another quantity than reflectance, a grid or values that are not legal; one line
            that names the file.
    """
    with naming(path):
        return _finish(raw, stated)


def _finish(raw: RawSpectra, stated: Stated) -> SpectraTable:
    """Table of raw spectra; errors do not name the file."""
    check_reflectance(raw.quantity, stated)
    length, scale = read_units(stated)
    declared = scale or raw.scale or meaning(raw.quantity).scale
    notes = list(raw.notes)
    names = different(
        [plain_name(name) or f"spectrum {i + 1}" for i, name in enumerate(raw.names)], notes
    )
    values = raw.values
    wavelengths, remarks = nanometres(raw.wavelengths, length or raw.wavelength_unit)
    notes += remarks
    if np.isfinite(wavelengths).all() and (np.diff(wavelengths) < 0).any():
        order = one_detector_each(wavelengths, notes)
        wavelengths = wavelengths[order]
        values = values[:, order]
    missing = raw.missing
    if np.fmin.reduce(values, axis=None) <= USUAL_MARK:
        # Infinity is no mark but damage.
        marks = ((values < DELETED) & np.isfinite(values)) | (values == USUAL_MARK)
        if marks.any():
            notes.append(f"{values[marks].min():g} was taken for missing data")
            values = np.where(marks, np.nan, values)
            missing = "drop"
    rows: Sequence[int] = range(len(names))
    if missing == "drop":
        rows, bands = _complete(values, names, notes)
        wavelengths = wavelengths[bands]
        values = values[rows][:, bands]
        names = [names[i] for i in rows]
    grid = validate_wavelengths(wavelengths)
    kept = lit_bands(grid, values, notes, raw, declared)
    grid = grid[kept]
    values = values[:, kept]
    unit_read = _to_fractions(raw, declared, grid, values, names, notes)
    attributes = {title: tuple(column[i] for i in rows) for title, column in raw.attributes.items()}
    return SpectraTable(
        wavelengths=grid,
        names=tuple(names),
        reflectance=values,
        notes=notes,
        format=raw.format,
        unit=unit_read,
        attributes=attributes,
    )


def one_detector_each(wavelengths: Bands, notes: list[str]) -> Int[np.ndarray, "kept"]:
    """Bands in ascending order. Where detectors overlap, each is read up to the middle of the
    overlap, with a note; any other order is sorted.
    """
    if not detectors_overlap(wavelengths):
        notes.append("bands were sorted by wavelength")
        return np.argsort(wavelengths, kind="stable")
    runs = _runs(wavelengths)
    ends = [(run[-1] + after[0]) / 2 for run, after in pairwise(runs)]
    notes += [f"detectors overlap: the change is at {end:g} nm" for end in ends]
    detectors = np.repeat(range(len(runs)), [*map(len, runs)])
    return np.flatnonzero(np.searchsorted(ends, wavelengths) == detectors)


def _runs(wavelengths: Bands) -> list[np.ndarray]:
    """Wavelengths, parted where they do not ascend."""
    return np.split(wavelengths, np.flatnonzero(np.diff(wavelengths) <= 0) + 1)


def detectors_overlap(wavelengths: Bands) -> bool:
    """Return whether wavelengths ascend in a few runs, each of which begins within the one
    before.
    """
    runs = _runs(wavelengths)
    # Two readings that changed places overlap by one.
    return 1 < len(runs) < 6 and all(
        min(a.size, b.size) > 2 and a[0] < b[0] < a[-2] and b[1] < a[-1] < b[-1]
        for a, b in pairwise(runs)
    )


def lit_bands(
    wavelengths: Bands,
    values: Rows,
    notes: list[str],
    raw: RawSpectra,
    scale: float | None,
) -> slice:
    """Bands without those at either end that no reflectance gives: all up to the innermost that
    reads less than -0.01, more than 3, or no number.

    Such bands where every instrument has light stay, and are refused by name.
    """
    lit = (wavelengths >= raw.lit[0]) & (wavelengths <= raw.lit[1])
    low = values.min(axis=0)
    peak = values.max(axis=0)
    if not lit.any():
        return slice(None)
    scale = scale or (100.0 if peak[lit].max() > MIN_PERCENT else 1.0)
    wrong: np.ndarray = ~((low >= raw.lowest * scale) & (peak <= raw.highest * scale))
    below = np.flatnonzero(wrong & (wavelengths < raw.lit[0]))
    above = np.flatnonzero(wrong & (wavelengths > raw.lit[1]))
    kept = slice(below.max(initial=-1) + 1, above.min(initial=wavelengths.size))
    if below.size or above.size:
        left = np.ones(wavelengths.size, bool)
        left[kept] = False
        notes.append(
            f"{left.sum()} bands at the ends are left out, at {ranges(wavelengths, left)}: they "
            "hold noise alone"
        )
    return kept


def _complete(values: Rows, names: Sequence[str], notes: list[str]) -> tuple[list[int], np.ndarray]:
    """Numbers of the rows, and mask of the bands, that stay: without bands that have no data at all
    and spectra that still lack some, or, where most do, without the bands that they lack.
    """
    there = np.isfinite(values)
    bands: np.ndarray = np.any(there, axis=0)
    if not bands.any():
        raise ValueError("no spectrum has any data")
    rows: np.ndarray = np.all(there[:, bands], axis=1)
    some: np.ndarray = np.any(there, axis=1)
    full: np.ndarray = np.all(there[some], axis=0)
    partial = some & ~rows
    # A library with deleted channels keeps its spectra: where most lack a few bands, these go.
    if partial.sum() > rows.sum() and (bands & ~full).sum() * some.sum() < (
        partial.sum() * bands.sum()
    ):
        bands = full
        rows = some
    if not rows.any() or not bands.any():
        raise ValueError("every spectrum lacks data at some wavelength")
    if not bands.all():
        notes.append(f"{(~bands).sum()} bands without data are left out")
    if not rows.all():
        lost = [names[i] for i in np.flatnonzero(~rows).tolist()]
        notes.append(f"{len(lost)} spectra that lack data are left out: {list_names(lost)}")
    return np.flatnonzero(rows).tolist(), bands


def _to_fractions(
    raw: RawSpectra,
    declared: float | None,
    grid: Bands,
    values: Rows,
    names: Sequence[str],
    notes: list[str],
) -> str:
    """Turn the values themselves into fractions, as a large table has no room for copies; the unit
    they were in.
    """
    # NaN where a value is
    lows = values.min(axis=1)
    peaks = values.max(axis=1)
    for i in np.flatnonzero(~(np.isfinite(lows) & np.isfinite(peaks)))[:1]:
        j = np.isfinite(values[i]).argmin()
        raise ValueError(
            f"reflectance of {names[i]!r} is not finite at band {j + 1}: {values[i, j]:g}"
        )
    cure = "are these counts? divide by what stands for a reflectance of 1, or say it: --scale"
    scale = declared or scale_by_size(values, peaks, names, notes, cure)
    if scale == 100.0:
        notes.append("values are in percent; divided by 100")
    elif scale != 1.0:
        notes.append(f"{scale:g} is stated to be a reflectance of 1; divided by it")
    elif declared is None:
        # One note of what nobody stated.
        both = not_stated("nm") in notes
        notes[:] = [note for note in notes if note != not_stated("nm")]
        notes.append(not_stated(*["nm"] * both, "fractions"))
    if scale != 1.0:
        values /= scale
        lows = lows / scale
        peaks = peaks / scale
    darkest = int(lows.argmin())
    if lows[darkest] < raw.lowest:
        j = int(values[darkest].argmin())
        raise ValueError(
            f"reflectance of {names[darkest]!r} is negative at band {j + 1} ({grid[j]:g} nm): "
            f"{lows[darkest] * scale:g}, more than noise (down to {raw.lowest * scale:g}); if that "
            "is noise, write 0"
        )
    if lows[darkest] < 0:
        count = sum(int((values[i] < 0).sum()) for i in np.flatnonzero(lows < 0))
        notes.append(
            f"{count} value{'s' if count != 1 else ''} slightly below 0 (noise, down to "
            f"{lows[darkest]:.2g}) became 0"
        )
        np.maximum(values, 0.0, out=values)
    worst = int(peaks.argmax())
    if peaks[worst] > raw.highest:
        raise ValueError(
            f"reflectance of {names[worst]!r} reaches {peaks[worst]:g} as a fraction, where "
            f"{raw.highest:g} is the most: is the file's unit or scale factor right?"
        )
    bright = list_names([names[i] for i in np.flatnonzero(peaks > 1).tolist()])
    if bright:
        verb = "exceeds" if (peaks > 1).sum() == 1 else "exceed"
        causes = "fluorescence, highlights or calibration"
        notes.append(
            f"{bright} {verb} a reflectance of 1, up to {peaks[worst]:.3g} ({causes}); kept"
        )
    return UNITS.get(scale, "scaled")


# What no format of names can hold: control characters, surrogates, and two that XML forbids.
NUMBERED = "names that repeat were numbered"
"""Of a note on names that were made different."""
_UNFIT = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def plain_name(name: str) -> str:
    """A name without control characters and without the blanks around it."""
    return " ".join(_UNFIT.sub(" ", name).split()) if _UNFIT.search(name) else name.strip()


def different(names: list[str], notes: list[str]) -> list[str]:
    """Names made different: the second ``red`` becomes ``red (2)``; a note says how many
    changed.
    """
    if len(set(names)) == len(names):
        return names
    counts = Counter(names)
    taken = set(counts)
    used = Counter()
    result = []
    for name in names:
        fresh = name
        while used[name] and fresh in taken:
            used[name] += 1
            fresh = f"{name} ({used[name]})"
        used[name] = max(used[name], 1)
        taken.add(fresh)
        result.append(fresh)
    repeated = [name for name, count in counts.items() if count > 1]
    notes.append(f"{NUMBERED}: {list_names(repeated)}")
    return result


def in_order(
    wavelengths: Stored,
    bands: Int[np.ndarray, "used"] | None,
    notes: list[str],
) -> tuple[Float[np.ndarray, "used"], Int[np.ndarray, "used"]]:
    """Wavelengths of the bands that are used (None: all), sorted, and the bands in that order; a
    note says if that changed them.
    """
    bands = np.arange(wavelengths.size) if bands is None else bands
    order = np.argsort(wavelengths[bands], kind="stable")
    if (order != np.arange(order.size)).any():
        notes.append("bands were sorted by wavelength")
    bands = bands[order]
    return wavelengths[bands], bands
