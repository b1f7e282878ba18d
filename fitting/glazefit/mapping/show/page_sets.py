"""Sets of paints on a map's page: shares, thickness, and spectra beside their fits."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from ...page.words import typeset
from ..store.chunk import Members, SetSum
from .legend import OTHERS
from .overview import Overview
from .pictures import own_colours, set_colours

SHOWN = 40
"""Sets that have a row of their own."""


def share_words(count: float, of: float) -> str:
    """A share of the area."""
    share = count / of if of else 0.0
    if 0 < share < 0.0001:
        return "<\u202f0.01\u202f%"
    return typeset(f"{100 * share:.{2 if share < 0.0995 else 1}f} %")


def set_rows(
    look: Overview, sums: Mapping[Members, SetSum], grid: Float[np.ndarray, "bands"]
) -> Iterator[dict[str, Any]]:
    """Rows of the table of sets, the largest first; what is not known is None.

    Args:
        look: the map.
        sums: sums over the pixels of each set.
        grid: of their spectra, nm.
    """
    colours = own_colours(look, SHOWN)
    legend = set_colours(look)
    for n, members in enumerate(look.ranked[:SHOWN]):
        area = look.where(members)
        chances = look.examples["probability"][area]
        chances = chances[np.isfinite(chances)]
        total, number = sums[members].thickness if members in sums else (0.0, 0)
        yield {
            "members": members,
            "legend": legend[n] if n < len(legend) else OTHERS,
            "colour": colours[n],
            "paints": _spreads(look, members),
            "pixels": look.sets[members],
            "probability": float(chances.mean()) if chances.size else None,
            "thickness": total / number * 1e6 if number else None,
            "spectrum": small_spectrum(sums.get(members), grid),
        }


def _spreads(look: Overview, members: Members) -> list[tuple[str, list[str] | None]]:
    """Paints of a set, each with the 10, 50 and 90 % quantiles of its shares, in percent."""
    shares = look.examples["fraction"][look.where(members)]
    paints = []
    for place, member in enumerate(members):
        told = shares[:, place][np.isfinite(shares[:, place])]
        spread = None
        if len(members) > 1 and told.size:
            quantiles = 100 * np.percentile(told, (10, 50, 90))
            spread = [f"{value:.{0 if value >= 9.5 else 1}f}" for value in quantiles]
        paints.append((look.paints[member], spread))
    return paints


def small_spectrum(sums: SetSum | None, grid: Float[np.ndarray, "bands"]) -> dict[str, Any] | None:
    """Points of the mean of a set's readings, of their spread, and of the mean of its fits, empty
    where they are not known; None for a set without pixels.
    """
    if sums is None or not sums.pixels:
        return None
    mean = np.asarray(sums.spectrum) / sums.pixels
    fitted = np.asarray(sums.fitted) / sums.pixels
    spread = np.sqrt(np.maximum(np.asarray(sums.square) / sums.pixels - mean**2, 0.0))
    most = next(
        level
        for level in (0.1, 0.2, 0.5, 1.0, 2.0)
        if (mean + spread).max() <= level or level == 2.0
    )
    span = float(grid[-1] - grid[0]) or 1.0
    # The picture, and the frame in it, which leaves room for numbers on the left and below.
    width = 208.0
    height = 84.0
    left = 22.0
    right = width - 4.0
    top = 5.0
    bottom = height - 14.0

    def across(nm: np.ndarray) -> np.ndarray:
        return left + (nm - grid[0]) / span * (right - left)

    def points(values: np.ndarray, nm: np.ndarray = grid) -> str:
        y = bottom - np.clip(values / most, 0, 1) * (bottom - top)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across(nm), y, strict=True))

    first = np.ceil(grid[0] / 100) * 100
    last = np.floor(grid[-1] / 100) * 100
    # The outermost numbers stay inside of the picture.
    anchors = {float(last): "end", float(first): "start"}
    ticks = np.arange(first, last + 1, 100.0 if span <= 500 else 500.0)
    return {
        "width": f"{width:.0f}",
        "height": int(height),
        "frame": (left, right, top, bottom),
        "most": most,
        "off": float(np.sqrt(np.mean((mean - fitted) ** 2))),
        "band": f"{points(mean + spread)} {points((mean - spread)[::-1], grid[::-1])}",
        "mean": points(mean),
        "fit": points(fitted) if np.isfinite(fitted).all() else "",
        "ticks": [
            (x, anchors.get(float(nm), "middle"), nm)
            for x, nm in zip(across(ticks), ticks, strict=True)
        ],
    }
