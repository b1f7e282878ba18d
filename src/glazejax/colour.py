"""Spectrum -> XYZ, Lab, sRGB and colour differences.

Colour matching functions, illuminants and the CIEDE2000 formula are those of colour-science, which is
imported when first needed. What depends only on the grid, the illuminant and the observer is folded into
one matrix of weights, so that a spectrum, or a million of them, becomes XYZ by one matrix product, and
every function but `delta_e_2000` can be differentiated.
"""

import difflib
import re
import warnings
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .spectra import (
    Grid,
    Numbers,
    Spectra,
    as_float_array,
    describe_grid,
    validate_wavelengths,
)

CIE_1931 = "CIE 1931 2 Degree Standard Observer"
_OBSERVERS = (
    CIE_1931,
    "CIE 1964 10 Degree Standard Observer",
    "CIE 2015 2 Degree Standard Observer",
    "CIE 2015 10 Degree Standard Observer",
)
_SHORT_OBSERVERS = {
    "2": _OBSERVERS[0],
    "1931": _OBSERVERS[0],
    "cie_2_1931": _OBSERVERS[0],
    "10": _OBSERVERS[1],
    "1964": _OBSERVERS[1],
    "cie_10_1964": _OBSERVERS[1],
}
# ASTM E308: the working range in nm.
_START, _END = 360, 780
# Beyond 20 nm ASTM E308 gives no tables; beyond this, cubic interpolation says nothing about a paint.
_MAX_STEP = 40.0
# Share of a tristimulus value that may rest on repeating the end bands; 420-680 nm stays below .07.
_MAX_GUESSED = 0.1


def colour_science() -> Any:
    """The colour-science package (an object in place of its module), imported without warnings about what it lacks."""
    printing = np.get_printoptions()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    # Its import switches all of NumPy to an old print format that drops digits.
    np.set_printoptions(**printing)
    return colour


def _find(what: str, asked: str, known: dict[str, str]) -> str:
    """Entry of `known`, whose keys are lower case, for a name in any case."""
    key = re.sub(r"\s+", " ", str(asked).strip()).lower()
    if key in known:
        return known[key]
    # Substrings first: difflib finds nothing near a name as short as "F".
    near = [name for k, name in known.items() if key and key in k][:4]
    near = near or [known[k] for k in difflib.get_close_matches(key, known, n=4, cutoff=0.3)]
    choices = near or list(known.values())
    raise ValueError(f"unknown {what} {asked!r}; the nearest are {', '.join(dict.fromkeys(choices))}")


def find_illuminant(name: str) -> str:
    """Full name of a CIE illuminant; the case does not matter, and F2 is FL2.

    Raises:
        ValueError: colour-science knows no such illuminant; the message lists the nearest names.
    """
    known = {str(key).lower(): str(key) for key in colour_science().SDS_ILLUMINANTS}
    lamps = {key.replace("fl", "f", 1): full for key, full in known.items() if key.startswith("fl")}
    return _find("illuminant", name, known | lamps)


def find_observer(name: str | int) -> str:
    """Full name of a standard observer; 2, 10, 1931 and 1964 will do, as number or text.

    Raises:
        ValueError: no such observer; the message lists the nearest names.
    """
    return _find("observer", str(name), {full.lower(): full for full in _OBSERVERS} | _SHORT_OBSERVERS)


def colour_weights(
    wavelengths: Grid, illuminant: str = "D65", observer: str | int = CIE_1931
) -> Float[np.ndarray, "bands 3"]:
    """Weights w such that ``reflectance @ w`` is XYZ, with Y = 1 for the perfect diffuser.

    The reflectance is interpolated to 1 nm by Lagrange's cubic through the four nearest bands (a parabola
    in the first and last step), and the end bands are repeated outwards to 360 and 780 nm; sums over the
    product of illuminant and observer at 1 nm are the weights. On even grids of 10 or 20 nm these are the
    weights of ASTM E2022, which ASTM E308 tabulates; any other grid is treated the same way. The columns
    sum to the white point.

    Args:
        wavelengths: (bands,), nm; even or not.
        illuminant: any name that colour-science knows, such as D65, A, FL2, LED-B3.
        observer: full name, or 2, 10, 1931, 1964.

    Returns:
        (bands, 3), read-only; the same array for the same arguments.

    Raises:
        ValueError: a grid that is too coarse or covers too little of the visible range, or an unknown name.

    Source: ASTM E308-15, ASTM E2022-11.
    """
    grid = validate_wavelengths(wavelengths)
    return _weights(tuple(grid.tolist()), find_illuminant(illuminant), find_observer(observer))


@lru_cache(maxsize=128)
def _weights(grid: tuple[float, ...], illuminant: str, observer: str) -> Float[np.ndarray, "bands 3"]:
    """Weights for full names; see `colour_weights`."""
    bands = np.asarray(grid)
    fine, products = _illuminated_observer(illuminant, observer)
    beyond = (fine < bands[0]) | (fine > bands[-1])
    guessed = float((np.abs(products[beyond]).sum(axis=0) / np.abs(products).sum(axis=0)).max())
    if guessed > _MAX_GUESSED:
        raise ValueError(
            f"{describe_grid(bands)} leaves {guessed:.0%} of a tristimulus value to guesswork: colour needs "
            "spectra from about 420 to 680 nm at least, better from 400 to 700 nm"
        )
    inside = bands[(bands > _START - _MAX_STEP) & (bands < _END + _MAX_STEP)]
    steps = np.diff(inside)
    if inside.size < 4 or steps.max() > _MAX_STEP:
        raise ValueError(
            f"{describe_grid(bands)} is too coarse for colour: steps may be {_MAX_STEP:g} nm at most, "
            "better 10 or 20 nm"
        )
    weights = _lagrange_matrix(bands, fine).T @ products
    weights.setflags(write=False)
    return weights


@lru_cache(maxsize=32)
def _illuminated_observer(
    illuminant: str, observer: str
) -> tuple[Float[np.ndarray, "fine"], Float[np.ndarray, "fine 3"]]:
    """Illuminant times colour matching functions at 1 nm, scaled so that the y column sums to 1."""
    colour = colour_science()
    matching = colour.MSDS_CMFS[observer]
    start, end = max(_START, matching.shape.start), min(_END, matching.shape.end)
    shape = colour.SpectralShape(start, end, 1)
    # Copies: align changes its object, which here is colour-science's own table.
    xyz_bar = matching.copy().align(shape).values
    lamp = colour.SDS_ILLUMINANTS[illuminant].copy().align(shape).values
    products = xyz_bar * lamp[:, None]
    return shape.wavelengths, products / products[:, 1].sum()


def _lagrange_matrix(
    bands: Float[np.ndarray, "bands"], points: Float[np.ndarray, "points"]
) -> Float[np.ndarray, "points bands"]:
    """Interpolation from the bands to the points: cubic inside, parabolic at the ends, constant beyond."""
    x = np.clip(points, bands[0], bands[-1])
    last = bands.size - 1
    left = np.clip(np.searchsorted(bands, x, side="right") - 1, 0, last - 1)
    matrix = np.zeros((points.size, bands.size))
    for offset in range(-1, 3):
        node = left + offset
        here = (node >= 0) & (node <= last)
        term = np.ones_like(x)
        for other in range(-1, 3):
            m = left + other
            if other == offset:
                continue
            use = here & (m >= 0) & (m <= last)
            a, b = bands[np.clip(m, 0, last)], bands[np.clip(node, 0, last)]
            term = np.where(use, term * (x - a) / np.where(use, b - a, 1.0), term)
        rows = np.flatnonzero(here)
        matrix[rows, node[rows]] += term[rows]
    return matrix


def white_point(wavelengths: Grid, illuminant: str = "D65", observer: str | int = CIE_1931) -> Float[np.ndarray, "3"]:
    """XYZ of the perfect diffuser on this grid, (3,), Y = 1; the same on every grid up to rounding."""
    return colour_weights(wavelengths, illuminant, observer).sum(axis=0)


def xyz(
    wavelengths: Grid,
    reflectance: Spectra,
    *,
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
) -> Float[Array, "*batch 3"]:
    """CIE XYZ of reflectance spectra, Y = 1 for the perfect diffuser.

    Args:
        wavelengths: (bands,), nm.
        reflectance: (..., bands), fraction.
        illuminant, observer: see `colour_weights`.

    Raises:
        ValueError: as `colour_weights`, or the last axis of `reflectance` is not the bands.
    """
    weights = colour_weights(wavelengths, illuminant, observer)
    values = as_float_array(reflectance)
    if values.shape[-1:] != weights.shape[:1]:
        raise ValueError(f"reflectance of shape {values.shape} does not end in the {weights.shape[0]} bands given")
    return jnp.matmul(values, jnp.asarray(weights, dtype=values.dtype), precision="highest")


def lab(
    wavelengths: Grid,
    reflectance: Spectra,
    *,
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
) -> Float[Array, "*batch 3"]:
    """CIE 1976 L*a*b* of reflectance spectra under their own illuminant.

    The white is that of the same weights, so the perfect diffuser is (100, 0, 0).

    Args and errors as `xyz`. Source: CIE 15:2018, section 8.2.1.
    """
    values = xyz(wavelengths, reflectance, illuminant=illuminant, observer=observer)
    white = white_point(wavelengths, illuminant, observer)
    return xyz_to_lab(values, jnp.asarray(white, dtype=values.dtype))


def xyz_to_lab(xyz: Numbers, white: Numbers) -> Float[Array, "*batch 3"]:
    """CIE 1976 L*a*b* of XYZ, (..., 3), relative to a white, (3,), on the same scale."""
    values = as_float_array(xyz)
    ratio = values / as_float_array(white).astype(values.dtype)
    dark = ratio <= (6 / 29) ** 3
    # Where the line is taken, the root gets 1, so that its gradient stays finite.
    root = jnp.cbrt(jnp.where(dark, 1.0, ratio))
    f = jnp.where(dark, ratio / (3 * (6 / 29) ** 2) + 4 / 29, root)
    fx, fy, fz = f[..., 0], f[..., 1], f[..., 2]
    return jnp.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], axis=-1)


def srgb(
    wavelengths: Grid,
    reflectance: Spectra,
    *,
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
    clip: bool = True,
) -> Float[Array, "*batch 3"]:
    """Encoded sRGB of reflectance spectra, for a screen.

    XYZ is adapted by the Bradford transform from the white of the illuminant to that of sRGB (D65), so
    that the perfect diffuser is (1, 1, 1) under every illuminant.

    Args:
        wavelengths, reflectance, illuminant, observer: as `xyz`.
        clip: clip to [0, 1]. Unclipped values tell how far outside the gamut a colour lies; below zero
            they follow the straight part of the encoding.

    Raises:
        ValueError: as `xyz`.

    Source: IEC 61966-2-1:1999; matrices from its primaries, not rounded.
    """
    values = xyz(wavelengths, reflectance, illuminant=illuminant, observer=observer)
    return xyz_to_srgb(values, white_point(wavelengths, illuminant, observer), clip=clip)


def xyz_to_srgb(xyz: Numbers, white: Grid, *, clip: bool = True) -> Float[Array, "*batch 3"]:
    """Encoded sRGB of XYZ, (..., 3), seen under a white, (3,), on the same scale: white becomes (1, 1, 1).

    Notes and source as `srgb`.
    """
    values = as_float_array(xyz)
    matrix = _screen_matrix(tuple(np.asarray(white, float).tolist()))
    linear = jnp.matmul(values, jnp.asarray(matrix, dtype=values.dtype), precision="highest")
    if clip:
        linear = jnp.clip(linear, 0.0, 1.0)
    dark = linear <= 0.0031308
    power = 1.055 * _root(jnp.where(dark, 1.0, linear)) - 0.055
    encoded = jnp.where(dark, 12.92 * linear, power)
    # Rounding in the power would otherwise leave white a hair above 1.
    return jnp.clip(encoded, 0.0, 1.0) if clip else encoded


@jax.custom_jvp
def _root(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """x^(1/2.4) of positive x: in float64 four times faster than its power, to a few units in the last place.

    The power in float32 and one step of Halley's iteration for y^12 = x^5, which leaves the cube of its error.
    """
    if x.dtype != jnp.float64:
        return x ** (1 / 2.4)
    y = (x.astype(jnp.float32) ** (1 / 2.4)).astype(x.dtype)
    square = y * y
    fourth = square * square
    rest = (x * x) * (x * x) * x / (fourth * fourth * fourth) - 1.0
    return y * (1.0 + rest * (1.0 / 12.0 - (11.0 / 288.0) * rest))


@_root.defjvp
def _root_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    root = _root(*primals)
    return root, root / (2.4 * primals[0]) * tangents[0]


@lru_cache(maxsize=128)
def _screen_matrix(white: tuple[float, ...]) -> Float[np.ndarray, "3 3"]:
    """Matrix M such that ``xyz @ M`` is linear sRGB, adapted from the illuminant's white."""
    colour = colour_science()
    space = colour.RGB_COLOURSPACES["sRGB"]
    to_xyz = colour.normalised_primary_matrix(space.primaries, space.whitepoint)
    adapt = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        np.asarray(white), to_xyz.sum(axis=1), transform="Bradford"
    )
    return (np.linalg.inv(to_xyz) @ adapt).T


def delta_e_2000(lab1: Numbers, lab2: Numbers) -> Float[np.ndarray, "*batch"]:
    """CIEDE2000 colour difference between Lab colours, (..., 3) each, by colour-science; NumPy only."""
    return np.asarray(colour_science().delta_E(np.asarray(lab1), np.asarray(lab2), method="CIE 2000"))


def delta_e_of_spectra(
    wavelengths: Grid,
    one: Spectra,
    other: Spectra,
    *,
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
) -> Float[np.ndarray, "*batch"]:
    """CIEDE2000 colour difference between reflectance spectra, (..., bands) each, which broadcast.

    Args and errors as `xyz`; NumPy only, as `delta_e_2000`.
    """
    seen = (np.asarray(lab(wavelengths, s, illuminant=illuminant, observer=observer)) for s in (one, other))
    return delta_e_2000(*np.broadcast_arrays(*seen))
