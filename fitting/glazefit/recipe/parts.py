"""Parts that a painter weighs out, in whole numbers."""

from collections.abc import Sequence

import numpy as np

from glazejax.paint.describe import Coat


def whole_parts(shares: Sequence[float]) -> tuple[int, ...]:
    """The smallest whole numbers that stand to each other as shares do, to 8 % of each.

    Args:
        shares: above 0, in any unit.

    Returns:
        As many whole numbers from 1 on: 84, 15, 1 for 0.84, 0.15, 0.01.
    """
    # Parts by which each share may be wrong, of itself.
    close = 0.08
    ratios = np.asarray(shares) / min(shares)
    exact = np.asarray(shares) / sum(shares)
    whole = ratios
    for smallest in range(1, 101):
        whole = np.round(ratios * smallest)
        if np.allclose(whole / whole.sum(), exact, rtol=close, atol=0.0):
            break
    return tuple(map(int, whole))


def parts_by_paint(coat: Coat) -> dict[str, int]:
    """Parts of a coat's paints, in their order."""
    shares, names = zip(*coat.parts, strict=True)
    return dict(zip(names, whole_parts(shares), strict=True))


def describe_parts(coat: Coat) -> str:
    """Parts of a coat's paints in their order, such as ``84 : 15 : 1``; empty of one paint."""
    parts = parts_by_paint(coat).values()
    return " : ".join(map(str, parts)) if len(parts) > 1 else ""
