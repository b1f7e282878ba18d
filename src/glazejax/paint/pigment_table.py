"""Tables of fitted pigments, one line for each pigment and wavelength, as ``glazejax recover`` and
``glazejax map`` write them.
"""

import csv
import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ..io.source import Source, open_source, show_path
from ..io.words import read_number, unshield_name
from ..io.write import table_bytes, write_files
from .media import Pigment

_NEEDED = ("pigment", "wavelength_nm", "absorption", "scattering")
_OPTIONAL = ("absorption_sd", "scattering_sd", "identifiable")
# A standard deviation may be missing or infinite where a coefficient is not identifiable.
_DOUBTFUL = re.compile(r"(absorption|scattering)_sd|[ks]_mode_[0-9]+")
_TRUTH = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}
# Columns of one pigment by title, in the order of the file; `identifiable` holds booleans.
_Columns = dict[str, list[float]]
_Refusal = Callable[[str], ValueError]


def read_pigments(path: str | Path, provenance: str = "") -> dict[str, Pigment]:
    """Read pigments from a CSV file.

    Columns, in any order and found by their titles: pigment, wavelength_nm, absorption (k, 1/m),
    scattering (s, 1/m), and optionally absorption_sd, scattering_sd (1/m), identifiable (true or
    false), and error modes of log k and log s, k_mode_1, k_mode_2, ... and as many s_mode (see
    `Pigment`). Other columns are left alone; lines that start with # are kept as the pigments'
    provenance, unless another is given.

    Returns:
        name -> pigment, in the order of the file.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a column is missing, a cell is not a finite number, or a pigment's wavelengths
            do not ascend or its coefficients are negative; the message names file and line.
    """
    comments: list[str] = []
    header: list[str] = []
    doubtful: list[str] = []
    pigments: dict[str, _Columns] = {}
    # A line takes up to 200 bytes while it is read, a pigment some thousand.
    most_lines = 500_000
    most_pigments = 20_000
    with open_source(
        path, missing=f"{show_path(path)}: there is no such file of pigments"
    ) as source:
        for count, (number, line) in enumerate(source.lines()):
            if line.startswith("#"):
                comments.append(line.lstrip("# ").strip())
                continue
            if not line.strip():
                continue
            error = partial(source.error, line=number)
            try:
                cells = [cell.strip() for cell in next(csv.reader([line]))]
            except csv.Error as wrong:
                raise error(f"{wrong}; is a quotation mark left open?") from None
            if not header:
                header = cells
                missing = ", ".join(title for title in _NEEDED if title not in header)
                if missing:
                    raise error(f"no column {missing}; expected {','.join(_NEEDED + _OPTIONAL)}")
                doubtful = [title for title in header if _DOUBTFUL.fullmatch(title)]
                continue
            if len(cells) != len(header):
                raise error(f"{len(cells)} cells where the header has {len(header)}")
            _add(pigments, error, dict(zip(header, cells, strict=True)), doubtful)
            if count > most_lines or len(pigments) > most_pigments:
                raise error(
                    f"more than {most_lines} lines or {most_pigments} pigments so far; split the "
                    "file"
                )
        if not header:
            raise source.error("the file is empty")
        if not pigments:
            raise source.error("there is a header but no pigment below it")
        provenance = provenance or " ".join(comments)
        return {
            name: _pigment(source, name, columns, provenance) for name, columns in pigments.items()
        }


def _add(
    pigments: dict[str, _Columns], error: _Refusal, row: dict[str, str], doubtful: list[str]
) -> None:
    """Append a line of the file to its pigment; in columns that are doubtful a number may be
    missing.
    """
    name = unshield_name(row["pigment"])
    if not name:
        raise error("the pigment has no name")
    columns = pigments.setdefault(name, {})
    for title in _NEEDED[1:]:
        columns.setdefault(title, []).append(_number(error, row, title))
    for title in doubtful:
        columns.setdefault(title, []).append(_maybe(row[title]))
    if "identifiable" in row:
        truth = _TRUTH.get(row["identifiable"].lower())
        if truth is None:
            raise error(f"identifiable is {row['identifiable']!r}; it must be true or false")
        columns.setdefault("identifiable", []).append(truth)


def _number(error: _Refusal, row: dict[str, str], title: str) -> float:
    value = _maybe(row[title])
    # Beyond it single precision has no numbers, and no paint has such coefficients.
    if not abs(value) < 1e30:
        raise error(
            f"{title} is {row[title]!r}, not a finite number" + " below 1e30" * math.isfinite(value)
        )
    return value


def _maybe(cell: str) -> float:
    try:
        return read_number(cell)
    except ValueError:
        return math.nan


def _modes(columns: _Columns) -> np.ndarray | None:
    """Error modes, (modes, 2, bands), by their numbers; None if the table has none, not those of s
    that it has of k, or cells that are empty.
    """

    def number(title: str) -> int:
        return int(title.rpartition("_")[2])

    titles = [
        sorted((title for title in columns if title.startswith(f"{what}_mode_")), key=number)
        for what in "ks"
    ]
    if not titles[0] or [*map(number, titles[0])] != [*map(number, titles[1])]:
        return None
    # From k and s by title to modes of both.
    modes = np.array([[columns[title] for title in half] for half in titles]).swapaxes(0, 1)
    return modes if np.all(np.isfinite(modes)) else None


def _pigment(source: Source, name: str, columns: _Columns, provenance: str) -> Pigment:
    def find_column(title: str) -> list[float] | None:
        values = columns.get(title, [])
        # A standard deviation that is missing or infinite in one band is left out for all.
        return values if values and all(abs(value) < 1e30 for value in values) else None

    try:
        return Pigment(
            name,
            *(columns[title] for title in _NEEDED[1:]),
            absorption_sd=find_column("absorption_sd"),
            scattering_sd=find_column("scattering_sd"),
            identifiable=columns.get("identifiable"),
            error_modes=_modes(columns),
            provenance=provenance or f"from {source.path}",
        )
    except ValueError as error:
        raise source.error(f"pigment {name!r}: {error}") from None


def write_pigments(
    path: str | Path,
    pigments: Iterable[Pigment],
    comments: Sequence[str] = (),
    *,
    digits: int | None = None,
    overwrite: bool = False,
) -> None:
    """Write pigments so that `read_pigments` gives the same numbers back.

    Args:
        path: the CSV; its folder must exist.
        pigments: with k and s of one spectrum each.
        comments: lines above the table, kept as the pigments' provenance.
        digits: of k, s and their standard deviations, by default all.
        overwrite: whether a file that exists may be replaced.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        ValueError: a pigment is a batch.
    """
    titles, rows = pigment_rows(list(pigments), digits)
    notes = "".join(f"# {line}\n" for line in comments).encode()
    write_files({Path(path): [notes, table_bytes(titles, rows)]}, overwrite=overwrite)


def pigment_rows(
    pigments: Sequence[Pigment], digits: int | None
) -> tuple[list[str], list[list[object]]]:
    """Titles and rows of a table of pigments; of an error mode three digits, and no more than five
    behind the point.

    Args:
        pigments, digits: as for `write_pigments`.

    Raises:
        ValueError: a pigment is a batch.
    """
    most = max((len(p.error_modes) for p in pigments if p.error_modes is not None), default=0)
    titles = [*_NEEDED, *_OPTIONAL, *(f"{w}_mode_{n + 1}" for w in "ks" for n in range(most))]

    def cell(value: float) -> object:
        if np.isnan(value):
            return ""
        return value if digits is None else f"{value:.{digits}g}"

    def mode_cell(value: float) -> str:
        return "" if np.isnan(value) else format(round(value, 5) + 0.0, ".3g")

    rows = []
    for pigment in pigments:
        k, s = np.asarray(pigment.absorption), np.asarray(pigment.scattering)
        if k.ndim != 1 or s.ndim != 1:
            raise ValueError(f"pigment {pigment.name!r} is a batch: write its members one by one")
        sds = [
            np.full(k.size, np.nan) if sd is None else np.asarray(sd)
            for sd in (pigment.absorption_sd, pigment.scattering_sd)
        ]
        identifiable = pigment.identifiable
        # Modes of k, then those of s, as the titles are.
        modes = np.full((2, most, k.size), np.nan)
        if pigment.error_modes is not None:
            # Another paint may have more; an empty cell would say that there are none.
            modes[:] = 0.0
            modes[:, : len(pigment.error_modes)] = np.swapaxes(pigment.error_modes, 0, 1)
        numbers = np.stack([pigment.wavelengths, k, s, *sds], axis=1)
        for band, band_modes in enumerate(modes.reshape(2 * most, k.size).T.tolist()):
            known_there = identifiable is None or bool(identifiable[band])
            cells = [cell(value) for value in numbers[band]]
            rows.append([pigment.name, *cells, known_there, *map(mode_cell, band_modes)])
    return titles, rows
