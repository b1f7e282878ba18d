"""Pictures as renderers read them: PNG with 16 bits a channel, OpenEXR, and normals of a relief."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

FORMATS = ("png", "exr")


def write_image(path: Path, values: Float[np.ndarray, "..."], *, encoded: bool = False) -> None:
    """Write a picture, (h, w) or (h, w, 3), by the ending of its name.

    Args:
        path: .png (16 bits a channel, values from 0 to 1) or .exr (single precision, any values).
        values: as they are to be written.
        encoded: of PNG: the values are sRGB's, which the file then says.

    Raises:
        ModuleNotFoundError: OpenEXR is not installed.
    """
    if path.suffix.lower() == ".exr":
        write_exr(path, {"RGB" if values.ndim == 3 else "Y": values})
    else:
        path.write_bytes(png(values, encoded=encoded))


def png(values: Float[np.ndarray, "..."], *, encoded: bool = False) -> bytes:
    """A PNG of grey (h, w) or colour (h, w, 3) with 16 bits a channel, of values from 0 to 1.

    Source: PNG specification, third edition (W3C, 2025).
    """
    integers = np.round(np.clip(values, 0.0, 1.0) * np.iinfo(np.uint16).max).astype(">u2")
    height, width = integers.shape[:2]
    rows = np.ascontiguousarray(integers).view(np.uint8).reshape(height, -1)
    # Filter 2: what changes from the row above, which is little.
    changes = np.diff(rows, axis=0, prepend=np.zeros((1, rows.shape[1]), np.uint8))
    data = np.concatenate([np.full((height, 1), 2, np.uint8), changes], axis=1)
    kind = 2 if integers.ndim == 3 else 0
    blocks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0))]
    blocks += [(b"sRGB", b"\0")] if encoded else []
    blocks += [(b"IDAT", zlib.compress(data.tobytes(), 6)), (b"IEND", b"")]
    chunks = (
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in blocks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def write_exr(
    path: Path, channels: Mapping[str, Float[np.ndarray, "..."]], **attributes: str
) -> None:
    """Write an OpenEXR file in single precision.

    Args:
        path: of the file.
        channels: by their names, (h, w) each; "RGB" is (h, w, 3).
        attributes: further entries of the header.

    Raises:
        ModuleNotFoundError: OpenEXR is not installed; callers ask `glazejax.extras` before they
            compute anything.
    """
    import OpenEXR  # pyright: ignore[reportMissingImports]

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    single = {name: np.ascontiguousarray(x, np.float32) for name, x in channels.items()}
    with OpenEXR.File(header, single) as file:
        file.write(str(path))


def normals(height: Float[np.ndarray, "h w"], pixel: float) -> Float[np.ndarray, "h w 3"]:
    """Tangent-space normals of a relief as colours, 0.5 + n/2; green points up the picture (OpenGL,
    Blender).

    Args:
        height: m.
        pixel: width of a pixel, m.
    """
    rows, columns = (
        np.gradient(height, pixel, axis=axis) if height.shape[axis] > 1 else np.zeros(height.shape)
        for axis in (0, 1)
    )
    slopes = np.stack([-columns, rows, np.ones(height.shape)], axis=-1)
    return 0.5 + 0.5 * slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
