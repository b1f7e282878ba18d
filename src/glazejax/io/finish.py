"""From a reader's raw numbers to a table of reflectance: one place for the rules that all formats
share.

Unit: what the file declares. Else a table made by hand is held to `glazejax.spectra.as_fraction`,
which looks for units that were mixed; a file that an instrument wrote has one unit, and the median
of its spectra's peaks says which. So a few highlights of 2 in a large library of fractions do not
pass for percent. Values above 1 stay, with a note: fluorescence, highlights and calibration against
a grey white all give them. Negative values down to -0.01 are an instrument's noise about black and
become 0, with a note; further below they are an error. Bands are sorted by wavelength. Names are
made different by numbers.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from ..spectra import MAX_FRACTION, MIN_PERCENT, as_fraction, validate_wavelengths
from .source import refusal
from .spectra_table import SpectraTable, list_names

# CxF3's own bound for a reflectance. Above it the unit or the scale that the file declares is
# wrong.
MAX_DECLARED = 3.0
# Dark signal of a spectrometer is known to about this.
MAX_NOISE = 0.01


@dataclass(frozen=True)
class RawSpectra:
    """Numbers as a reader found them.

    Attributes:
        wavelengths: (bands,), nm, in any order.
        names: one a row; they may repeat or be empty.
        values: (rows, bands), fraction or percent or scaled; NaN where missing.
        format: what the file is.
        notes: what the reader noticed.
        scale: number that stands for a reflectance of 1, if the file says so; None to detect
            percent.
        missing: ``refuse`` values that are not finite; or ``drop`` bands that have none in any
            spectrum, and then spectra that lack one; where most do, bands that some lack.
        attributes: what else the file says of each row.
        by_hand: whether people make such files, who may mix units.
        lowest: value (fraction) below which it is no noise any more.
        highest: value (fraction) above which the unit must be wrong.
    """

    wavelengths: Float[np.ndarray, "bands"]
    names: Sequence[str]
    values: Float[np.ndarray, "rows bands"]
    format: str
    notes: Sequence[str] = ()
    scale: float | None = None
    missing: Literal["refuse", "drop"] = "refuse"
    attributes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    by_hand: bool = False
    lowest: float = -MAX_NOISE
    highest: float = MAX_DECLARED


def finish(raw: RawSpectra, path: Path, *, unit: str | None = None) -> SpectraTable:
    """Check raw spectra and express them as fractions on an ascending grid.

    Args:
        raw: what a reader found.
        path: file, for the errors.
        unit: what to say of the file's unit; left out, it is told from the scale.

    Raises:
        ValueError: no spectra, a grid or values that are not legal; one line that names the file.
    """
    try:
        return _finish(raw, unit)
    except ValueError as error:
        raise refusal(path, error) from None


def _finish(raw: RawSpectra, unit: str | None) -> SpectraTable:
    """Table of raw spectra; errors do not name the file."""
    if not len(raw.names):
        raise ValueError("the file holds no spectra")
    notes = list(raw.notes)
    names = raw.names
    # The reader of tables has seen that names differ, in less room.
    if not raw.by_hand or any(plain_name(name) != name for name in names):
        names = different(
            [plain_name(name) or f"spectrum {i + 1}" for i, name in enumerate(names)], notes
        )
    values = np.asarray(raw.values, np.float64)
    wavelengths = np.asarray(raw.wavelengths, np.float64)
    if np.isfinite(wavelengths).all() and (np.diff(wavelengths) < 0).any():
        order = np.argsort(wavelengths, kind="stable")
        notes.append("bands were sorted by wavelength")
        wavelengths = wavelengths[order]
        values = values[:, order]
    rows: Sequence[int] = range(len(names))
    if raw.missing == "drop":
        wavelengths, values, rows = _without_missing(wavelengths, values, names, notes)
        names = [names[i] for i in rows]
    grid = validate_wavelengths(wavelengths)
    if not values.flags.writeable:
        values = values.copy()
    found = _to_fractions(raw, values, names, notes)
    attributes = {title: tuple(column[i] for i in rows) for title, column in raw.attributes.items()}
    return SpectraTable(
        wavelengths=grid,
        names=tuple(names),
        reflectance=values,
        notes=notes,
        format=raw.format,
        unit=unit or found,
        attributes=attributes,
    )


def _without_missing(
    wavelengths: Float[np.ndarray, "bands"],
    values: Float[np.ndarray, "rows bands"],
    names: Sequence[str],
    notes: list[str],
) -> tuple[Float[np.ndarray, "kept"], Float[np.ndarray, "full kept"], list[int]]:
    """Without bands that have no data at all and spectra that still lack some, or, where most do,
    without the bands that they lack; rows that are kept.
    """
    there = np.isfinite(values)
    bands = there.any(axis=0)
    if not bands.any():
        raise ValueError("no spectrum has any data")
    if not bands.all():
        notes.append(f"{(~bands).sum()} bands without data are left out")
    rows: np.ndarray = np.all(there[:, bands], axis=1)
    some: np.ndarray = np.any(there, axis=1)
    full = np.all(there[some], axis=0)
    partial = some & ~rows
    # A library with deleted channels keeps its spectra: where most lack a few bands, these go.
    if partial.sum() > rows.sum() and (bands & ~full).sum() * some.sum() < (
        partial.sum() * bands.sum()
    ):
        notes.append(f"{(bands & ~full).sum()} bands that some spectra lack are left out")
        bands = full
        rows = some
    if not rows.any():
        raise ValueError("every spectrum lacks data at some wavelength")
    if not rows.all():
        lost = [name for name, keep in zip(names, rows, strict=True) if not keep]
        notes.append(f"{len(lost)} spectra that lack data are left out: {list_names(lost)}")
    return wavelengths[bands], values[rows][:, bands], [i for i, keep in enumerate(rows) if keep]


def _to_fractions(
    raw: RawSpectra, values: Float[np.ndarray, "rows bands"], names: Sequence[str], notes: list[str]
) -> str:
    """Turn the values themselves into fractions, as a large table has no room for copies; the unit
    they were in.
    """
    # NaN where a value is
    lows = values.min(axis=1)
    peaks = values.max(axis=1)
    wrong = ~(np.isfinite(lows) & np.isfinite(peaks))
    if wrong.any():
        i = int(wrong.argmax())
        j = int(np.isfinite(values[i]).argmin())
        raise ValueError(
            f"reflectance of {names[i]!r} is not finite at band {j + 1}: {values[i, j]:g}"
        )
    scale = raw.scale or _detected_scale(
        peaks if peaks.min() >= 0 else np.maximum(peaks, 0.0), names, raw.by_hand
    )
    if scale == 100.0:
        notes.append("values are in percent; divided by 100")
    elif scale != 1.0:
        notes.append(f"the file says that {scale:g} is a reflectance of 1; divided by it")
    if scale != 1.0:
        values /= scale
        lows = lows / scale
        peaks = peaks / scale
    darkest = int(lows.argmin())
    if lows[darkest] < raw.lowest:
        j = int(values[darkest].argmin())
        raise ValueError(
            f"reflectance of {names[darkest]!r} is negative at band {j + 1}: "
            f"{lows[darkest] * scale:g}, more than "
            f"noise (down to {raw.lowest * scale:g})"
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
    bright = list_names([names[int(i)] for i in np.flatnonzero(peaks > 1)])
    if bright:
        verb = "exceeds" if (peaks > 1).sum() == 1 else "exceed"
        causes = "fluorescence, highlights or calibration"
        notes.append(
            f"{bright} {verb} a reflectance of 1, up to {peaks[worst]:.3g} ({causes}); kept"
        )
    return {1.0: "fraction", 100.0: "percent"}.get(scale, "scaled")


def _detected_scale(peaks: Float[np.ndarray, "rows"], names: Sequence[str], by_hand: bool) -> float:
    """100 for values in percent, 1 for fractions, told from the largest value of each spectrum."""
    if by_hand:
        return 1.0 if as_fraction(peaks[:, None], names)[1] is None else 100.0
    percent = bool(np.median(peaks) > MIN_PERCENT)
    strange = peaks <= MAX_FRACTION if percent else peaks > MAX_DECLARED
    if strange.any():
        odd = list_names([name for name, is_odd in zip(names, strange, strict=True) if is_odd])
        most, others = (
            ("percent", "fractions") if percent else ("fractions", "percent or something else")
        )
        raise ValueError(
            f"percent and fraction are mixed: most spectra are in {most}, {odd} in {others}"
        )
    return 100.0 if percent else 1.0


# What no format of names can hold: control characters, surrogates, and two that XML forbids.
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
        used[name] += 1
        fresh = name
        if used[name] > 1:
            while (fresh := f"{name} ({used[name]})") in taken:
                used[name] += 1
            taken.add(fresh)
        result.append(fresh)
    repeated = [name for name, count in counts.items() if count > 1]
    if repeated:
        notes.append(f"names that repeat were numbered: {list_names(repeated)}")
    return result


def nanometres(
    wavelengths: Float[np.ndarray, "bands"], unit: str | None
) -> tuple[Float[np.ndarray, "bands"], list[str]]:
    """Wavelengths in nm from what a file calls their unit, with notes.

    A unit that is not named is micrometres if all are below 100, as no spectrum of paint reaches so
    far down in nm; whole numbers that small are taken for band numbers and refused.

    Raises:
        ValueError: the unit is not one of nm, um, angstrom, m, 1/cm, or there is none and they
            count bands.
    """
    word = (unit or "").strip().strip("{}()[]").strip().lower().replace("µ", "u").replace("μ", "u")
    if word in {"", "unknown", "<unspecified>", "none"}:
        if not wavelengths.size or np.nanmax(wavelengths) >= 100:
            return wavelengths, []
        if (wavelengths == np.round(wavelengths)).all():
            raise ValueError(
                f"{wavelengths[0]:g}, ... {wavelengths[-1]:g} look like band numbers, not "
                "wavelengths in nm"
            )
        return wavelengths * 1e3, [
            "wavelengths without a unit look like micrometres; multiplied by 1000"
        ]
    if word in {"nm", "nanometer", "nanometers", "nanometre", "nanometres"}:
        return wavelengths, []
    if word in {
        "um",
        "micron",
        "microns",
        "micrometer",
        "micrometers",
        "micrometre",
        "micrometres",
    }:
        return wavelengths * 1e3, ["wavelengths are in micrometres; multiplied by 1000"]
    if word in {"a", "å", "angstrom", "angstroms"}:
        return wavelengths / 10, ["wavelengths are in angstrom; divided by 10"]
    if word in {"m", "meter", "meters", "metre", "metres"}:
        return wavelengths * 1e9, ["wavelengths are in metres; multiplied by 1e9"]
    if word in {"1/cm", "cm-1", "cm^-1", "wavenumber", "wavenumbers"}:
        if not (wavelengths > 0).all():
            raise ValueError("wavenumbers must be positive")
        return _whole(wavelengths), ["wavenumbers in 1/cm were turned into wavelengths"]
    raise ValueError(f"wavelengths are in {unit!r}; known units are nm, um, angstrom, m and 1/cm")


def _whole(wavenumbers: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "bands"]:
    """Wavelengths in nm of wavenumbers in 1/cm; whole ones if all are, to the digits of the file.

    14285.7 is 700.0007 nm, and would lie beyond a paint that is known up to 700 nm.
    """
    found = 1e7 / wavenumbers
    decimals = next((n for n in range(9) if (np.round(wavenumbers, n) == wavenumbers).all()), None)
    if decimals is None:
        return found
    slack = 0.5 * 10.0**-decimals * found**2 / 1e7
    near = np.round(found)
    whole = (np.abs(found - near) <= slack).all() and np.unique(near).size == near.size
    return near if whole else found


def in_order(
    wavelengths: Float[np.ndarray, "stored"],
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


def unit_of(level: float, declared: float | None, cure: str) -> tuple[float, str, list[str]]:
    """Number that stands for a reflectance of 1, the unit's name and notes, for an image of which
    the level is known.

    Args:
        level: what the bright pixels reach: in fractions if the scale is declared, else in the
            file's numbers.
        declared: the scale that the file or the user says, or None to tell fractions from percent.
        cure: what to do where the numbers are neither.

    Raises:
        ValueError: neither fractions nor percent, or much above 1 by the declared scale.
    """
    if declared is not None:
        if level > MAX_DECLARED:
            raise ValueError(
                f"pixels reach a reflectance of {level:g} by the reflectance scale factor "
                f"{declared:g}"
            )
        scale = declared
        unit = {1.0: "fraction", 100.0: "percent"}.get(declared, "scaled")
    elif level <= MIN_PERCENT:
        scale = 1.0
        unit = "fraction"
    elif level <= 100 * MAX_FRACTION:
        scale = 100.0
        unit = "percent"
    else:
        raise ValueError(f"pixels reach {level:g}, neither fraction nor percent: {cure}")
    notes = []
    if scale != 1.0:
        notes.append(
            "values are in percent; divided by 100" if scale == 100.0 else f"divided by {scale:g}"
        )
    return scale, unit, notes
