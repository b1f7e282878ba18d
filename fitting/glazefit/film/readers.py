"""Readers of measured films, and of what the films are made of.

Rows of a table are recognised by their endings. The layout is that of the Revigo spectra: `X_b` and
`X_w` are the bare black and white cards of film X, `X_ob` and `X_ow` its paint over them; tab,
comma or semicolon separated, percent or fraction. `read_films` wants all four.

Films as they come from a kitchen table are over one card or two, with the cards measured or not, or
just opaque paint. For `read_loose_films` no ending must be there:

- NAME_ob, NAME_ow: paint over black, over white; one of them will do.
- NAME_b, NAME_w: that film's own cards, bare. Else card_b and card_w, those of all films. Else a
usual card is assumed.
- NAME alone: paint that hides whatever is below.

A film may be called by what is in it: ``Ultramarine 1:10 ZincWhite`` is one part of ultramarine to
ten of white by weight; any other name is that of a paint.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Unpack

import numpy as np

from glazejax.io import SpectraTable, read_spectra
from glazejax.io.finish import NUMBERED
from glazejax.io.quantity import Stated
from glazejax.io.source import naming, open_source
from glazejax.io.spectra_table import list_names
from glazejax.names import first_repeated

from .films import Films, usual_cards
from .shared_bands import crop

ROWS = {
    "b": "the bare black card",
    "w": "the bare white card",
    "ob": "paint over black",
    "ow": "paint over white",
}
ENDINGS = ", ".join(f"_{end} ({what})" for end, what in ROWS.items())
NAMES_FILE = "mixtures.tsv"
USUAL_RANGE = (380.0, 780.0)
"""Where usual cards are known, nm."""

_CARDS = {"card", "cards"}
# A row with an ending, and the measurement condition of CxF behind it.
_CONDITION = re.compile(r"(?P<row>.+_(?:b|w|ob|ow)) \((?P<condition>.+)\)", re.IGNORECASE)
_TINT = re.compile(
    r"(?P<first>\S.*?)\s+(?P<a>\d+(?:\.\d+)?)\s*:\s*(?P<b>\d+(?:\.\d+)?)\s+(?P<second>\S.*)"
)


def read_films(path: str | Path, *, specular: bool = True, **stated: Unpack[Stated]) -> Films:
    """Read films over a black and a white card.

    Any table that `glazejax.io.read_spectra` reads will do, if its spectra come in fours: NAME_b,
    NAME_w, NAME_ob and NAME_ow, the bare black and white card and the paint over each.
    `read_loose_films` reads tables that lack some.

    Args:
        path: the table, in fractions or percent; its wavelengths in nm.
        specular: of a table of both, whether readings with the specular component are taken
            (NAME_ob SCI) or those without (NAME_ob SCE).
        stated: ``quantity``, ``unit`` and ``scale``, as `glazejax.io.read_spectra` takes them.

    Returns:
        The films, reflectance as fractions; their notes say what the reader changed.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the table is not legal (see `read_spectra`), a name has no such ending, or a
            film lacks one of its four rows. The message is one line and says which.
    """
    return films_in(read_spectra(path, **stated), path, specular=specular)


def films_in(table: SpectraTable, path: str | Path, *, specular: bool = True) -> Films:
    """Films of a table that was read from a file, as `read_films` gives them; errors name it."""
    with naming(path):
        return films_of(one_reading(table, specular=specular))


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
    """Numbers of the rows of each film by their ending, "opaque" for a name without one.

    Raises:
        ValueError: a sample with several readings.
    """
    if repeated := [note for note in table.notes if note.startswith(NUMBERED)]:
        raise ValueError(f"{repeated[0]}; a film has one reading of each kind: average them first")
    rows: dict[str, dict[str, int]] = {}
    for number, name in enumerate(table.names):
        film, _, ending = name.rpartition("_")
        if several := _CONDITION.fullmatch(name):
            raise ValueError(
                f"{several['row']!r} was read under several conditions, such as "
                f"{several['condition']}: export one of them"
            )
        if film and (ending := ending.lower()) in ROWS:
            if ending in rows.setdefault(film, {}):
                raise ValueError(f"film {film!r} has two rows '{film}_{ending}'")
            rows[film][ending] = number
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


def read_loose_films(path: str | Path, *, specular: bool = True, **stated: Unpack[Stated]) -> Films:
    """Read films of which not every reading is there: over one card or two, or opaque, with or
    without their cards.

    Rows of a table are recognised by their endings, all optional: NAME_ob and NAME_ow are
    paint over black and over white, NAME_b and NAME_w that film's own cards, card_b and card_w the
    cards of all films (usual ones are assumed if they are missing). NAME alone is paint that hides
    whatever is below. `recipes_from_names` says what films called ``Ultramarine 1:10 ZincWhite``
    are made of.

    Args:
        path: any table that `glazejax.io.read_spectra` reads; a fraction or percent, nm.
        specular: of a table of both, whether readings with the specular component are taken
            (NAME_ob SCI) or those without (NAME_ob SCE).
        stated: ``quantity``, ``unit`` and ``scale``, as `glazejax.io.read_spectra` takes them.

    Returns:
        The films; their notes say what was assumed.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the table is not legal (see `glazejax.io.read_spectra`), cards without paint, or
            a name whose ending is nearly right. The message is one line and says which.
    """
    table = one_reading(read_spectra(path, **stated), specular=specular)
    with naming(path):
        return loose_films(table)


def loose_films(table: SpectraTable) -> Films:
    """Films of a table whose rows are named as `read_loose_films` wants them.

    Raises:
        ValueError: cards without paint, or a name whose ending is nearly right.
    """
    rows = rows_of(table)
    shared = {}
    for film, endings in list(rows.items()):
        if film.lower() in _CARDS and {"ob", "ow"}.isdisjoint(endings):
            shared.update(rows.pop(film))
    _check_rows(rows)
    return _add_notes(build_films(table, rows, shared))


def _check_rows(rows: Mapping[str, Mapping[str, int]]) -> None:
    if not rows:
        raise ValueError(
            "there are cards but no paint: name its rows NAME_ob (over black) and NAME_ow (over "
            "white)"
        )
    for film, endings in rows.items():
        stem, mark, _ = film.rpartition("_")
        if "opaque" in endings and mark and stem in rows:
            raise ValueError(f"the name {film!r} must end in {ENDINGS}")
        if "opaque" in endings and len(endings) > 1:
            raise ValueError(
                f"{film!r} is there with an ending and without: opaque paint has one row, {film!r}"
            )
        if {"ob", "ow", "opaque"}.isdisjoint(endings):
            raise ValueError(
                f"film {film!r} has no row '{film}_ob' or '{film}_ow' (paint over black, over "
                "white); cards of all films are card_b and card_w"
            )


def _add_notes(films: Films) -> Films:
    """Films with sentences on what was taken for granted; assumed cards end where usual cards are
    known.
    """
    notes = list(films.notes)
    if films.opaque.any():
        names = list(compress(films.names, films.opaque))
        notes.append(
            f"{list_names(names)}: no ending _ob or _ow, so taken to hide whatever is below"
        )
    needed = films.assumed & films.seen & ~films.opaque[:, None]
    cards = ("black", "white")
    missing = [card for card, lacks in zip(cards, needed.T, strict=True) if lacks.any()]
    if missing:
        notes.append(
            f"the {' and the '.join(missing)} card was not measured (card_b, card_w): a usual one "
            "is assumed, and its level is fitted"
        )
    films = replace(films, notes=tuple(notes))
    return crop(films, *USUAL_RANGE, "usual cards are known there only") if missing else films


def read_recipes(path: str | Path) -> dict[str, dict[str, float]]:
    """Read what films are made of: a line each, ``07C<TAB>ZincWhite-BoneBlack|97.1-2.9``, weights
    in percent.

    Returns:
        For each sample the paints in it and their percentages; those of none are left out.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a line of another form, a weight that is not a number >= 0, weights that are all
            0, or a sample, or a paint of one, listed twice.
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
            if (twice := first_repeated(paints.split("-"))) is not None:
                raise source.error(
                    f"paint {twice!r} is listed twice in {sample!r}; add its weights up", number
                )
            if not any(values):
                raise source.error(f"all weights of {sample!r} are 0", number)
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
    return len(recipe) == 1


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
            percent = 100.0 / sum(recipe.values())
            parts = (f"{paint} {percent * weight:.4g}%" for paint, weight in recipe.items())
            names.append(f"{sample} {' + '.join(parts)}")
    return tuple(
        f"{sample} {name}" if names.count(name) > 1 else name
        for sample, name in zip(samples, names, strict=True)
    )


def tint(name: str) -> dict[str, float] | None:
    """Paints and parts by weight of a film that is called by them, such as ``Red 1:10 White``; None
    if it is not.
    """
    match = _TINT.fullmatch(name)
    if match is None:
        return None
    weights = {match["first"]: float(match["a"]), match["second"]: float(match["b"])}
    return weights if len(weights) == 2 and sum(weights.values()) > 0 else None


def recipes_from_names(
    names: Sequence[str], listed: Mapping[str, Mapping[str, float]] | None = None
) -> dict[str, Mapping[str, float]]:
    """Recipes of films: as listed, or as their names say, or else one paint of that name.

    Args:
        names: of films; ``Red 1:10 White`` is a tint by weight.
        listed: film -> paint -> weight, in any unit, such as `read_recipes` reads.

    Returns:
        film -> paint -> weight, as `recover_jointly` takes it.

    Example:
        >>> recipes_from_names(["Red 1:10 White", "Red"])
        {'Red 1:10 White': {'Red': 1.0, 'White': 10.0}, 'Red': {'Red': 100.0}}
    """
    listed = listed or {}
    return {name: listed.get(name) or tint(name) or {name: 100.0} for name in names}
