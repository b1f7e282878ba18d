"""What all pictures share: where they may be written, their colours, and the style of their axes."""

from pathlib import Path

import numpy as np
from jaxtyping import Array, Float

from .io.outputs import check_output

FORMATS = (".png", ".pdf", ".svg", ".jpg")
INK, FAINT, GRID = "#26221e", "#7d766e", "#e6e1da"


def check_picture(path: str | Path, *, overwrite: bool = False) -> Path:
    """The path of a picture, if one can be written there.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        ValueError: its ending is none of .png, .pdf, .svg, .jpg, or it is a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name a picture in it, such as {path / 'glaze.png'}")
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{path}: pictures end in {', '.join(FORMATS)}")
    return check_output(path, overwrite=overwrite)


def hex_colour(rgb: Float[Array | np.ndarray, "3"]) -> str:
    """Encoded sRGB in [0, 1] as #rrggbb."""
    return "#" + "".join(f"{round(float(np.clip(c, 0, 1)) * 255):02x}" for c in rgb)
