"""Lookup of a point of a body's table, in the arithmetic of NumPy or of Dr.Jit.

The table checks its own error through the very functions that render. Numbers come in packets of
four, so that one gather brings what belongs together. Every axis of thickness or fraction is
interpolated by Hermite's cubic from values and slopes, so that derivatives are smooth; angles and
wavelengths linearly.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

WeightedNodes: TypeAlias = list[tuple[Any, list[Any]]]
"""Numbers of nodes around a point, each with the weights of its values and slopes."""


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


def hermite(t: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Weights of (value, slope) at the lower and at the upper node, slopes in units of a cell."""
    complement = 1.0 - t
    return ((1.0 + 2.0 * t) * complement * complement, t * complement * complement), (
        t * t * (3.0 - 2.0 * t),
        -t * t * complement,
    )


def nodes_and_weights(spots: Sequence[Place], counts: Sequence[int]) -> WeightedNodes:
    """Nodes around a point, each with the weights of its 2^axes numbers (value, slopes, mixed
    slope).
    """
    nodes: WeightedNodes = [(0, [1.0])]
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
    ops: Arithmetic, table: Any, nodes: WeightedNodes, packets: int, row: Any = 0, rows: int = 1
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
    # The numbers of an entry follow one another: value, slopes, mixed slope.
    entries = (
        ((node * rows + row) * len(weights) + h, weight)
        for node, weights in nodes
        for h, weight in enumerate(weights)
    )
    return _sum(ops, table, entries, packets)


def spectral_sum(
    ops: Arithmetic, table: Any, nodes: WeightedNodes, packets: int, band: Place, bands: int
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
    # Bilinear between the four nodes around the pair of angles.
    entries = ((m * count + n, u * v) for m, u in _sides(a) for n, v in _sides(b))
    return _sum(ops, table, entries, packets)


def line_sum(ops: Arithmetic, table: Any, a: Place, packets: int) -> list[Any]:
    """Packets of the shapes at one angle, from a table (count, packets, 4) laid out flat."""
    return _sum(ops, table, _sides(a), packets)


def _sides(spot: Place) -> list[tuple[Any, Any]]:
    """The two nodes around a place, each with its linear weight."""
    return [(spot.lower, 1.0 - spot.along), (spot.lower + 1, spot.along)]


def _sum(
    ops: Arithmetic, table: Any, entries: Iterable[tuple[Any, Any]], packets: int
) -> list[Any]:
    """Packets of entries, weighted."""
    total: list[Any] = [0.0] * packets
    for entry, weight in entries:
        for p in range(packets):
            total[p] = total[p] + ops.packet(table, entry * packets + p) * weight
    return total


NUMPY = Arithmetic()
