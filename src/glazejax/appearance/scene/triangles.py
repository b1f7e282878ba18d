"""Rays against many triangles, through a tree of boxes.

The tree is flat: nodes stand in the order in which a ray visits them, each with the node to go to when its box is
missed. A ray therefore needs no stack, only the number of its next node, and all rays walk in step until the last one
is through.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

if TYPE_CHECKING:
    from .shapes import Mesh

# Triangles of a leaf; all of them are tried in every step.
_LEAF = 2
# Rays that walk in step.
_BLOCK = 256


class Triangles(NamedTuple):
    """Triangles of all meshes, sorted along a tree of boxes."""

    corner: Float[np.ndarray, "triangles 3"]
    edge1: Float[np.ndarray, "triangles 3"]
    edge2: Float[np.ndarray, "triangles 3"]
    normals: Float[np.ndarray, "triangles 3 3"]
    """At the three corners; unit vectors."""
    uv: Float[np.ndarray, "triangles 3 2"]
    shape: Int[np.ndarray, "triangles"]
    """Number of the mesh among all shapes."""
    low: Float[np.ndarray, "nodes 3"]
    high: Float[np.ndarray, "nodes 3"]
    first: Int[np.ndarray, "nodes"]
    """First triangle of a leaf."""
    held: Int[np.ndarray, "nodes"]
    """Triangles of a leaf; 0 for the others."""
    skip: Int[np.ndarray, "nodes"]
    """The node to go to where the box is missed, or after a leaf."""


def make_triangles(meshes: "Sequence[Mesh]", before: int) -> Triangles:
    """Arrays and tree of all triangles.

    Args:
        meshes: at least one.
        before: number of shapes that come before the first mesh.
    """
    corners, normals, uv, shape = [], [], [], []
    for k, mesh in enumerate(meshes):
        faces = np.asarray(mesh.faces)
        points = np.asarray(mesh.vertices, float)[faces]
        flat = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        size = np.linalg.norm(flat, axis=1, keepdims=True)
        flat = flat / np.where(size > 0, size, 1.0)
        corners.append(points)
        if mesh.normals is None:
            normals.append(np.repeat(flat[:, None], 3, axis=1))
        else:
            smooth = np.asarray(mesh.normals, float)[faces]
            length = np.linalg.norm(smooth, axis=-1, keepdims=True)
            normals.append(np.where(length > 0, smooth / np.where(length > 0, length, 1.0), flat[:, None]))
        uv.append(np.zeros((len(faces), 3, 2)) if mesh.uv is None else np.asarray(mesh.uv, float)[faces])
        shape.append(np.full(len(faces), before + k))
    points, numbers = np.concatenate(corners), np.concatenate(shape)
    order, nodes = _tree(points)
    points = points[order]
    return Triangles(
        points[:, 0],
        points[:, 1] - points[:, 0],
        points[:, 2] - points[:, 0],
        np.concatenate(normals)[order],
        np.concatenate(uv)[order],
        numbers[order],
        *nodes,
    )


def _tree(points: Float[np.ndarray, "triangles 3 3"]) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Order of the triangles and, node by node, low, high, first, count, skip; halves at the median of the centres."""
    low, high = points.min(axis=1), points.max(axis=1)
    centre = 0.5 * (low + high)
    order: list[np.ndarray] = []
    lows: list[np.ndarray] = []
    highs: list[np.ndarray] = []
    first: list[int] = []
    count: list[int] = []
    skip: list[int] = []
    done = 0
    # A number closes the node of that number: what comes after it is known then.
    pending: list[np.ndarray | int] = [np.arange(len(points))]
    while pending:
        members = pending.pop()
        if isinstance(members, int):
            skip[members] = len(lows)
            continue
        node = len(lows)
        lows.append(low[members].min(axis=0))
        highs.append(high[members].max(axis=0))
        skip.append(node + 1)
        leaf = len(members) <= _LEAF
        first.append(done if leaf else 0)
        count.append(len(members) if leaf else 0)
        if leaf:
            order.append(members)
            done += len(members)
            continue
        spread = centre[members]
        axis = int(np.argmax(spread.max(axis=0) - spread.min(axis=0)))
        sorted_members = members[np.argsort(spread[:, axis], kind="stable")]
        half = len(members) // 2
        pending += [node, sorted_members[half:], sorted_members[:half]]
    return np.concatenate(order), (np.array(lows), np.array(highs), np.array(first), np.array(count), np.array(skip))


def nearest_triangle(
    triangles: Triangles,
    origin: Float[Array, "rays 3"],
    direction: Float[Array, "rays 3"],
    limit: Float[Array, "rays"],
) -> tuple[Float[Array, "rays"], Int[Array, "rays"]]:
    """Distance and number of the nearest triangle nearer than the limit; the limit and -1 where there is none.

    Source: T. Möller, B. Trumbore, Journal of Graphics Tools 2 (1997) 21, for the single triangle.
    """
    # Rays that miss everything go last; small blocks then end with their own last ray rather than with that of all.
    enter, leave = _through(jnp.asarray(triangles.low[0]), jnp.asarray(triangles.high[0]), origin, _slope(direction))
    misses = ~((limit > 0) & (enter <= leave) & (leave >= 0) & (enter < limit))
    order = jnp.argsort(misses, stable=True)
    reach = jnp.where(misses, -1.0, limit)
    blocks = -(-origin.shape[0] // _BLOCK)
    fill = blocks * _BLOCK - origin.shape[0]
    rays = [
        jnp.pad(a[order], ((0, fill), *(((0, 0),) * (a.ndim - 1))), mode="edge") for a in (origin, direction, reach)
    ]
    rays = [a.reshape(blocks, _BLOCK, *a.shape[1:]) for a in rays]
    found = jax.lax.map(lambda block: _walk(triangles, *block), tuple(rays))
    back = jnp.argsort(order)
    best: Array = found[0].reshape(-1)[back]
    return jnp.where(misses, limit, best), found[1].reshape(-1)[back]


def _slope(direction: Array) -> Array:
    """One over the direction; a ray along an axis gets a slope that is tiny but not zero, so that no 0/0 can arise."""
    return 1.0 / jnp.where(jnp.abs(direction) < 1e-30, 1e-30, direction)


def _through(low: Array, high: Array, origin: Array, slope: Array) -> tuple[Array, Array]:
    """Distances at which rays enter and leave boxes; coordinates on the last axis."""
    ends = [[(side[..., k] - origin[..., k]) * slope[..., k] for side in (low, high)] for k in range(3)]
    near, far = [jnp.minimum(a, b) for a, b in ends], [jnp.maximum(a, b) for a, b in ends]
    enter = jnp.maximum(jnp.maximum(near[0], near[1]), near[2])
    leave = jnp.minimum(jnp.minimum(far[0], far[1]), far[2])
    return enter, leave * (1 + 1e-12)


def _walk(triangles: Triangles, origin: Array, direction: Array, limit: Array) -> tuple[Array, Array]:
    """One block of rays through the tree, in step."""
    nodes = len(triangles.skip)
    # Side by side, so that one look-up gets all.
    boxes = jnp.concatenate([jnp.asarray(a) for a in (triangles.low, triangles.high)], axis=1)
    links = jnp.stack([jnp.asarray(a, jnp.int32) for a in (triangles.first, triangles.held, triangles.skip)], axis=1)
    corners = jnp.concatenate([jnp.asarray(a) for a in (triangles.corner, triangles.edge1, triangles.edge2)], axis=1)
    slope = _slope(direction)

    def walking(state: tuple[Array, Array, Array]) -> Array:
        return jnp.any(state[0] < nodes)

    def step(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        node, best, which = state
        here = jnp.minimum(node, nodes - 1)
        box, link = boxes[here], links[here]
        first, held, skip = link[:, 0], link[:, 1], link[:, 2]
        enter, leave = _through(box[:, :3], box[:, 3:], origin, slope)
        inside = (node < nodes) & (enter <= leave) & (leave >= 0) & (enter < best)
        for k in range(_LEAF):
            trial = inside & (k < held)
            t = jnp.where(trial, first + k, 0)
            met = _distance(corners[t], origin, direction)
            closer = trial & (met > 0) & (met < best)
            best, which = jnp.where(closer, met, best), jnp.where(closer, t, which)
        onward = jnp.where(inside & (held == 0), here + 1, skip)
        return jnp.where(node < nodes, onward, node), best, which

    start = jnp.where(limit > 0, 0, nodes).astype(jnp.int32)
    _, best, which = jax.lax.while_loop(walking, step, (start, limit, jnp.full(limit.shape, -1, jnp.int32)))
    return best, which


def _distance(triangle: Float[Array, "rays 9"], origin: Array, direction: Array) -> Array:
    """Distance of one triangle (corner and two edges) for each ray; infinite where missed or edge-on."""
    # Coordinate by coordinate: sums over an axis of three run much slower.
    corner, edge1, edge2 = (tuple(triangle[:, k + j] for j in range(3)) for k in (0, 3, 6))
    way = tuple(direction[:, k] for k in range(3))
    offset = tuple(origin[:, k] - corner[k] for k in range(3))
    across, other = _cross(way, edge2), _cross(offset, edge1)
    volume = _dot(edge1, across)
    flat = volume == 0
    scale = 1.0 / jnp.where(flat, 1.0, volume)
    u, v = scale * _dot(offset, across), scale * _dot(way, other)
    # Neighbours overlap by rounding, so that no ray slips between them.
    hit = ~flat & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    return jnp.where(hit, scale * _dot(edge2, other), jnp.inf)


def _cross(a: tuple[Array, ...], b: tuple[Array, ...]) -> tuple[Array, ...]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: tuple[Array, ...], b: tuple[Array, ...]) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def triangle_surface(
    triangles: Triangles, part: Int[Array, "rays"], point: Float[Array, "rays 3"]
) -> tuple[Float[Array, "rays 3"], Float[Array, "rays 3"], Float[Array, "rays 2"]]:
    """Smooth normal, normal of the face and texture coordinates at points of triangles."""
    corner, edge1, edge2 = (jnp.asarray(a)[part] for a in (triangles.corner, triangles.edge1, triangles.edge2))
    across = jnp.cross(edge1, edge2)
    area = jnp.sum(across**2, axis=-1, keepdims=True)
    area = jnp.where(area > 0, area, 1.0)
    offset = point - corner
    v = jnp.sum(jnp.cross(edge1, offset) * across, axis=-1, keepdims=True) / area
    u = jnp.sum(jnp.cross(offset, edge2) * across, axis=-1, keepdims=True) / area
    weights = jnp.stack([1 - u - v, u, v], axis=1)
    normal = jnp.sum(weights * jnp.asarray(triangles.normals)[part], axis=1)
    length = jnp.sqrt(jnp.sum(normal**2, axis=-1, keepdims=True))
    face = across / jnp.sqrt(area)
    normal = jnp.where(length > 0, normal / jnp.where(length > 0, length, 1.0), face)
    return normal, face, jnp.sum(weights * jnp.asarray(triangles.uv)[part], axis=1)
