"""Numbers in words, for the screen and for pages."""

import re
from html import escape


def chance(probability: float) -> str:
    """A probability in words."""
    return f"{probability:.1%}" if probability >= 0.001 else "< 0.1%"


def chance_html(probability: float) -> str:
    """A probability on a page."""
    return words_html(chance(probability))


def words_html(words: str) -> str:
    """Words as text of a page; percentages have a narrow blank that no line breaks at."""
    return re.sub(r"(\d) ?%", "\\1\u202f%", escape(words).replace("Delta E00", "ΔE00"))
