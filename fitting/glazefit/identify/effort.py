"""How much of a search is done in full."""

from typing import NamedTuple


class Effort(NamedTuple):
    """What a search looks at, and what it takes as alike.

    Attributes:
        pairs: sets of two paints that are fitted, after all were compared with the spectrum on a
            grid of amounts.
        kept: sets that are fitted with errors of their own.
        behind: log weight by which these may stay behind the best while all have the same errors,
        close: and with errors of their own, to be fitted again where they then stand,
        shown: and to be an answer at all.
        trace: a paint that does less than this to the readings (root mean square, per unit of the
            logarithm of its k and s) is a trace: films that differ by traces share their errors.
        moved: how far that may be from where the errors were worked out.
        ranking, own, again, near: damped steps of a fit: while sets are ranked, with errors of
            their own, again with these, and to the amounts that are shown.
        single: whether sets are weighed in single precision; amounts that are shown never are.
    """

    pairs: int
    kept: int
    behind: float
    close: float
    shown: float
    trace: float
    moved: float
    ranking: int
    own: int
    again: int
    near: int
    single: bool


USUAL = Effort(
    pairs=80,
    kept=40,
    behind=8.0,
    close=6.0,
    shown=8.0,
    trace=0.005,
    moved=0.0005,
    ranking=5,
    own=8,
    again=6,
    near=8,
    single=True,
)
"""Told from `THOROUGH` by one first answer in a hundred or two, where several sets explain a film
about as well (`python -m benchmarks.identification`)."""
THOROUGH = Effort(
    pairs=10_000,
    kept=120,
    behind=20.0,
    close=20.0,
    shown=20.0,
    trace=0.0,
    moved=0.0,
    ranking=14,
    own=14,
    again=14,
    near=14,
    single=False,
)
"""Every pair is fitted, and all that may matter have errors of their own."""
