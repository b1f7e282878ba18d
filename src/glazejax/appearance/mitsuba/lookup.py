"""Lookup of a point of a body's table, in the arithmetic of NumPy or of Dr.Jit.

The table checks its own error through the very functions that render. Numbers come in packets of
four, so that one gather brings what belongs together. Every axis of thickness or fraction is
interpolated by Hermite's cubic from values and slopes, so that derivatives are smooth; angles and
wavelengths linearly.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...chebyshev_table import Axis, Mirrored


class Place(NamedTuple):
    """A cell and where in it: numbers of its lower node, and the distance from there in cells."""

    lower: Any
    along: Any


class Arithmetic:
    """Functions that the lookup asks of an array library: NumPy's, whose packets are (4, points).

    `device.DrJit` has those of Dr.Jit.
    """

    def packet(self, table: Any, number: Any) -> Any:
        """Four numbers, beginning at 4 `number`."""
        return np.moveaxis(table.reshape(-1, 4)[number], -1, 0)

    def whole(self, x: Any) -> Any:
        """Whole number of x >= 0, without slope."""
        return np.floor(x).astype(int)

    def clip(self, x: Any, low: float, high: float) -> Any:
        """x within [low, high]."""
        return np.clip(x, low, high)

    def maximum(self, x: Any, y: Any) -> Any:
        """The larger one."""
        return np.maximum(x, y)

    def dot(self, a: Any, b: Any) -> Any:
        """Sum of the four products."""
        return np.sum(a * b, axis=0)

    def sqrt(self, x: Any) -> Any:
        """Square root."""
        return np.sqrt(x)

    def log1p(self, x: Any) -> Any:
        """Logarithm of 1 + x."""
        return np.log1p(x)

    def asinh(self, x: Any) -> Any:
        """Inverse hyperbolic sine."""
        return np.arcsinh(x)


def place(ops: Arithmetic, x: Any, count: int) -> Place:
    """Cell of x in [0, 1] on an axis of `count` nodes; what lies outside goes to the ends."""
    scaled = ops.clip(x, 0.0, 1.0) * (count - 1)
    # The last node belongs to the last cell.
    lower = ops.whole(ops.clip(scaled, 0.0, count - 1.5))
    return Place(lower, scaled - lower)


def place_on(ops: Any, axis: Axis | Mirrored, x: Any, count: int) -> Place:
    """Cell of a thickness or fraction on an even grid of the axis's coordinate."""
    return place(ops, 0.5 * (axis.coordinate(ops.clip(x, axis.low, axis.high), ops) + 1.0), count)


def hermite(t: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Weights of (value, slope) at the lower and at the upper node, slopes in units of a cell."""
    complement = 1.0 - t
    return ((1.0 + 2.0 * t) * complement * complement, t * complement * complement), (
        t * t * (3.0 - 2.0 * t),
        -t * t * complement,
    )


def nodes_and_weights(spots: Sequence[Place], counts: Sequence[int]) -> list[tuple[Any, list[Any]]]:
    """Nodes around a point, each with the weights of its 2^axes numbers (value, slopes, mixed
    slope).
    """
    nodes: list[tuple[Any, list[Any]]] = [(0, [1.0])]
    # Axis by axis each node becomes two, and each weight one of a value and one of a slope.
    for spot, count in zip(spots, counts, strict=True):
        sides = hermite(spot.along)
        nodes = [
            (
                number * count + (spot.lower + side),
                [old * new for old in weights for new in sides[side]],
            )
            for number, weights in nodes
            for side in (0, 1)
        ]
    return nodes


def node_sum(
    ops: Arithmetic, table: Any, nodes: Any, packets: int, row: Any = 0, rows: int = 1
) -> list[Any]:
    """Packets at a point, from a table (nodes, rows, numbers, packets, 4) laid out flat.

    Args:
        ops: arithmetic.
        table: flat.
        nodes: of `nodes_and_weights`.
        packets: of one entry.
        row: which of the rows.
        rows: how many there are.
    """
    total: list[Any] = [0.0] * packets
    for node, weights in nodes:
        # The numbers of an entry follow one another: value, slopes, mixed slope.
        entry = (node * rows + row) * len(weights)
        for h, weight in enumerate(weights):
            for p in range(packets):
                total[p] = total[p] + ops.packet(table, (entry + h) * packets + p) * weight
    return total


def spectral_sum(
    ops: Arithmetic, table: Any, nodes: Any, packets: int, band: Place, bands: int
) -> list[Any]:
    """The same between two bands, the rows of the table."""
    low, high = (node_sum(ops, table, nodes, packets, band.lower + side, bands) for side in (0, 1))
    return [a + (b - a) * band.along for a, b in zip(low, high, strict=True)]


def pair_sum(
    ops: Arithmetic, table: Any, a: Place, b: Place, count: int, packets: int
) -> list[Any]:
    """Packets of the shapes at two angles, from a table (count, count, packets, 4) laid
    out flat.
    """
    total: list[Any] = [0.0] * packets
    for lower_step, lower_weight in ((0, 1.0 - a.along), (1, a.along)):
        for upper_step, upper_weight in ((0, 1.0 - b.along), (1, b.along)):
            # Bilinear between the four nodes around the pair of angles.
            entry = ((a.lower + lower_step) * count + (b.lower + upper_step)) * packets
            for p in range(packets):
                total[p] = total[p] + ops.packet(table, entry + p) * (lower_weight * upper_weight)
    return total


def line_sum(ops: Arithmetic, table: Any, a: Place, packets: int) -> list[Any]:
    """Packets of the shapes at one angle, from a table (count, packets, 4) laid out flat."""
    total: list[Any] = [0.0] * packets
    for side, share in ((0, 1.0 - a.along), (1, a.along)):
        for p in range(packets):
            total[p] = total[p] + ops.packet(table, (a.lower + side) * packets + p) * share
    return total


NUMPY = Arithmetic()
