"""Bicubic splines over two optical thicknesses: nodes, coefficients around each cell, and weights.

What a coat reflects is smooth in log(c + k d) and log(c + s d), down to coats that do not absorb or
scatter at all. `xp` is numpy or jax.numpy.
"""

from typing import Any

import jax
import numpy as np
from jaxtyping import Float

HIGHEST = (300.0, 1000.0)
"""Largest k d and s d of a table; a coat beyond is opaque and taken at the end, at its k/s."""

BEND = 0.01
"""Below this a coat's reflectance is linear in k d and s d; above it varies with their
logarithms.
"""


def nodes_of(count: int) -> tuple[Float[np.ndarray, "nodes"], Float[np.ndarray, "nodes"]]:
    """Values of k d and of s d at so many nodes an axis."""
    k, s = (
        BEND * np.expm1(np.linspace(0.0, np.log1p(highest / BEND), count)) for highest in HIGHEST
    )
    return k, s


def patches(values: Float[np.ndarray, "n nodes nodes"]) -> Float[np.ndarray, "cells 4 4 n"]:
    """Spline coefficients around each cell, from values at the nodes of k d and s d."""
    count = values.shape[-1]
    inverse = np.linalg.inv(not_a_knot(count))[:, :count]
    coefficients = np.einsum("ai,bj,cij->abc", inverse, inverse, values, optimize=True)
    windows = np.lib.stride_tricks.sliding_window_view(coefficients, (4, 4), axis=(0, 1))
    return np.ascontiguousarray(np.moveaxis(windows, 2, -1)).reshape(-1, 4, 4, len(values))


def not_a_knot(nodes: int) -> Float[np.ndarray, "n n"]:
    """Matrix from a uniform cubic B-spline's nodes + 2 coefficients to its values and two end
    conditions.

    The conditions say that the third derivative does not jump at the second and the last but one
    node.
    """
    matrix = np.zeros((nodes + 2, nodes + 2))
    for node in range(nodes):
        matrix[node, node : node + 3] = np.array([1.0, 4.0, 1.0]) / 6.0
    matrix[nodes, :5] = matrix[nodes + 1, -5:] = [1.0, -4.0, 6.0, -4.0, 1.0]
    return matrix


def within(xp: Any, absorption: Any, scattering: Any) -> tuple[Any, Any, Any]:
    """K d and s d, (...), of coats no thicker than the table, and how many times as thick the coats
    are, 1 or more. Each keeps its k/s: nothing else of an opaque coat is seen.
    """
    beyond = xp.maximum(xp.maximum(absorption / HIGHEST[0], scattering / HIGHEST[1]), 1.0)
    return absorption / beyond, scattering / beyond, beyond


def look_up(xp: Any, patches: Any, absorption: Any, scattering: Any, nodes: int) -> Any:
    """Values, (..., n), of a table's patches at k d and s d, (...)."""
    absorption, scattering, _ = within(xp, absorption, scattering)
    row, over = locate(xp, absorption, HIGHEST[0], nodes)
    column, across = locate(xp, scattering, HIGHEST[1], nodes)
    cell = row * (nodes - 1) + column
    patch = patches[cell] if xp is np else patches.at[cell].get(mode="promise_in_bounds")
    # A sum of products: XLA on the CPU takes six times as long for the same as an einsum.
    products = over[..., :, None] * across[..., None, :]
    return xp.sum(patch * products[..., None], axis=(-3, -2))


def locate(xp: Any, thickness: Any, highest: float, nodes: int) -> tuple[Any, Any]:
    """Cell of each value that is in the table, (...), and the weights of the four cubic B-splines
    that reach into it, (..., 4).
    """
    at = xp.log1p(thickness / BEND) * float((nodes - 1) / np.log1p(highest / BEND))
    # The last node ends the last cell.
    cell = xp.clip(xp.floor(at if xp is np else jax.lax.stop_gradient(at)), 0.0, nodes - 2)
    # How far a value lies from its cell's lower and from its upper end.
    far = at - cell
    near = 1.0 - far
    weights = (
        near**3,
        4.0 - 6.0 * far**2 + 3.0 * far**3,
        4.0 - 6.0 * near**2 + 3.0 * near**3,
        far**3,
    )
    return cell.astype(np.int32), xp.stack(weights, axis=-1) / 6.0
