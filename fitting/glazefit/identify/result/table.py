"""An identification as a table."""

from collections.abc import Iterator
from typing import Any

import numpy as np

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
    "none_of_these",
    "explained",
    "coats_probability",
)
FAMILY_COLUMNS = (
    "spectrum",
    "rank",
    "families",
    "probability",
    "right_in_tests",
    "nearest_exemplars",
    "none_of_these",
    "explained",
    "coats_probability",
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
        for rank, candidate in enumerate(found.ranked(row, top), start=1):
            cells: list[object] = [name, rank, candidate.probability]
            for n in range(3):
                if n < len(candidate.paints):
                    share = candidate.fractions[n]
                    sd = candidate.fractions_sd[n]
                    cells += [candidate.paints[n], share, sd, candidate.coats[n] + 1]
                else:
                    cells += [None] * 4
            thick = (
                [None, None]
                if found.opaque
                else [candidate.thickness * 1e6, candidate.thickness_sd * 1e6]
            )
            colour = None if np.isnan(candidate.delta_e) else candidate.delta_e
            cells += [*thick, candidate.rmse, candidate.angle, colour, candidate.gloss]
            yield [
                *cells,
                found.none[row],
                bool(found.explained[row]),
                found.coats_probability[row],
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
                " + ".join(found.ranked(row, 1)[0].paints) if rank == 1 else None,
                found.none[row],
                bool(found.explained[row]),
                found.coats_probability[row],
            ]
