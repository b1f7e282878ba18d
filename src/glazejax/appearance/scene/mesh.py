"""Triangle meshes from files, read by trimesh: OBJ, PLY, STL, GLB, OFF and what else it knows."""

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from ...extras import advice
from .shapes import Mesh, rotation


def read_mesh(
    path: str | Path,
    material: str,
    *,
    size: float | None = None,
    centre: Sequence[float] | None = None,
    turn: Sequence[float] = (0.0, 0.0, 0.0),
    smooth: bool = True,
) -> Mesh:
    """Read a mesh and put it in its place.

    Args:
        path: the file; its ending gives the format.
        material: name of its material.
        size: length of the longest side of its bounding box; as in the file if left out.
        centre: where the middle of its bounding box comes to lie; as in the file if left out.
        turn: degrees about x, then y, then z, before that.
        smooth: hide the edges between faces by normals interpolated between vertices.

    Raises:
        FileNotFoundError: no such file.
        ValueError: trimesh is not there, or the file holds no triangles.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no mesh {path}")
    trimesh = import_trimesh()
    try:
        loaded = trimesh.load(path, force="mesh")
        vertices = np.asarray(loaded.vertices, float)
        faces = np.asarray(loaded.faces, int)
    except Exception as error:  # trimesh raises whatever its readers do
        formats = ", ".join(sorted(trimesh.available_formats()))
        raise ValueError(
            f"{path}: trimesh cannot read it ({error}); formats that it knows: {formats}"
        ) from None
    if len(faces) == 0:
        raise ValueError(f"{path}: there are no triangles in it")
    # Turned first, then scaled and moved by the box around the turned mesh.
    about = rotation(turn)
    vertices = vertices @ about.T
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    scale = 1.0 if size is None else size / max(float(np.max(high - low)), 1e-300)
    middle = 0.5 * (low + high)
    vertices = (vertices - middle) * scale + (
        middle if centre is None else np.asarray(centre, float)
    )
    uv = getattr(loaded.visual, "uv", None)
    return Mesh(
        material=material,
        vertices=vertices,
        faces=faces,
        normals=np.asarray(loaded.vertex_normals, float) @ about.T if smooth else None,
        uv=None if uv is None or len(uv) != len(vertices) else np.asarray(uv, float),
    )


def import_trimesh() -> ModuleType:
    """The library that reads meshes and casts rays at them.

    Raises:
        ValueError: it is not there.
    """
    try:
        import trimesh  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError(advice("trimesh")) from None
    return trimesh
