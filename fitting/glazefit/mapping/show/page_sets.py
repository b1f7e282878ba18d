"""Sets of paints on a map's page: shares, thickness, and spectra with their fits."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...page.plot import PlotAxes
from ...page.words import typeset
from ..store.chunk import Bands, Members, SetSum, rms_difference
from .overview import Overview


def share_words(count: float, of: float) -> str:
    """A share of the area."""
    share = count / of if of else 0.0
    if 0 < share < 0.0001:
        return "<\u202f0.01\u202f%"
    return typeset(f"{100 * share:.{2 if share < 0.0995 else 1}f} %")


def set_rows(
    look: Overview,
    grid: Bands,
    facts: Mapping[Members, Mapping[str, Any]] | None,
) -> Iterator[dict[str, Any]]:
    """Rows of the table of sets, the largest first; what is not known is None.

    Args:
        look: the map.
        grid: of their spectra, nm.
        facts: of each set of a map by family, by `describe_sets`: the film of its nearest exemplars
            takes the place of the fit, and no amounts are stated.
    """
    for n, members in enumerate(look.shown):
        sums = look.sets[members]
        about = (facts or {}).get(members, {})
        film = about.get("film")
        area = look.where(members)
        chances = look.examples["probability"][area]
        chances = chances[np.isfinite(chances)]
        yield {
            "members": members,
            "legend": look.legend_colours[n],
            "colour": look.own_colours[n],
            "paints": [(look.paints[member], None) for member in members]
            if facts is not None
            else list(_spreads(look, members)),
            "pigments": about.get("pigments", ()),
            "exemplars": film["paints"] if film else (),
            "pixels": sums.pixels,
            "probability": float(chances.mean()) if chances.size else None,
            "thickness": sums.thickness_um,
            "spectrum": small_spectrum(
                sums, grid, np.array(film["fitted"][0], float) if film else None
            ),
        }


def _spreads(look: Overview, members: Members) -> Iterator[tuple[str, list[str] | None]]:
    """Paints of a set, each with the 10, 50 and 90 % quantiles of its shares, in percent."""
    shares = look.examples["fraction"][look.where(members)]
    for slot, member in enumerate(members):
        finite = shares[:, slot][np.isfinite(shares[:, slot])]
        spread = None
        if len(members) > 1 and finite.size:
            quantiles = 100 * np.percentile(finite, (10, 50, 90))
            spread = [f"{value:.{0 if value >= 9.5 else 1}f}" for value in quantiles]
        yield look.paints[member], spread


def small_spectrum(
    sums: SetSum | None,
    grid: Bands,
    film: Bands | None = None,
) -> dict[str, Any] | None:
    """Mean of a set's readings, their spread and a film, by default the mean of its fits, NaN where
    it is not known, with axes that hold them; None where no pixel has the set.
    """
    if sums is None:
        return None
    fitted = sums.mean_fit if film is None else film
    highest = (sums.mean + sums.sd).max()
    most = next((top for top in (0.1, 0.2, 0.5, 1.0) if highest <= top), 2.0)
    return {
        "axes": PlotAxes(grid=grid, low=0.0, high=most, most=4),
        "off": float(rms_difference(sums.mean, fitted)),
        "mean": sums.mean,
        "spread": sums.sd,
        "fitted": fitted,
    }
