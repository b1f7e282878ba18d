"""From the accuracy asked for to directions, Legendre moments, azimuth modes and doublings of the many-flux solver."""

from typing import Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Float

from glazejax.radiative.directions import Resolution, half_range
from glazejax.radiative.fresnel import cos_refracted
from glazejax.radiative.manyflux_directions import Spread, best_directions, fewest_directions, spread_directions
from glazejax.radiative.manyflux_layer import doublings

# Moments whose weighed square is below this share of the tolerance change nothing that is scattered twice or more.
_MOMENT_SHARE = 0.03
THICKEST = 1e6
"""Layers whose thickness is traced may be this thick."""

Solution = Literal["doubling", "modes"]
"""Ways to the operators of a layer: `manyflux_layer` or `manyflux_modes`."""


class Effort(NamedTuple):
    """How finely a stack is solved; static."""

    directions: Spread | Resolution
    """A `Resolution` serves where the refractive index is an array."""
    kept: int
    """Legendre moments kept; what lies beyond is the forward peak of delta-M."""
    modes: int
    """Azimuth modes."""
    doublings: int | None
    """None: layers are solved by eigenvectors."""


def choose_effort(
    tolerance: float,
    index: float,
    moments: Float[np.ndarray, "*batch layers terms"] | None,
    terms: int,
    thickest: float | None,
    least_cosine: float,
    streams: int | None,
    *,
    azimuthal: bool,
    solution: Solution = "doubling",
) -> Effort:
    """Least effort for an accuracy.

    Args:
        tolerance: absolute error wanted.
        index: refractive index of the layers.
        moments: of the phase functions, or None where they are traced: all ``terms`` are kept then.
        terms: how many there are.
        thickest: largest optical thickness, or None where it is traced.
        least_cosine: smallest cosine outside, of incidence or viewing.
        streams: number of directions in a hemisphere, if it is given.
        azimuthal: whether the result depends on the azimuth at all.
        solution: of the layers.

    Raises:
        ValueError: too few streams, no directions good enough, or an unknown solution.
    """
    if solution not in get_args(Solution):
        raise ValueError(f"solution {solution!r} is unknown; use one of {', '.join(map(repr, get_args(Solution)))}")
    sizes = np.ones(terms) if moments is None else np.max(np.abs(moments).reshape(-1, terms), axis=0)
    # What a moment does to light scattered twice or more.
    twice = (2 * np.arange(terms) + 1) * sizes**2
    kept = int(np.flatnonzero(twice > _MOMENT_SHARE * tolerance).max(initial=0)) + 1
    if streams is None:
        directions = fewest_directions(tolerance, index, _rounded(sizes[:kept]))
    elif streams < 2:
        raise ValueError(f"streams is {streams}; it must be at least 2")
    else:
        kept = min(kept, 2 * streams)
        directions = best_directions(index, streams, _rounded(sizes[:kept]))
    mu = np.asarray(spread_directions(index, directions).cosines)
    least = min(float(mu.min()), float(cos_refracted(least_cosine, index)))
    count = doublings(THICKEST if thickest is None else thickest, least)
    return Effort(directions, kept, kept if azimuthal else 1, count if solution == "doubling" else None)


def effort_for_indices(resolution: Resolution, low: float, high: float, thickest: float, least_cosine: float) -> Effort:
    """Effort of isotropic scattering in directions for a range of indices."""
    at = [np.float64(low), np.float64(high)]
    least = min(float(np.min(half_range(index, resolution).cosines)) for index in at)
    return Effort(resolution, 1, 1, doublings(thickest, min(least, float(cos_refracted(least_cosine, low)))))


def _rounded(sizes: np.ndarray) -> tuple[float, ...]:
    """Few enough different ones that the search is rarely repeated."""
    return tuple(float(x) for x in np.round(sizes, 4))
