"""An identification as a table."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np

_OF_SPECTRUM = ("none_of_these", "explained", "coats_probability")
COLUMNS = (
    "spectrum",
    "rank",
    "probability",
    *(f"{what}_{n}" for n in (1, 2, 3) for what in ("paint", "fraction", "fraction_sd", "coat")),
    "thickness_um",
    "thickness_sd_um",
    "rmse",
    "spectral_angle_deg",
    "delta_e_2000",
    "gloss",
    *_OF_SPECTRUM,
)
FAMILY_COLUMNS = (
    "spectrum",
    "rank",
    "families",
    "probability",
    "right_in_tests",
    "nearest_exemplars",
    *_OF_SPECTRUM,
)
"""Of a table of families: how often an answer that sure was right in tests stands with the first.
"""


def table_of(found: Any, top: int | None = None) -> tuple[tuple[str, ...], Iterator[list[object]]]:
    """Titles, and a row for each of the most probable explanations of an `Identification`, of
    families where these were sought.
    """
    if found.family_sets:
        return FAMILY_COLUMNS, _family_rows(found, top)
    return COLUMNS, _rows(found, top)


def _rows(found: Any, top: int | None) -> Iterator[list[object]]:
    """Cells of `COLUMNS`, a row an explanation."""
    for row, name in enumerate(found.measured.names):
        for rank, one in enumerate(found.ranked(row, top), start=1):
            coats = [coat + 1 for coat in one.coats]
            each = zip(one.paints, one.fractions, one.fractions_sd, coats, strict=True)
            paints: list[object] = [*chain.from_iterable(each)]
            thick = [one.thickness * 1e6, one.thickness_sd * 1e6]
            yield [
                name,
                rank,
                one.probability,
                *paints,
                *[None] * (12 - len(paints)),
                *([None, None] if found.opaque else thick),
                one.rmse,
                one.angle,
                None if np.isnan(one.delta_e) else one.delta_e,
                one.gloss,
                *_of_spectrum(found, row),
            ]


def _family_rows(found: Any, top: int | None) -> Iterator[list[object]]:
    """Cells of `FAMILY_COLUMNS`, a row an answer."""
    for row, name in enumerate(found.measured.names):
        counts = found.came_true(row)
        for rank, answer in enumerate(found.family_sets[row][:top], start=1):
            yield [
                name,
                rank,
                answer.words,
                answer.probability,
                f"{counts[0]} of {counts[1]}" if counts and rank == 1 else None,
                found.nearest_exemplars(row) if rank == 1 else None,
                *_of_spectrum(found, row),
            ]


def _of_spectrum(found: Any, row: int) -> tuple[object, ...]:
    return found.none[row], bool(found.explained[row]), found.coats_probability[row]
