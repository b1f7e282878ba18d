"""Facts for the report of a map by family: the families of each set, and the exemplars whose film
looks most like its mean spectrum.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax import Pigment

from ..identify.families.evidence import describe_anachronism
from ..identify.families.identify_pigments import identify_families
from ..identify.result import Identification
from ..identify.result.groups import answer_of
from ..identify.search.options import IdentificationOptions
from ..identify.show.explanation import explanations
from ..identify.show.record import describe_film, describe_pigments
from .show.names import paint_names
from .show.overview import shown_sets
from .store.chunk import Members, SetSums

if TYPE_CHECKING:
    import xarray

# Answers of a mean spectrum among which the one that the map names is looked for.
_ANSWERS = 20
# Share of a group from which a family of it is named.
_NAMED = 0.005


def describe_sets(
    paint_map: "xarray.Dataset",
    sets: SetSums,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    ground: Sequence[float] | None,
) -> dict[Members, dict[str, Any]]:
    """Facts of each set that a report shows.

    Args:
        paint_map: the map.
        sets: sums over the pixels of each set.
        pigments: exemplars that were searched.
        options: of the search.
        ground: at the working bands; None where films hide it.

    Returns:
        Of each set ``pigments``, its families and the likeliest ones of its groups, each with
        ``share`` of its group, formula, Colour Index, years and ``anachronism``; and ``film``,
        computed from the nearest exemplars, or None where no film of the set was kept.
    """
    names = paint_names(paint_map)
    reported = shown_sets(sets)
    if not reported:
        return {}
    means = np.stack([sets[members].mean for members in reported])
    single = Identification.join(
        list(
            identify_families(
                np.asarray(paint_map.attrs["working_wavelengths"], float),
                np.maximum(means, 0.0),
                pigments,
                options,
                ground=None if ground is None else np.asarray(ground, float),
                opaque=ground is None,
                names=None,
            )
        )
    )
    facts = {}
    for row, members in enumerate(reported):
        named = answer_of(names[member] for member in members)
        within = {
            name: shares
            for answer in single.family_sets[row]
            if answer_of(answer.families) == named
            for name, shares in answer.within.items()
        }
        films = [
            film
            for film in explanations(single, row, _ANSWERS)
            if answer_of(film.words.split(" + ")) == named
        ]
        facts[members] = {
            "pigments": [
                {
                    **pigment,
                    "share": share,
                    "anachronism": describe_anachronism([family], options.painted),
                }
                for name in (names[member] for member in members)
                for family, share in within.get(name, ((name, 1.0),))
                if share >= _NAMED
                for pigment in describe_pigments([family])
            ],
            "film": describe_film(films[0], means[row]) if films else None,
        }
    return facts
