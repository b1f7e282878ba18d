"""From the accuracy asked for to the number of directions."""

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..common.directions import Directions, Resolution, conserve
from ..common.simultaneous import Rule, fine_half_range, simultaneous_rule

# Below this index the internal reflectance rises within a sliver of directions above the critical angle.
_NEAR_ONE = 1.07
# No real medium; but asked for, it gets the directions that its almost singular interface needs.
_SLIVER = 1.0001
# Above this index the cone is narrow and what it lets out is bright.
_HIGH = 1.85

# The largest error of the sums over directions may be this share of the tolerance: the worst error of a stack's
# reflectance stays below the tolerance then (`python -m benchmarks.calibrate_directions`).
_SHARE = 0.17
# Beams may graze inside, too, where the index is near one; where it is high, the light inside is many times brighter.
_SHARE_NEAR_ONE = 0.08
_SHARE_HIGH = 0.1
_FINEST = 1e-10
_MOST_NODES = 40
# Optical depths at which the sums are compared; beyond the last one there is nothing left.
_DEPTHS = np.concatenate([[0.0], np.geomspace(1e-3, 30.0, 80)])
# Ways to divide the conditions and to crowd the nodes that are tried for each number of nodes.
_CONE = (1, 2, 3, 4)
_CROWDING_OFFSETS = (-0.6, -0.45, -0.3, -0.15, 0.0, 0.15)


def resolve_known(tolerance: float, refractive_index: float) -> Resolution:
    """Fewest directions that keep the absolute error of either reflectance below the tolerance at one known index.

    Args:
        tolerance: absolute error wanted; anything below 1e-10 gets the directions for 1e-10.
        refractive_index: n >= 1, a number.

    Returns:
        `Resolution` of a rule over the whole half range.
    """
    return _fewest(max(float(tolerance), _FINEST), float(refractive_index))


@functools.lru_cache(maxsize=256)
def _fewest(tolerance: float, index: float) -> Resolution:
    # Some digits come with every two nodes; the search starts below where it can end.
    share = _SHARE_NEAR_ONE if index < _NEAR_ONE else _SHARE_HIGH if index > _HIGH else _SHARE
    wanted = share * tolerance
    exact = flux_sums(fine_half_range(index, 6.0))
    for count in range(max(2, int(-1.2 * np.log10(wanted)) - 1), _MOST_NODES + 1):
        usual = max(1.95 * np.sqrt(count) - 2.0, 0.6)
        cones = [cone for cone in _CONE if cone < count] if index > 1 else [0]
        tried = [
            (flux_error(rule, exact), Resolution(cone, count - cone, crowding=usual + offset))
            for cone in cones
            for offset in _CROWDING_OFFSETS
            if (rule := _rule(index, count - cone, cone, usual + offset)) is not None
        ]
        error, best = min(tried, default=(np.inf, None))
        if best is not None and error <= wanted:
            return best
    raise ValueError(f"no directions found for a tolerance of {tolerance:g} at index {index:g}; ask for a coarser one")


def _rule(index: float, whole: int, cone: int, crowding: float) -> Rule | None:
    found = simultaneous_rule(index, whole, cone, crowding)
    return None if found is None else found._replace(weights=conserve(found.cosines, found.weights))


def flux_sums(rule: Rule | Directions) -> Float[np.ndarray, "2 depths"]:
    """Sums of mu e^(-t/mu) and of R mu e^(-t/mu) over a rule, at a range of depths t."""
    mu, weights, reflectance = (np.asarray(a) for a in rule)
    terms = weights * mu * np.exp(-_DEPTHS[:, None] / mu)
    return np.stack([terms.sum(axis=1), terms @ reflectance])


def flux_error(rule: Rule | Directions, exact: Float[np.ndarray, "2 depths"]) -> float:
    """Largest error of either sum and of their difference.

    All that the directions do to the reflectance goes through the kernels of paper A's integral equation; integrated
    over two layers, or a layer and the ground, these are the sums, so their errors are those of a thin layer's fluxes.
    """
    everything, reflected = flux_sums(rule) - exact
    return float(max(np.max(np.abs(a)) for a in (everything, reflected, everything - reflected)))


class _Row(NamedTuple):
    tolerance: float
    cone: int
    total: int
    near_cone: int  # for indices between 1 and 1.07, and where the index is not known


# Worst errors of each row: `python -m benchmarks.calibrate_directions`.
_ROWS = (
    _Row(1e-2, 3, 3, 4),
    _Row(1e-3, 4, 5, 6),
    _Row(1e-4, 5, 6, 8),
    _Row(1e-5, 6, 8, 11),
    _Row(1e-6, 7, 10, 12),
    _Row(1e-7, 8, 13, 14),
    _Row(1e-8, 9, 15, 17),
    _Row(1e-9, 11, 19, 20),
    _Row(1e-10, 12, 22, 23),
)


def resolve(tolerance: float, lowest_index: float, highest_index: float) -> Resolution:
    """Directions that keep the absolute error of either reflectance below the tolerance for an array of indices.

    A span that reaches down to one, such as that of a traced index, gets directions good for all of it.

    Args:
        tolerance: absolute error wanted; anything below 1e-10 gets the directions for 1e-10.
        lowest_index: smallest refractive index of the batch.
        highest_index: largest one, above 1.

    Returns:
        `Resolution`, the first row of the table that is fine enough, split at the critical angle.
    """
    row = next((row for row in _ROWS if row.tolerance <= tolerance * (1 + 1e-9)), _ROWS[-1])
    if 1.0 < lowest_index < _SLIVER:
        return Resolution(3 * row.near_cone // 2 + 1, row.total, crowded=True)
    if lowest_index < _NEAR_ONE:
        return Resolution(row.near_cone, row.total, crowded=True)
    return Resolution(row.cone + (highest_index > _HIGH), row.total, crowded=False)
