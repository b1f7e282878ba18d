"""From the accuracy asked for to the number of directions."""

from typing import NamedTuple

from glazejax.radiative.directions import Resolution

# Below this index the internal reflectance rises within a sliver of directions above the critical angle.
_NEAR_ONE = 1.07
# No real medium; but asked for, it gets the directions that its almost singular interface needs.
_SLIVER = 1.0001
# Above this index the cone is narrow and what it lets out is bright: one node more.
_HIGH = 1.85


class _Row(NamedTuple):
    tolerance: float
    cone: int
    total: int
    near_cone: int  # for indices between 1 and 1.07, and where the index is not known
    single: int  # for an index of exactly 1


# Worst errors of each row: `python -m benchmarks.calibrate_directions`.
_ROWS = (
    _Row(1e-2, 3, 3, 4, 4),
    _Row(1e-3, 4, 5, 6, 5),
    _Row(1e-4, 5, 6, 8, 7),
    _Row(1e-5, 6, 8, 11, 8),
    _Row(1e-6, 7, 10, 12, 11),
    _Row(1e-7, 8, 13, 14, 13),
    _Row(1e-8, 9, 15, 17, 16),
    _Row(1e-9, 11, 19, 20, 19),
    _Row(1e-10, 12, 22, 23, 24),
)


def resolve(tolerance: float, lowest_index: float, highest_index: float) -> Resolution:
    """Directions that keep the absolute error of either reflectance below the tolerance.

    A span that reaches down to one, such as that of a traced index, gets directions good for all of it.

    Args:
        tolerance: absolute error wanted; anything below 1e-10 gets the directions for 1e-10.
        lowest_index: smallest refractive index of the batch.
        highest_index: largest one.

    Returns:
        `Resolution`, the first row of the table that is fine enough.
    """
    row = next((row for row in _ROWS if row.tolerance <= tolerance * (1 + 1e-9)), _ROWS[-1])
    if highest_index == 1.0:
        return Resolution(row.single, 0, crowded=True)
    if 1.0 < lowest_index < _SLIVER:
        return Resolution(3 * row.near_cone // 2 + 1, row.total, crowded=True)
    if lowest_index < _NEAR_ONE:
        return Resolution(row.near_cone, row.total, crowded=True)
    return Resolution(row.cone + (highest_index > _HIGH), row.total, crowded=False)
