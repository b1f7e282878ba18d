"""Numbers in words, for the screen and for pages."""

import re


def chance(probability: float) -> str:
    """A probability in words."""
    return f"{probability:.1%}" if probability >= 0.001 else "< 0.1%"


def typeset(words: str) -> str:
    """Words as a page shows them: percentages have a narrow blank that no line breaks at."""
    return re.sub(r"(\d) ?%", "\\1\u202f%", words.replace("Delta E00", "ΔE00"))
