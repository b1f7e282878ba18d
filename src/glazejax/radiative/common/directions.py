"""Half-range quadratures fitted to the interface: which directions inside the medium are followed.

Only directions inside the medium matter to the operator. For an index that is a plain number they
come from one rule over the whole half range (`simultaneous`). An index that is an array, traced or
differentiated by, gets a rule split at the critical angle. Those inside the cone of refraction can
leave; they are Gauss nodes in the cosine OUTSIDE, which removes the square-root singularity of the
internal reflectance at the critical angle. The rest are totally reflected; there the field varies
as exp(-depth/mu), so their nodes crowd towards grazing directions.
"""

import functools
import math
from typing import NamedTuple

from jaxtyping import Array, Float

from .fresnel import cos_refracted
from .quadrature import Directions, conserve, gauss, graded_gauss, split_range
from .simultaneous import simultaneous_rule

# Below this index the internal reflectance rises within a sliver of directions above the critical
# angle.
NEAR_ONE = 1.07
# No real medium; but asked for, it gets the directions that its almost singular interface needs.
_SLIVER = 1.0001
# Where light and view are both below this cosine inside, they need more directions at grazing
# angles.
_GRAZING = 0.05
# Above this index the cone is narrow and what it lets out is bright.
HIGH = 1.85


class Resolution(NamedTuple):
    """Numbers of nodes of each part of the half range, cone + total in all; static."""

    cone: int
    """Nodes that can leave, in the outside cosine."""
    total: int
    """Totally reflected nodes; 0 only for an index of exactly one."""
    crowded: bool = False
    """Whether the cone's nodes crowd towards grazing too: needed as the index nears one, unless
    they follow the rise of R, along which they are spread already."""
    crowding: float | None = None
    """If given: one rule for the whole half range with this crowding, whose conditions `cone` and
    `total` count.
    """
    reach: float | None = None
    """If given: the cone's nodes follow the rise of the internal reflectance, down to grazing of
    about e^-reach.
    """

    def resolves(self) -> float:
        """Smallest n^2 - 1 at which the nodes follow the rise of the internal reflectance in slope,
        too.
        """
        return 0.0 if self.reach is None else 9.0 * math.exp(-2.0 * self.reach)


def half_range(
    refractive_index: float | Float[Array, "*batch"], resolution: Resolution
) -> Directions:
    """Directions for media of index n under a smooth interface to air.

    Args:
        refractive_index: n >= 1, a number (the result is then numpy, double precision) or a JAX
            array (...), by which the result can be differentiated.
        resolution: node counts, static; one for the whole half range is that of the number.

    Returns:
        `Directions`, arrays (..., cone + total).
    """
    if resolution.crowding is not None:
        rule = whole_range(float(refractive_index), resolution)
        assert rule is not None, "the resolution is one for which there are directions"
        return rule
    outside = graded_gauss(resolution.cone) if resolution.crowded else gauss(resolution.cone)
    below = graded_gauss(resolution.total) if resolution.total else None
    return split_range(refractive_index, outside, below, resolution.reach)


@functools.lru_cache(maxsize=256)
def whole_range(index: float, resolution: Resolution) -> Directions | None:
    """One rule for the whole half range of an index that is a number; None where there is no such
    rule.
    """
    assert resolution.crowding is not None
    rule = simultaneous_rule(index, resolution.total, resolution.cone, resolution.crowding)
    return None if rule is None else rule._replace(weights=conserve(rule.cosines, rule.weights))


class _ResolutionRow(NamedTuple):
    tolerance: float
    cone: int
    total: int
    near_cone: int  # for indices between 1.0001 and 1.07
    sliver: tuple[int, float]  # nodes in the cone and their reach, for an index down to one
    grazing: tuple[int, float]  # the same where light and view both graze, too


# Worst errors of each row: `python -m benchmarks.solver.calibrate_directions`.
_ROWS = (
    _ResolutionRow(
        tolerance=1e-2, cone=3, total=3, near_cone=4, sliver=(4, 3.5), grazing=(9, 10.0)
    ),
    _ResolutionRow(
        tolerance=1e-3, cone=4, total=5, near_cone=6, sliver=(5, 4.5), grazing=(10, 10.5)
    ),
    _ResolutionRow(
        tolerance=1e-4, cone=5, total=6, near_cone=8, sliver=(9, 6.0), grazing=(13, 12.0)
    ),
    _ResolutionRow(
        tolerance=1e-5, cone=6, total=8, near_cone=11, sliver=(10, 7.0), grazing=(16, 12.0)
    ),
    _ResolutionRow(
        tolerance=1e-6, cone=7, total=10, near_cone=12, sliver=(14, 8.0), grazing=(20, 12.5)
    ),
    _ResolutionRow(
        tolerance=1e-7, cone=8, total=13, near_cone=14, sliver=(18, 9.0), grazing=(26, 14.5)
    ),
    _ResolutionRow(
        tolerance=1e-8, cone=9, total=16, near_cone=17, sliver=(22, 10.0), grazing=(32, 16.5)
    ),
    _ResolutionRow(
        tolerance=1e-9, cone=11, total=19, near_cone=20, sliver=(27, 10.5), grazing=(38, 17.5)
    ),
    _ResolutionRow(
        tolerance=1e-10, cone=12, total=22, near_cone=23, sliver=(30, 10.5), grazing=(43, 17.5)
    ),
)


def resolve(
    tolerance: float, lowest_index: float, highest_index: float, least_cosine: float = 1.0
) -> Resolution:
    """Directions that keep the absolute error of either reflectance below the tolerance for an
    array of indices.

    A span that reaches down to one, such as that of a traced index, gets directions good for all of
    it.

    Args:
        tolerance: absolute error wanted; anything below 1e-10 gets the directions for 1e-10.
        lowest_index: smallest refractive index of the batch.
        highest_index: largest one, above 1.
        least_cosine: of the two cosines in air the larger one, at its smallest: where both graze a
            medium of index one, the light between them scatters within a thin layer that takes more
            directions.

    Returns:
        `Resolution`, the first row of the table that is fine enough, split at the critical angle.
    """
    row = next((row for row in _ROWS if row.tolerance <= tolerance * (1 + 1e-9)), _ROWS[-1])
    if lowest_index < NEAR_ONE:
        cos_inside = float(cos_refracted(least_cosine, lowest_index))
        if cos_inside < _GRAZING:
            cone, reach = row.grazing
        else:
            cone, reach = row.sliver if lowest_index < _SLIVER else (row.near_cone, row.sliver[1])
        return Resolution(cone, row.total, reach=reach)
    return Resolution(row.cone + (highest_index > HIGH), row.total)
