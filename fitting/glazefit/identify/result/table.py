"""An identification as a table."""

from collections.abc import Iterator
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

TableRows: TypeAlias = Iterator[list[object]]
"""Rows of a table, cell by cell."""
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
    "condition",
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


def table_of(identification: Any, top: int | None = None) -> tuple[tuple[str, ...], TableRows]:
    """Titles, and a row for each of the most probable explanations of an `Identification`, of
    families where these were searched.
    """
    columns, cells = (
        (FAMILY_COLUMNS, _family_cells) if identification.family_sets else (COLUMNS, _cells)
    )
    rows: TableRows = (
        [
            name,
            rank,
            *explanation,
            identification.none[row],
            bool(identification.explained[row]),
            # Where one coat alone was tried nothing is known of more.
            identification.coats_probability[row] if identification.coats_odds else None,
        ]
        for row, name in enumerate(identification.measured.names)
        for rank, explanation in enumerate(cells(identification, row, top), start=1)
    )
    return columns, rows


def _cells(identification: Any, row: int, top: int | None) -> TableRows:
    """Cells of `COLUMNS` that are an explanation's own."""
    for candidate in identification.ranked(row, top):
        coats = [coat + 1 for coat in candidate.coats]
        columns = zip(
            candidate.paints, candidate.fractions, candidate.fractions_sd, coats, strict=True
        )
        paints: list[object] = [*chain.from_iterable(columns)]
        # A film that hides its ground has no thickness to state.
        hidden = identification.opaque or np.isnan(candidate.thickness)
        thick = [candidate.thickness * 1e6, candidate.thickness_sd * 1e6]
        yield [
            candidate.probability,
            *paints,
            *[None] * (12 - len(paints)),
            *([None, None] if hidden else thick),
            candidate.rmse,
            candidate.angle,
            None if np.isnan(candidate.delta_e) else candidate.delta_e,
            candidate.gloss,
            candidate.condition,
        ]


def _family_cells(identification: Any, row: int, top: int | None) -> TableRows:
    """Cells of `FAMILY_COLUMNS` that are an answer's own."""
    counts = identification.came_true(row)
    for number, answer in enumerate(identification.family_sets[row][:top]):
        yield [
            answer.words,
            answer.probability,
            f"{counts[0]} of {counts[1]}" if counts and number == 0 else None,
            identification.nearest_exemplars(row) if number == 0 else None,
        ]
