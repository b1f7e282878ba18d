"""Directions shared by media of different refractive index, so that smooth interfaces only pair
them up.

A direction keeps n sin(theta) through all smooth interfaces, and n^2 mu w, its share of the flux,
with it. The range of n sin(theta) is cut at every index: a direction beyond a medium's index does
not exist there and is totally reflected by its faces. In each piece the nodes are those of the
medium in which its upper end grazes.
"""

import functools
import itertools
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Array, Bool, Float

from ..common.quadrature import Directions, gauss, graded_gauss
from .directions import MomentSizes, best_rule, first_good, scattered_sums

PerSharedNode: TypeAlias = Float[np.ndarray, "n"]
"""A number for each direction."""


class Media(NamedTuple):
    """Refractive indices from the top down; static."""

    layers: tuple[float, ...]
    below: float | None
    """Of the medium below the layers, or None for a ground."""


class SharedSpread(NamedTuple):
    """Numbers of nodes between one index and the next, from zero up, and how they crowd at its end;
    static.
    """

    ends: tuple[float, ...]
    """Indices, ascending."""
    counts: tuple[int, ...]
    crowding: float
    media: tuple[float, ...]
    """Indices of media that scatter: nodes crowd at these."""


class SharedDirections(NamedTuple):
    """Directions by what they keep; see `in_medium`."""

    flux: PerSharedNode
    """n^2 mu w."""
    end: PerSharedNode
    """The end of the direction's piece."""
    beyond: PerSharedNode
    """The end squared less (n sin theta)^2, exact near grazing."""


@functools.lru_cache(maxsize=128)
def shared_directions(pieces: SharedSpread) -> SharedDirections:
    """Nodes over all pieces, n sin(theta) ascending."""
    flux = []
    end = []
    beyond = []
    below = 0.0
    for upper, count in zip(pieces.ends, pieces.counts, strict=True):
        if upper in pieces.media:
            y, w = graded_gauss(count, pieces.crowding)
        else:
            y, w = gauss(count)
        # The piece's lower end as a cosine in the medium where its upper end grazes.
        steepest = np.sqrt((upper - below) * (upper + below)) / upper
        mu = steepest * y
        share = mu * w
        # The pieces' fluxes are exact: their sum in any medium is half its index squared.
        flux.append(share * 0.5 * (upper**2 - below**2) / share.sum())
        end.append(np.full(count, upper))
        beyond.append((upper * mu) ** 2)
        below = upper
    return SharedDirections(*(np.concatenate(pieces) for pieces in (flux, end, beyond)))


def in_medium(
    common: SharedDirections, index: float
) -> tuple[PerSharedNode, PerSharedNode, Bool[np.ndarray, "n"]]:
    """Cosines, weights and whether each direction exists in a medium; where not, the cosine is one,
    the weight zero.
    """
    exists = common.end <= index
    # (n mu)^2 = n^2 - (n sin theta)^2; the two indices cancel first, so that grazing light keeps
    # its digits.
    squared = np.where(exists, index**2 - common.end**2 + common.beyond, index**2)
    mu = np.sqrt(squared) / index
    return mu, np.where(exists, common.flux / (index**2 * mu), 0.0), exists


def interface_reflectance(
    upper: Any, lower: Any, cos_upper: Any, cos_lower: Any
) -> Array | np.ndarray:
    """Fresnel's reflectance for unpolarised light between two media, zero where their indices are
    equal.

    Args:
        upper, lower: refractive indices, (...).
        cos_upper, cos_lower: cosines of the same direction on both sides, (...).
    """
    # s polarisation compares n cos of both sides, p polarisation cos/n.
    upper_product = upper * cos_upper
    lower_product = lower * cos_lower
    s = (upper_product - lower_product) / (upper_product + lower_product)
    p = (lower**2 * upper_product - upper**2 * lower_product) / (
        lower**2 * upper_product + upper**2 * lower_product
    )
    return 0.5 * (s**2 + p**2)


@functools.lru_cache(maxsize=128)
def fewest_shared_directions(
    media: tuple[float, ...],
    outside: tuple[float, ...],
    sizes: MomentSizes,
    tolerance: float,
    streams: int | None,
) -> SharedSpread:
    """Fewest directions for an accuracy, or the best way to spread a number of them.

    Args:
        media: refractive indices of the layers.
        outside: of the air, and of the medium below where light leaves there.
        sizes: of the moments, see `MomentSizes`.
        tolerance: absolute error wanted.
        streams: number of directions, if it is given.

    Raises:
        ValueError: 120 directions are not enough, or the streams given are too few for the pieces.
    """
    ends = tuple(sorted({*media, *outside}))
    inner_indices = sorted(set(media))
    if streams is not None and streams < 2 * len(ends):
        raise ValueError(
            f"streams is {streams}; media of {len(ends)} indices need at least {2 * len(ends)}"
        )

    def sums(pieces: SharedSpread) -> np.ndarray:
        # Rules are judged by their sums over scattered light in each medium.
        rules = (_as_directions(pieces, index) for index in inner_indices)
        return np.stack([scattered_sums(rule, np.array(sizes)) for rule in rules])

    # The sums of a fine rule stand for the exact ones.
    exact = sums(SharedSpread(ends, (80,) * len(ends), 4.0, media))

    def best(count: int) -> tuple[float, SharedSpread]:
        # Of a number of directions, every way to share them out and to crowd them.
        shares = {_shared_out(ends, count, share) for share in (0.3, 0.4, 0.5)}
        spreads = itertools.product(shares, (0.5, 1.5, 2.5, 3.5))
        return best_rule((SharedSpread(ends, *spread, media) for spread in spreads), sums, exact)

    if streams is not None:
        return best(streams)[1]
    counts = range(max(6, 3 * len(ends)), 121, 4)
    where = f" in media of indices {inner_indices}"
    return first_good(map(best, counts), tolerance, len(sizes), where)


def _shared_out(ends: tuple[float, ...], count: int, share: float) -> tuple[int, ...]:
    """Nodes of each piece: a share for the first, the others by the steepest cosine at
    their ends.
    """
    if len(ends) == 1:
        return (count,)
    # Every piece keeps two nodes at least.
    first = min(max(2, round(share * count)), count - 2 * (len(ends) - 1))
    steepest = [np.sqrt(1.0 - (low / high) ** 2) for low, high in itertools.pairwise(ends)]
    remaining = count - first
    nodes = [max(2, int(remaining * s / sum(steepest))) for s in steepest]
    # Rounding leaves some over: the widest piece takes them.
    nodes[int(np.argmax(steepest))] += remaining - sum(nodes)
    return (first, *nodes)


def _as_directions(pieces: SharedSpread, index: float) -> Directions:
    """Directions as one medium sees them, with the reflectance of a face to air."""
    common = shared_directions(pieces)
    mu, weights, exists = in_medium(common, index)
    air, _, outside = in_medium(common, 1.0)
    reflectance = np.where(outside, interface_reflectance(1.0, index, air, mu), 1.0)
    return Directions(mu[exists], weights[exists], reflectance[exists])
