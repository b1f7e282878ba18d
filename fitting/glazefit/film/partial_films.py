"""Films as they come from a kitchen table: over one card or two, with the cards measured or not, or
just opaque paint.

Rows of a table are recognised by their endings, as in `readers`, but none must be there:

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

from glazejax.io import SpectraTable, read_spectra
from glazejax.io.quantity import Stated
from glazejax.io.source import naming
from glazejax.io.spectra_table import list_names

from .films import Films
from .readers import ENDINGS, build_films, one_reading, rows_of
from .shared_bands import crop

USUAL_RANGE = (380.0, 780.0)
"""Where usual cards are known, nm."""

_CARDS = {"card", "cards"}
_TINT = re.compile(
    r"(?P<first>\S.*?)\s+(?P<a>\d+(?:\.\d+)?)\s*:\s*(?P<b>\d+(?:\.\d+)?)\s+(?P<second>\S.*)"
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
