"""From the accuracy asked for to the number of directions, for an index that is a number."""

import functools
import math

import numpy as np
from jaxtyping import Float

from ..common.directions import NEAR_ONE, Resolution, resolve, whole_range
from ..common.fresnel import cos_refracted
from ..common.inputs import INDEX_RANGE, LEAST_COSINE
from ..common.quadrature import Directions
from ..common.simultaneous import fine_half_range

# The largest error of the sums over directions may be this share of the tolerance: the worst error
# of a stack's reflectance stays below the tolerance then (`python -m
# benchmarks.solver.calibrate_directions`).
_SHARE = 0.17
# Beams may graze inside, too, where the index is near one; where it is high, the light inside is
# many times brighter.
_SHARE_NEAR_ONE = 0.08
_SHARE_HIGH = 0.1
# From here on; a rule split at the critical angle takes more from `common.directions.HIGH` on.
_HIGH = 1.7
# The same for what is scattered twice between grazing beams, which is most of the error there.
_SHARE_GRAZING = 1.2
# Where light and view are both below this cosine inside, that is looked at, and of the sums less
# may be wrong: thin layers are several times as bright there. Below the second one an index above
# one takes another rule.
_SLANTED = 0.25
_GRAZING = 0.1
_SHARE_SLANTED = 0.5
_FINEST = 1e-10
_MOST_NODES = 52
# Optical depths at which the sums are compared: errors are largest near the smallest cosine of a
# rule, 2e-5 for the finest; beyond the last depth there is nothing left.
_DEPTHS = np.concatenate([[0.0], np.geomspace(1e-6, 30.0, 140)])
# Ways to divide the conditions and to crowd the nodes that are tried for each number of nodes.
_CONE = (1, 2, 3, 4)
_CROWDING_OFFSETS = (-0.6, -0.45, -0.3, -0.15, 0.0, 0.15)


@functools.lru_cache(maxsize=256)
def resolve_known(
    tolerance: float, refractive_index: float, least_cosine: float = 1.0
) -> Resolution:
    """Fewest directions that keep the absolute error of either reflectance below the tolerance at
    one known index.

    Args:
        tolerance: absolute error wanted; anything below 1e-10 gets the directions for 1e-10.
        refractive_index: n >= 1, a number.
        least_cosine: of the two cosines in air the larger one, at its smallest. It matters for an
            index near one, where light may graze inside too; below 1e-4 it counts as that.

    Returns:
        `Resolution` of a rule over the whole half range; where light grazes a medium inside that is
        not quite of index one, of one split at the critical angle, which follows the rise of R
        between such angles.
    """
    cos_inside = max(float(cos_refracted(least_cosine, refractive_index)), LEAST_COSINE)
    if cos_inside < _GRAZING and refractive_index > 1:
        return resolve(tolerance, 1.0, INDEX_RANGE[1], least_cosine)
    # Decades, so that few programs serve all angles.
    grazing = 10.0 ** math.floor(math.log10(cos_inside) + 1e-9) if cos_inside < _SLANTED else None
    return _fewest(max(float(tolerance), _FINEST), float(refractive_index), grazing)


@functools.lru_cache(maxsize=256)
def _fewest(tolerance: float, index: float, grazing: float | None) -> Resolution:
    # Some digits come with every two nodes; the search starts below where it can end.
    share = _SHARE_NEAR_ONE if index < NEAR_ONE else _SHARE_HIGH if index > _HIGH else _SHARE
    share *= 1.0 if grazing is None else _SHARE_SLANTED
    goal = share * tolerance
    # What a rule is judged by: sums that a far finer rule gives.
    exact = flux_sums(fine_half_range(index, 6.0))
    offsets = _CROWDING_OFFSETS
    error = functools.partial(flux_error, exact=exact)
    if grazing is not None:
        cosines = np.geomspace(grazing, 1.0, 40)
        exact_grazing = grazing_sums(fine_half_range(index, 9.0), cosines)

        def error(rule: Directions) -> float:
            between = np.max(np.abs(grazing_sums(rule, cosines) - exact_grazing))
            return max(flux_error(rule, exact), share / _SHARE_GRAZING * float(between))

    for count in range(max(2, int(-1.2 * np.log10(goal)) - 1), _MOST_NODES + 1):
        # Nodes inside and outside of the cone, and how they crowd at grazing angles.
        usual = max(1.95 * np.sqrt(count) - 2.0, 0.6)
        if grazing is not None:
            offsets = np.arange(-0.6, max(0.0, -math.log(grazing) - usual) + 1.0, 0.3).tolist()
        cones = [cone for cone in _CONE if cone < count] if index > 1 else [0]
        tried = [
            (error(rule), resolution)
            for cone in cones
            for offset in offsets
            if (
                rule := whole_range(
                    index, resolution := Resolution(cone, count - cone, crowding=usual + offset)
                )
            )
        ]
        least_error, best = min(tried, default=(np.inf, None))
        if best is not None and least_error <= goal:
            return best
    raise ValueError(
        f"no directions found for a tolerance of {tolerance:g} at index {index:g}; ask for a "
        "coarser one"
    )


def flux_sums(rule: Directions) -> Float[np.ndarray, "2 depths"]:
    """Sums of mu e^(-t/mu) and of R mu e^(-t/mu) over a rule, at a range of depths t."""
    mu, weights, reflectance = (np.asarray(a) for a in rule)
    terms = weights * mu * np.exp(-_DEPTHS[:, None] / mu)
    return np.stack([terms.sum(axis=1), terms @ reflectance])


def flux_error(rule: Directions, exact: Float[np.ndarray, "2 depths"]) -> float:
    """Largest error of either sum and of their difference.

    All that the directions do to the reflectance goes through the kernels of paper A's integral
    equation; integrated over two layers, or a layer and the ground, these are the sums, so their
    errors are those of a thin layer's fluxes.
    """
    everything, reflected = flux_sums(rule) - exact
    return float(max(np.max(np.abs(a)) for a in (everything, reflected, everything - reflected)))


def grazing_sums(
    rule: Directions, cosines: Float[np.ndarray, "m"]
) -> Float[np.ndarray, "m depths"]:
    """Addition of light that comes and leaves along a cosine m to the reflectance factor where it
    is scattered twice: layers of no absorption and a range of optical depths t, the last one
    without end. There is no surface where this is asked for.

    Light goes from one depth to another along the directions of the rule:

        sum w/(8 m^2 mu) int int exp(-x/m - |x - y|/mu - y/m) dx dy,  x and y from 0 to t;

    without end that is sum w/(8 (mu + m)). Thin layers are 1/m^2 times as far off as the sums of
    `flux_error`.
    """
    mu, weights, _ = (np.asarray(a)[:, None] for a in rule)
    m = cosines[:, None, None]
    depths = np.append(_DEPTHS[1:], np.inf)
    there_and_back = -0.5 * m * np.expm1(-2.0 * depths / m)
    between = -m * mu / (m + mu) * np.expm1(-depths * (1.0 / m + 1.0 / mu))
    # Where both are equal, both terms are, to a small difference.
    difference = np.where(np.abs(m - mu) < 1e-9 * m, 1e-9 * m, m - mu)
    doubly = (there_and_back - between) / (m * difference)
    return 0.25 * np.sum(weights * doubly, axis=1)
