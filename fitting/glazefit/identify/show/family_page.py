"""A page to file of pigments that were sought by family, and the same as CSV and JSON."""

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from glazejax import catalogue

from ...page.frame import END, facts_html, page_start, table_html
from ...page.words import chance_html, words_html
from ..families.evidence import describe_anachronism
from ..result import Candidate, Identification
from .figures import FITS, draw_spectra
from .page import beside, record_section, spots_html, write_report
from .record import Provenance, describe_colours, describe_run, round_spectra
from .spectrum_html import Record, key_html, swatches

_SCHEMA = {"name": "glazejax identify families report", "version": 1}
_COLUMNS = (
    "spot",
    "explained",
    "none_of_these",
    "rank",
    "families",
    "probability",
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
        for answer in spot["families"]:
            yield [
                spot["name"],
                spot["explained"],
                spot["none_of_these"],
                answer["rank"],
                answer["words"],
                answer["probability"],
                answer["anachronism"],
                near,
            ]


# ---- the page ------------------------------------------------------------------------------------


def _page(record: Record, table: str, data: str) -> Iterator[str]:
    yield page_start(f"Pigments: {record['title']}", _head(record))
    yield _summary(record)
    yield '<h2 class="spots">Spots</h2>\n'
    yield from spots_html(record, data, _spot_html)
    yield _method(record)
    yield record_section(record, table, data)
    yield END


def _head(record: Record) -> str:
    measured = record["measurement"]
    count = len(record["spots"])
    exemplars = len(record["catalogue"]["paints"])
    facts = {
        "Made": (
            f"{record['created'].replace('T', ', ')}, by glazejax {record['versions']['glazejax']}"
        ),
        "Measured": f"{count} {'spot' if count == 1 else 'spots'}, {measured['grid']}",
        "Instrument": measured["geometry"],
        "Ground": "not seen: the films are said to hide it"
        if measured["opaque"]
        else "; ".join(measured["grounds"]),
        "Painted": "" if record["painted"] is None else str(record["painted"]),
        "Sought": f"families of pigments, known by {exemplars} paints of many hands",
        "Noticed": "; ".join(measured["notes"]),
    }
    return facts_html(facts)


def _summary(record: Record) -> str:
    rows = "".join(
        f'<tr><td><a href="#{spot["id"]}">{escape(spot["name"])}</a></td>'
        f'<td class="wide">{swatches(spot, "measured")}</td>'
        f"<td>{_first_words(spot)}</td>"
        f'<td class="n">{chance_html(spot["families"][0]["probability"])}</td>'
        f'<td class="n">{chance_html(spot["none_of_these"])}</td></tr>\n'
        for spot in record["spots"]
    )
    return (
        '<h2>Summary</h2>\n<p class="faint">‘None’: probability that no family of the catalogue '
        "is in the spot.</p>\n"
    ) + table_html(
        '<th>Spot</th><th class="wide">Colour</th><th>Most probable pigments</th>'
        '<th class="n">Probability</th><th class="n">None</th>',
        rows,
        ' id="summary"',
    )


def _first_words(spot: Record) -> str:
    first = words_html(spot["families"][0]["words"])
    return first if spot["explained"] else f"<em>like none that is known; nearest {first}</em>"


def _spot_html(record: Record, spot: Record, *, drawn: bool) -> str:
    answers = "".join(
        f'<tr><td class="n">{answer["rank"]}</td><td>{words_html(answer["words"])}'
        f"{_warning(answer['anachronism'])}</td>"
        f'<td class="n">{chance_html(answer["probability"])}</td></tr>\n'
        for answer in spot["families"]
    )
    pigments = "".join(
        f"<tr><td>{escape(one['family'])}</td><td>{escape(one['formula'])}</td>"
        f'<td class="wide">{escape(one["colour_index"])}</td>'
        f"<td>{escape(one['in_use'])}</td></tr>\n"
        for one in spot["pigments"]
    )
    warn = "" if spot["explained"] else " warn"
    coats = f"<p>{words_html(spot['coats'])}.</p>\n" if spot["coats"] else ""
    return (
        f'<article class="spot" id="{spot["id"]}" aria-label="spot {escape(spot["name"])}">\n'
        f'<div class="first">\n<h3>{escape(spot["name"])}</h3>\n'
        f'<p class="verdict{warn}"><strong>{words_html(_sentence(spot["words"]))}</strong></p>\n'
        f"{coats}{_figure(record, spot) if drawn else ''}</div>\n"
        "<h4>Pigments</h4>\n"
        + table_html(
            '<th class="n">Rank</th><th>Families</th><th class="n">Probability</th>', answers
        )
        + "<h4>What they are</h4>\n"
        + table_html(
            '<th>Family</th><th>Formula</th><th class="wide">Colour Index</th><th>In use</th>',
            pigments,
        )
        + f"<h4>Nearest exemplars</h4>\n{_exemplars(spot)}</article>\n"
    )


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _warning(words: str) -> str:
    return f" <strong>({escape(words)})</strong>" if words else ""


def _figure(record: Record, spot: Record) -> str:
    grid = np.asarray(record["measurement"]["wavelengths_nm"])
    names = "; ".join(f"{n}, {one['words']}" for n, one in enumerate(spot["explanations"], 1))
    words = (
        f"Reflectance of spot {spot['name']} from {grid[0]:g} to {grid[-1]:g} nm, and films of the "
        f"nearest exemplars: {names}."
    )
    drawing = draw_spectra(spot, grid, record["measurement"]["grounds"])
    keys = "".join(
        key_html(n, one["words"], chance_html(one["probability"]))
        for n, one in enumerate(spot["explanations"], start=1)
    )
    return (
        f'<div class="figures">\n<figure role="img" aria-label="{escape(words)}">{drawing}'
        f'</figure>\n</div>\n<ul class="keys"><li>○ measured</li>{keys}</ul>\n'
    )


def _exemplars(spot: Record) -> str:
    rows = "".join(
        f'<tr><td class="n">{number}</td><td>{escape(paint["name"])}</td>'
        f"<td>{escape(paint['binder'])}</td>"
        f'<td class="wide">{escape(paint["citation"])}</td></tr>\n'
        for number, one in enumerate(spot["explanations"], start=1)
        for paint in one["paints"]
    )
    return (
        '<p class="faint">Paints of other hands whose computed films look most like the spot, one '
        "set for each answer; they are drawn above beside the reading.</p>\n"
    ) + table_html(
        '<th class="n">Line</th><th>Exemplar</th><th>Binder</th><th class="wide">Source</th>', rows
    )


def _method(record: Record) -> str:
    points = [
        "A family is known by paints of several hands. How much two paints of one family differ is "
        "learnt from all such pairs; what varies between hands counts little.",
        "A reading is compared with films computed from these paints, pure and in pairs, and with "
        "any paint at all. Probabilities are as sure as the same search was right about paints "
        "of sources that it was not shown.",
        "Whites and extenders, blacks, and iron oxides that the spectrum cannot tell apart share "
        "one name, with the likeliest families in brackets.",
        "Nothing is said of amounts: another maker's paint is stronger or weaker.",
    ]
    items = "".join(f"<li>{escape(point)}</li>\n" for point in points)
    return f"<h2>Method</h2>\n<ul>\n{items}</ul>\n"
