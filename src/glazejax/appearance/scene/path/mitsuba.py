"""A whole scene for Mitsuba 3: the same shapes, lights and camera, with glazes through the plugin.

What Mitsuba adds is light between diffuse things, area lights, relief and everything else that this
program's ray caster leaves out. Rough metals, estimates of a metal's reflectance and Phong's model
have no counterpart there that is the same: they are refused, or become the nearest there is, and
that is said.
"""

from pathlib import Path

import numpy as np

from ....spectra import Bands, Numbers
from ...mitsuba.describe import Description
from ..lights import AreaLight, Light, PointLight
from ..materials import Conductor, Glazed, Lambert, Material, Phong
from ..scene import Scene
from ..shapes import Shape, Sphere
from .mitsuba_shapes import mitsuba_shape, numbers, repeats, sphere_map
from .scale import REACH, Placing, to_scale

# Shortest and longest wavelength that Mitsuba follows, nm.
_FOLLOWED = (360.0, 830.0)


def mitsuba_scene(
    scene: Scene,
    folder: Path,
    *,
    samples: int,
    max_depth: int,
    background: bool,
    tolerance: float,
    notes: list[str],
) -> Description:
    """Dictionary for `mitsuba.load_dict`; a spectral variant must be set.

    Args:
        scene: what there is.
        folder: where meshes are written; files of the same names are replaced.
        samples: rays of a pixel, best a square.
        max_depth: of paths: 2 for direct light alone, -1 for everything.
        background: light from all around with the scene's background; here it lights things, which
            it does not in `render`.
        tolerance: absolute error wanted of a glaze's reflectance factor.
        notes: takes a sentence for each material that becomes the nearest that Mitsuba has.

    Returns:
        The scene, in the lengths of `Placing`; its film is XYZ, on the scale of
        `picture.picture_xyz`.

    Raises:
        ValueError: a material of another kind than those of `materials`.
    """
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    grid = np.asarray(scene.wavelengths, float)
    placing = to_scale(scene)
    camera = scene.camera
    view = mi.ScalarTransform4f().look_at(
        origin=[0.0, 0.0, 0.0],
        target=numbers(camera.axes()[2]),
        up=numbers(camera.up),
    )
    description: Description = {
        "type": "scene",
        # Paths without an end need Russian roulette, or they go on between white walls.
        "integrator": {
            "type": "path",
            "max_depth": max_depth,
            "rr_depth": 1000 if max_depth > 0 else 8,
        },
        "sensor": {
            "type": "perspective",
            "fov": float(camera.field_of_view),
            "fov_axis": "x",
            # From next to the camera to behind the end of what stands for an endless plane.
            "near_clip": 1e-7 * REACH,
            "far_clip": 1e4 * REACH,
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
    # A map lies on a sphere another way round than on the rest, and on some shapes it repeats, so
    # that a material may be needed in several ways.
    materials: dict[tuple[str, bool, bool], str] = {}
    for k, shape in enumerate(scene.shapes):
        material = scene.materials[shape.material]
        mapped = material.thickness_map is not None
        key = (shape.material, mapped and isinstance(shape, Sphere), mapped and repeats(shape))
        if key not in materials:
            materials[key] = f"m{len(materials)}"
            bsdf = _bsdf(shape, material, grid=grid, tolerance=tolerance, notes=notes)
            description[f"material_{materials[key]}"] = {
                "type": "twosided",
                "bsdf": bsdf,
                "id": materials[key],
            }
        body = mitsuba_shape(shape, placing, folder / f"mesh_{k}.ply", mapped=mapped)
        description[f"shape_{k}"] = body | {"bsdf": {"type": "ref", "id": materials[key]}}
    for k, light in enumerate(scene.lights):
        description[f"light_{k}"] = _light(light, grid, placing)
    if background and np.any(scene.background_spectrum() > 0):
        description["background"] = {
            "type": "constant",
            "radiance": spectrum(scene.background_spectrum(), grid),
        }
    return description


def spectrum(values: Numbers, wavelengths: Bands) -> Description:
    """A spectrum for Mitsuba: linear between the bands, and the end bands repeated beyond them, as
    `glazejax.colour.colour_weights` has it.
    """
    values = np.broadcast_to(np.asarray(values, float), wavelengths.shape)
    shortest, longest = _FOLLOWED
    # Mitsuba's regular spectrum needs even steps.
    steps = np.diff(wavelengths)
    if steps.size and np.ptp(steps) < 1e-9 * steps[0]:
        step = float(steps[0])
        before = max(0, int(np.ceil((wavelengths[0] - shortest) / step)))
        after = max(0, int(np.ceil((longest - wavelengths[-1]) / step)))
        return {
            "type": "regular",
            "values": _listed(np.pad(values, (before, after), "edge")),
            "wavelength_min": float(wavelengths[0] - before * step),
            "wavelength_max": float(wavelengths[-1] + after * step),
        }
    everywhere = np.union1d(wavelengths, _FOLLOWED)
    return {
        "type": "irregular",
        "wavelengths": _listed(everywhere),
        "values": _listed(np.interp(everywhere, wavelengths, values)),
    }


def _listed(values: np.ndarray) -> str:
    return ",".join(f"{value:.9g}" for value in values)


def _bsdf(
    shape: Shape, material: Material, grid: np.ndarray, tolerance: float, notes: list[str]
) -> Description:
    if isinstance(material, Lambert):
        return {"type": "diffuse", "reflectance": spectrum(material.reflectance, grid)}
    if isinstance(material, Glazed):
        return _glaze(shape, material, grid, tolerance)
    name = shape.material
    if isinstance(material, Conductor):
        return _metal(name, material, grid, notes)
    if not isinstance(material, Phong):
        raise ValueError(
            f"material {name!r}: Mitsuba has no counterpart of {type(material).__name__}"
        )
    notes.append(
        f"material {name!r}: Mitsuba has no Phong; drawn as a plastic with a highlight of the "
        "same width"
    )
    # Facets whose highlight is as wide as Phong's: alpha^2 = 2/(n + 2).
    width = float(np.sqrt(2.0 / (float(material.exponent) + 2.0)))
    body = spectrum(material.body, grid)
    return {"type": "roughplastic", "alpha": width, "diffuse_reflectance": body}


def _glaze(shape: Shape, material: Glazed, grid: np.ndarray, tolerance: float) -> Description:
    from ...mitsuba import glaze_bsdf, register

    register()
    thickness = None if material.thickness is None else np.asarray(material.thickness, float)
    if thickness is not None:
        # The plugin wants the first row at v = 0.
        thickness = sphere_map(thickness) if isinstance(shape, Sphere) else thickness[::-1]
    description = glaze_bsdf(
        material.glaze,
        roughness=material.roughness,
        thickness=thickness,
        layer=material.layer,
        wavelengths=grid,
        gloss=material.gloss,
        tolerance=tolerance,
    )
    if thickness is not None and repeats(shape):
        description["thickness"]["wrap_mode"] = "repeat"
    return description


def _metal(name: str, material: Conductor, grid: np.ndarray, notes: list[str]) -> Description:
    """Fresnel's mirror, or Beckmann's facets, half of them left at the same angle; always of the
    exact reflectance.
    """
    optics = {
        "eta": spectrum(material.refractive_index, grid),
        "k": spectrum(material.extinction, grid),
    }
    if material.is_mirror:
        if material.fresnel != "exact":
            notes.append(
                f"material {name!r}: Mitsuba has no metal by the estimate {material.fresnel!r}; "
                "drawn with its exact reflectance"
            )
        return {"type": "conductor"} | optics
    notes.append(
        f"material {name!r}: Mitsuba has no rough metal as paper B has it; drawn with Beckmann's "
        "facets of the same width"
    )
    # Half of Beckmann's facets are left where tan^2 = alpha^2 ln 2.
    alpha = float(np.tan(np.deg2rad(material.roughness)) / np.sqrt(np.log(2.0)))
    return {"type": "roughconductor", "distribution": "beckmann", "alpha": alpha} | optics


def _light(light: Light, grid: np.ndarray, placing: Placing) -> Description:
    if isinstance(light, AreaLight):
        emitter = {"type": "area", "radiance": spectrum(light.spectrum, grid)}
        black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
        return mitsuba_shape(light.shape, placing) | {"emitter": emitter, "bsdf": black}
    # A perfect white has 1/pi of the irradiance as radiance, and here it is to have all of it.
    power = np.pi * np.asarray(light.spectrum, float)
    if isinstance(light, PointLight):
        # Its strength is that at a distance of one unit of the scene.
        intensity = spectrum(placing.unit**2 * power, grid)
        position = numbers(placing.points(light.position))
        return {"type": "point", "position": position, "intensity": intensity}
    irradiance = spectrum(power, grid)
    return {"type": "directional", "direction": numbers(light.direction), "irradiance": irradiance}
