"""Shapes of a scene for Mitsuba 3: its own where they have the same coordinates on them, and
triangles otherwise.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ....spectra import Numbers
from ...mitsuba.describe import Description
from ..shapes import Box, Mesh, Plane, Shape, Sphere, plane_frame, rotation
from .scale import REACH, Placing

# Half the side of the rectangle that stands for an endless plane. One of triangles, whose points
# Mitsuba knows less well, is smaller.
_ENDLESS = 1e3 * REACH
_ENDLESS_MAPPED = 30.0 * REACH


def mitsuba_shape(
    shape: Shape, placing: Placing, path: Path | None = None, *, mapped: bool = False
) -> Description:
    """A shape for `mitsuba.load_dict`, without its material.

    Args:
        shape: of the scene.
        placing: its place in Mitsuba's lengths.
        path: file to write triangles to, ``.ply``; replaced if it exists. A sphere and a
            flat rectangle need none.
        mapped: its material has a map, so that coordinates on it must be those of the ray caster. A
            sphere's are
            not: its map is to be turned, see `sphere_map`.
    """
    if isinstance(shape, Sphere):
        radius = float(placing.unit * shape.radius)
        return {"type": "sphere", "center": numbers(placing.points(shape.centre)), "radius": radius}
    if isinstance(shape, Plane) and shape.relief is not None:
        mesh = relief_mesh(shape)
    elif isinstance(shape, Plane):
        # Mitsuba's rectangle reaches from -1 to 1: its axes are half the sides.
        axes = plane_frame(shape).T
        if shape.size is not None:
            axes = axes * [shape.size[0] / 2, shape.size[1] / 2, 1.0]
            return _rectangle(placing, shape.point, axes)
        # Around the point that is nearest to the camera.
        point = np.asarray(shape.point, float)
        foot = placing.eye + (axes[:, 2] @ (point - placing.eye)) * axes[:, 2]
        half = (_ENDLESS_MAPPED if mapped else _ENDLESS) / placing.unit
        quad = (foot, axes * [half, half, 1.0])
        if not mapped:
            return _rectangle(placing, *quad)
        # u and v count from the plane's own point; whole numbers of them make no difference.
        start = (foot - point) @ axes[:, :2] % 1.0 - half
        mesh = _quads(shape.material, [quad], 2.0 * half, start)
    elif isinstance(shape, Box):
        axes = rotation(shape.rotation) * (np.asarray(shape.size, float) / 2)
        mesh = _quads(shape.material, _faces(axes, np.asarray(shape.centre, float)))
    else:
        mesh = shape
    # What shines has no triangles: it is a sphere or a flat rectangle.
    assert path is not None
    return write_ply(path, replace(mesh, vertices=placing.points(mesh.vertices)))


def repeats(shape: Shape) -> bool:
    """Test whether u and v leave 0 to 1, where a map begins again."""
    if isinstance(shape, Mesh):
        # By more than the rounding of a file.
        return shape.uv is not None and bool(
            np.any(np.abs(np.asarray(shape.uv) - 0.5) > 0.5 + 1e-6)
        )
    return isinstance(shape, Plane) and shape.size is None


def relief_mesh(plane: Plane) -> Mesh:
    """Triangles of a plane that stands out by its relief, with smooth normals; u and v run as on
    the flat plane.
    """
    # A plane with a relief has a size.
    assert plane.relief is not None
    assert plane.size is not None
    heights = np.asarray(plane.relief, float)
    rows, columns = heights.shape
    frame = plane_frame(plane)
    width = float(plane.size[0])
    height = float(plane.size[1])
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(1.0, 0.0, rows))
    points = np.stack([(u - 0.5) * width, (v - 0.5) * height, heights], axis=-1).reshape(-1, 3)
    # Slopes by central differences; rows go down, the height goes up.
    down, across = np.gradient(heights, height / (rows - 1), width / (columns - 1))
    steep = np.stack([-across, down, np.ones_like(heights)], axis=-1).reshape(-1, 3)
    steep /= np.linalg.norm(steep, axis=1, keepdims=True)
    # Four neighbouring heights make two triangles.
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = first + columns
    # Both counter-clockwise seen from the side of the normal.
    faces = np.concatenate(
        [
            np.stack([first, below, first + 1], axis=1),
            np.stack([first + 1, below, below + 1], axis=1),
        ]
    )
    vertices = points @ frame + np.asarray(plane.point, float)
    return Mesh(
        material=plane.material,
        vertices=vertices,
        faces=faces,
        normals=steep @ frame,
        uv=np.stack([u, v], axis=-1).reshape(-1, 2),
    )


def write_ply(path: Path, mesh: Mesh) -> Description:
    """A mesh as a binary PLY file, and the shape that loads it."""
    names = list("xyz")
    columns = [mesh.vertices]
    if mesh.normals is not None:
        names += ["nx", "ny", "nz"]
        columns.append(mesh.normals)
    if mesh.uv is not None:
        names += ["u", "v"]
        columns.append(mesh.uv)
    # Mitsuba keeps meshes in single precision.
    vertices = np.concatenate(columns, axis=1).astype("<f4")
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"] = mesh.faces
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    with path.open("wb") as file:
        file.write(("\n".join(head) + "\n").encode())
        file.write(vertices.tobytes())
        file.write(faces.tobytes())
    return {"type": "ply", "filename": str(path), "face_normals": mesh.normals is None}


def sphere_map(values: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """A map whose first row is on top, as Mitsuba's sphere wants it with the first row at v = 0:
    there v runs down from the top, and u begins half way round. An odd width is doubled by
    repeating columns, so that half is whole.
    """
    if values.shape[1] % 2:
        values = np.repeat(values, 2, axis=1)
    return np.roll(values, values.shape[1] // 2, axis=1)


def _faces(axes: np.ndarray, centre: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Centre and axes of a box's six faces, with u and v along the axes that are left, in their
    order.
    """
    faces = []
    for k, in_plane in enumerate([(1, 2), (0, 2), (0, 1)]):
        for sign in (-1.0, 1.0):
            frame = axes[:, [*in_plane, k]] * [1.0, 1.0, sign]
            faces.append((centre + frame[:, 2], frame))
    return faces


def _quads(material: str, quads: list, scale: float = 1.0, start: float | np.ndarray = 0.0) -> Mesh:
    """Flat quadrangles with u and v from `start` on, over `scale`; each has half its sides and the
    way out as axes.
    """
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    vertices = []
    faces = []
    uv = []
    for k, (centre, axes) in enumerate(quads):
        vertices.append(centre + corners @ axes[:, :2].T)
        uv.append(start + scale * 0.5 * (corners + 1.0))
        # Turned round where the axes are left-handed, so that all faces look outwards.
        order = [[0, 1, 2], [0, 2, 3]] if np.linalg.det(axes) > 0 else [[0, 2, 1], [0, 3, 2]]
        faces.append(4 * k + np.array(order))
    return Mesh(
        material=material,
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces),
        uv=np.concatenate(uv),
    )


def numbers(values: Numbers) -> list[float]:
    """Plain numbers."""
    return np.asarray(values, float).tolist()


def _rectangle(placing: Placing, centre: Numbers, axes: Float[np.ndarray, "3 3"]) -> Description:
    """Mitsuba's rectangle, with half its sides and its normal as columns of `axes`."""
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    matrix = np.eye(4)
    matrix[:3, :3] = placing.unit * axes
    matrix[:3, 3] = placing.points(centre)
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix.tolist())}
