"""Tables of fitted pigments, one line for each pigment and wavelength, as ``glazejax recover`` writes them."""

import csv
import math
from pathlib import Path

from .media import Pigment

_NEEDED = ("pigment", "wavelength_nm", "absorption", "scattering")
_OPTIONAL = ("absorption_sd", "scattering_sd", "identifiable")
_TRUTH = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}
# Columns of one pigment by title, in the order of the file; `identifiable` holds booleans.
_Columns = dict[str, list[float]]


def read_pigments(path: str | Path, provenance: str = "") -> dict[str, Pigment]:
    """Read pigments from a CSV file.

    Columns, in any order and found by their titles: pigment, wavelength_nm, absorption (k, 1/m), scattering
    (s, 1/m), and optionally absorption_sd, scattering_sd (1/m) and identifiable (true or false). Other columns
    are left alone; lines that start with # are kept as the pigments' provenance, unless another is given.

    Returns:
        name -> pigment, in the order of the file.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a column is missing, a cell is not a finite number, or a pigment's wavelengths do not
            ascend or its coefficients are negative; the message names file and line.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file of pigments")
    if path.is_dir():
        raise ValueError(f"{path} is a folder: give the file of pigments inside it, often pigments.csv")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not UTF-8 text; a table of pigments is a CSV file") from None
    comments = " ".join(line.lstrip("# ").strip() for line in lines if line.startswith("#"))
    numbered = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not numbered:
        raise ValueError(f"{path}: the file is empty")
    header = [title.strip() for title in next(csv.reader([numbered[0][1]]))]
    missing = [title for title in _NEEDED if title not in header]
    if missing:
        raise ValueError(
            f"{path}, line {numbered[0][0]}: no column {', '.join(missing)}; expected {','.join(_NEEDED + _OPTIONAL)}"
        )
    pigments: dict[str, _Columns] = {}
    for number, line in numbered[1:]:
        cells = [cell.strip() for cell in next(csv.reader([line]))]
        where = f"{path}, line {number}"
        if len(cells) != len(header):
            raise ValueError(f"{where}: {len(cells)} cells where the header has {len(header)}")
        _add(pigments, where, dict(zip(header, cells, strict=True)))
    if not pigments:
        raise ValueError(f"{path}: there is a header but no pigment below it")
    return {name: _pigment(path, name, rows, provenance or comments) for name, rows in pigments.items()}


def _add(pigments: dict[str, _Columns], where: str, row: dict[str, str]) -> None:
    """Append a line of the file to its pigment."""
    name = row["pigment"]
    if not name:
        raise ValueError(f"{where}: the pigment has no name")
    columns = pigments.setdefault(name, {})
    for title in _NEEDED[1:]:
        columns.setdefault(title, []).append(_number(where, row, title))
    for title in ("absorption_sd", "scattering_sd"):
        if title in row:
            # A standard deviation may be missing or infinite where a coefficient is not identifiable.
            columns.setdefault(title, []).append(_maybe(row[title]))
    if "identifiable" in row:
        truth = _TRUTH.get(row["identifiable"].lower())
        if truth is None:
            raise ValueError(f"{where}: identifiable is {row['identifiable']!r}; it must be true or false")
        columns.setdefault("identifiable", []).append(truth)


def _number(where: str, row: dict[str, str], title: str) -> float:
    value = _maybe(row[title])
    if not math.isfinite(value):
        raise ValueError(f"{where}: {title} is {row[title]!r}, not a finite number")
    return value


def _maybe(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _pigment(path: Path, name: str, columns: _Columns, provenance: str) -> Pigment:
    def known(title: str) -> list[float] | None:
        values = columns.get(title, [])
        return values if values and all(map(math.isfinite, values)) else None

    try:
        return Pigment(
            name,
            *(columns[title] for title in _NEEDED[1:]),
            absorption_sd=known("absorption_sd"),
            scattering_sd=known("scattering_sd"),
            identifiable=columns.get("identifiable"),
            provenance=provenance or f"from {path}",
        )
    except ValueError as error:
        raise ValueError(f"{path}, pigment {name!r}: {error}") from None
