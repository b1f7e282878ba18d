"""All that is filed of pigments that were searched by family, for the page, the table and the
JSON.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from glazejax import catalogue

from ..families.evidence import describe_anachronism, facts_of
from ..families.features import brightest, relative_misfit
from ..families.misfit import UsualMisfit
from ..result import Identification
from .explanation import Explanation, explanations
from .record import Record, describe_run, describe_spot, round_spectra

SCHEMA = {"name": "glazejax identify families report", "version": 2}
COLUMNS = (
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


def make_family_record(
    identification: Identification,
    about: Record,
    names: Sequence[str],
    top: int,
    *,
    painted: int | None,
    usual: UsualMisfit | None,
) -> Record:
    """All that is filed, as JSON has it.

    Args:
        identification: with `family_sets`.
        about, names: as for `make_record`.
        top: answers of each spectrum.
        painted: year in which it was painted, if that is known.
        usual: how far films of right answers are off, if any is known.
    """
    return {
        "schema": SCHEMA,
        **describe_run(identification, about, names),
        "painted": painted,
        "usual_misfit": usual
        and {"answers": usual.answers, "half": usual.half, "nine_tenths": usual.nine_tenths},
        "spots": [
            _spot(identification, row, top, painted=painted, usual=usual)
            for row in range(len(identification))
        ],
    }


def _spot(
    identification: Identification,
    row: int,
    top: int,
    *,
    painted: int | None,
    usual: UsualMisfit | None,
) -> Record:
    answers = identification.family_sets[row][:top]
    named = dict.fromkeys(
        family
        for answer in answers
        for name in answer.families
        for family in dict(answer.within.get(name, ((name, 1.0),)))
    )
    reading = identification.measured.readings[row]
    counts = identification.came_true(row)
    return {
        **describe_spot(identification, row),
        "in_tests": counts and {"right": counts[0], "answers": counts[1]},
        "usual_band": usual and round_spectra(usual.band[None] * brightest(reading[0])),
        "families": [
            {
                "rank": rank,
                "words": answer.words,
                "families": list(answer.families),
                "within": {name: dict(shares) for name, shares in answer.within.items()},
                "probability": answer.probability,
                "anachronism": describe_anachronism(answer.families, painted),
            }
            for rank, answer in enumerate(answers, start=1)
        ],
        "pigments": describe_pigments(named),
        "explanations": [
            describe_film(film, reading[0]) for film in explanations(identification, row, top)
        ],
    }


def describe_pigments(names: Iterable[str]) -> list[Record]:
    """Describe families; names of groups are left out."""
    return [
        {
            "family": family.name,
            "formula": family.formula,
            "elements": list(family.elements),
            "colour_index": family.colour_index,
            "in_use": family.in_use,
        }
        for family in facts_of(names)
    ]


def describe_film(film: Explanation, reading: np.ndarray) -> Record:
    """A film that stands for an answer, and whose paints it is of.

    Args:
        film: of an answer.
        reading: with which it is drawn, (bands,).
    """
    provenance = catalogue.provenance()
    facts = ("source", "binder", "citation")
    off = relative_misfit(reading, film.fitted[0])
    return {
        "words": film.words,
        "probability": film.probability,
        "scale": film.scale,
        "misfit": float(np.sqrt(np.nanmean(off**2))),
        "paints": [
            # A user's own paint has none.
            {"name": name, **{fact: getattr(provenance.get(name), fact, "") for fact in facts}}
            for name in film.paints
        ],
        "fitted": round_spectra(film.fitted),
    }


def table_rows(record: Record) -> Iterator[list[object]]:
    """Cells of `COLUMNS`."""
    for spot in record["spots"]:
        tests = spot["in_tests"]
        near = {
            film["words"]: " + ".join(paint["name"] for paint in film["paints"])
            for film in spot["explanations"]
        }
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
                near.get(" + ".join(answer["families"]), ""),
            ]
