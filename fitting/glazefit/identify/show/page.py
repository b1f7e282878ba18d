"""A page to file: one HTML file without anything from elsewhere, from the record of an
identification.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

from glazejax.io.write import table_bytes, write_files

from ...page.frame import END, facts_html, page_start, table_html
from ...page.words import chance_html, words_html
from ..search.weigh import REJECTED, UNSEEN
from .record import COLUMNS, table_rows
from .spectrum_html import Record, length_html, number_html, spot_html, swatches

DRAWN = 60
"""Spots whose spectra are drawn; those of all are in the JSON."""
LISTED = 60
"""Paints of a catalogue that the page lists; those of a larger one are in the JSON."""


def beside(path: Path) -> tuple[Path, Path]:
    """The table and the JSON that are written with a page.

    Raises:
        ValueError: the page's name does not end in .html.
    """
    if path.suffix != ".html":
        raise ValueError(
            f"--report {path}: a report ends in .html, such as {path.with_suffix('.html')}"
        )
    return path.with_suffix(".csv"), path.with_suffix(".json")


def write_page(record: Record, path: Path, *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write the page, and the same as CSV and JSON beside it; each is there whole or not at all.

    Returns:
        Paths of the table and of the JSON.

    Raises:
        FileExistsError: one of the three exists and `overwrite` is false; then none is written.
        ValueError: see `beside`.
    """
    table, data = beside(path)
    pieces = page(record, table.name, data.name)
    write_report(record, pieces, (COLUMNS, table_rows(record)), path, overwrite=overwrite)
    return table, data


def write_report(
    record: Record,
    pieces: Iterable[str],
    rows: tuple[Sequence[str], Iterable[Sequence[object]]],
    path: Path,
    *,
    overwrite: bool,
) -> None:
    """Write a page, its table and its JSON: all three, or none.

    Args:
        record: the JSON.
        pieces: of the page.
        rows: names of the table's columns, and its rows.
        path: of the page.
        overwrite: whether files that exist may be replaced.

    Raises:
        FileExistsError, ValueError: see `write_page`.
    """
    table, data = beside(path)
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    # A spectrum a line; the strings of JSON have no line breaks.
    text = re.sub(r"\[\n[-+\d.eE,\s]*\]", lambda numbers: re.sub(r"\s+", " ", numbers[0]), text)
    # All is made before anything is written, so that no table stands beside an older page.
    shown = [piece.encode("utf-8", "xmlcharrefreplace") for piece in pieces]
    cells = table_bytes(*rows)
    write_files({table: [cells], data: [text.encode()], path: shown}, overwrite=overwrite)


def page(record: Record, table: str, data: str) -> Iterator[str]:
    """The page, piece by piece; `table` and `data` are names of the files beside it."""
    yield page_start(f"Paint identification: {record['title']}", _head(record))
    yield _summary(record)
    yield '<h2 class="spots">Spots</h2>\n'
    yield from spots_html(record, data, spot_html)
    yield _method(record)
    yield record_section(record, table, data)
    yield END


def spots_html(record: Record, data: str, draw: Callable[..., str]) -> Iterator[str]:
    """All spots, piece by piece, the first of them with their spectra.

    Args:
        record: of the page.
        data: name of the JSON beside it.
        draw: HTML of one spot, called as `spot_html`.
    """
    if len(record["spots"]) > DRAWN:
        yield (
            f"<p>Spectra are drawn for the first {DRAWN} spots; those of all are in "
            f"{escape(data)}.</p>\n"
        )
    last = DRAWN
    for number, spot in enumerate(record["spots"]):
        try:
            yield draw(record, spot, drawn=number < last)
        except KeyboardInterrupt:
            # What takes long is drawing: an interrupt ends that, and the page is still filed.
            last = number
            yield (
                "<p>Interrupted: from here on spectra are not drawn; they are in "
                f"{escape(data)}.</p>\n"
            )
            yield draw(record, spot, drawn=False)


def _head(record: Record) -> str:
    measured = record["measurement"]
    method = record["method"]
    count = len(record["spots"])
    paints = record["catalogue"]["paints"]
    sets = (
        "each alone" if method["max_paints"] == 1 else f"every set of up to {method['max_paints']}"
    )
    coats = "one coat only" if method["layers"] == 1 else "one coat, and two coats in both orders"
    grounds = (
        "not seen: the films are said to hide it"
        if measured["opaque"]
        else "; ".join(measured["grounds"])
    )
    facts = {
        "Made": (
            f"{record['created'].replace('T', ', ')}, by glazejax {record['versions']['glazejax']}"
        ),
        "Measured": f"{count} {'spot' if count == 1 else 'spots'}, {measured['grid']}",
        "Instrument": (
            f"{measured['geometry']}; refractive index of the paint "
            f"{measured['refractive_index']:g}"
        ),
        "Ground": grounds,
        "Tried": f"{sets} of {len(paints)} paints of {record['catalogue']['name']}, as {coats}",
    }
    if measured["notes"]:
        facts["Noticed"] = "; ".join(measured["notes"])
    out = facts_html(facts)
    if record["not_done"]:
        left = record["not_done"]
        names = ", ".join(left[:12]) + (f" and {len(left) - 12} more" if len(left) > 12 else "")
        out += (
            f'<p class="warn"><strong>Interrupted.</strong> {count} of {count + len(left)} spots '
            "were finished. "
            f"Not done: {escape(names)}.</p>\n"
        )
    return out


def _summary(record: Record) -> str:
    rows = "".join(_summary_row(record, spot) for spot in record["spots"])
    thick = "" if record["measurement"]["opaque"] else '<th class="n wide">Thickness, µm</th>'
    coats = "" if record["method"]["layers"] == 1 else '<th class="n wide">Two coats</th>'
    return (
        '<h2>Summary</h2>\n<p class="faint">Probability of these paints together. '
        "‘None’: that no paints of the catalogue explain the spot. ΔE00: colour difference "
        "between measured and fitted "
        f"film; below {UNSEEN:g} nobody sees it.</p>\n"
    ) + table_html(
        '<th>Spot</th><th class="wide">Colour</th><th>Most probable paints</th>'
        f'<th class="n">Probability</th><th class="n">None</th>{coats}{thick}<th class="n">ΔE00'
        "</th>",
        rows,
        ' id="summary"',
    )


def _summary_row(record: Record, spot: Record) -> str:
    best = spot["explanations"][0]
    if spot["explained"]:
        words = words_html(best["words"])
        probability = chance_html(best["probability"])
        words += " <em>(uncertain)</em>" if best["probability"] < spot["none_of_these"] else ""
    else:
        words = "<em>Nothing in the catalogue explains it</em>"
        probability = "–"
    thick = (
        ""
        if record["measurement"]["opaque"]
        else f'<td class="n wide">{length_html(best["thickness_um"])}</td>'
    )
    coats = (
        ""
        if record["method"]["layers"] == 1
        else f'<td class="n wide">{chance_html(spot["coats_probability"])}</td>'
    )
    return (
        f'<tr><td><a href="#{spot["id"]}">{escape(spot["name"])}</a></td><td '
        f'class="wide">{swatches(spot, "measured")}'
        f'</td><td>{words}</td><td class="n">{probability}</td><td '
        f'class="n">{chance_html(spot["none_of_these"])}</td>'
        f'{coats}{thick}<td class="n">{number_html(best["delta_e_2000"], 1)}</td></tr>\n'
    )


def _method(record: Record) -> str:
    layers = record["method"]["layers"]
    opaque = record["measurement"]["opaque"]
    scale = record["catalogue"].get("scale")
    points = [
        "Sets of paints compete: amounts are fitted to the spectrum by radiative transfer, and a "
        "set's probability follows from its misfit, given the errors stated below. One answer is "
        "that no set of the catalogue explains the spot.",
        "Probabilities hold for these paints and these assumptions. A paint that is not in the "
        "catalogue cannot be found; paints of like spectra cannot be told apart, and share their "
        "probability.",
        "ΔE00 is CIEDE2000 for D65 and 10 degrees, the largest over the grounds: below "
        f"{UNSEEN:g} nobody sees it, "
        f"above {REJECTED:g} everybody. RMSE is the root mean square of measured minus fitted "
        "reflectance.",
        "Intervals are 90 % intervals from the fit's covariance, for the paints named; they do "
        "not count that the film might be of others.",
        "The band about a fit is where 90 % of readings would lie if the explanation were right, "
        "with errors of the instrument, the model and the catalogue as stated, after the amounts "
        "are fitted.",
        "For a paint that was not found, films of it alone, with every other paint, and beside "
        "the most probable paints were fitted in one "
        f"coat{', and the coats that were found count too' if layers > 1 else ''}. The one "
        "that is nearest in its spectrum is named.",
    ]
    if layers == 1:
        points.append(
            "More than one coat was not tried: a spot of several coats is described as if they "
            "were mixed."
        )
    if opaque:
        points.append(
            "The films are taken as hiding their ground: they say nothing on thickness or what "
            "lies below."
        )
    if scale:
        points.append(f"Thicknesses are on the catalogue's scale: {scale}.")
    items = "".join(f"<li>{escape(point)}</li>\n" for point in points)
    settings = {
        name.capitalize(): ", ".join(
            f"{key.replace('_', ' ')} {value}" for key, value in values.items()
        )
        for name, values in record["method"]["settings"].items()
    }
    return (
        f"<h2>Method</h2>\n<ul>\n{items}</ul>\n<h4>Errors and "
        f"expectations</h4>\n{facts_html(settings)}"
    )


def record_section(record: Record, table: str, data: str) -> str:
    """How it was made, with what, and the files that were read; see `page`."""
    catalogue = record["catalogue"]
    inputs = "".join(
        f"<tr><td>{escape(each['role'])}</td><td><code>{escape(each['name'])}</code></td>"
        f"<td><code>{each['sha256'] or 'read from a pipe: no checksum'}</code></td></tr>\n"
        for each in record["inputs"]
    )
    if catalogue.get("sha256"):
        inputs += (
            f"<tr><td>catalogue</td><td><code>{escape(catalogue['file'])}</code> of glazejax "
            f"{record['versions']['glazejax']}</td><td><code>{catalogue['sha256']}</code></td></tr>\n"
        )
    count = len(catalogue["paints"])
    listed = count <= LISTED
    words = ", ".join(catalogue["paints"]) if listed else f"{count} paints, which {data} lists"
    paints = f"<dt>Catalogue</dt><dd>{escape(catalogue['name'])}: {escape(words)}</dd>"
    if catalogue.get("provenance"):
        source = catalogue["provenance"] if listed else f"that of each paint, in {data}"
        paints += f"<dt>Its source</dt><dd>{escape(source)}</dd>"
    versions = ", ".join(f"{name} {number}" for name, number in record["versions"].items())
    return (
        f"<h2>Record</h2>\n<dl><dt>Command</dt><dd><code>{escape(record['command'])}</code></dd>"
        f"<dt>Versions</dt><dd>{escape(versions)}; {escape(record['platform'])}</dd>{paints}"
        f"<dt>Beside this page</dt><dd>{escape(table)}: explanations, a line for each paint. "
        f"{escape(data)}: all of "
        "this, with spectra and every option.</dd></dl>\n"
        '<p class="faint">Files that were read, by their SHA-256.</p>\n'
    ) + table_html("<th>As</th><th>File</th><th>SHA-256</th>", inputs)
