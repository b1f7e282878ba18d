"""One's own file of paints, ``mine.csv``: read, and added to, paint by paint, all on the scale of
one white.

Paints of a file share error modes: what a paint that was fitted against the file's white inherits
of the white's errors stands in the white's own columns, what is its own in columns that are new and
empty of the others. So errors of their mixtures come out right. Lines that are there stay as they
are, letter by letter; the file is written in UTF-8, whatever it was in.
"""

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import equinox as eqx
import numpy as np

from glazejax import Pigment
from glazejax.io.outputs import check_output
from glazejax.io.source import open_source
from glazejax.io.words import shield_name, unshield_name
from glazejax.io.write import row_writer
from glazejax.paint.describe import format_length
from glazejax.paint.pigment_table import pigment_rows, read_pigments
from glazejax.whole_file import whole_file

from .pose import MOST_ERROR, error_modes
from .result import JointRecovery, by_paint


def read_own_paints(path: str | Path, argument: str = "") -> dict[str, Pigment]:
    """Paints of a file that may be added to, by name; none if it does not exist.

    Args:
        path: of the file.
        argument: what the path was given as; errors begin with it.

    Raises:
        FileNotFoundError: its folder does not exist.
        IsADirectoryError: it is a folder.
        ValueError: it is no table of paints.
    """
    path = check_output(path, overwrite=True, argument=argument)
    return read_pigments(path) if path.exists() and path.stat().st_size else {}


def add_paints(
    recovery: JointRecovery, path: str | Path, *, overwrite: bool = False
) -> tuple[str, ...]:
    """Add the paints of a joint fit to your own file of paints, as ``glazejax recover --into``
    does.

    `glazejax.catalogue.read` reads the file, and ``--pigments`` of the commands. It is written
    whole or not at all. Known paints that it lacks go into it too: the errors of the new ones
    depend on theirs. `read_loose_films` and
    `recipes_from_names` read what the command reads, and `recover_jointly` fits it with
    ``pigments={"ZincWhite": glazejax.catalogue.pigment("ZincWhite")}``, or what else the white
    of the tints is.

    Args:
        recovery: of `recover_jointly`. k and s are in 1/m if its `unit` is the thickness of a
            typical film.
        path: the CSV, which need not exist.
        overwrite: replace paints of the same name.

    Returns:
        Names of the paints that were written.

    Raises:
        ValueError: the file has a paint of that name, or another paint by the name of one that the
            fit was given, or it is no table of paints.
        FileNotFoundError, IsADirectoryError: there is no such folder, or the path is one.
    """
    path = Path(path)
    own_paints = read_own_paints(path)
    for name in recovery.known:
        if name in own_paints and not _same(recovery, name, own_paints[name]):
            raise ValueError(
                f"{path} has another {name!r} than the fit used: give the fit the file's own, "
                f"glazejax.catalogue.read(path)[{name!r}] (--white {name})"
            )
    written = entries(recovery, own_paints)
    new = tuple(paint.name for paint in written)
    if (existing := sorted(set(new) & set(own_paints))) and not overwrite:
        raise ValueError(
            f"{path} has an entry {existing[0]!r}; give another name, or replace it with "
            "overwrite=True (--overwrite)"
        )
    scale = f"a typical film taken as {format_length(recovery.unit)}"
    if recovery.known:
        scale = f"scale of {' and '.join(recovery.known)}"
    elif recovery.gauged:
        scale = "thickness measured"
    comments = [f"# {', '.join(new)}: glazejax recover, {len(recovery.films)} films, {scale}."]
    comments += [
        f"# {name}: {paint.provenance}"
        for name, paint in recovery.known_paints.items()
        if name in new
    ]
    # The other paints' lines stay as they are.
    lines: list[str] = []
    if own_paints:
        with open_source(path) as source:
            lines = [line for _, line in source.lines()]
    remarks = [line for line in lines if line.startswith("#")]
    remarks += [comment for comment in comments if comment not in remarks]
    cells = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    titles, rows = pigment_rows(written, digits=6)
    header = [title.strip() for title in cells[0]] if cells else titles
    wide = [*header, *(title for title in titles if title not in header)]
    # A paint without modes stays without: empty cells. One that has some has no share in the new.
    empty = "0" if "k_mode_1" in header else ""
    # Without that column k and s are known at all bands, and a cell of it must not be empty.
    defaults = {"identifiable": "True"}
    fill = [
        empty if "_mode_" in title else defaults.get(title, "") for title in wide[len(header) :]
    ]
    text = io.StringIO()
    write_row = row_writer(text)
    text.writelines(line + "\n" for line in remarks)
    write_row(wide)
    name_column = header.index("pigment")
    for row in cells[1:]:
        if unshield_name(row[name_column].strip()) not in new:
            write_row([*row, *fill])
    for name, *values in rows:
        row = dict(zip(titles, [shield_name(str(name)), *values], strict=True))
        # No share in modes that no new paint has either; other columns of the file are not ours.
        write_row([row.get(title, "0") for title in wide])
    with whole_file(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")
    return new


def _same(recovery: JointRecovery, name: str, existing: Pigment) -> bool:
    """True if a known paint is the file's own, as far as its modes state the fit's
    errors."""
    paint = recovery.known_paints[name]
    numbers = list(recovery.known_modes[name].values())
    try:
        paint, existing = (pigment.resample(recovery.wavelengths) for pigment in (paint, existing))
    except ValueError:  # another range
        return False
    refitted, stored = (np.stack([p.absorption, p.scattering]) for p in (paint, existing))
    if not np.allclose(refitted, stored, rtol=1e-4):
        return False
    if paint.error_modes is None:
        return True
    modes = error_modes(paint)
    modes_in_file = error_modes(existing)
    # Three digits of a mode are written.
    return len(modes_in_file) > max(numbers, default=-1) and np.allclose(
        modes[numbers], modes_in_file[numbers], rtol=6e-3, atol=1e-5
    )


def entries(recovery: JointRecovery, own_paints: Mapping[str, Pigment]) -> list[Pigment]:
    """Paints as they are written, in 1/m: a recovery's new ones, and known ones that the file
    lacks. Their error modes stand where the file's columns for them are, 0 in those of others.

    Args:
        recovery: joint fit of the new paints.
        own_paints: of the file that they go to.
    """
    in_file = (paint.error_modes for paint in own_paints.values())
    first = max((len(modes) for modes in in_file if modes is not None), default=0)
    # Numbers of known paints' modes among the others -> their columns in the file.
    columns: dict[int, int] = {}
    for name, paint in recovery.known_paints.items():
        numbers = recovery.known_modes[name]
        if name in own_paints:
            if paint.error_modes is not None:
                columns |= numbers
        elif not columns.keys() >= numbers.keys():
            columns |= {index: first + i for i, index in enumerate(numbers)}
            first += len(numbers)
    # Errors of log k and log s regressed on these others, for one standard deviation each, and what
    # is left.
    whole = recovery.whole_covariance
    shape = recovery.unknowns.bands.shape
    slopes, across = (values.reshape(-1, *shape) for values in whole.regress(list(columns)))
    variance = recovery.log_variance - np.sum(slopes * across, axis=0)
    # As large as is used to first order; both parts of an error equally.
    total = np.sqrt(np.sum(slopes**2, axis=0) + np.maximum(variance, 0.0))
    cap = np.minimum(1.0, MOST_ERROR / np.maximum(total, 1e-12))
    # Error modes that are the new paints' own.
    new = np.tile(~np.isin(recovery.paints, recovery.known), 2)
    own_modes = by_paint(whole.largest(cap * new, 16, list(columns)))
    # The fit may have moved the others, but what is known stays as it is: so paints are shifted to
    # where they are likely if the others are nought, as a tint demands, and the others count with
    # all of their prior that was open.
    shift = np.tensordot(recovery.unknowns.others[list(columns)], slopes, 1)
    coefficients = np.exp(by_paint(recovery.unknowns.bands - shift)) / recovery.unit
    sd = coefficients * by_paint(total)
    modes = np.zeros((first + len(own_modes), *sd.shape))
    modes[list(columns.values())] = by_paint(slopes * cap)
    modes[first:] = own_modes
    # New paints: k and s, how known paints' errors move them, and errors of their own.
    pigments = [
        Pigment(
            name,
            recovery.wavelengths,
            *coefficients[:, row],
            identifiable=recovery.identifiable[row],
            absorption_sd=sd[0, row],
            scattering_sd=sd[1, row],
            error_modes=modes[:, :, row],
        )
        for row, name in enumerate(recovery.paints)
        if name not in recovery.known
    ]
    # Known paints that the file lacks, with their own errors.
    for name, paint in recovery.known_paints.items():
        if name in own_paints:
            continue
        numbers = recovery.known_modes[name]
        known_paint = paint.resample(recovery.wavelengths)
        stated_modes = np.zeros_like(modes[:, :, 0])
        stated_modes[[columns[index] for index in numbers]] = error_modes(known_paint)[
            list(numbers.values())
        ]
        pigments.append(
            eqx.tree_at(
                lambda pigment: pigment.error_modes,
                known_paint,
                stated_modes,
                is_leaf=lambda leaf: leaf is None,
            )
        )
    return pigments
