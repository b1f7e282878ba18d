"""Guesses of what an unknown name was meant to be, and names that repeat."""

import difflib
from collections import Counter
from collections.abc import Callable, Iterable


def nearest_names(
    name: str,
    choices: Iterable[str],
    *,
    cutoff: float = 0.6,
    shortest: int = 3,
    fold: Callable[[str], str] = str.casefold,
) -> list[str]:
    """At most four known names that are near one: those with it inside, or inside it, come first.

    Args:
        name: as it was given.
        choices: names that there are.
        cutoff: likeness, 0 to 1, that counts as near where none is inside the other.
        shortest: names of fewer letters are not looked for inside others; a known name that is to
            lie inside has three at least.
        fold: takes away what does not matter, such as the case.
    """
    folded: dict[str, str] = {}
    for full in choices:
        folded.setdefault(fold(full), full)
    key = fold(name)
    # An illuminant is called A: a known name of three letters counts as lying inside another.
    containing = [
        full
        for candidate, full in folded.items()
        if (len(key) >= shortest and key in candidate) or (len(candidate) >= 3 and candidate in key)
    ]
    count = 4
    if containing:
        return containing[:count]
    return [folded[k] for k in difflib.get_close_matches(key, folded, n=count, cutoff=cutoff)]


def nearest_hint(name: str, choices: Iterable[str], cutoff: float = 0.4) -> str:
    """Clause that lists the known names near one, such as ``; nearest: azurite``; empty if none
    is.
    """
    near = nearest_names(name, choices, cutoff=cutoff)
    return f"; nearest: {', '.join(near)}" if near else ""


def first_repeated(names: Iterable[str]) -> str | None:
    """The first of the names that stand there twice; None if all differ."""
    return next((name for name, count in Counter(names).items() if count > 1), None)
