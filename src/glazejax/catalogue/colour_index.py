"""Families of pigments by what paints are called: a Colour Index number, or the family's name."""

import functools
import re

from ..names import nearest_hint
from .exemplars import families

# PB29, P.B. 29, PB15:3, NR9; a form behind the colon is the same pigment. NO is a word, and so is
# the German Nr. 4, while NR 4 is natural red.
_NUMBER = re.compile(
    r"(?<![A-Za-z])(?!no|nr\.|(?-i:[Nn]r)\s)([PNV])\.?\s?(Bk|Br|[BGMORVWY])\.?\s?(\d{1,3})(?!\d|\.\d)",
    re.IGNORECASE,
)
_LONG = re.compile(
    r"\b(Pigment|Natural|Vat)\s+(Black|Brown|Blue|Green|Metal|Orange|Red|Violet|White|Yellow)\s+"
    r"(\d{1,3})\b",
    re.IGNORECASE,
)
_LETTERS = {"black": "Bk", "brown": "Br", "blue": "B"}
# PBk6-PBk9 and NY13-14, as families.tsv writes several numbers.
_SPAN = re.compile(r"([PNV](?:Bk|Br|[BGMORVWY]))(\d+)(?:-(?:\1)?(\d+))?")


def colour_indices(text: str) -> tuple[str, ...]:
    """Colour Index numbers in a text, such as ``PB29``, each once.

    Example:
        >>> colour_indices("Phthalo blue P.B. 15:3, Pigment White 6")
        ('PB15', 'PW6')
    """
    short = [(kind.upper(), hue, number) for kind, hue, number in _NUMBER.findall(text)]
    short += [
        (kind[0].upper(), _LETTERS.get(hue.lower(), hue[0]), number)
        for kind, hue, number in _LONG.findall(text)
    ]
    return tuple(dict.fromkeys(f"{kind}{hue.capitalize()}{int(n)}" for kind, hue, n in short))


def family_named(text: str) -> str:
    """Family of pigments that a text names by a Colour Index number or by its name.

    A number counts more than a name: cobalt blue hue PB29 is ultramarine. Where several families
    have the number, the name decides.

    Raises:
        ValueError: no family is named, or two are, or none has the number; the message is a clause.

    Example:
        >>> family_named("Hansa yellow PY74"), family_named("raw umber, PBr7")
        ('azo yellow', 'raw umber')
    """
    padded = f" {_words(text)} "
    named = [name for name in families() if f" {_words(name)} " in padded]
    numbers = colour_indices(text)
    if not numbers:
        if len(named) == 1:
            return named[0]
        if named:
            raise ValueError(f"it names {' and '.join(named)}: a reference is of one pigment")
        hint = nearest_hint(text, families(), 0.75)
        raise ValueError(f"it names neither a Colour Index number nor a family{hint}")
    having = [_numbered().get(number, ()) for number in numbers]
    for number, numbered in zip(numbers, having, strict=True):
        if not numbered:
            raise ValueError(f"no family has the Colour Index number {number}")
    shared = [family for family in having[0] if all(family in numbered for numbered in having)]
    if not shared:
        raise ValueError(f"{' and '.join(numbers)} are two pigments: a reference is of one")
    candidates = shared if len(shared) == 1 else [family for family in shared if family in named]
    if len(candidates) != 1:
        raise ValueError(f"{numbers[0]} may be {' or '.join(sorted(shared))}")
    return candidates[0]


def _words(text: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", text.casefold()))


@functools.cache
def _numbered() -> dict[str, list[str]]:
    """Families of each Colour Index number."""
    out: dict[str, list[str]] = {}
    for family in families().values():
        for kind, first, last in _SPAN.findall(family.colour_index):
            for number in range(int(first), int(last or first) + 1):
                out.setdefault(f"{kind}{number}", []).append(family.name)
    return out
