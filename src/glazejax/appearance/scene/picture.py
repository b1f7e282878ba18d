"""A rendered picture as a file: colours of a screen to PNG, spectra to NPZ or OpenEXR."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from ...colour import CIE_1931, colour_weights, find_observer
from ...extras import require
from ...spectra import Grid, Numbers
from ..image_files import write_exr
from .render_result import Rendered

if TYPE_CHECKING:
    from ..display.display import Display, Gamut

SPECTRAL_ENDINGS = (".npz", ".exr")


def picture_xyz(
    rendered: Rendered, wavelengths: Grid, observer: str | int = CIE_1931
) -> Float[np.ndarray, "h w 3"]:
    """CIE XYZ of each pixel, Y = 1 for a perfect white under light of luminance 1; NaN where it was
    interrupted.

    Args:
        rendered: picture.
        wavelengths: (bands,), of the scene.
        observer: see `glazejax.colour.find_observer`.

    Raises:
        ValueError: another observer than that of a picture without spectra.
    """
    if rendered.spectral:
        return rendered.radiance @ colour_weights(wavelengths, "E", observer)
    if find_observer(observer) != CIE_1931:
        raise ValueError(
            f"a picture without spectra is for the {CIE_1931}: render it with spectral=True for "
            "another"
        )
    return rendered.values


def light_white(
    spectrum: Numbers, wavelengths: Grid, observer: str | int = CIE_1931
) -> Float[np.ndarray, "3"]:
    """XYZ of a perfect white under a light, (3,), with Y = 1.

    Args:
        spectrum: of the light, (bands,), in any unit, such as `lamp` gives it.
        wavelengths: (bands,), nm.
        observer: see `glazejax.colour.find_observer`.

    Raises:
        ValueError: a grid that is too coarse or too short for colour, or an unknown observer.
    """
    white = np.asarray(spectrum, float) @ colour_weights(wavelengths, "E", observer)
    return white / white[1]


class Screen(NamedTuple):
    """A picture for a display."""

    rgb: UInt8[np.ndarray, "h w 3"]
    bright: float
    """Share of the pixels that are too bright for the display."""
    colourful: float
    """Share of the pixels that are too colourful for it, at any brightness."""


def screen_picture(
    xyz: Float[np.ndarray, "h w 3"],
    white: Float[np.ndarray, "3"],
    display: "Display | None" = None,
    *,
    exposure: float = 1.0,
    gamut: "Gamut" = "desaturate",
) -> Screen:
    """Digital colours of a picture, with `white` shown as the display's own; pixels not computed
    are mid-grey.

    Args:
        xyz: colours, NaN where not computed.
        white: XYZ of the light that the eye is adapted to, Y = 1.
        display: of 256 levels; sRGB if left out.
        exposure: factor of all colours.
        gamut: what becomes of colours that the display cannot show, see `Display.to_rgb`.
    """
    from ..display.display import Display

    display = display or Display.preset("sRGB")
    missing = np.any(~np.isfinite(xyz), axis=-1)
    adapted = display.adapt(np.where(missing[..., None], 0.0, exposure * xyz), white)
    rgb = np.array(display.to_rgb(adapted, gamut=gamut).rgb, np.uint8)
    rgb[missing] = 128
    light = np.asarray(display.linear(adapted))[~missing]
    # Light beyond the display's range by less, in parts of it, the eye cannot distinguish from the
    # edge.
    bright, colourful = (np.any(wrong, axis=-1) for wrong in (light > 1.002, light < -0.002))
    # A pixel that is too colourful is not counted as too bright as well.
    shares = [
        float(np.mean(wrong)) if wrong.size else 0.0 for wrong in (bright & ~colourful, colourful)
    ]
    return Screen(rgb, *shares)


def save_png(path: str | Path, rgb: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write digital colours as PNG; a file that is there is replaced.

    Args:
        path: the file.
        rgb: (h, w, 3), 0 to 255, such as ``screen_picture(...).rgb``.

    Raises:
        ModuleNotFoundError: matplotlib is not installed.
    """
    require("matplotlib")
    from matplotlib.image import imsave

    imsave(path, rgb, format="png")


def save_spectral(path: str | Path, rendered: Rendered) -> None:
    """Write spectra: ``.npz`` with ``radiance`` and ``wavelengths``, or ``.exr`` with a channel for
    each band.

    Raises:
        ValueError: another ending, or a picture without spectra. ModuleNotFoundError: OpenEXR is
        not installed.

    Notes:
        Channels are called ``S0.550,000000nm``. 1 is a perfect white under a light of spectrum 1.

        Source of the layout: A. Fichet, R. Pacanowski, A. Wilkie, An OpenEXR Layout for Spectral
        Images, JCGT 10(3) (2021).
    """
    path = Path(path)
    radiance = rendered.radiance.astype(np.float32)
    if path.suffix.lower() == ".npz":
        # Opened here: NumPy adds .npz to a name that ends otherwise, such as in .NPZ.
        with path.open("wb") as file:
            np.savez_compressed(file, radiance=radiance, wavelengths=rendered.wavelengths)
        return
    check_spectral(path)
    # The layout has a comma in the wavelength, and a point after S0.
    channels = {
        "S0." + f"{wavelength:.6f}nm".replace(".", ","): radiance[..., k]
        for k, wavelength in enumerate(rendered.wavelengths)
    }
    write_exr(path, channels, spectralLayoutVersion="1.0", emissiveUnits="W.m^-2.sr^-1.nm^-1")


def check_spectral(path: str | Path) -> None:
    """Refuse a spectral file that could not be written in the end.

    Raises:
        ValueError: its ending is neither .npz nor .exr. ModuleNotFoundError: OpenEXR is not
        installed.
    """
    ending = Path(path).suffix.lower()
    if ending not in SPECTRAL_ENDINGS:
        raise ValueError(
            f"{path}: spectra are written as .npz or .exr, not {ending or 'without an ending'}"
        )
    if ending == ".exr":
        require("OpenEXR")
