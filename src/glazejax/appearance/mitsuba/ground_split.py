"""Terms of a reflectance over any ground, and the nodes of an angle.

The ground enters in closed form: with R0 over black, T the light that reaches a black ground and S
what the stack throws back to the ground, R = R0 + g T T/(1 - g S) for any Lambertian ground g.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...chebyshev_table import roots


class GroundTerms(NamedTuple):
    """Terms of the reflectance factor over any ground."""

    black: Float[np.ndarray, "*batch angles angles"]
    """R0, over a black ground."""
    through: Float[np.ndarray, "*batch angles"]
    """T of one direction, that reaches a black ground."""
    back: Float[np.ndarray, "*batch"]
    """S, thrown back to the ground."""


def split(values: Float[np.ndarray, "*batch rows"], angles: int) -> GroundTerms:
    """Terms from rows of numbers: pairs of angles (the upper triangle) of R0, then T of each angle,
    then S.
    """
    rows, columns = np.triu_indices(angles)
    black = np.empty((*values.shape[:-1], angles, angles))
    black[..., rows, columns] = black[..., columns, rows] = values[..., : rows.size]
    return GroundTerms(black, values[..., rows.size : -1], values[..., -1])


def factor_of(black: Any, through_in: Any, through_out: Any, back: Any, ground: Any) -> Any:
    """R0 + g T T/(1 - g S)."""
    return black + ground * through_in * through_out / (1.0 - ground * back)


def evenly(count: int) -> Float[np.ndarray, "nodes"]:
    """Coordinates in [0, 1] of an angle's nodes, steepest last."""
    return 0.5 * (roots(count) + 1.0)
