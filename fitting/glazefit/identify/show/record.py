"""All that is filed of an identification, in plain numbers and words, for the page, the table and
the JSON.
"""

import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from importlib.metadata import version
from typing import Any

import numpy as np
from jaxtyping import Float

from glazejax.colour import srgb
from glazejax.plots import hex_colour
from glazejax.spectra import describe_grid

from ..result import Candidate, Identification
from .ambiguity import describe_ambiguity, describe_undecided
from .ruled_out import IMPROBABLE, LEAST_SHARE, ruled_out

SCHEMA = {"name": "glazejax identify report", "version": 1}
_PACKAGES = ("glazejax", "jax", "jaxlib", "numpy", "scipy", "colour-science")


@dataclass(frozen=True)
class RunProvenance:
    """Account of how an identification was made, for the record.

    Attributes:
        title: what was identified, such as the file's name.
        command: the command line.
        options: all options and their values.
        inputs: files that were read, as `input_files` gives them.
        catalogue: name, file, checksum and provenance of the paints, and what is assumed of
            lengths.
        geometry: of the instrument, in words.
        refractive_index: of the paint.
        grounds: a name for each ground below the paint.
        notes: what the readers of the files noticed.
        max_paints, max_coats: what was tried.
        settings: of noise, model errors and prior, by name.
        names: of all spectra, also of those that an interrupt left out.
        subject: object, inventory number, spot and operator, as far as they were said.
        created: when.
    """

    title: str
    command: str
    options: Mapping[str, Any]
    inputs: Sequence[Mapping[str, Any]]
    catalogue: Mapping[str, Any]
    geometry: str
    refractive_index: float
    grounds: Sequence[str]
    notes: Sequence[str]
    max_paints: int
    max_coats: int
    settings: Mapping[str, Any]
    names: Sequence[str]
    subject: Mapping[str, str] = field(default_factory=dict)
    created: datetime = field(default_factory=lambda: datetime.now().astimezone())


def make_record(
    identification: Identification,
    bands: Float[np.ndarray, "spectra explanations grounds bands"],
    about: RunProvenance,
    top: int,
) -> dict[str, Any]:
    """All that is filed, as JSON has it.

    Args:
        identification: its result.
        bands: half the widths of 90 % bands about the first explanations.
        about: how it was made.
        top: explanations of each spectrum.
    """
    return {
        "schema": SCHEMA,
        **describe_run(identification, about),
        "thresholds": {"ruled_out_below": IMPROBABLE, "least_share": LEAST_SHARE},
        "spots": [_spot(identification, bands, row, top) for row in range(len(identification))],
    }


def describe_run(identification: Identification, about: RunProvenance) -> dict[str, Any]:
    """Describe what was identified, how and with what, as JSON has it; see `make_record`."""
    done = set(identification.measured.names)
    unfinished = [name for name in about.names if name not in done]
    return {
        "title": about.title,
        "subject": dict(about.subject),
        "created": about.created.isoformat(timespec="seconds"),
        "complete": not unfinished,
        "not_done": unfinished,
        "versions": {
            **{name: version(name) for name in _PACKAGES},
            "python": platform.python_version(),
        },
        "platform": platform.platform(terse=True),
        "command": about.command,
        "options": dict(about.options),
        "inputs": [dict(file) for file in about.inputs],
        "catalogue": {**about.catalogue, "paints": list(identification.paints)},
        "measurement": {
            "geometry": about.geometry,
            "refractive_index": about.refractive_index,
            "grounds": list(about.grounds),
            "notes": list(about.notes),
            "opaque": identification.opaque,
            "grid": describe_grid(identification.measured.wavelengths),
            "wavelengths_nm": identification.measured.wavelengths.tolist(),
        },
        "method": {
            "max_paints": about.max_paints,
            "layers": about.max_coats,
            "settings": dict(about.settings),
        },
    }


def describe_spot(identification: Identification, row: int) -> dict[str, Any]:
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


def _spot(identification: Identification, bands: np.ndarray, row: int, top: int) -> dict[str, Any]:
    chances = identification.paint_probability[row]
    ranked = identification.ranked(row, top)
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
            _explanation(candidate, rank, bands[row, rank - 1] if rank <= bands.shape[1] else None)
            for rank, candidate in enumerate(ranked, start=1)
        ],
        "ruled_out": [
            {
                **paint._asdict(),
                "delta_e": _number(paint.delta_e),
                "rmse": _number(paint.rmse),
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


def _explanation(candidate: Candidate, rank: int, band: np.ndarray | None) -> dict[str, Any]:
    micro = 1e6
    return {
        "rank": rank,
        "words": candidate.words,
        "probability": candidate.probability,
        "thickness_um": _number(candidate.thickness * micro),
        "thickness_90_um": _numbers(candidate.thickness_90 * micro),
        "delta_e_2000": _number(candidate.delta_e),
        "rmse": candidate.rmse,
        "spectral_angle_deg": candidate.angle,
        "gloss": candidate.gloss,
        "paints": [
            {
                "name": name,
                "coat": candidate.coats[n] + 1,
                "fraction": float(candidate.fractions[n]),
                "fraction_90": _numbers(candidate.fractions_90[n]),
                "amount_um": _number(candidate.amounts[n] * micro),
                "amount_90_um": _numbers(candidate.amounts_90[n] * micro),
            }
            for n, name in enumerate(candidate.paints)
        ],
        "fitted": round_spectra(candidate.fitted),
        "band_90": None if band is None else round_spectra(band),
    }


def describe_colours(identification: Identification, row: int) -> dict[str, list[str]] | None:
    """Of the measured spectra and of the best fit over each ground, #rrggbb; None where the bands
    give no colour.
    """
    by_origin = {
        "measured": identification.measured.readings[row],
        "fitted": identification.fitted[row, 0],
    }
    # A film whose paints are not known at all bands has no colour.
    by_origin = {what: spectra for what, spectra in by_origin.items() if np.isfinite(spectra).all()}
    try:
        shades = {
            what: srgb(identification.measured.wavelengths, spectra)
            for what, spectra in by_origin.items()
        }
    except ValueError:
        return None
    return {
        what: [hex_colour(shade) for shade in np.asarray(colours)]
        for what, colours in shades.items()
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _numbers(values: np.ndarray) -> list[float] | None:
    return [float(value) for value in values] if np.isfinite(values).all() else None


def round_spectra(
    spectra: Float[np.ndarray, "grounds bands"],
) -> list[list[float | None]]:
    """Spectra with as many digits as are filed; what is not known at a band is None there."""
    # Six digits separate spectra in the JSON.
    return [[_number(x) for x in line] for line in np.round(spectra, 6).tolist()]


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


def table_rows(record: Mapping[str, Any]) -> Iterator[list[object]]:
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
