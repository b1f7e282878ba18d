"""Numbers in words, for the screen and for pages."""

import re


def chance(probability: float) -> str:
    """A probability in words."""
    return f"{probability:.1%}" if probability >= 0.001 else "< 0.1%"


def typeset(text: str) -> str:
    """Words as a page shows them: no line breaks in a percentage, or after a sign before one."""
    joined = re.sub(r"(\d) ?%", "\\1\u202f%", text.replace("Delta E00", "ΔE00"))
    return re.sub(r"([<>]) (?=\d)", "\\1\u202f", joined)
