"""Numbers of a page in words."""

import re
from collections.abc import Sequence
from html import escape

import numpy as np

from .report import chance, micrometres
from .result import percent

# Lengths in um beyond which an interval says no more: far below a grain of pigment, and the
# thickest film there is.
_LEAST_UM = 0.001
_MOST_UM = 1e4


def chance_html(probability: float) -> str:
    """A probability."""
    return words_html(chance(probability))


def words_html(words: str) -> str:
    """Words as text of a page; percentages have a narrow blank that no line breaks at."""
    return re.sub(r"(\d) ?%", "\\1\u202f%", escape(words).replace("Delta E00", "ΔE00"))


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
