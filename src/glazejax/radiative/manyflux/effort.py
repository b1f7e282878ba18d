"""From the accuracy asked for to directions, Legendre moments, azimuth modes and doublings of the
many-flux solver.
"""

from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from ..common.directions import Resolution, half_range
from ..common.fresnel import cos_refracted
from ..common.inputs import Numbers, check_choice
from .directions import MomentSizes, NodeSpread, fewest_directions, spread_directions
from .doubling import doublings
from .media import Media, SharedSpread, fewest_shared_directions, in_medium, shared_directions

Solution = Literal["doubling", "modes"]
"""Ways to the operators of a layer: `doubling` or `eigenmodes`."""


class FluxEffort(NamedTuple):
    """Fineness of the solution of a stack; static."""

    directions: NodeSpread | Resolution | SharedSpread
    """A `Resolution` where the refractive index is an array, a `SharedSpread` where media of
    several are joined.
    """
    terms: int
    """Legendre moments kept; what lies beyond is the forward peak of delta-M."""
    modes: int
    """Azimuth modes."""
    doublings: int | None
    """None: layers are solved by eigenvectors."""

    @property
    def width(self) -> int:
        """Number of directions in a hemisphere."""
        return sum(
            self.directions.counts
            if isinstance(self.directions, SharedSpread)
            else self.directions[:2]
        )


def choose_effort(
    tolerance: float,
    media: float | Media,
    moments: Float[np.ndarray, "... terms"] | None,
    terms: int,
    optical_thickness: Numbers,
    least_cosine: float,
    streams: int | None,
    *,
    azimuthal: bool,
    solution: Solution = "doubling",
    cos_inside: Float[np.ndarray, "inside"] | None = None,
) -> FluxEffort:
    """Least effort for an accuracy.

    Args:
        tolerance: absolute error wanted.
        media: refractive index of the layers, or all indices.
        moments: of the phase functions, or None where they are traced: all ``terms`` are kept then.
        terms: how many there are.
        optical_thickness: of the layers, as given, perhaps traced.
        least_cosine: smallest cosine outside, of incidence or viewing.
        streams: number of directions in a hemisphere, if it is given.
        azimuthal: whether the result depends on the azimuth at all.
        solution: of the layers.
        cos_inside: of directions in any of the layers, beside those outside.

    Raises:
        ValueError: too few streams, no directions good enough, or an unknown solution.
    """
    check_choice("solution", solution, Solution)
    # A moment that is traced may be as large as one.
    sizes = (
        np.ones(terms) if moments is None else np.max(np.abs(moments).reshape(-1, terms), axis=0)
    )
    # What a moment does to light scattered twice or more.
    twice = (2 * np.arange(terms) + 1) * sizes**2
    # Moments whose weighed square is below this share of the tolerance change nothing there.
    terms_kept = int(np.flatnonzero(twice > 0.03 * tolerance).max(initial=0)) + 1
    if streams is not None:
        if streams < 2:
            raise ValueError(f"streams is {streams}; it must be at least 2")
        # No more moments than the directions of both hemispheres can separate.
        terms_kept = min(terms_kept, 2 * streams)
    # Rounded, there are few enough different ones that the search is rarely repeated.
    rounded = tuple(np.round(sizes[:terms_kept], 4).tolist())
    directions, least = _directions(media, rounded, tolerance, streams, least_cosine)
    if cos_inside is not None:
        layers = media.layers if isinstance(media, Media) else (media,)
        least = min(least, _least_inside(layers, cos_inside))
    # An azimuth mode that is left out is missed once, a moment in all modes: a larger share.
    modes = (
        np.flatnonzero(twice[:terms_kept] > 0.3 * tolerance).max(initial=0) + 1 if azimuthal else 1
    )
    count = doublings(optical_thickness, least) if solution == "doubling" else None
    return FluxEffort(directions, terms_kept, int(modes), count)


def _directions(
    media: float | Media,
    sizes: MomentSizes,
    tolerance: float,
    streams: int | None,
    least_cosine: float,
) -> tuple[NodeSpread | SharedSpread, float]:
    """Directions and the smallest cosine that light has in any layer."""
    if isinstance(media, Media):
        # Directions are cut at the indices outside too: total reflection begins there.
        below = 1.0 if media.below is None else media.below
        pieces = fewest_shared_directions(media.layers, (1.0, below), sizes, tolerance, streams)
        nodes = [in_medium(shared_directions(pieces), index) for index in media.layers]
        least = min(float(mu[exists].min()) for mu, _, exists in nodes)
        # Beam and view by Snell's law; what grazes in a dense medium below stays flattest in the
        # paint.
        added = [
            np.sqrt((n - below) * (n + below) + (below * least_cosine) ** 2) / n
            for n in media.layers
        ]
        return pieces, float(min(least, *added))
    spread = fewest_directions(tolerance, media, sizes, streams)
    # A beam or view that is followed exactly may be flatter than all nodes.
    mu = np.asarray(spread_directions(media, spread).cosines)
    return spread, min(float(mu.min()), float(cos_refracted(least_cosine, media)))


def _least_inside(layers: tuple[float, ...], cosines: Float[np.ndarray, "inside"]) -> float:
    """Smallest cosine of directions in any layer, and in those that they reach from it."""
    index = np.array(layers)[:, None, None]
    known_in = np.array(layers)[:, None]
    # (n cos)^2 by Snell's law; below zero a direction is totally reflected before.
    squared = (index - known_in) * (index + known_in) + (known_in * cosines) ** 2
    return float(np.min(np.sqrt(np.where(squared > 0, squared, index**2)) / index, initial=1.0))


def effort_for_indices(
    resolution: Resolution, low: float, high: float, optical_thickness: Numbers, least_cosine: float
) -> FluxEffort:
    """Effort of isotropic scattering in directions for a range of indices."""
    least = min(float(np.min(half_range(index, resolution).cosines)) for index in (low, high))
    least = min(least, float(cos_refracted(least_cosine, low)))
    return FluxEffort(resolution, 1, 1, doublings(optical_thickness, least))
