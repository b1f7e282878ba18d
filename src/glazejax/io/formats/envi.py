"""ENVI spectral libraries and images: a text header and a file of plain numbers."""

import re
from collections.abc import Iterator
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any, TypeAlias, Unpack

import numpy as np
from jaxtyping import Float

from ..finish import DELETED, RawSpectra, finish, in_order
from ..probe import scale_of, with_usual_mark
from ..quantity import Stated, first_quantity, meaning, read_units
from ..raw_cube import OnDisk, RawCube
from ..source import (
    DATA_ENDINGS,
    Source,
    explain_errors,
    is_there,
    open_source,
    refusal,
    show_path,
)
from ..spectra_table import Bands, Chosen, SpectraTable
from ..words import is_number, read_number

EnviFields: TypeAlias = dict[str, str | list[str]]
"""Fields of a header by their titles: text, or a list of texts where it has braces."""

_NEEDED = ("samples", "lines", "bands", "data type", "interleave")
_ONCE = (*_NEEDED, "byte order", "wavelength", "header offset")
# A title, and its text to the end of the line, or in braces to the line that ends with one.
_FIELD = re.compile(r"(?m)^([^=\n]*)=[^\S\n]*(\{[\s\S]*?\}$|.*)")
_LIBRARY = "ENVI Spectral Library"
_TYPES = {
    1: "u1",
    2: "i2",
    3: "i4",
    4: "f4",
    5: "f8",
    6: "c8",
    9: "c16",
    12: "u2",
    13: "u4",
    14: "i8",
    15: "u8",
}
# Axes of the file for each interleave, and the transposition to (lines, samples, bands).
_AXES = {
    "bil": (("lines", "bands", "samples"), (0, 2, 1)),
    "bip": (("lines", "samples", "bands"), (0, 1, 2)),
    "bsq": (("bands", "lines", "samples"), (1, 2, 0)),
}
# A library is read as a whole; its numbers take 8 bytes each.
_MAX_VALUES = 1 << 27
# A table of more pixels than this is no table any more; 200 bands of float64 take 160 MB.
_MAX_PIXELS = 100_000


def read_header(source: Source) -> EnviFields:
    """Fields of a header, titles in lower case: text, or a list of texts where the header has
    braces.

    Raises:
        ValueError: no legal header, or one that lacks a field that is needed or has it twice.
    """
    header: EnviFields = {}
    lines = source.text().splitlines()
    # Lines of comment stay as empty ones, so that lines can be counted.
    text = "\n".join("" if line.startswith(";") else line.strip() for line in lines[1:])
    for field in _FIELD.finditer(text):
        title = field[1].strip().lower()
        value = field[2].strip()
        twice = title in header and title in _ONCE
        is_open = value.startswith("{") and not value.endswith("}")
        if twice or is_open:
            cut = "; is a brace left open, or the file cut short?"
            what = f": {title!r} stands there twice" if twice else cut
            line = 2 + text.count("\n", 0, field.start())
            raise source.error(f"not a legal ENVI header{what}", line)
        inner = value[1:-1].strip()
        header[title] = value
        if value.startswith("{"):
            listed = title != "description"
            header[title] = [entry.strip() for entry in inner.split(",")] if listed else inner
    missing = [title for title in _NEEDED if title not in header]
    if missing:
        raise source.error(f"the ENVI header lacks {missing[0]!r}")
    return header


class EnviFile:
    """Header and data of an ENVI file, of which the header has been read and the sizes are checked.

    Args:
        source: header.
        data: file of numbers, if it is known; else the file of the header's name next to it.

    Raises:
        FileNotFoundError: no data next to the header.
        ValueError: the header is not legal, or the data are not as long as it promises.
    """

    def __init__(self, source: Source, data: Path | None = None):
        self.path: Path = source.path
        self.header: EnviFields = read_header(source)
        self.sizes: dict[str, int] = {
            title: self._whole(title, 1) for title in ("lines", "samples", "bands")
        }
        self._offset = self._whole("header offset", 0)
        self.interleave: str = str(self.header["interleave"]).lower()
        if self.interleave not in _AXES:
            raise self.error(
                f"the ENVI header is not legal: interleave is {self.interleave!r}, not bil, bip "
                "or bsq"
            )
        kind = _TYPES.get(self._whole("data type", 0))
        order = self._whole("byte order", 0)
        if kind is None or order > 1:
            raise self.error(
                f"the ENVI header is not legal: data type {self.header['data type']}, byte order "
                f"{order}; known are {', '.join(map(str, _TYPES))}, and 0 and 1"
            )
        if kind.startswith("c"):
            raise self.error("the data are complex numbers, not reflectance")
        for title in ("file compression", "major frame offsets", "minor frame offsets"):
            if any(entry.strip(" {}") not in ("", "0") for entry in self.entries(title)):
                raise self.error(
                    f"the ENVI header has {title!r}, which is not understood; save it without"
                )
        self._dtype = np.dtype(("<", ">")[order] + kind)
        self.data: Path = data or self._data_beside()
        needed = self._offset + prod(self.sizes.values()) * self._dtype.itemsize
        with open_source(self.data) as opened:
            size = opened.size
        if size is None or size != needed:
            cause = (
                "; the file was cut short"
                if size is None or size < needed
                else ": are its samples, lines, bands, data type and header offset right?"
            )
            raise refusal(
                self.data,
                f"{size} bytes where the header {self.path.name} promises {needed}{cause}",
            )

    def error(self, complaint: object) -> ValueError:
        """Error that says what is wrong with the header."""
        return refusal(self.path, complaint)

    def entries(self, title: str) -> list[str]:
        """Entries of a list in the header; none if there is no such list."""
        value = self.header.get(title, [])
        return [text for text in (value if isinstance(value, list) else [value]) if text]

    @property
    def is_library(self) -> bool:
        """Return whether the header is that of a spectral library."""
        return str(self.header.get("file type", "")).lower() == _LIBRARY.lower()

    def library(self) -> RawSpectra:
        """Spectra of a library: samples are its bands, lines its spectra.

        Lists of the header with an entry a spectrum are attributes. Bands that ``bbl`` marks as bad
        are left out, and so are spectra that hold the ``data ignore value``.

        Raises:
            ValueError: header or data are not legal, or there are no wavelengths.
        """
        count = self.sizes["lines"]
        width = self.sizes["samples"]
        depth = self.sizes["bands"]
        if depth != 1:
            raise self.error(f"an ENVI spectral library of {depth} bands, where one is legal")
        if count * width > _MAX_VALUES:
            raise self.error(
                f"{count} spectra of {width} bands are too many to be read at once; split the "
                "library"
            )
        wavelengths = self.wavelengths()
        raw = self.raw(wavelengths)
        bands = self.good_bands()
        names = self.entries("spectra names") or [""] * count
        listed = self.header.get("spectra names")
        if isinstance(listed, list) and len(listed) == count:
            # A spectrum may have an empty name.
            names = listed
        if len(names) != count:
            raise self.error(
                f"{len(names)} spectra names for {count} spectra; does a name hold a comma, "
                "which ENVI splits?"
            )
        attributes = {
            title: column
            for title, column in self.header.items()
            if isinstance(column, list)
            and len(column) == count
            and title not in ("spectra names", "wavelength", "fwhm")
        }
        with explain_errors(self.data), self.data.open("rb") as file:
            # Read, not mapped: on a failing disk a map ends the process.
            stored = np.empty(count * width, self._dtype)
            file.seek(self._offset)
            if file.readinto(stored.data.cast("B")) != stored.nbytes:
                raise refusal(self.data, "the file was cut short while it was read")
        values = raw.numbers(stored.reshape(count, width)[:, bands], bands, dtype=np.float64)
        return RawSpectra(
            wavelengths=wavelengths[bands],
            names=names,
            values=values,
            format="ENVI spectral library",
            notes=raw.notes,
            wavelength_unit=raw.wavelength_unit,
            quantity=raw.quantity,
            scale=raw.scale,
            missing="drop" if raw.ignore or (stored < DELETED).any() else "refuse",
            attributes=attributes,
        )

    def table(self, **stated: Unpack[Stated]) -> SpectraTable:
        """All pixels of an image, named ``line 1 sample 1`` and so on; pixels that lack data are
        left out, with a note.

        Its unit is its scale factor, or estimated from pixels all over it: percent if the brightest
        of 99 % of them exceed 2, else fractions; a few pixels of glare do not decide.

        Args:
            stated: what the user says, before the header.

        Raises:
            ValueError: header or data are not legal, there are no wavelengths, the numbers are
                neither fractions nor percent and the header has no reflectance scale factor, or
                there are more than 100 000 pixels, or all lack data.
        """
        lines = self.sizes["lines"]
        samples = self.sizes["samples"]
        if lines * samples > _MAX_PIXELS:
            raise self.error(
                f"{lines} x {samples} pixels are too many for a table of spectra (at most "
                f"{_MAX_PIXELS}); use glazejax.io.open_cube and take windows of it"
            )
        raw = with_usual_mark(self.raw(self.wavelengths()))
        wavelengths, remarks = raw.nanometres(read_units(stated)[0])
        notes = [*raw.notes, *remarks]
        grid, bands = in_order(wavelengths, raw.good, notes)
        cure = "add 'reflectance scale factor = 10000', say, to the header"
        scale, unit = scale_of(raw, bands, notes, cure, **stated)
        stored = raw.block(slice(lines), slice(samples), bands)
        values = raw.numbers(stored, bands, dtype=np.float64) / scale
        pixels = RawSpectra(
            wavelengths=grid,
            names=[f"line {i + 1} sample {j + 1}" for i in range(lines) for j in range(samples)],
            values=values.reshape(lines * samples, -1),
            format=raw.format,
            notes=notes,
            scale=1.0,
            missing="drop",
            # A camera's noise and glare are what they are; one pixel must not make an image
            # unreadable.
            lowest=-np.inf,
            highest=np.inf,
        )
        return replace(finish(pixels, self.path), unit=unit)

    def raw(self, wavelengths: Bands | None) -> RawCube:
        """The numbers as they are stored, not read, and what the header says of them.

        Args:
            wavelengths: of the stored bands, as the header has them.

        Raises:
            ValueError: the header is not legal.
        """
        axes, order = _AXES[self.interleave]
        sizes = tuple(self.sizes[axis] for axis in axes)
        notes: list[str] = []
        good = self.good_bands()
        if good.size < self.stored:
            bad = self.stored - good.size
            notes.append(f"{bad} bands that the header marks as bad are left out")
        gain, offset = self._conversion(notes)
        # The second title of ENVI's plot of a spectrum is that of its values.
        said = [" ".join(self.entries("data units")), *self.entries("z plot titles")[1:2]]
        scale = self._numbers("reflectance scale factor")[:1].tolist()
        if scale and not (np.isfinite(scale[0]) and scale[0] > 0):
            raise self.error(
                f"the header's reflectance scale factor is {scale[0]:g}; it must be positive"
            )
        if "byte order" not in self.header:
            notes.append("the header does not say the byte order: taken as 0 (least byte first)")
        return RawCube(
            path=self.path,
            format="ENVI image",
            data=OnDisk(np.memmap, self.data, self._dtype, "r", self._offset, sizes),
            order=order,
            sizes=sizes,
            dtype=self._dtype,
            wavelengths=wavelengths,
            wavelength_unit=" ".join(self.entries("wavelength units")),
            quantity=first_quantity(said),
            good=good,
            gain=gain,
            offset=offset,
            scale=next(iter(scale), meaning(said[0]).scale),
            ignore=tuple(self._numbers("data ignore value")[:1].tolist()),
            notes=tuple(notes),
        )

    def _conversion(self, notes: list[str]) -> tuple[Any, Any]:
        """Gain and offset of the stored bands, numbers or arrays; those to reflectance before
        those to radiance.

        Raises:
            ValueError: a list of them is of another length, or holds what is no number.
        """
        count = self.stored
        for words in ("data reflectance", "data"):
            pair = []
            for title, neutral in ((f"{words} gain values", 1.0), (f"{words} offset values", 0.0)):
                values = self._numbers(title)
                if values.size not in (0, 1, count) or not np.isfinite(values).all():
                    raise self.error(
                        f"{title!r} has {values.size} entries for {count} bands, or one that is "
                        "not finite"
                    )
                pair.append(np.resize(values, count) if values.size else neutral)
            if any(map(np.ndim, pair)):
                notes.append(f"the header's {words!r} gain and offset values are applied")
                return pair[0], pair[1]
        return 1.0, 0.0

    def _data_beside(self) -> Path:
        """Data file of the header, by the names that ENVI and its kin use."""
        for ending in DATA_ENDINGS:
            name = self.path.with_suffix(ending)
            if name != self.path and is_there(name):
                return name
        stem = self.path.stem
        raise FileNotFoundError(
            f"{show_path(self.path)}: no data next to this ENVI header; looked for {stem} and "
            f"{stem}.sli, .img, ..."
        )

    @property
    def stored(self) -> int:
        """Number of stored bands."""
        return self.sizes["samples" if self.is_library else "bands"]

    def wavelengths(self) -> Bands:
        """Wavelengths of the stored bands, as the header has them.

        Raises:
            ValueError: there are none, or they are not legal.
        """
        values = self._numbers("wavelength")
        if not values.size:
            raise self.error(
                "the ENVI header has no wavelengths; add 'wavelength = {400, 410, ...}'"
            )
        if values.size != self.stored:
            raise self.error(f"{values.size} wavelengths for {self.stored} bands")
        if not np.isfinite(values).all():
            raise self.error(
                f"wavelength number {int(np.argmin(np.isfinite(values))) + 1} is not finite"
            )
        return values

    def good_bands(self) -> Chosen:
        """Stored bands that the header's ``bbl`` does not mark as bad.

        Raises:
            ValueError: the list has another length, marks all, or holds what is no number.
        """
        good = self._numbers("bbl")
        if good.size not in (0, self.stored):
            raise self.error(
                f"the list of bad bands (bbl) has {good.size} entries for {self.stored} bands"
            )
        bands = np.flatnonzero(good if good.size else np.ones(self.stored))
        if not bands.size:
            raise self.error("the header marks every band as bad (bbl)")
        return bands

    def _numbers(self, title: str) -> Float[np.ndarray, "entries"]:
        """Numbers of a list in the header; none if there is no such list."""
        words = [word.strip("[]' ") for word in self.entries(title)]
        for i, word in enumerate(words, start=1):
            if not is_number(word):
                raise self.error(
                    f"{title!r} number {i} in the header is {word[:30]!r}, not a number"
                )
        return np.array(list(map(read_number, words)))

    def _whole(self, title: str, least: int) -> int:
        """Whole number in a field of the header; 0 where it is left out."""
        text = str(self.header.get(title, 0))
        try:
            read_number(text)
            value = int(text)
        except ValueError:
            raise self.error(
                f"the ENVI header is not legal: {title!r} is {text[:30]!r}, not a whole number"
            ) from None
        if value < least:
            raise self.error(
                f"the ENVI header has sizes below 1 or a negative offset: {title!r} is {value}"
            )
        return value


def format_envi(table: SpectraTable) -> tuple[str, Iterator[bytes], list[str]]:
    """A table as a spectral library: header, numbers (float64, so that nothing is lost) and notes
    on names changed.
    """
    names = [name.translate(str.maketrans("{},", "();")) for name in table.names]
    changed = [old for old, new in zip(table.names, names, strict=True) if old != new]
    notes = (
        [f"ENVI has no commas or braces in names: {len(changed)} names changed"] if changed else []
    )
    fields = {
        "samples": table.wavelengths.size,
        "lines": len(table),
        "bands": 1,
        "header offset": 0,
        "file type": _LIBRARY,
        "data type": 5,
        "interleave": "bsq",
        "byte order": 0,
        "reflectance scale factor": 1.0,
        "wavelength units": "Nanometers",
        "wavelength": "{ " + ", ".join(map(repr, table.wavelengths.tolist())) + " }",
        "spectra names": "{ " + ", ".join(names) + " }",
    }
    header = "ENVI\n" + "".join(f"{title} = {value}\n" for title, value in fields.items())
    return header, (row.astype("<f8").tobytes() for row in table.reflectance), notes
