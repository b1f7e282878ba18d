"""What nobody may have mentioned: a yellowed varnish on top, another ground than told, a film that
hides its ground.
"""

from typing import NamedTuple


class Condition(NamedTuple):
    """One way in which a film may lie differently from what was told."""

    words: str  # as an answer names it; empty for what was told
    chance: float  # beforehand, beside 1 for what was told
    varnish: float = 0.0  # optical thickness at 400 nm
    ground: float | None = None  # internal reflectance; None is as told
    opaque: bool | None = None  # None is as told


_VARNISHED = "under a yellowed varnish"
_LIGHT = 0.85
_DARK = 0.04
"""Internal reflectances of grounds that nobody named."""

CONDITIONS = (
    Condition("", 1.0),
    Condition(_VARNISHED, 0.08, varnish=0.2),
    Condition(_VARNISHED, 0.08, varnish=0.6),
    Condition("over a light ground", 0.4, ground=_LIGHT, opaque=False),
    Condition("over a dark ground", 0.1, ground=_DARK, opaque=False),
    Condition("hiding its ground", 0.05, opaque=True),
    Condition("over a lighter ground than told", 0.03, ground=_LIGHT),
    Condition("over a darker ground than told", 0.03, ground=_DARK),
)
"""All that are tried, by number; the first is what was told."""
VARNISHES = (1, 2)
NOT_OPAQUE = (3, 4)
OTHER_GROUNDS = (5, 6, 7)
"""Numbers of those with a varnish, of those for films said to be opaque, and of those for one
reading over a ground.
"""
