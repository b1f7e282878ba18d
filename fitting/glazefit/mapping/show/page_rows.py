"""Rows of a map's page: sets of paints with their spectra, families in the picture of the object,
and spectra that no paints explain, each of which may be added as a paint.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from glazejax.plots import hex_colour

from ...page.plot import PlotAxes
from ...page.words import typeset
from ..store.chunk import Bands, Members, SetSum, rms_difference, true_colour
from .overview import Overview
from .pictures import RGB, enlarge, paint_pictures

SPECTRA = "spots.csv"
PAINTS = "paints_with_spots.csv"
"""Files next to the page: readings, and paints for a second map."""
REFERENCES = "references.csv"
"""The same of a map by family: readings as references, of which the user says the family."""
# Share of its contrast that the rest of the picture keeps.
_FADED = 0.12


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
        chances = look.examples["probability"][look.where(members)]
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
        spread = None
        if len(members) > 1 and len(shares):
            quantiles = 100 * np.percentile(shares[:, slot], (10, 50, 90))
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


def family_rows(look: Overview) -> list[dict[str, Any]]:
    """Families and groups of the sets that are shown, those of the largest sets first."""
    return [
        {
            "name": look.paints[number],
            "key": f"{look.file_stems[number]}_place",
            "pixels": look.in_set[number],
            "place": _place(look, number),
            "probability": paint_pictures(look, number)[0],
        }
        for number in dict.fromkeys(member for members in look.shown for member in members)
    ]


def _place(look: Overview, family: int) -> RGB:
    """The object in true colour where a family is of the most probable set, faded elsewhere."""
    present = (look.examples["members"] == family).any(axis=-1) & (look.examples["explained"] > 0)
    faded = 255 - _FADED * (255.0 - look.colour)
    return enlarge(np.where(present[..., None], look.colour, faded).round().astype(np.uint8))


def spot_rows(spots: Sequence[Mapping[str, Any]], grid: Bands) -> Iterator[dict[str, Any]]:
    """The map's attribute ``spots`` with a colour and a small spectrum of each.

    Args:
        spots: name, pixels, place and reading of each.
        grid: of their readings, nm.
    """
    for spot in spots:
        reading = np.asarray(spot["reading"], float)
        alone = SetSum(
            pixels=1, spectrum=reading, fitted=np.full(reading.shape, np.nan), square=reading**2
        )
        yield {
            **spot,
            "colour": hex_colour(true_colour(grid, reading[None])[0] / 255),
            "spectrum": small_spectrum(alone, grid),
        }
