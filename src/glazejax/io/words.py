"""Words of tables and options: numbers read strictly, grids of wavelengths, and names that no
spreadsheet takes for a formula.
"""

import math
import re

_FORMULA = re.compile(r"'*[=+\-@]")


def read_number(word: str) -> float:
    """Number that a word spells in ASCII: Python's own spellings with ``_`` or in other scripts'
    digits are slips of a hand or an encoding.

    Raises:
        ValueError: it spells none.
    """
    if "_" in word or not word.isascii():
        raise ValueError(f"{word[:30]!r} is not a number; write it with the digits 0 to 9")
    return float(word)


def finite_number(word: str) -> float | None:
    """Number that `read_number` reads, if it is finite; else None."""
    try:
        value = read_number(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def is_number(word: str) -> bool:
    """Return whether `read_number` reads it."""
    try:
        read_number(word)
    except ValueError:
        return False
    return True


def shield_name(name: str) -> str:
    """Name as a table holds it: one that begins as a formula does gets an apostrophe before it.

    Quotation marks would not help: a spreadsheet computes ``"=1+1"`` as well. Numbers stay.
    """
    return f"'{name}" if _FORMULA.match(name) and not is_number(name) else name


def unshield_name(name: str) -> str:
    """Name that `shield_name` wrote."""
    return name[1:] if name.startswith("'") and _FORMULA.match(name) else name


def parse_grid(text: str) -> list[float]:
    """Wavelengths of ``FROM:TO:STEP`` in nm, both ends included.

    Raises:
        ValueError: another form, numbers that are no wavelengths, or an end that no step meets.
    """
    try:
        start, end, step = map(float, text.split(":"))
    except ValueError:
        raise ValueError(f"{text!r} is not FROM:TO:STEP in nm, such as 400:700:10") from None
    if not (0 < start <= end < math.inf and 0 < step < math.inf):
        raise ValueError(f"{text!r}: FROM must be positive, TO not below it, STEP above 0")
    count = (end - start) / step
    # Wavelengths of one spectrum; more are a slip of the hand, such as a step of 1e-9.
    limit = 100_000
    if count >= limit:
        raise ValueError(f"{text!r}: {count + 1:.0f} wavelengths are too many (at most {limit})")
    if abs(count - round(count)) > 1e-6:
        last = start + step * math.floor(count)
        raise ValueError(f"{text!r}: steps of {step:g} nm do not meet {end:g} nm; end at {last:g}")
    return [start + step * i for i in range(round(count) + 1)]
