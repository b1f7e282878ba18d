"""Common parts of all pictures: where they may be written, their colours, and the style of their
axes.

matplotlib is imported when the first one is drawn, and its global state stays as it is.
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from .extras import require
from .io.outputs import check_output
from .io.write import write_files

if TYPE_CHECKING:
    from jaxtyping import Array, Real
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg", ".jpg")
INK, FAINT, GRID, EDGE = "#26221e", "#7d766e", "#e6e1da", "#cfc8bf"
ABSORPTION, SCATTERING = "#8c2d04", "#08519c"
OVER_BLACK, OVER_WHITE = "#333333", "#b8860b"
STYLE: dict[Any, Any] = {
    "figure.facecolor": "white",
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "legend.frameon": False,
    "legend.fontsize": 8,
    # Pictures say their own layout: one of the user's settings would move what is placed by hand,
    # and warn.
    "figure.constrained_layout.use": False,
    "figure.autolayout": False,
}


def load_matplotlib_ahead() -> None:
    """Begin to import what a picture needs, in another thread, and return at once: XLA compiles
    and computes without Python's lock.
    """

    def load() -> None:
        # A missing package is reported where the picture is drawn.
        with suppress(ImportError):
            import matplotlib.figure  # noqa: F401

    Thread(target=load, daemon=True).start()


@contextmanager
def style(more: Mapping[Any, Any] | None = None) -> Generator[None]:
    """Draw in the style of all pictures; `more` are settings of matplotlib's own that
    come on top.
    """
    require("matplotlib")
    from matplotlib import rc_context

    with rc_context({**STYLE, **(more or {})}):
        yield


@contextmanager
def picture(
    path: str | Path, width: float, height: float, *, layout: Any = "constrained"
) -> "Generator[Figure]":
    """An empty figure to draw on, inches; afterwards it is written in the format of the path's
    ending.
    """
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout=layout)
        yield figure
        save_picture(figure, path, dpi=110)


def save_picture(figure: "Figure", path: str | Path, *, dpi: float) -> None:
    """Write a figure in the format of the path's ending: whole, or what was there stays.

    Args:
        figure: it.
        path: the file, which is replaced if it exists.
        dpi: dots per inch.
    """
    path = Path(path)
    drawn = BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], dpi=dpi)
    write_files({path: [drawn.getvalue()]}, overwrite=True)


def label_spectra(axes: "Axes", ylabel: str = "reflectance", **settings: Any) -> None:
    """Labels of axes with the wavelength along x; further settings as of matplotlib's
    ``axes.set``.
    """
    axes.set(xlabel="wavelength (nm)", ylabel=ylabel, **settings)


def check_picture(path: str | Path, *, overwrite: bool = False, argument: str = "") -> Path:
    """The path of a picture, if one can be written there; errors begin with ``argument``, such as
    ``--out``.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        ValueError: its ending is none of .png, .pdf, .svg, .jpg, or it is a folder.
    """
    path = Path(path)
    check_ending(path, argument=argument)
    return check_output(path, overwrite=overwrite, argument=argument)


def check_ending(path: Path, *, argument: str = "") -> None:
    """Refuse a name that is no picture's; errors begin with ``argument``, such as ``--out``.

    Raises:
        ValueError: its ending is none of .png, .pdf, .svg, .jpg, or it is a folder.
    """
    described = f"{argument} {path}" if argument else str(path)
    if path.is_dir():
        raise ValueError(
            f"{described} is a folder: name a picture in it, such as {path / 'glaze.png'}"
        )
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{described}: pictures end in {', '.join(FORMATS)}")


def hex_colour(rgb: "Real[Array | np.ndarray, '3'] | Sequence[float]") -> str:
    """Encoded sRGB in [0, 1] as #rrggbb."""
    return "#" + "".join(f"{round(float(np.clip(c, 0, 1)) * 255):02x}" for c in np.asarray(rgb))
