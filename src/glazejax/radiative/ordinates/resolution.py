"""From the accuracy asked for to the number of directions, for an index that is a number."""

import functools

import numpy as np
from jaxtyping import Float

from ..common.directions import HIGH, NEAR_ONE, Resolution, whole_range
from ..common.quadrature import Directions
from ..common.simultaneous import fine_half_range

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
    share = _SHARE_NEAR_ONE if index < NEAR_ONE else _SHARE_HIGH if index > HIGH else _SHARE
    wanted = share * tolerance
    exact = flux_sums(fine_half_range(index, 6.0))
    for count in range(max(2, int(-1.2 * np.log10(wanted)) - 1), _MOST_NODES + 1):
        usual = max(1.95 * np.sqrt(count) - 2.0, 0.6)
        cones = [cone for cone in _CONE if cone < count] if index > 1 else [0]
        tried = [
            (flux_error(rule, exact), resolution)
            for cone in cones
            for offset in _CROWDING_OFFSETS
            if (rule := whole_range(index, resolution := Resolution(cone, count - cone, crowding=usual + offset)))
        ]
        error, best = min(tried, default=(np.inf, None))
        if best is not None and error <= wanted:
            return best
    raise ValueError(f"no directions found for a tolerance of {tolerance:g} at index {index:g}; ask for a coarser one")


def flux_sums(rule: Directions) -> Float[np.ndarray, "2 depths"]:
    """Sums of mu e^(-t/mu) and of R mu e^(-t/mu) over a rule, at a range of depths t."""
    mu, weights, reflectance = (np.asarray(a) for a in rule)
    terms = weights * mu * np.exp(-_DEPTHS[:, None] / mu)
    return np.stack([terms.sum(axis=1), terms @ reflectance])


def flux_error(rule: Directions, exact: Float[np.ndarray, "2 depths"]) -> float:
    """Largest error of either sum and of their difference.

    All that the directions do to the reflectance goes through the kernels of paper A's integral equation; integrated
    over two layers, or a layer and the ground, these are the sums, so their errors are those of a thin layer's fluxes.
    """
    everything, reflected = flux_sums(rule) - exact
    return float(max(np.max(np.abs(a)) for a in (everything, reflected, everything - reflected)))
