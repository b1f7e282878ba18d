"""How much of a search is done in full."""

from typing import NamedTuple


class Effort(NamedTuple):
    """What a search looks at, and what it takes as alike.

    Attributes:
        pairs: sets of two paints that are fitted, after all were compared with the spectrum on a grid of amounts.
        kept: sets that are fitted with errors of their own.
        behind: log weight by which these may stay behind the best while all have the same errors,
        close: and with errors of their own, to be fitted again where they then stand,
        shown: and to be an answer at all.
        trace: a paint that does less than this to the readings (root mean square, per unit of the logarithm of its k
            and s) is a trace: films that differ by traces share their errors.
        moved: how far that may be from where the errors were worked out.
        ranking, own, again, near: damped steps of a fit: while sets are ranked, with errors of their own, again with
            these, and to the amounts that are shown.
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


USUAL = Effort(80, 40, 8.0, 6.0, 8.0, 0.005, 0.0005, 5, 8, 6, 8, True)
"""Told from `THOROUGH` by one first answer in a hundred or two, where several sets explain a film about as well
(`python -m benchmarks.identification`)."""
THOROUGH = Effort(10_000, 120, 20.0, 20.0, 20.0, 0.0, 0.0, 14, 14, 14, 14, False)
"""Every pair is fitted, and all that may matter have errors of their own."""
