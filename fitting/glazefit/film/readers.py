"""Readers of measured films: tables of four rows a film, and lists of what the films are made of.

The layout is that of the Revigo spectra: `X_b` and `X_w` are the bare black and white cards of film
X, `X_ob` and
`X_ow` its paint over them; tab, comma or semicolon separated, percent or fraction.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np

from glazejax.io import SpectraTable, read_spectra
from glazejax.io.quantity import Stated
from glazejax.io.source import naming, open_source

from .films import Films, usual_cards

ROWS = {
    "b": "the bare black card",
    "w": "the bare white card",
    "ob": "paint over black",
    "ow": "paint over white",
}
ENDINGS = ", ".join(f"_{end} ({what})" for end, what in ROWS.items())
NAMES_FILE = "mixtures.tsv"


def read_films(path: str | Path, **stated: Unpack[Stated]) -> Films:
    """Read films over a black and a white card.

    Any table that `glazejax.io.read_spectra` reads will do, if its spectra come in fours: NAME_b,
    NAME_w, NAME_ob and NAME_ow, the bare black and white card and the paint over each.
    `read_loose_films` reads tables that lack some. Of readings with the specular component and
    without (NAME_b SCI, NAME_b SCE) the former are taken.

    Args:
        path: the table, in fractions or percent; its wavelengths in nm.
        stated: ``quantity``, ``unit`` and ``scale``, as `glazejax.io.read_spectra` takes them.

    Returns:
        The films, reflectance as fractions; their notes say what the reader changed.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the table is not legal (see `read_spectra`), a name has no such ending, or a
            film lacks one of its four rows. The message is one line and says which.
    """
    return films_in(read_spectra(path, **stated), path)


def films_in(table: SpectraTable, path: str | Path) -> Films:
    """Films of a table that was read from a file, as `read_films` gives them; errors name it."""
    with naming(path):
        return films_of(one_reading(table))


def one_reading(table: SpectraTable, *, specular: bool = True) -> SpectraTable:
    """Spectra read with the specular component (or without), of a table that has both as NAME SCI
    and NAME SCE, as `glazejax.io.read_spectra` names them; any other table as it is.
    """
    kinds = (("SCI", "SPIN"), ("SCE", "SPEX"))
    ends = [next((i for i in (0, 1) if name.endswith(kinds[i])), None) for name in table.names]
    if set(ends) != {0, 1}:
        return table
    used = [row for row, end in enumerate(ends) if end == (0 if specular else 1)]
    word = "included (SCI)" if specular else "excluded (SCE)"
    return replace(
        table,
        names=tuple(table.names[row].rpartition(" ")[0] for row in used),
        reflectance=table.reflectance[used],
        attributes={},
        notes=[
            *table.notes,
            f"of both kinds, readings with the specular component {word} are used",
        ],
    )


def films_of(table: SpectraTable) -> Films:
    """Films of a table whose spectra come in fours, as `read_films` wants them.

    Raises:
        ValueError: a name has no such ending, or a film lacks one of its four rows.
    """
    rows = rows_of(table)
    for name in table.names:
        if "opaque" in rows.get(name, {}):
            raise ValueError(f"the name {name!r} must end in {ENDINGS}")
    for film, row_of in rows.items():
        missing = [end for end in ROWS if end not in row_of]
        if missing:
            raise ValueError(
                f"film {film!r} has no row '{film}_{missing[0]}' ({ROWS[missing[0]]}); a film "
                f"needs all four of {', '.join('_' + end for end in ROWS)}"
            )
    return build_films(table, rows, {})


def rows_of(table: SpectraTable) -> dict[str, dict[str, int]]:
    """Numbers of the rows of each film by their ending, "opaque" for a name without one."""
    rows: dict[str, dict[str, int]] = {}
    for number, name in enumerate(table.names):
        film, _, ending = name.rpartition("_")
        if film and ending in ROWS:
            rows.setdefault(film, {})[ending] = number
        else:
            rows.setdefault(name, {})["opaque"] = number
    return rows


def build_films(
    table: SpectraTable, rows: Mapping[str, Mapping[str, int]], shared: Mapping[str, int]
) -> Films:
    """Films of a table's rows.

    Args:
        table: of spectra.
        rows: of films that have paint, see `rows_of`; a reading that there is not takes the other's
            values.
        shared: ending -> number of the row of cards of all films. Usual cards are assumed where
            there are none.
    """
    over = np.array(
        [
            [row_of.get("ob", row_of.get("opaque", -1)), row_of.get("ow", -1)]
            for row_of in rows.values()
        ]
    )
    bare = np.array(
        [[row_of.get(end, shared.get(end, -1)) for end in "bw"] for row_of in rows.values()]
    )
    seen = over >= 0
    assumed = bare < 0
    painted = table.reflectance[np.where(seen, over, over[:, ::-1])]
    usual = np.stack(usual_cards(table.wavelengths))
    cards = np.where(assumed[..., None], usual, table.reflectance[bare])
    return Films(
        names=tuple(rows),
        wavelengths=table.wavelengths,
        bare_black=cards[:, 0],
        bare_white=cards[:, 1],
        over_black=painted[:, 0],
        over_white=painted[:, 1],
        notes=tuple(table.notes),
        seen=seen,
        assumed=assumed,
        opaque=np.array(["opaque" in row_of for row_of in rows.values()]),
    )


def read_recipes(path: str | Path) -> dict[str, dict[str, float]]:
    """Read what films are made of: a line each, ``07C<TAB>ZincWhite-BoneBlack|97.1-2.9``, weights
    in percent.

    Returns:
        For each sample the paints in it and their percentages; those of none are left out.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a line of another form, a weight that is not a number >= 0, or a sample listed
            twice.
    """
    recipes: dict[str, dict[str, float]] = {}
    count = 0
    most = 200_000
    with open_source(path) as source:
        for number, line in source.lines():
            if not line.strip() or line.startswith("#"):
                continue
            sample, tab, recipe = line.partition("\t")
            paints, bar, weights = recipe.strip().partition("|")
            sample = sample.strip()
            try:
                values = [float(weight) for weight in weights.split("-")]
            except ValueError:
                values = []
            if not (
                tab
                and bar
                and sample
                and len(values) == len(paints.split("-"))
                and np.isfinite(values).all()
            ):
                raise source.error(
                    "expected 'SAMPLE<TAB>PaintA-PaintB|weightA-weightB', not "
                    f"{line.strip()[:80]!r}",
                    number,
                )
            if sample in recipes:
                raise source.error(f"sample {sample!r} is listed twice", number)
            count += len(values)
            if count > most:
                raise source.error(
                    f"more than {most} paints in films so far; split the file", number
                )
            recipes[sample] = {
                p: w for p, w in zip(paints.split("-"), values, strict=True) if w > 0
            }
    return recipes


def is_masstone(recipe: dict[str, float]) -> bool:
    """True if a film is one paint only."""
    return len(recipe) == 1 and next(iter(recipe.values())) >= 99.95


def readable_names(
    samples: tuple[str, ...], recipes: dict[str, dict[str, float]]
) -> tuple[str, ...]:
    """Readable names of films: the paint of a masstone, sample and recipe of a mixture, else the
    sample.

    A paint of which there are several masstones keeps its sample's number.
    """
    names = []
    for sample in samples:
        recipe = recipes.get(sample)
        if not recipe:
            names.append(sample)
        elif is_masstone(recipe):
            names.append(next(iter(recipe)))
        else:
            names.append(
                f"{sample} "
                + " + ".join(f"{paint} {weight:g}%" for paint, weight in recipe.items())
            )
    return tuple(
        f"{sample} {name}" if names.count(name) > 1 else name
        for sample, name in zip(samples, names, strict=True)
    )
