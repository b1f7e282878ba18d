"""A glaze as a measured BSDF that Mitsuba 3 loads, for what a small ray caster cannot do: global
illumination.

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
from glazejax.io.outputs import check_output
from glazejax.paint.media import Glaze
from glazejax.spectra import Grid, validate_wavelengths

# Mitsuba's numbers for kinds of numbers.
_KINDS = {np.dtype(np.uint8): 1, np.dtype(np.uint32): 5, np.dtype(np.float32): 10}
# At exactly 90 degrees nothing is reflected, which cannot be normalised.
_STEEPEST = np.deg2rad(89.9)
# Share of even sampling, so that no direction that reflects is ever left out.
_EVEN = 0.02


def export_glaze(
    glaze: Glaze | GlazeTable,
    path: str | Path,
    wavelengths_nm: Grid,
    *,
    gloss: bool = True,
    roughness: float = 0.02,
    angles: int = 48,
    resolution: int = 48,
    tolerance: float = 1e-4,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write a glaze to a ``.bsdf`` file, and say how Mitsuba is to use it.

    Args:
        glaze: without batch axes, or its table for all angles, of even thickness.
        path: file to write.
        wavelengths_nm: (bands,), of the table; Mitsuba interpolates between them.
        gloss: with the reflection of the surface itself.
        roughness: of that surface, root mean square slope of Beckmann's facets; above 0.
        angles: directions of the eye, from 0 to 90 degrees.
        resolution: half-way vectors along both of their angles.
        tolerance: absolute error wanted of the reflectance factor at the table's entries.
        overwrite: replace the file if it exists.

    Returns:
        A BSDF for `mitsuba.load_dict`, in a spectral variant.

    Raises:
        FileExistsError: the file exists.
        FileNotFoundError: its folder does not exist.
        IsADirectoryError: it is a folder.
        ValueError: what `glaze_table` refuses, a table whose thickness varies or not for all
            angles, a roughness of 0, or fewer than two angles or half-way vectors.
    """
    if not 0 < roughness <= 1:
        raise ValueError(
            f"roughness must be above 0 and at most 1, such as 0.02, not {roughness!r}"
        )
    for name, count in (("angles", angles), ("resolution", resolution)):
        if count < 2:
            raise ValueError(f"{name} is {count}; it must be at least 2")
    path = check_output(path, overwrite=overwrite, switch="overwrite=True")
    grid = validate_wavelengths(wavelengths_nm)
    table = (
        glaze if isinstance(glaze, GlazeTable) else glaze_table(glaze, grid, tolerance=tolerance)
    )
    if table.thickness.shape[0] > 1:
        raise ValueError(
            "Mitsuba's measured BSDF has no textures: export glazes of one thickness each"
        )
    if table.table.shape[0] != grid.size:
        raise ValueError(
            f"the table has {table.table.shape[0]} bands, but {grid.size} wavelengths are given"
        )
    for what, span in zip(("incidence", "viewing"), table.ranges, strict=False):
        if float(span.low) > np.cos(_STEEPEST) or float(span.high) < 1:
            far, near = np.rad2deg(np.arccos([float(span.low), float(span.high)]))
            raise ValueError(
                f"the table has {near:.3g} to {far:.3g} degrees of {what}: export one of all angles"
            )
    # With gloss two halves are blended, so each counts double.
    scale = 2.0 if gloss else 1.0
    write_tensor_file(
        path, measured_fields(table, grid, angles=angles, resolution=resolution, scale=scale)
    )
    body = {"type": "measured", "filename": str(path)}
    if not gloss:
        return body
    mirror = {
        "type": "roughplastic",
        "distribution": "beckmann",
        "alpha": float(roughness),
        "int_ior": float(np.mean(np.asarray(table.refractive_index))),
        "ext_ior": 1.0,
        "diffuse_reflectance": {"type": "uniform", "value": 0.0},
        "specular_reflectance": {"type": "uniform", "value": scale},
    }
    return {"type": "blendbsdf", "weight": 0.5, "first": body, "second": mirror}


def measured_fields(
    table: GlazeTable,
    wavelengths_nm: Grid,
    *,
    angles: int = 48,
    resolution: int = 48,
    scale: float = 1.0,
) -> dict[str, np.ndarray]:
    """Fields of the file: f cos(theta_o) for the eye's angle, wavelength, azimuth and polar angle
    of the half vector.

    Args:
        table: of a glaze, for all angles.
        wavelengths_nm: its bands.
        angles, resolution: see `export_glaze`.
        scale: factor of all values.
    """
    # Crowded towards grazing, where the surface lets less and less through.
    eye = _STEEPEST * np.sin(np.linspace(0.0, np.pi / 2, angles))
    steps = np.linspace(0.0, 1.0, resolution)
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
        "vndf": np.ones((1, angles, 2, 2), np.float32),
        "wavelengths": np.asarray(wavelengths_nm, np.float32),
    }


def write_tensor_file(path: str | Path, fields: dict[str, np.ndarray]) -> None:
    """Write named arrays of uint8, uint32 or float32 as Mitsuba's tensor file, version 1.0.

    Raises:
        ValueError: an array of another kind.
    """
    for name, values in fields.items():
        if values.dtype not in _KINDS:
            raise ValueError(
                f"{name} holds {values.dtype}; a tensor file takes {', '.join(map(str, _KINDS))}"
            )
    head = (
        12
        + 2
        + 4
        + sum(
            2 + len(name.encode()) + 2 + 1 + 8 + 8 * values.ndim for name, values in fields.items()
        )
    )
    with Path(path).open("wb") as file:
        file.write(b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)))
        place = head
        for name, values in fields.items():
            label = name.encode()
            file.write(struct.pack("<H", len(label)) + label)
            file.write(struct.pack("<HBQ", values.ndim, _KINDS[values.dtype], place))
            file.write(struct.pack(f"<{values.ndim}Q", *values.shape))
            place += values.nbytes
        for values in fields.values():
            file.write(np.ascontiguousarray(values).tobytes())
