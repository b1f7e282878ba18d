"""A glaze as a measured BSDF that Mitsuba 3 loads: what the plugin is compared with.

Mitsuba's plugin ``measured`` reads a table of f cos(theta_o) over the direction of the eye and the
half-way vector, in the layout of the measured materials of EPFL's RGL, inside a container called a
tensor file. A glaze needs no warped sampling, so the maps that would warp are constant, and
coordinates of the table are those of the half-way vector itself. The mirror reflection of the
surface cannot stand in a table: Mitsuba's own ``roughplastic`` without a body adds it, a little
rough, because its ``blendbsdf`` weighs a perfect mirror wrongly (seen in 3.9.1: the pdf of the body
at the mirror direction goes into the mirror's weight).

Sources: J. Dupuy, W. Jakob, ACM Trans. Graph. 37 (2018) 274, the parametrisation; Mitsuba 3,
`src/bsdfs/measured.cpp` and `src/core/tensor.cpp`, the layout.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from glazejax.appearance.glaze.table import GlazeTable, glaze_table
from glazejax.paint.media import Glaze
from glazejax.spectra import Grid

# Mitsuba's numbers for kinds of numbers.
_KINDS = {np.dtype(np.uint8): 1, np.dtype(np.float32): 10}
# At exactly 90 degrees nothing is reflected, which cannot be normalised.
_STEEPEST = np.deg2rad(89.9)
# Share of even sampling, so that no direction that reflects is ever left out.
_EVEN = 0.02
# Directions of the eye, from 0 to 90 degrees, and half-way vectors along both of their angles.
_ANGLES = _HALVES = 48


def export_glaze(
    glaze: Glaze, path: Path, wavelengths_nm: Grid, *, gloss: bool = True
) -> dict[str, Any]:
    """Write a glaze to a ``.bsdf`` file, and state how Mitsuba is to use it.

    Args:
        glaze: without batch axes.
        path: file to write.
        wavelengths_nm: (bands,), of the table; Mitsuba interpolates between them.
        gloss: with the reflection of the surface itself, whose facets (Beckmann's) have a root mean
            square slope of 0.02.

    Returns:
        A BSDF for `mitsuba.load_dict`, in a spectral variant.
    """
    table = glaze_table(glaze, wavelengths_nm, tolerance=1e-4)
    # With gloss two halves are blended, so each counts double.
    scale = 2.0 if gloss else 1.0
    _write_tensor_file(path, _measured_fields(table, wavelengths_nm, scale))
    body = {"type": "measured", "filename": str(path)}
    if not gloss:
        return body
    mirror = {
        "type": "roughplastic",
        "distribution": "beckmann",
        "alpha": 0.02,
        "int_ior": float(np.mean(np.asarray(table.refractive_index))),
        "ext_ior": 1.0,
        "diffuse_reflectance": {"type": "uniform", "value": 0.0},
        "specular_reflectance": {"type": "uniform", "value": scale},
    }
    return {"type": "blendbsdf", "weight": 0.5, "first": body, "second": mirror}


def _measured_fields(
    table: GlazeTable, wavelengths_nm: Grid, scale: float
) -> dict[str, np.ndarray]:
    """Fields of the file: f cos(theta_o), times `scale`, for the eye's angle, wavelength, azimuth
    and polar angle of the half vector.
    """
    # Crowded towards grazing, where the surface lets less and less through.
    eye = _STEEPEST * np.sin(np.linspace(0.0, np.pi / 2, _ANGLES))
    steps = np.linspace(0.0, 1.0, _HALVES)
    half_polar = steps**2 * (np.pi / 2)
    half_azimuth = (2 * steps - 1) * np.pi
    cos_eye = np.cos(eye)[:, None, None]
    cos_half = np.cos(half_polar)
    # With the eye in the plane of azimuth 0: V.H, and the z of L = 2 (V.H) H - V.
    between = (
        np.sin(eye)[:, None, None] * np.sin(half_polar) * np.cos(half_azimuth)[:, None]
        + cos_eye * cos_half
    )
    cos_light = 2 * between * cos_half - cos_eye
    # Near the horizon the values go as the square of the cosine. Below it they get the other sign,
    # so that values interpolated across it are not too large.
    above = np.clip(np.abs(cos_light), 1e-3, 1.0)
    factor = np.asarray(
        table.reflectance_factor(above, np.broadcast_to(cos_eye, above.shape)), float
    )
    values = scale / np.pi * factor * cos_light[..., None]
    spectra = np.moveaxis(values, -1, 1)[None]
    seen = np.maximum(values.mean(axis=-1), 0.0)
    luminance = seen + _EVEN * seen.mean(axis=(1, 2), keepdims=True) + 1e-9
    words = "glaze computed by glazejax"
    ones = np.ones((2, 2), np.float32)
    return {
        "description": np.frombuffer(words.encode(), np.uint8),
        "jacobian": np.zeros(1, np.uint8),
        "luminance": luminance[None].astype(np.float32),
        "ndf": ones,
        "phi_i": np.zeros(1, np.float32),
        "sigma": ones,
        "spectra": spectra.astype(np.float32),
        "theta_i": eye.astype(np.float32),
        "vndf": np.ones((1, _ANGLES, 2, 2), np.float32),
        "wavelengths": np.asarray(wavelengths_nm, np.float32),
    }


def _write_tensor_file(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Write named arrays of uint8 or float32 as Mitsuba's tensor file, version 1.0."""
    sizes = [len(name.encode()) + 13 + 8 * values.ndim for name, values in fields.items()]
    place = 18 + sum(sizes)
    with path.open("wb") as file:
        file.write(b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)))
        for name, values in fields.items():
            label = name.encode()
            file.write(struct.pack("<H", len(label)) + label)
            file.write(struct.pack("<HBQ", values.ndim, _KINDS[values.dtype], place))
            file.write(struct.pack(f"<{values.ndim}Q", *values.shape))
            place += values.nbytes
        for values in fields.values():
            file.write(np.ascontiguousarray(values).tobytes())
