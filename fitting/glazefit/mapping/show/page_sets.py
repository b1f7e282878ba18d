"""Tables of a map's page: sets with their areas and spectra, and paints."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from jaxtyping import Float

from ...page.words import chance_html, words_html
from ..store.chunk import Members, SetSum
from .legend import OTHERS
from .overview import Overview
from .pictures import found_paints, own_colours, set_colours

SHOWN = 40
"""Sets that have a row of their own."""

_WIDTH = 208.0
_HEIGHT = 84.0
_LEFT = 22.0
_RIGHT = 4.0
_TOP = 5.0
_BOTTOM = 14.0


def share_html(count: float, of: float) -> str:
    """A share of the area."""
    share = count / of if of else 0.0
    if 0 < share < 0.0001:
        return "&lt;\u202f0.01\u202f%"
    return words_html(f"{100 * share:.{2 if share < 0.0995 else 1}f} %")


def area_html(count: int, look: Overview) -> str:
    """An area in cm2, if the size of a pixel is known."""
    return "" if look.pixel_area is None else f"{count * look.pixel_area * 1e4:.3g}"


def sets_table(
    look: Overview, sums: Mapping[Members, SetSum], grid: Float[np.ndarray, "bands"]
) -> str:
    """Sets, the largest first, with mean spectra beside their fits."""
    colours = own_colours(look, SHOWN)
    legend = set_colours(look)
    area = '<th class="n wide">Area, cm²</th>' if look.pixel_area is not None else ""
    rows = ""
    for n, members in enumerate(look.ranked[:SHOWN]):
        colour = legend[n] if n < len(legend) else OTHERS
        rows += (
            f'<tr><td class="n">{n + 1}</td><td><span class="key" '
            f'style="background:{colour}"></span> '
            f'<span class="swatch" style="background:{colours[n]}" '
            f'title="{colours[n]}"></span></td>'
            f"<td>{_paints_html(look, members)}</td>{_numbers(look, members, sums)}"
            f'<td class="spectrum">{spectra_svg(sums.get(members), grid, look.words(members))}</td>'
            "</tr>\n"
        )
    rest = look.ranked[SHOWN:]
    if rest:
        count = sum(look.sets[members] for members in rest)
        cell = f'<td class="n wide">{area_html(count, look)}</td>' if area else ""
        rows += (
            '<tr><td></td><td><span class="key" '
            f'style="background:{OTHERS}"></span></td><td>{len(rest)} further sets'
            f'</td><td class="n">{share_html(count, look.mapped)}</td>{cell}<td '
            'colspan="3"></td></tr>\n'
        )
    if look.sets.get(()):
        cell = f'<td class="n wide">{area_html(look.sets[()], look)}</td>' if area else ""
        rows += (
            '<tr><td></td><td><span class="key none"></span></td><td><em>None of these '
            "paints</em></td>"
            f'<td class="n">{share_html(look.sets[()], look.mapped)}</td>{cell}<td class="n"></td>'
            '<td class="n wide"></td><td '
            f'class="spectrum">{spectra_svg(sums.get(()), grid, "none of these paints")}'
            "</td></tr>\n"
        )
    return (
        '<div class="scroll"><table id="sets">\n<thead><tr><th class="n">No.</th><th>Legend, own '
        "colour</th>"
        f"<th>Paints, with their median share by mass (10–90\u202f% of pixels)</th>"
        f'<th class="n">Share of area</th>{area}'
        '<th class="n">Prob.</th><th class="n wide">Thickness, µm</th><th>Mean reflectance and '
        "fit</th></tr></thead>\n"
        f"<tbody>\n{rows}</tbody></table></div>\n"
    )


def _paints_html(look: Overview, members: Members) -> str:
    """Paints of a set with the spread of their shares."""
    area = look.where(members)
    shares = look.examples["fraction"][area]
    words = []
    for place, member in enumerate(members):
        known = shares[:, place][np.isfinite(shares[:, place])]
        spread = ""
        if len(members) > 1 and known.size:
            low, middle, high = 100 * np.percentile(known, (10, 50, 90))
            spread = (
                f" {_percent(middle)}\u202f% <span "
                f'class="range">({_percent(low)}–{_percent(high)})</span>'
            )
        words.append(f"{escape(look.paints[member])}{spread}")
    return "<br>".join(words)


def _percent(value: float) -> str:
    return f"{value:.0f}" if value >= 9.5 else f"{value:.1f}"


def _numbers(look: Overview, members: Members, sums: Mapping[Members, SetSum]) -> str:
    count = look.sets[members]
    area = look.where(members)
    chances = look.examples["probability"][area]
    known = chances[np.isfinite(chances)]
    chance = chance_html(float(known.mean())) if known.size else "–"
    total, number = sums[members].thickness if members in sums else (0.0, 0)
    thick = f"{total / number * 1e6:.1f}" if number else "–"
    area = (
        f'<td class="n wide">{area_html(count, look)}</td>' if look.pixel_area is not None else ""
    )
    return (
        f'<td class="n">{share_html(count, look.mapped)}</td>{area}<td class="n">{chance}</td>'
        f'<td class="n wide">{thick}</td>'
    )


def spectra_svg(sums: SetSum | None, grid: Float[np.ndarray, "bands"], words: str) -> str:
    """Mean of the readings with their spread, and the mean of the fits."""
    if sums is None or not sums.pixels:
        return "–"
    mean = np.asarray(sums.spectrum) / sums.pixels
    fitted = np.asarray(sums.fitted) / sums.pixels
    spread = np.sqrt(np.maximum(np.asarray(sums.square) / sums.pixels - mean**2, 0.0))
    top = next(
        level
        for level in (0.1, 0.2, 0.5, 1.0, 2.0)
        if (mean + spread).max() <= level or level == 2.0
    )
    span = float(grid[-1] - grid[0]) or 1.0

    def points(values: np.ndarray, across: np.ndarray = grid) -> str:
        x = _LEFT + (across - grid[0]) / span * (_WIDTH - _LEFT - _RIGHT)
        y = _HEIGHT - _BOTTOM - np.clip(values / top, 0, 1) * (_HEIGHT - _TOP - _BOTTOM)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    band = f"{points(mean + spread)} {points((mean - spread)[::-1], grid[::-1])}"
    ends = (np.ceil(grid[0] / 100) * 100, np.floor(grid[-1] / 100) * 100)
    # The outermost numbers stay inside of the picture.
    anchors = {float(ends[1]): "end", float(ends[0]): "start"}
    ticks = "".join(
        f'<text x="{_LEFT + (nm - grid[0]) / span * (_WIDTH - _LEFT - _RIGHT):.1f}" '
        f'y="{_HEIGHT - 3:.0f}" text-anchor="{anchors.get(float(nm), "middle")}">{nm:.0f}</text>'
        for nm in np.arange(ends[0], ends[1] + 1, 100.0 if span <= 500 else 500.0)
    )
    off = float(np.sqrt(np.mean((mean - fitted) ** 2)))
    says = (
        f"Mean reflectance of {words} from {grid[0]:.0f} to {grid[-1]:.0f} nm; the mean fit is "
        f"off by {off:.4f}"
    )
    line = (
        f'<line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{_HEIGHT - _BOTTOM}" '
        f'y2="{_HEIGHT - _BOTTOM}" stroke="var(--edge)"/>'
    )
    fit = ""
    if np.isfinite(fitted).all():
        fit = (
            f'<polyline points="{points(fitted)}" fill="none" stroke="var(--fit-1)" '
            'stroke-width="1.6" stroke-dasharray="4 2"/>'
        )
    return (
        f'<svg viewBox="0 0 {_WIDTH:.0f} {_HEIGHT:.0f}" role="img" aria-label="{escape(says)}" '
        f'font-size="8.5" fill="var(--faint)">{line}<text x="{_LEFT - 4}" y="{_TOP + 6}" '
        f'text-anchor="end">{top:g}</text><text x="{_LEFT - 4}" y="{_HEIGHT - _BOTTOM}" '
        f'text-anchor="end">0</text>{ticks}<polygon points="{band}" fill="var(--ink)" '
        f'fill-opacity=".14"/><polyline points="{points(mean)}" fill="none" stroke="var(--ink)" '
        f'stroke-width="1.5"/>{fit}</svg>'
    )


def paints_table(look: Overview) -> str:
    """How much of the area each paint is in."""
    order: Sequence[int] = found_paints(look, least=0.0)
    rows = ""
    for paint in order:
        rows += (
            f"<tr><td>{escape(look.paints[paint])}</td><td "
            f'class="n">{share_html(look.in_set[paint], look.mapped)}</td>'
            f'<td class="n">{share_html(look.likely[paint], look.mapped)}</td></tr>\n'
        )
    never = [escape(name) for n, name in enumerate(look.paints) if n not in order]
    last = (
        "<p>In no pixel’s most probable set, and nowhere with a probability above ½: "
        f"{', '.join(never)}.</p>\n"
        if never
        else ""
    )
    return (
        '<div class="scroll"><table class="amounts">\n<thead><tr><th>Paint</th>'
        '<th class="n">In the most probable set</th><th class="n">Probability above '
        "½</th></tr></thead>\n"
        f"<tbody>\n{rows}</tbody></table></div>\n{last}"
    )
