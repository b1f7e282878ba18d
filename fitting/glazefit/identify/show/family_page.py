"""A page to file of pigments that were sought by family, and the same as CSV and JSON."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from glazejax import catalogue

from ..families.evidence import describe_anachronism
from ..result import Candidate, Identification
from .figures import FITS, draw_spectra
from .page import Record, beside, fill_page, write_report
from .record import Provenance, describe_colours, describe_run, round_spectra

_SCHEMA = {"name": "glazejax identify families report", "version": 1}
_COLUMNS = (
    "spot",
    "explained",
    "none_of_these",
    "rank",
    "families",
    "probability",
    "right_in_tests",
    "not_of_the_year",
    "nearest_exemplars",
)


def write_family_report(
    found: Identification,
    about: Provenance,
    path: Path,
    top: int,
    painted: int | None,
    *,
    overwrite: bool = False,
) -> tuple[Path, Path]:
    """Write the page of an identification by family, a table and a JSON beside it.

    Args:
        found: identification with `family_sets`.
        about: how it was made.
        path: of the page.
        top: answers of each spectrum.
        painted: year in which it was painted, if that is known.
        overwrite: whether files that exist may be replaced.

    Returns:
        Paths of the table and of the JSON.

    Raises:
        FileExistsError: one of the three exists and `overwrite` is false; then none is written.
        ValueError: the page's name does not end in .html.
    """
    table, data = beside(path)
    record = {
        "schema": _SCHEMA,
        **describe_run(found, about),
        "painted": painted,
        "spots": [_spot(found, row, top, painted) for row in range(len(found))],
    }
    pieces = _page(record, table.name, data.name)
    write_report(record, pieces, (_COLUMNS, _rows(record)), path, overwrite=overwrite)
    return table, data


# ---- the record ----------------------------------------------------------------------------------


def _spot(found: Identification, row: int, top: int, painted: int | None) -> dict[str, Any]:
    known = catalogue.families()
    answers = found.family_sets[row][:top]
    named = dict.fromkeys(
        family
        for answer in answers
        for name in answer.families
        for family in ([one for one, _ in answer.within[name]] if name in answer.within else [name])
    )
    return {
        "id": f"spot-{row + 1}",
        "name": found.measured.names[row],
        "explained": bool(found.explained[row]),
        "words": found.verdict(row),
        "none_of_these": float(found.none[row]),
        "in_tests": _in_tests(found, row),
        "coats_probability": float(found.coats_probability[row]),
        "coats": found.coats_words(row),
        "colours": describe_colours(found, row),
        "measured": round_spectra(found.measured.readings[row]),
        "families": [
            {
                "rank": rank,
                "words": answer.words,
                "families": list(answer.families),
                "within": {name: dict(shares) for name, shares in answer.within.items()},
                "probability": answer.probability,
                "anachronism": ""
                if painted is None
                else describe_anachronism(answer.families, known, painted),
            }
            for rank, answer in enumerate(answers, start=1)
        ],
        "pigments": [
            {
                "family": family,
                "formula": known[family].formula,
                "elements": list(known[family].elements),
                "colour_index": known[family].colour_index,
                "in_use": known[family].in_use,
            }
            for family in named
            if family in known
        ],
        # The figure draws the first few as it does fits.
        "explanations": [_exemplar(candidate) for candidate in found.ranked(row, FITS)],
    }


def _in_tests(found: Identification, row: int) -> dict[str, int] | None:
    counts = found.came_true(row)
    return None if counts is None else {"right": counts[0], "answers": counts[1]}


def _exemplar(candidate: Candidate) -> dict[str, Any]:
    known = catalogue.provenance()
    return {
        "words": candidate.mixture,
        "probability": candidate.probability,
        "paints": [
            {
                "name": name,
                "source": known[name].source if name in known else "",
                "binder": known[name].binder if name in known else "",
                "citation": known[name].citation if name in known else "",
            }
            for name in candidate.paints
        ],
        "fitted": [
            [None if np.isnan(x) else x for x in line] for line in round_spectra(candidate.fitted)
        ],
        "band_90": None,
    }


def _rows(record: Record) -> Iterator[list[object]]:
    for spot in record["spots"]:
        near = " + ".join(paint["name"] for paint in spot["explanations"][0]["paints"])
        tests = spot["in_tests"]
        for answer in spot["families"]:
            yield [
                spot["name"],
                spot["explained"],
                spot["none_of_these"],
                answer["rank"],
                answer["words"],
                answer["probability"],
                f"{tests['right']} of {tests['answers']}" if tests and answer["rank"] == 1 else "",
                answer["anachronism"],
                near,
            ]


# ---- the page ------------------------------------------------------------------------------------


def _page(record: Record, table: str, data: str) -> Iterator[str]:
    title = f"Pigments: {record['title']}"
    return fill_page("family_page", record, table, data, _draw, title=title)


def _draw(record: Record, spot: Record) -> dict[str, str]:
    measured = record["measurement"]
    grid = np.asarray(measured["wavelengths_nm"])
    return {"spectra": draw_spectra(spot, grid, measured["grounds"])}
