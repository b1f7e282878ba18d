"""A whole scene for Mitsuba 3: the same shapes, lights and camera, with glazes as measured BSDFs.

What Mitsuba adds is light between diffuse things, area lights and everything else that this program's ray caster
leaves out. Rough metals and Phong's model have no counterpart there that is the same, and are refused.
"""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...extras import require
from ...spectra import Numbers
from ..glaze.mitsuba import export_glaze
from .intersect import plane_frame, rotation
from .lights import Light, PointLight
from .materials import Conductor, Glazed, Lambert, Material
from .scene import Scene
from .shapes import Box, Mesh, Plane, Shape, Sphere

# Half the side of the rectangle that stands for an endless plane.
_ENDLESS = 100.0


def mitsuba_scene(
    scene: Scene,
    folder: str | Path,
    *,
    samples: int = 256,
    max_depth: int = -1,
    gloss: bool = True,
    background: bool = False,
) -> dict[str, Any]:
    """Dictionary for `mitsuba.load_dict`; a spectral variant must be set.

    Args:
        scene: what there is; glazes of even thickness.
        folder: where the tables of glazes and the meshes are written; files of the same names are replaced.
        samples: rays of a pixel, best a square.
        max_depth: of paths: 2 for direct light alone, -1 for everything.
        gloss: glazes with their mirror reflection.
        background: light from all around with the scene's background; here it lights things, as in
            `render` only where the scene follows diffuse bounces.

    Returns:
        The scene; its film is XYZ, on the scale of `scene_picture.picture_xyz`.

    Raises:
        FileNotFoundError: the folder does not exist.
        ValueError: a material that Mitsuba has no counterpart of, or a thickness map.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"the folder {folder} for tables and meshes does not exist")
    require("mitsuba")
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    grid = np.asarray(scene.wavelengths, float)
    camera = scene.camera
    view = mi.ScalarTransform4f().look_at(
        origin=list(map(float, np.asarray(camera.position))),
        target=list(map(float, np.asarray(camera.target))),
        up=list(map(float, np.asarray(camera.up))),
    )
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth, "rr_depth": 1000},
        "sensor": {
            "type": "perspective",
            "fov": float(camera.field_of_view),
            "fov_axis": "x",
            "to_world": view,
            "sampler": {"type": "stratified", "sample_count": samples},
            "film": {
                "type": "hdrfilm",
                "width": scene.width,
                "height": scene.height,
                "pixel_format": "xyz",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        },
    }
    used = dict.fromkeys(shape.material for shape in scene.shapes)
    for number, name in enumerate(used):
        path = folder / f"material_{number}.bsdf"
        found[f"material_{number}"] = _bsdf(name, scene.materials[name], grid, path, gloss) | {"id": f"m{number}"}
    numbers = {name: number for number, name in enumerate(used)}
    for k, shape in enumerate(scene.shapes):
        body = _shape(shape, folder / f"mesh_{k}.obj")
        found[f"shape_{k}"] = body | {"bsdf": {"type": "ref", "id": f"m{numbers[shape.material]}"}}
    for k, light in enumerate(scene.lights):
        found[f"light_{k}"] = _light(light, grid)
    if background and np.any(scene.background_spectrum() > 0):
        found["background"] = {"type": "constant", "radiance": spectrum(scene.background_spectrum(), grid)}
    return found


def spectrum(values: Numbers, wavelengths: Float[np.ndarray, "bands"]) -> dict[str, Any]:
    """A spectrum as Mitsuba's `irregular`: linear between the bands, nothing beyond them."""
    values = np.broadcast_to(np.asarray(values, float), wavelengths.shape)
    return {
        "type": "irregular",
        "wavelengths": ",".join(f"{w:.9g}" for w in wavelengths),
        "values": ",".join(f"{v:.9g}" for v in values),
    }


def _bsdf(name: str, material: Material, grid: np.ndarray, path: Path, gloss: bool) -> dict[str, Any]:
    if isinstance(material, Lambert):
        return _both_sides({"type": "diffuse", "reflectance": spectrum(material.reflectance, grid)})
    if isinstance(material, Conductor) and material.is_mirror and material.fresnel == "exact":
        n, k = spectrum(material.refractive_index, grid), spectrum(material.extinction, grid)
        return _both_sides({"type": "conductor", "eta": n, "k": k})
    if isinstance(material, Glazed):
        if material.thickness is not None:
            raise ValueError(f"material {name!r} has a thickness map, which Mitsuba's measured BSDF cannot have")
        shiny = gloss and material.gloss
        return _both_sides(export_glaze(material.glaze, path, grid, gloss=shiny, overwrite=True))
    raise ValueError(f"material {name!r}: Mitsuba has no counterpart of {_describe(material)}")


def _describe(material: Material) -> str:
    if not isinstance(material, Conductor):
        return type(material).__name__
    return "a rough metal as paper B has it" if material.roughness else f"a metal by the estimate {material.fresnel!r}"


def _both_sides(bsdf: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "bsdf": bsdf}


def _light(light: Light, grid: np.ndarray) -> dict[str, Any]:
    """A perfect white has 1/pi of the irradiance as radiance, and here it is to have all of it."""
    power = spectrum(np.pi * np.asarray(light.spectrum, float), grid)
    if isinstance(light, PointLight):
        return {"type": "point", "position": _numbers(light.position), "intensity": power}
    return {"type": "directional", "direction": _numbers(light.direction), "irradiance": power}


def _shape(shape: Shape, path: Path) -> dict[str, Any]:
    if isinstance(shape, Sphere):
        return {"type": "sphere", "center": _numbers(shape.centre), "radius": float(shape.radius)}
    if isinstance(shape, Plane):
        half = (_ENDLESS, _ENDLESS) if shape.size is None else (shape.size[0] / 2, shape.size[1] / 2)
        right, up, normal = plane_frame(shape)
        axes = np.stack([right * half[0], up * half[1], normal], axis=1)
        return {"type": "rectangle", "to_world": _placed(axes, shape.point)}
    if isinstance(shape, Box):
        axes = rotation(np.asarray(shape.rotation, float)) * (np.asarray(shape.size, float) / 2)
        return {"type": "cube", "to_world": _placed(axes, shape.centre)}
    return _mesh(shape, path)


def _mesh(mesh: Mesh, path: Path) -> dict[str, Any]:
    """A mesh through an OBJ file."""
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*v) for v in np.asarray(mesh.vertices)]
    smooth = mesh.normals is not None
    if mesh.normals is not None:
        lines += ["vn {:.9g} {:.9g} {:.9g}".format(*n) for n in np.asarray(mesh.normals)]
    for face in np.asarray(mesh.faces) + 1:
        lines.append("f " + " ".join(f"{v}//{v}" if smooth else f"{v}" for v in face))
    path.write_text("\n".join(lines) + "\n")
    return {"type": "obj", "filename": str(path), "face_normals": not smooth}


def _numbers(values: Numbers) -> list[float]:
    return [float(v) for v in np.asarray(values)]


def _placed(axes: Float[np.ndarray, "3 3"], point: Numbers) -> Any:
    """Transform with the axes as columns and a point as origin."""
    require("mitsuba")
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, np.asarray(point, float)
    return mi.ScalarTransform4f(matrix.tolist())
