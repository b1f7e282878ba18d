"""Fewer and simpler stacks of the same reflectance: equal or empty, hidden, or of closed form
(numpy).
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from ..common.chunks import pieces_of
from . import closed_form
from .bounds import End, PerLayer, PerStack, hidden_below, scattered_beyond_first


class Rows(NamedTuple):
    """Stacks as rows, float64."""

    albedo: PerLayer
    optical_thickness: PerLayer
    ground: PerStack
    refractive_index: PerStack
    cos_incidence: PerStack
    cos_viewing: PerStack | None

    @property
    def stacks(self) -> int:
        """Number of stacks."""
        return self.ground.size

    def take(self, rows: np.ndarray) -> "Rows":
        """Some of the stacks."""
        return jax.tree.map(lambda leaf: leaf[rows], self)

    def columns(self) -> list[np.ndarray]:
        """Every quantity of a stack as one array (stacks,)."""
        return [column for leaf in jax.tree.leaves(self) for column in np.atleast_2d(leaf.T)]

    def ends(self) -> tuple[End, End]:
        """Incidence and viewing, as the bounds want them."""
        n = self.refractive_index
        return closed_form.end(self.cos_incidence, n), closed_form.end(self.cos_viewing, n)


def distinct(
    columns: list[Float[np.ndarray, "entries"]],
) -> tuple[Int[np.ndarray, "kept"], Int[np.ndarray, "entries"]]:
    """First of each kind among entries equal in all columns, and which kind each entry is."""
    columns = [np.asarray(column, np.float64) + 0.0 for column in columns]  # -0 becomes 0
    key = np.zeros(columns[0].size, np.uint64)
    for column in columns:  # a hash sorts much faster than rows of numbers
        key = (key ^ column.view(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(31)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    # Two kinds of one hash are next to impossible; if there are any, whole rows are compared.
    if not all(np.array_equal(column[first][inverse], column) for column in columns):
        _, first, inverse = np.unique(
            np.stack(columns, 1), axis=0, return_index=True, return_inverse=True
        )
    return first, inverse.reshape(-1)


def once(rows: Rows) -> tuple[Rows, Int[np.ndarray, "entries"]]:
    """Distinct stacks, and where each of the given ones is among them."""
    first, inverse = distinct(rows.columns())
    return rows.take(first), inverse


def simplify(rows: Rows) -> Rows:
    """Empty layers out, neighbours of equal albedo merged, the rest moved up."""
    albedo = np.zeros_like(rows.albedo)
    thickness = np.zeros_like(rows.optical_thickness)
    # The layer that each stack has reached, and its albedo.
    at = np.full(rows.stacks, -1)
    last = np.full(rows.stacks, np.nan)
    for q, depth in zip(rows.albedo.T, rows.optical_thickness.T, strict=True):
        rows_present = np.flatnonzero(depth > 0)
        # Another albedo begins a new layer, the same one thickens the last.
        at[rows_present] += q[rows_present] != last[rows_present]
        last[rows_present] = q[rows_present]
        albedo[rows_present, at[rows_present]] = q[rows_present]
        thickness[rows_present, at[rows_present]] += depth[rows_present]
    deepest = int(at.max(initial=0)) + 1
    return rows._replace(albedo=albedo[:, :deepest], optical_thickness=thickness[:, :deepest])


def cut_below_opaque(rows: Rows, tolerance: float) -> tuple[Rows, Bool[np.ndarray, "stacks"]]:
    """Nothing below what is opaque, and black instead of a ground that is not seen; whether so."""
    visible, hidden = hidden_below(
        rows.albedo,
        rows.optical_thickness,
        rows.ground,
        rows.refractive_index,
        *rows.ends(),
        tolerance,
    )
    follow = np.arange(rows.albedo.shape[1]) < visible[:, None]
    cut = rows._replace(
        albedo=np.where(follow, rows.albedo, 0.0),
        optical_thickness=np.where(follow, rows.optical_thickness, 0.0),
        ground=np.where(hidden, 0.0, rows.ground),
    )
    return cut, hidden & (rows.ground > 0)


def by_closed_form(rows: Rows) -> closed_form.FirstOrder:
    """Closed form, index by index, in pieces as large as its quadrature should hold."""
    value, by_light, by_view = np.empty((3, rows.stacks))
    for index in np.unique(rows.refractive_index):
        for numbers in pieces_of(np.flatnonzero(rows.refractive_index == index), 16384):
            chosen = rows.take(numbers)
            first_order = closed_form.without_multiple_scattering(
                chosen.albedo,
                chosen.optical_thickness,
                chosen.ground,
                float(index),
                chosen.cos_incidence,
                chosen.cos_viewing,
            )
            value[numbers], (by_light[numbers], by_view[numbers]) = first_order
    return closed_form.FirstOrder(value, (by_light, by_view))


def closes(rows: Rows, tolerance: float) -> Bool[np.ndarray, "stacks"]:
    """Mask of stacks of which the closed form leaves out no more than the tolerance."""

    def bound(chosen: Rows, lit: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return scattered_beyond_first(
            chosen.albedo, chosen.optical_thickness, lit, chosen.refractive_index, *chosen.ends()
        )

    # Without the ground's part the bound is cheap, and only smaller: few stacks are looked at
    # closely.
    fits = bound(rows, (np.zeros(rows.stacks), np.zeros(rows.stacks))) <= tolerance
    # One quadrature an index: with more distinct ones it is not worth them.
    if np.unique(rows.refractive_index[fits]).size > 32:
        return np.zeros(rows.stacks, bool)
    chosen = rows.take(fits)
    fits[fits] = bound(chosen, by_closed_form(chosen).ground_radiosity) <= tolerance
    return fits
