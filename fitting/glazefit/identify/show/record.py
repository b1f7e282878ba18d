"""All that is filed of an identification, by paint or by family, in plain numbers and words:
for the page, the table and the JSON.
"""

import platform
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from glazejax import catalogue
from glazejax.colour import srgb
from glazejax.plots import hex_colour
from glazejax.spectra import describe_grid

from ..families.evidence import describe_anachronism, facts_of
from ..families.features import brightest, relative_misfit
from ..families.misfit import UsualMisfit
from ..result import Candidate, Identification
from .ambiguity import describe_ambiguity, describe_undecided
from .explanation import Explanation, explanations
from .ruled_out import IMPROBABLE, LEAST_SHARE, ruled_out

Record: TypeAlias = dict[str, Any]
"""Numbers and words by name, as pages and JSON have them."""
SCHEMA = {"name": "glazejax identify report", "version": 1}
FAMILY_SCHEMA = {"name": "glazejax identify families report", "version": 2}
_PACKAGES = ("glazejax", "jax", "jaxlib", "numpy", "scipy", "colour-science")


def make_record(
    identification: Identification,
    about: Record,
    names: Sequence[str],
    top: int,
    *,
    bands: Float[np.ndarray, "spectra explanations grounds bands"] | None = None,
    painted: int | None = None,
    usual: UsualMisfit | None = None,
) -> Record:
    """All that is filed, as JSON has it.

    Args:
        identification: its result.
        about: how it was made (`describe_run`).
        names: of all spectra, also of those that an interrupt left out.
        top: explanations of each spectrum.
        bands: of a search by paint, half the widths of 90 % bands about the first explanations.
        painted: of a search by family, year in which it was painted, if that is known.
        usual: of a search by family, how far films of right answers are off, if any is known.
    """
    rows = range(len(identification))
    run = describe_run(identification, about, names)
    if identification.family_sets:
        return {
            "schema": FAMILY_SCHEMA,
            **run,
            "painted": painted,
            "usual_misfit": usual
            and {"answers": usual.answers, "half": usual.half, "nine_tenths": usual.nine_tenths},
            "spots": [_family_spot(identification, row, top, painted, usual) for row in rows],
        }
    return {
        "schema": SCHEMA,
        **run,
        "thresholds": {"ruled_out_below": IMPROBABLE, "least_share": LEAST_SHARE},
        "spots": [_spot(identification, row, top, bands) for row in rows],
    }


def describe_run(identification: Identification, about: Record, names: Sequence[str]) -> Record:
    """Describe what was identified, how and with what, as JSON has it.

    Args:
        identification: its result.
        about: how it was made: ``title``, ``subject``, ``created``, ``command``, ``options``,
            ``inputs``, ``catalogue``, ``measurement`` and ``method``.
        names: as for `make_record`.
    """
    done = set(identification.measured.names)
    unfinished = [name for name in names if name not in done]
    return {
        **about,
        "complete": not unfinished,
        "not_done": unfinished,
        "versions": {
            **{name: version(name) for name in _PACKAGES},
            "python": platform.python_version(),
        },
        "platform": platform.platform(terse=True),
        "catalogue": {**about["catalogue"], "paints": list(identification.paints)},
        "measurement": {
            **about["measurement"],
            "opaque": identification.opaque,
            "grid": describe_grid(identification.measured.wavelengths),
            "wavelengths_nm": identification.measured.wavelengths.tolist(),
        },
    }


def describe_spot(identification: Identification, row: int) -> Record:
    """Describe a spectrum and its answer, as the records of paints and of families have it."""
    return {
        "id": f"spot-{row + 1}",
        "name": identification.measured.names[row],
        "explained": bool(identification.explained[row]),
        "words": identification.verdict(row),
        "none_of_these": float(identification.none[row]),
        "coats_probability": float(identification.coats_probability[row]),
        "coats": identification.coats_words(row),
        "colours": describe_colours(identification, row),
        "measured": round_spectra(identification.measured.readings[row]),
    }


def _spot(identification: Identification, row: int, top: int, bands: np.ndarray | None) -> Record:
    chances = identification.paint_probability[row]
    ranked = identification.ranked(row, top)
    drawn = () if bands is None else bands[row]
    spot = describe_spot(identification, row)
    if spot["explained"]:
        spot["words"] = ranked[0].words
    return {
        **spot,
        "paint_probability": {
            identification.paints[i]: float(chances[i]) for i in np.argsort(-chances, kind="stable")
        },
        "not_settled": describe_undecided(identification, row),
        "doubts": [*_open_words(identification, row), *describe_ambiguity(identification, row)],
        "noise_sd": float(np.median(identification.measured.noise_sd[row])),
        "explanations": [
            _explanation(candidate, rank, drawn[rank - 1] if rank <= len(drawn) else None)
            for rank, candidate in enumerate(ranked, start=1)
        ],
        "ruled_out": [
            {
                **paint._asdict(),
                "delta_e": _plain_numbers(paint.delta_e),
                "rmse": _plain_numbers(paint.rmse),
            }
            for paint in ruled_out(identification, row)
        ],
    }


def _open_words(identification: Identification, row: int) -> list[str]:
    """Say that a paint is probable which the most probable set is without."""
    likely = identification.likely_paint(row) if identification.explained[row] else None
    if likely is None:
        return []
    paint, share = likely
    return [
        f"It is open: {paint} is in the film with a probability of {share:.0%}, though the most "
        "probable set is without it."
    ]


def _explanation(candidate: Candidate, rank: int, band: np.ndarray | None) -> Record:
    micro = 1e6
    return {
        "rank": rank,
        "words": candidate.words,
        "probability": candidate.probability,
        "thickness_um": _plain_numbers(candidate.thickness * micro),
        "thickness_90_um": _plain_numbers(candidate.thickness_90 * micro),
        "delta_e_2000": _plain_numbers(candidate.delta_e),
        "rmse": candidate.rmse,
        "spectral_angle_deg": candidate.angle,
        "gloss": candidate.gloss,
        "paints": [
            {
                "name": name,
                "coat": candidate.coats[n] + 1,
                "fraction": float(candidate.fractions[n]),
                "fraction_90": _plain_numbers(candidate.fractions_90[n]),
                "amount_um": _plain_numbers(candidate.amounts[n] * micro),
                "amount_90_um": _plain_numbers(candidate.amounts_90[n] * micro),
            }
            for n, name in enumerate(candidate.paints)
        ],
        "fitted": round_spectra(candidate.fitted),
        "band_90": None if band is None else round_spectra(band),
    }


def _family_spot(
    identification: Identification,
    row: int,
    top: int,
    painted: int | None,
    usual: UsualMisfit | None,
) -> Record:
    answers = identification.family_sets[row][:top]
    named = dict.fromkeys(
        family for answer in answers for name in answer.families for family in answer.shares(name)
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


def describe_colours(identification: Identification, row: int) -> dict[str, list[str]] | None:
    """Of the measured spectra and of the best fit over each ground, #rrggbb; None where the bands
    give no colour.
    """
    by_origin = {
        "measured": identification.measured.readings[row],
        "fitted": identification.fitted[row, 0],
    }
    grid = identification.measured.wavelengths
    try:
        return {
            what: [hex_colour(shade) for shade in np.asarray(srgb(grid, spectra))]
            for what, spectra in by_origin.items()
            # A film whose paints are not known at all bands has no colour.
            if np.isfinite(spectra).all()
        }
    except ValueError:
        return None


def _plain_numbers(values: float | np.ndarray) -> Any:
    """A number, or a list of them, as JSON has it; None where one is not known."""
    return np.asarray(values).tolist() if np.isfinite(values).all() else None


def round_spectra(spectra: Float[np.ndarray, "grounds bands"]) -> list[list[float | None]]:
    """Spectra with as many digits as are filed; what is not known at a band is None there."""
    # Six digits separate spectra in the JSON.
    return [[x if np.isfinite(x) else None for x in line] for line in np.round(spectra, 6).tolist()]


COLUMNS = (
    "spot",
    "explained",
    "none_of_these",
    "rank",
    "probability",
    "explanation",
    "delta_e_2000",
    "rmse",
    "thickness_um",
    "thickness_low_um",
    "thickness_high_um",
    "coat",
    "paint",
    "fraction",
    "fraction_low",
    "fraction_high",
    "amount_um",
    "amount_low_um",
    "amount_high_um",
)
"""Of the table next to a page: a line for each paint of each explanation; low and high end 90 %
intervals.
"""
FAMILY_COLUMNS = (
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
"""Of the table next to a page of families: a line for each answer."""


def table_of_record(record: Record) -> tuple[tuple[str, ...], Iterator[list[object]]]:
    """Titles and rows of the table next to a page."""
    if record["schema"] == FAMILY_SCHEMA:
        return FAMILY_COLUMNS, _family_rows(record)
    return COLUMNS, _rows(record)


def _rows(record: Record) -> Iterator[list[object]]:
    """Cells of `COLUMNS`; None where there is no number."""
    for spot in record["spots"]:
        for film in spot["explanations"]:
            lead = [
                spot["name"],
                spot["explained"],
                spot["none_of_these"],
                film["rank"],
                film["probability"],
                film["words"],
                film["delta_e_2000"],
                film["rmse"],
                film["thickness_um"],
                *(film["thickness_90_um"] or (None, None)),
            ]
            for paint in film["paints"]:
                yield [
                    *lead,
                    paint["coat"],
                    paint["name"],
                    paint["fraction"],
                    *paint["fraction_90"],
                    paint["amount_um"],
                    *(paint["amount_90_um"] or (None, None)),
                ]


def _family_rows(record: Record) -> Iterator[list[object]]:
    """Cells of `FAMILY_COLUMNS`."""
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
