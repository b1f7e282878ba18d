"""ENVI spectral libraries and images: a text header and a file of plain numbers, opened with Spectral Python (SPy)."""

import re
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...spectra import MAX_FRACTION, MIN_PERCENT, validate_wavelengths
from ..cube import SpectraCube, with_gaps
from ..finish import MAX_DECLARED, RawSpectra, nanometres
from ..sniff import decode
from ..spectra_table import SpectraTable

_NEEDED = ("samples", "lines", "bands", "data type", "interleave", "byte order")
_LIBRARY = "ENVI Spectral Library"
# So many pixels tell the unit of an image.
_PROBE = 20_000


def read_header(path: Path) -> dict[str, Any]:
    """Fields of a header, titles in lower case: text, or a list of texts where the header has braces.

    Raises:
        ValueError: no legal header, or one that lacks a field that is needed.
    """
    import spectral.io.envi as spy

    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # SPy opens headers in the encoding of the machine and warns of capitals.
        warnings.simplefilter("ignore")
        copy = Path(folder) / "header.hdr"
        copy.write_text(decode(path), errors="replace")
        try:
            header: dict[str, Any] = spy.read_envi_header(str(copy))
        except Exception:
            raise ValueError(f"{path}: not a legal ENVI header; is a brace left open, or the file cut short?") from None
    missing = [title for title in _NEEDED if title not in header]
    if missing:
        raise ValueError(f"{path}: the ENVI header lacks {missing[0]!r}")
    return header


def is_library(path: Path) -> bool:
    """Whether a header is that of a spectral library."""
    return str(read_header(path).get("file type", "")).strip().lower() == _LIBRARY.lower()


def read_envi_library(path: Path, data: Path | None = None) -> RawSpectra:
    """Read a spectral library: samples are its bands, lines its spectra.

    Lists of the header with an entry a spectrum are attributes. Bands that ``bbl`` marks as bad are left out, and so
    are spectra that hold the ``data ignore value``.

    Args:
        path: header.
        data: file of numbers, if it is known; else the file of the header's name beside it.

    Raises:
        FileNotFoundError: no data beside the header.
        ValueError: header or data are not legal, or there are no wavelengths.
    """
    header = read_header(path)
    stored = np.array(_memory_map(path, header, data))  # (spectra, wavelengths, 1)
    if stored.shape[2] != 1:
        raise ValueError(f"{path}: an ENVI spectral library of {stored.shape[2]} bands, where one is legal")
    wavelengths, bands, notes = _grid(path, header, stored.shape[1])
    ignore = _ignore(path, header)
    values = with_gaps(stored[:, bands, 0], ignore)
    count = len(values)
    names = _list(header, "spectra names") or [f"spectrum {i + 1}" for i in range(count)]
    if len(names) != count:
        raise ValueError(
            f"{path}: {len(names)} spectra names for {count} spectra; does a name hold a comma, which ENVI splits?"
        )
    attributes = {
        title: column
        for title, column in header.items()
        if isinstance(column, list) and len(column) == count and title not in ("spectra names", "wavelength", "fwhm")
    }
    return RawSpectra(
        wavelengths,
        names,
        values,
        "ENVI spectral library",
        notes,
        _declared_scale(path, header),
        "refuse" if ignore is None else "drop",
        attributes,
    )


def read_envi_cube(path: Path, data: Path | None = None) -> SpectraCube:
    """Open an image without reading it. Its unit is its scale factor, or told from 20 000 pixels spread over it.

    That is percent if the brightest of 99 % of them exceed 2, else fractions; a few pixels of glare do not decide.

    Raises:
        FileNotFoundError: no data beside the header.
        ValueError: header or data are not legal, there are no wavelengths, or the numbers are neither fractions nor
            percent and the header has no reflectance scale factor.
    """
    header = read_header(path)
    raw = _memory_map(path, header, data)
    wavelengths, bands, notes = _grid(path, header, raw.shape[2])
    try:
        grid = validate_wavelengths(wavelengths)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    ignore = _ignore(path, header)
    declared = _declared_scale(path, header)
    probe = SpectraCube(grid, raw, bands, declared or 1.0, ignore, notes, "ENVI image", "fraction", path)
    level = _bright(probe)
    if declared is not None:
        if level > MAX_DECLARED:
            raise ValueError(
                f"{path}: pixels reach a reflectance of {level:g} by the header's reflectance scale factor {declared:g}"
            )
        scale, unit = declared, {1.0: "fraction", 100.0: "percent"}.get(declared, "scaled")
    elif level <= MIN_PERCENT:
        scale, unit = 1.0, "fraction"
    elif level <= 100 * MAX_FRACTION:
        scale, unit = 100.0, "percent"
    else:
        raise ValueError(
            f"{path}: pixels reach {level:g}, neither fraction nor percent: add 'reflectance scale factor = 10000', "
            "say, to the header"
        )
    if scale != 1.0:
        notes.append("values are in percent; divided by 100" if scale == 100.0 else f"divided by {scale:g}")
    return SpectraCube(grid, raw, bands, scale, ignore, notes, "ENVI image", unit, path)


def _bright(cube: SpectraCube) -> float:
    """What the brightest bands of 99 % of the pixels of a sample stay below."""
    lines, samples, _ = cube.shape
    step = max(1, round(np.sqrt(lines * samples / _PROBE)))
    pixels = cube[::step, ::step].reshape(-1, cube.bands.size)
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        raise ValueError(f"{cube.path}: no pixel has data at every wavelength")
    return float(np.quantile(pixels.max(axis=1), 0.99))


def _memory_map(path: Path, header: dict[str, Any], data: Path | None) -> np.ndarray:
    """Numbers of the data file as (lines, samples, bands), read from disk when they are used."""
    import spectral.io.envi as spy

    try:
        params: Any = spy.gen_params(header)
        interleave = str(header["interleave"]).strip().lower()
        kind = {"bil": spy.BilFile, "bip": spy.BipFile, "bsq": spy.BsqFile}[interleave]
    except (KeyError, ValueError, TypeError) as error:
        raise ValueError(
            f"{path}: the ENVI header is not legal: {error} (of its sizes, data type or interleave)"
        ) from None
    if min(params.nrows, params.ncols, params.nbands) < 1 or params.offset < 0:
        raise ValueError(f"{path}: the ENVI header has sizes below 1 or a negative offset")
    if np.dtype(params.dtype).kind == "c":
        raise ValueError(f"{path}: the data are complex numbers, not reflectance")
    data = data or _data_beside(path, interleave)
    needed = params.offset + params.nrows * params.ncols * params.nbands * np.dtype(params.dtype).itemsize
    size = data.stat().st_size
    if size < needed:
        raise ValueError(f"{data}: {size} bytes where the header {path.name} promises {needed}; the file was cut short")
    params.filename = str(data)
    return kind(params, header).open_memmap(interleave="bip")


def _data_beside(path: Path, interleave: str) -> Path:
    """Data file of a header, by the names that ENVI and its kin use."""
    import spectral.io.envi as spy

    stem = path.with_suffix("")
    endings = [*spy.KNOWN_EXTS, interleave, "lib", "slb", "cube"]
    names = [stem, *(stem.with_name(f"{stem.name}.{end}") for word in endings for end in (word, word.upper()))]
    for name in names:
        if name.is_file() and name != path:
            return name
    raise FileNotFoundError(
        f"{path}: no data beside this ENVI header; looked for {stem.name} and {stem.name}.sli, .img, ..."
    )


def _grid(path: Path, header: dict[str, Any], count: int) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Wavelengths in ascending order, which stored bands they are, and notes; bad bands are left out."""
    texts = _list(header, "wavelength")
    if not texts:
        raise ValueError(f"{path}: the ENVI header has no wavelengths; add 'wavelength = {{400, 410, ...}}'")
    if len(texts) != count:
        raise ValueError(f"{path}: {len(texts)} wavelengths for {count} bands")
    try:
        values = np.array([float(text) for text in texts])
    except ValueError as error:
        raise ValueError(f"{path}: wavelengths: {error}") from None
    if not np.isfinite(values).all():
        raise ValueError(f"{path}: wavelength number {int(np.argmin(np.isfinite(values))) + 1} is not finite")
    try:
        wavelengths, notes = nanometres(values, " ".join(_list(header, "wavelength units")))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    good = _list(header, "bbl")
    bands = np.arange(count)
    if good:
        if len(good) != count:
            raise ValueError(f"{path}: the list of bad bands (bbl) has {len(good)} entries for {count} bands")
        bands = bands[[text.strip() not in ("0", "0.0") for text in good]]
        if not bands.size:
            raise ValueError(f"{path}: the header marks every band as bad (bbl)")
        if bands.size < count:
            notes.append(f"{count - bands.size} bands that the header marks as bad are left out")
    order = np.argsort(wavelengths[bands], kind="stable")
    if (order != np.arange(order.size)).any():
        notes.append("bands were sorted by wavelength")
    bands = bands[order]
    return wavelengths[bands], bands, notes


def _list(header: dict[str, Any], title: str) -> list[str]:
    """Entries of a list in the header; none if there is no such list."""
    value = header.get(title, [])
    return [text.strip() for text in (value if isinstance(value, list) else [value]) if text.strip()]


def _number(path: Path, header: dict[str, Any], title: str) -> float | None:
    """Number in a field of the header, or None if there is no such field."""
    text = header.get(title)
    if text is None or not str(text).strip():
        return None
    try:
        return float(str(text).strip(" {}"))
    except ValueError:
        raise ValueError(f"{path}: {title!r} in the header is {str(text)[:30]!r}, not a number") from None


def _ignore(path: Path, header: dict[str, Any]) -> float | None:
    return _number(path, header, "data ignore value")


def _declared_scale(path: Path, header: dict[str, Any]) -> float | None:
    scale = _number(path, header, "reflectance scale factor")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise ValueError(f"{path}: the header's reflectance scale factor is {scale:g}; it must be positive")
    return scale


def format_envi(table: SpectraTable) -> tuple[str, bytes, list[str]]:
    """A table as a spectral library: header, numbers (float64, so that nothing is lost) and notes on names changed.

    SPy's own writer is not used: it rounds to float32 and writes in the encoding of the machine.
    """
    names = [re.sub(r"[{}]", lambda m: "(" if m[0] == "{" else ")", name).replace(",", ";") for name in table.names]
    changed = [old for old, new in zip(table.names, names, strict=True) if old != new]
    notes = [f"ENVI has no commas or braces in names: {len(changed)} names changed"] if changed else []
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
    return header, np.ascontiguousarray(table.reflectance, dtype="<f8").tobytes(), notes
