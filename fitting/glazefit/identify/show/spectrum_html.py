"""One spot of a page: verdict, spectra, amounts, and what was ruled out."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ...page.frame import table_html
from ...page.words import chance_html, words_html
from ..result import percent
from ..search.weigh import REJECTED
from .figures import FITS, draw_residuals, draw_spectra
from .terminal import micrometres

_KINDS = {
    "misfit": f"Ruled out: a person sees that no film with it fits (ΔE00 above {REJECTED:g})",
    "trace": "Ruled out but for a trace",
    "worse": "Improbable: others fit better",
    "unneeded": "Improbable, though it fits as well: a film without it is more probable",
    "absent": "Improbable: films without it came nearer before any with it was fitted closely",
}
# Lengths in um beyond which an interval says no more: far below a grain of pigment, and the
# thickest film there is.
_LEAST_UM = 0.001
_MOST_UM = 1e4
# Of a spot's tables, what is printed on its page; the screen has all.
_PRINTED_FITS = 3
_PRINTED_PAINTS = 8

Record = Mapping[str, Any]


def spot_html(record: Record, spot: Record, *, drawn: bool) -> str:
    """All on one spot; its spectra are drawn if `drawn`."""
    name = escape(spot["name"])
    best = spot["explanations"][0]
    if spot["explained"]:
        probability = chance_html(best["probability"])
        verdict = (
            f"Most probable: <strong>{words_html(spot['words'])}</strong>, probability "
            f"{probability}."
        )
        if best["probability"] < spot["none_of_these"]:
            verdict += (
                " Uncertain: more probable than any one set is that no paints of the catalogue "
                "explain it."
            )
    else:
        verdict = f"<strong>{words_html(spot['words'][0].upper() + spot['words'][1:])}.</strong>"
    unexplained = chance_html(spot["none_of_these"])
    none = f"Probability that none of these paints explains it: {unexplained}."
    doubts = [none] if spot["explained"] else []
    if record["method"]["layers"] > 1:
        several = chance_html(spot["coats_probability"])
        doubts.append(f"Probability that the film has more than one coat: {several}.")
        if spot["coats"]:
            doubts.append(f"{words_html(spot['coats'])}.")
    doubts += [words_html(words) for words in spot["doubts"]]
    least = record["thresholds"]["ruled_out_below"]
    likely = [
        f"{escape(paint)} {chance_html(p)}"
        for paint, p in spot["paint_probability"].items()
        if p >= least
    ]
    chances = ", ".join(likely)
    colours = ""
    if spot["colours"] is not None:
        colours = (
            f"<p>Measured {swatches(spot, 'measured')} fitted {swatches(spot, 'fitted')}</p>\n"
        )
    return (
        f'<article class="spot" id="{spot["id"]}" aria-label="spot {name}">\n<div '
        f'class="first">\n<h3>{name}</h3>\n'
        f'<p class="verdict{"" if spot["explained"] else " warn"}">{verdict}</p>\n'
        f"<p>{' '.join(doubts)}</p>\n"
        f"{colours}{_figures(record, spot) if drawn else ''}</div>\n{_explanations(record, spot)}"
        "<h4>Chance of each paint to be in the "
        f"film</h4>\n<p>{chances or 'None reaches 1 %'}.</p>\n"
        f"{_ruled_out(spot)}</article>\n"
    )


def _figures(record: Record, spot: Record) -> str:
    grid = np.asarray(record["measurement"]["wavelengths_nm"])
    grounds = record["measurement"]["grounds"]
    fits = spot["explanations"][:FITS]
    keys = "".join(
        key_html(n, fit["words"], chance_html(fit["probability"]))
        for n, fit in enumerate(fits, start=1)
    )
    names = "; ".join(f"{n}, {fit['words']}" for n, fit in enumerate(fits, start=1))
    low = np.min(spot["measured"])
    high = np.max(spot["measured"])
    spectra = (
        f"Reflectance of spot {spot['name']} from {grid[0]:g} to {grid[-1]:g} nm, measured "
        f"between {low:.2f} and {high:.2f}, and the fits {names}."
    )
    off = np.abs(np.asarray(spot["measured"]) - np.asarray(fits[0]["fitted"])).max()
    residuals = (
        f"Measured minus fitted reflectance of spot {spot['name']}; the best fit is off by "
        f"{off:.3f} at most."
    )
    return (
        '<div class="figures">\n'
        '<figure role="img" '
        f'aria-label="{escape(spectra)}">{draw_spectra(spot, grid, grounds)}</figure>\n'
        f'<figure role="img" aria-label="{escape(residuals)}">{draw_residuals(spot, grid, grounds)}'
        "</figure>\n</div>\n"
        '<ul class="keys"><li><svg viewBox="0 0 32 12" aria-hidden="true"><circle cx="16" cy="6" '
        'r="3.5" fill="none" '
        f'stroke="var(--ink)"/></svg>measured</li>{keys}<li><svg viewBox="0 0 32 12" '
        'aria-hidden="true"><rect '
        'width="32" height="12" fill="var(--fit-1)" fill-opacity=".2"/></svg>90\u202f% band of '
        "fit 1</li></ul>\n"
    )


def key_html(number: int, words: str, probability: str) -> str:
    """One line of a figure, in the list of its keys."""
    dash = ("", ' stroke-dasharray="7 3"', ' stroke-dasharray="2 2.5"')[number - 1]
    return (
        '<li><svg viewBox="0 0 32 12" aria-hidden="true"><line x1="0" x2="32" y1="6" y2="6" '
        'stroke-width="2.5" '
        f'stroke="var(--fit-{number})"{dash}/></svg>{number}: {words_html(words)} '
        f"({probability})</li>"
    )


def _explanations(record: Record, spot: Record) -> str:
    opaque = record["measurement"]["opaque"]
    columns = 2 if opaque else 3
    body = ""
    for number, found in enumerate(spot["explanations"]):
        beyond = number >= _PRINTED_FITS
        thick = (
            ""
            if opaque
            else f"thickness {length_html(found['thickness_um'], found['thickness_90_um'])} µm, "
        )
        body += _row(
            f'<th colspan="{columns}" scope="rowgroup">{found["rank"]}: probability '
            f'{chance_html(found["probability"])} <span class="faint">{thick}ΔE00 '
            f"{number_html(found['delta_e_2000'], 2)}, RMSE {found['rmse']:.4f}</span></th>",
            kind="lead",
            beyond=beyond,
        )
        stacked = any(paint["coat"] > 1 for paint in found["paints"])
        for paint in found["paints"]:
            coat = "" if not stacked else " (upper coat)" if paint["coat"] == 1 else " (lower coat)"
            share = share_html(paint["fraction"], paint["fraction_90"])
            amount = (
                ""
                if opaque
                else f'<td class="n">{length_html(paint["amount_um"], paint["amount_90_um"])}</td>'
            )
            body += _row(
                f'<td>{escape(paint["name"])}{coat}</td><td class="n">{share}</td>{amount}',
                beyond=beyond,
            )
    amount = "" if opaque else '<th class="n">Amount, µm</th>'
    left = len(spot["explanations"]) - _PRINTED_FITS
    return (
        f'<h4>{"Shares" if opaque else "Amounts"}</h4>\n<p class="faint">With 90\u202f% '
        "intervals, if the film is of "
        "these paints. Share: by mass, of all paint in the film."
        f"{'' if opaque else ' Amount: thickness times share.'}</p>\n"
        + table_html(f'<th>Paint</th><th class="n">Share</th>{amount}', body, ' class="amounts"')
        + _not_printed(f"{left} less probable" if left > 0 else "")
    )


def _ruled_out(spot: Record) -> str:
    if not spot["ruled_out"]:
        return "<h4>Ruled out</h4>\n<p>No paint of the catalogue.</p>\n"
    body = ""
    kind = ""
    for number, paint in enumerate(spot["ruled_out"]):
        beyond = number >= _PRINTED_PAINTS
        if paint["kind"] != kind:
            kind = paint["kind"]
            heading = f'<th colspan="4" scope="rowgroup">{_KINDS[kind]}</th>'
            body += _row(heading, kind="kind", beyond=beyond)
        body += _row(
            f"<td>{words_html(paint['reason'])}</td>"
            f'<td class="wide">{words_html(paint["film"])}</td>'
            f'<td class="n">{number_html(paint["delta_e"], 1)}</td>'
            f'<td class="n wide">{number_html(paint["rmse"], 4)}</td>',
            beyond=beyond,
        )
    left = [paint["paint"] for paint in spot["ruled_out"][_PRINTED_PAINTS:]]
    return (
        '<h4>Ruled out, and why</h4>\n<p class="faint">Paints that do not fit, or with a '
        "probability "
        "below 1\u202f%, judged by the nearest film with at least 1\u202f% of each: a smaller "
        "trace can hide in any "
        "film.</p>\n"
        + table_html(
            '<th>Why</th><th class="wide">Nearest film with it</th><th class="n">ΔE00</th>'
            '<th class="n wide">RMSE</th>',
            body,
            ' class="ruled"',
        )
        + _not_printed(", ".join(left))
    )


def _row(cells: str, *, kind: str = "", beyond: bool = False) -> str:
    """A row of a table; one beyond what a page holds is on the screen only."""
    classes = " ".join(filter(None, (kind, "more" if beyond else "")))
    named = f' class="{classes}"' if classes else ""
    return f"<tr{named}>{cells}</tr>\n"


def _not_printed(what: str) -> str:
    """What a page says of the rows that it has no room for."""
    words = f"Also, in the files beside this page: {what}."
    return f'<p class="paper faint">{escape(words)}</p>\n' if what else ""


def swatches(spot: Record, what: str) -> str:
    """Colours over each ground, of what is "measured" or "fitted"."""
    if spot["colours"] is None:
        return ""
    shades = spot["colours"][what]
    patches = "".join(
        f'<span class="swatch" style="background:{shade}"></span>' for shade in shades
    )
    return f'<span role="img" aria-label="{what} colour, {", ".join(shades)}">{patches}</span>'


def share_html(fraction: float, ends: Sequence[float]) -> str:
    """A fraction and its interval."""
    if fraction == 1:
        return words_html("100 %")
    return f"{words_html(percent(fraction))} {_range([escape(percent(end)[:-2]) for end in ends])}"


def number_html(value: float | None, digits: int) -> str:
    """A number, or a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def length_html(value: float | None, ends: Sequence[float] | None = None) -> str:
    """Micrometres, and their interval."""
    if value is None:
        return "–"
    words = _micrometres(value)
    return words if ends is None else f"{words} {_range([_micrometres(end) for end in ends])}"


def _micrometres(value: float) -> str:
    if value < _LEAST_UM or value > _MOST_UM:
        return f"&lt; {_LEAST_UM:g}" if value < _LEAST_UM else f"&gt; {_MOST_UM:g}"
    if value >= 0.095:
        return micrometres(value * 1e-6)
    return np.format_float_positional(value, precision=1, fractional=False, trim="-")


def _range(ends: Sequence[str]) -> str:
    return "" if ends[0] == ends[1] else f'<span class="range">({ends[0]}–{ends[1]})</span>'
