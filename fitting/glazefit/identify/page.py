"""A page to file: one HTML file without anything from elsewhere, from the record of an identification."""

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from glazejax.io.write import table_bytes, write_files

from ..film.errors import REJECTED, UNSEEN
from .page_figures import FITS, draw_residuals, draw_spectra
from .record import COLUMNS, table_rows
from .report import chance, micrometres
from .result import percent

DRAWN = 60
"""Spots whose spectra are drawn; those of all are in the JSON."""

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
_KINDS = {
    "misfit": f"Ruled out: a person sees that no film with it fits (ΔE00 above {REJECTED:g})",
    "worse": "Ruled out: others fit better",
    "unneeded": "Improbable, not excluded: fits as well, and nothing calls for it",
}
Record = Mapping[str, Any]


def beside(path: Path) -> tuple[Path, Path]:
    """The table and the JSON that are written with a page.

    Raises:
        ValueError: the page's name does not end in .html.
    """
    if path.suffix != ".html":
        raise ValueError(f"--report {path}: a report ends in .html, such as {path.with_suffix('.html')}")
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
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    pieces = {
        table: [table_bytes(COLUMNS, table_rows(record))],
        data: [text.encode()],
        path: (piece.encode("utf-8", "xmlcharrefreplace") for piece in page(record, table.name, data.name)),
    }
    write_files(pieces, overwrite=overwrite)
    return table, data


def page(record: Record, table: str, data: str) -> Iterator[str]:
    """The page, piece by piece; `table` and `data` are names of the files beside it."""
    css = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    title = f"Paints of {record['title']}"
    yield (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{css}</style>\n</head>\n<body>\n"
    )
    yield f"<header>\n<h1>{escape(title)}</h1>\n{_head(record)}</header>\n<main>\n"
    yield _summary(record)
    yield "<h2>Spots</h2>\n"
    if len(record["spots"]) > DRAWN:
        yield f"<p>Spectra are drawn for the first {DRAWN} spots; those of all are in {escape(data)}.</p>\n"
    for number, spot in enumerate(record["spots"]):
        yield _spot(record, spot, drawn=number < DRAWN)
    yield _method(record)
    yield _filed(record, table, data)
    yield "</main>\n</body>\n</html>\n"


def _head(record: Record) -> str:
    measured, method = record["measurement"], record["method"]
    count, paints = len(record["spots"]), record["catalogue"]["paints"]
    sets = "each alone" if method["max_paints"] == 1 else f"every set of up to {method['max_paints']}"
    coats = "one coat only" if method["layers"] == 1 else "one coat, and two coats in both orders"
    grounds = "not seen: the films are said to hide it" if measured["opaque"] else ", ".join(measured["grounds"])
    facts = {
        "Made": f"{record['created'].replace('T', ' ')}, glazejax {record['versions']['glazejax']}",
        "Measured": f"{count} {'spot' if count == 1 else 'spots'}, {measured['grid']}",
        "Instrument": f"{measured['geometry']}; refractive index of the paint {measured['refractive_index']:g}",
        "Ground": grounds,
        "Tried": f"{sets} of {len(paints)} paints of {record['catalogue']['name']}, as {coats}",
    }
    if measured["notes"]:
        facts["Noticed"] = "; ".join(measured["notes"])
    out = f"<dl>{_pairs(facts)}</dl>\n"
    if record["not_done"]:
        left = record["not_done"]
        some = ", ".join(left[:12]) + (f" and {len(left) - 12} more" if len(left) > 12 else "")
        out += (
            f'<p class="warn"><strong>Interrupted.</strong> {count} of {count + len(left)} spots were finished. '
            f"Not done: {escape(some)}.</p>\n"
        )
    return out


def _pairs(facts: Mapping[str, str]) -> str:
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts.items())


def _summary(record: Record) -> str:
    rows = "".join(_summary_row(record, spot) for spot in record["spots"])
    thick = "" if record["measurement"]["opaque"] else '<th class="n wide">Thickness, µm</th>'
    coats = "" if record["method"]["layers"] == 1 else '<th class="n wide">Two coats</th>'
    return (
        '<h2>Summary</h2>\n<div class="scroll"><table id="summary">\n<caption>Probability of these paints together. '
        "‘None’: that no paints of the catalogue explain the spot. ΔE00: colour difference between measured and fitted "
        f"film; below {UNSEEN:g} nobody sees it.</caption>\n"
        '<thead><tr><th>Spot</th><th class="wide">Colour</th><th>Most probable paints</th><th class="n">Probability</th>'
        f'<th class="n">None</th>{coats}{thick}<th class="n">ΔE00</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n'
    )


def _summary_row(record: Record, spot: Record) -> str:
    best = spot["explanations"][0]
    if spot["explained"]:
        words, probability = escape(best["words"]), chance(best["probability"])
    else:
        words, probability = "<em>Nothing in the catalogue explains it</em>", "–"
    thick = "" if record["measurement"]["opaque"] else f'<td class="n wide">{_length(best["thickness_um"])}</td>'
    coats = "" if record["method"]["layers"] == 1 else f'<td class="n wide">{chance(spot["two_coats"])}</td>'
    return (
        f'<tr><td><a href="#{spot["id"]}">{escape(spot["name"])}</a></td><td class="wide">{_swatches(spot, "measured")}'
        f'</td><td>{words}</td><td class="n">{probability}</td><td class="n">{chance(spot["none_of_these"])}</td>'
        f'{coats}{thick}<td class="n">{_number(best["delta_e_2000"], 1)}</td></tr>\n'
    )


def _swatches(spot: Record, what: str) -> str:
    if spot["colours"] is None:
        return ""
    shades = spot["colours"][what]
    patches = "".join(f'<span class="swatch" style="background:{shade}"></span>' for shade in shades)
    return f'<span role="img" aria-label="{what} colour, {", ".join(shades)}">{patches}</span>'


def _spot(record: Record, spot: Record, *, drawn: bool) -> str:
    name = escape(spot["name"])
    best = spot["explanations"][0]
    if spot["explained"]:
        verdict = f"Most probable: <strong>{escape(spot['words'])}</strong>, probability {chance(best['probability'])}."
    else:
        verdict = f"<strong>{escape(spot['words'][0].upper() + spot['words'][1:])}.</strong>"
    doubts = [f"That none of these paints explain it: {chance(spot['none_of_these'])}."] if spot["explained"] else []
    if record["method"]["layers"] > 1:
        doubts.append(f"That the film has two coats: {chance(spot['two_coats'])}.")
    if spot["not_settled"]:
        doubts.append(f"{escape(spot['not_settled'])}.")
    likely = [(paint, p) for paint, p in spot["paint_probability"].items() if p >= record["thresholds"]["ruled_out_below"]]
    chances = ", ".join(f"{escape(paint)} {chance(p)}" for paint, p in likely)
    colours = ""
    if spot["colours"] is not None:
        colours = f"<p>Measured {_swatches(spot, 'measured')} fitted {_swatches(spot, 'fitted')}</p>\n"
    return (
        f'<article id="{spot["id"]}" aria-label="spot {name}">\n<h3>{name}</h3>\n'
        f'<p class="verdict{"" if spot["explained"] else " warn"}">{verdict}</p>\n<p>{" ".join(doubts)}</p>\n'
        f"{colours}{_figures(record, spot) if drawn else ''}{_explanations(record, spot)}"
        f"<h4>Chance of each paint to be in the film</h4>\n<p>{chances or 'None has 1 %'}.</p>\n"
        f"{_ruled_out(spot)}</article>\n"
    )


def _figures(record: Record, spot: Record) -> str:
    grid = np.asarray(record["measurement"]["wavelengths_nm"])
    grounds = record["measurement"]["grounds"]
    fits = spot["explanations"][:FITS]
    keys = "".join(_key(n, f"{fit['words']} ({chance(fit['probability'])})") for n, fit in enumerate(fits, start=1))
    names = "; ".join(f"{n}, {fit['words']}" for n, fit in enumerate(fits, start=1))
    low, high = np.min(spot["measured"]), np.max(spot["measured"])
    spectra = (
        f"Reflectance of spot {spot['name']} from {grid[0]:g} to {grid[-1]:g} nm, measured between {low:.2f} and "
        f"{high:.2f}, and the fits {names}."
    )
    off = np.abs(np.asarray(spot["measured"]) - np.asarray(fits[0]["fitted"])).max()
    residuals = f"Measured minus fitted reflectance of spot {spot['name']}; the best fit is off by {off:.3f} at most."
    return (
        '<div class="figures">\n'
        f'<figure role="img" aria-label="{escape(spectra)}">{draw_spectra(spot, grid, grounds)}</figure>\n'
        f'<figure role="img" aria-label="{escape(residuals)}">{draw_residuals(spot, grid, grounds)}</figure>\n</div>\n'
        f'<ul class="keys"><li><svg viewBox="0 0 32 12" aria-hidden="true"><circle cx="16" cy="6" r="3.5" fill="none" '
        f'stroke="var(--ink)"/></svg>measured</li>{keys}<li><svg viewBox="0 0 32 12" aria-hidden="true"><rect width="32" '
        'height="12" fill="var(--fit-1)" fill-opacity=".2"/></svg>90 % band of fit 1</li></ul>\n'
    )


def _key(number: int, words: str) -> str:
    dash = ("", ' stroke-dasharray="7 3"', ' stroke-dasharray="2 2.5"')[number - 1]
    return (
        f'<li><svg viewBox="0 0 32 12" aria-hidden="true"><line x1="0" x2="32" y1="6" y2="6" stroke-width="2.5" '
        f'stroke="var(--fit-{number})"{dash}/></svg>{number}: {escape(words)}</li>'
    )


def _explanations(record: Record, spot: Record) -> str:
    opaque = record["measurement"]["opaque"]
    columns = 2 if opaque else 3
    body = ""
    for found in spot["explanations"]:
        thick = "" if opaque else f"thickness {_length(found['thickness_um'], found['thickness_90_um'])} µm, "
        body += (
            f'<tr class="lead"><th colspan="{columns}" scope="rowgroup">{found["rank"]}: probability '
            f'{chance(found["probability"])} <span class="faint">{thick}ΔE00 {_number(found["delta_e_2000"], 2)}, '
            f"RMSE {found['rmse']:.4f}</span></th></tr>\n"
        )
        stacked = any(paint["coat"] > 1 for paint in found["paints"])
        for paint in found["paints"]:
            coat = "" if not stacked else " (upper coat)" if paint["coat"] == 1 else " (lower coat)"
            share = f"{percent(paint['fraction'])} {_range([percent(f)[:-2] for f in paint['fraction_90']])}"
            amount = "" if opaque else f'<td class="n">{_length(paint["amount_um"], paint["amount_90_um"])}</td>'
            body += f'<tr><td>{escape(paint["name"])}{coat}</td><td class="n">{share}</td>{amount}</tr>\n'
    amount = "" if opaque else '<th class="n">Amount, µm</th>'
    return (
        f'<h4>Amounts</h4>\n<div class="scroll"><table>\n<caption>With 90 % intervals, if the film is of these paints. '
        "Share: by mass, of all paint in the film. Amount: thickness times share.</caption>\n"
        f'<thead><tr><th>Paint</th><th class="n">Share</th>{amount}</tr></thead>\n<tbody>\n{body}</tbody></table></div>\n'
    )


def _ruled_out(spot: Record) -> str:
    if not spot["ruled_out"]:
        return "<h4>Ruled out</h4>\n<p>No paint of the catalogue.</p>\n"
    body, kind = "", ""
    for paint in spot["ruled_out"]:
        if paint["kind"] != kind:
            kind = paint["kind"]
            body += f'<tr class="kind"><th colspan="4" scope="rowgroup">{_KINDS[kind]}</th></tr>\n'
        reason = paint["reason"].replace("Delta E00", "ΔE00")
        body += (
            f'<tr><td>{escape(reason)}</td><td class="wide">{escape(paint["film"])}</td>'
            f'<td class="n">{_number(paint["delta_e"], 1)}</td><td class="n wide">{paint["rmse"]:.4f}</td></tr>\n'
        )
    return (
        '<h4>Ruled out, and why</h4>\n<div class="scroll"><table>\n<caption>Paints with a probability below 1 %, and the '
        "nearest film that has at least 1 % of each: a smaller trace of any paint can hide in any film.</caption>\n"
        '<thead><tr><th>Why</th><th class="wide">Nearest film with it</th><th class="n">ΔE00</th><th class="n wide">RMSE</th>'
        f"</tr></thead>\n<tbody>\n{body}</tbody></table></div>\n"
    )


def _method(record: Record) -> str:
    layers, opaque = record["method"]["layers"], record["measurement"]["opaque"]
    scale = record["catalogue"].get("scale")
    points = [
        "Every set of paints competes: its amounts are fitted to the spectrum by radiative transfer, and its probability "
        "follows from the misfit, given the errors stated below. One answer is that no set of the catalogue explains the "
        "spot.",
        "Probabilities hold for these paints and these assumptions. A paint that is not in the catalogue cannot be found; "
        "paints of like spectra cannot be told apart, and share their probability.",
        f"ΔE00 is CIEDE2000 for D65 and 10 degrees, the largest over the grounds: below {UNSEEN:g} nobody sees it, above "
        f"{REJECTED:g} everybody. RMSE is the root mean square of measured minus fitted reflectance.",
        "Intervals are 90 % intervals from the fit's covariance, for the paints named; they do not count that the film "
        "might be of others.",
        "The band about a fit is where 90 % of readings would lie if the explanation were right, with errors of the "
        "instrument, the model and the catalogue as stated, after the amounts are fitted.",
        f"For a paint that was not found, films of it alone, with every other paint, and beside the most probable "
        f"paints were fitted in one coat{', and two coats where those were found' if layers > 1 else ''}.",
    ]
    if layers == 1:
        points.append("Two coats were not tried: a spot of several coats is described as if they were mixed.")
    if opaque:
        points.append("The films are taken as hiding their ground: they say nothing on thickness, or on what lies below.")
    if scale:
        points.append(f"Thicknesses are on the catalogue's scale: {scale}.")
    items = "".join(f"<li>{escape(point)}</li>\n" for point in points)
    settings = {
        name.capitalize(): ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in values.items())
        for name, values in record["method"]["settings"].items()
    }
    return f"<h2>Method</h2>\n<ul>\n{items}</ul>\n<h4>Errors and expectations</h4>\n<dl>{_pairs(settings)}</dl>\n"


def _filed(record: Record, table: str, data: str) -> str:
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
    paints = f"<dt>Catalogue</dt><dd>{escape(catalogue['name'])}: {escape(', '.join(catalogue['paints']))}</dd>"
    if catalogue.get("provenance"):
        paints += f"<dt>Its source</dt><dd>{escape(catalogue['provenance'])}</dd>"
    versions = ", ".join(f"{name} {number}" for name, number in record["versions"].items())
    return (
        f"<h2>Record</h2>\n<dl><dt>Command</dt><dd><code>{escape(record['command'])}</code></dd>"
        f"<dt>Versions</dt><dd>{escape(versions)}; {escape(record['platform'])}</dd>{paints}"
        f"<dt>Beside this page</dt><dd>{escape(table)}: explanations, a line for each paint. {escape(data)}: all of this, "
        "with spectra and every option.</dd></dl>\n"
        '<div class="scroll"><table>\n<caption>Files that were read, by their SHA-256.</caption>\n'
        f"<thead><tr><th>As</th><th>File</th><th>SHA-256</th></tr></thead>\n<tbody>\n{inputs}</tbody></table></div>\n"
    )


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _length(value: float | None, ends: Sequence[float] | None = None) -> str:
    """Micrometres, and their interval."""
    if value is None:
        return "–"
    words = micrometres(value * 1e-6)
    return words if ends is None else f"{words} {_range([micrometres(end * 1e-6) for end in ends])}"


def _range(ends: Sequence[str]) -> str:
    return "" if ends[0] == ends[1] else f'<span class="range">({ends[0]}–{ends[1]})</span>'
