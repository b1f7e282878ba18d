"""Spectrum -> XYZ, Lab, sRGB and colour differences.

Colour matching functions and illuminants are colour-science's tables, which `glazejax.cie` carries.
What depends only on the grid, the illuminant and the observer is folded into one matrix of weights,
so that a spectrum, or a million of them, becomes XYZ by one matrix product, and every function but
`delta_e_2000` can be differentiated.

What is known and small is computed by NumPy (`glazejax.spectra.on_numpy_or_jax`), anything else is
one compiled program.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .cie import CIE_1931, find_illuminant, find_observer, illuminants, observers
from .cie.difference import ciede2000
from .spectra import (
    Bands,
    Grid,
    Numbers,
    Spectra,
    as_array,
    describe_grid,
    matmul,
    on_numpy_or_jax,
    small,
    validate_wavelengths,
)

# ASTM E308: the working range in nm.
_START = 360
_END = 780
# Beyond 20 nm ASTM E308 gives no tables; beyond this, cubic interpolation says nothing about a
# paint.
_MAX_STEP = 40.0
# IEC 61966-2-1: chromaticities of the primaries and of white, and the light up to which the
# encoding is straight.
SRGB_PRIMARIES = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
SRGB_WHITE = (0.3127, 0.3290)
_STRAIGHT = 0.0031308
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def colour_science() -> Any:
    """The colour-science package (an object in place of its module), imported without warnings
    about what it lacks.

    It takes a second or two, for it brings matplotlib, pandas and SciPy: nothing that every command
    does asks for it.
    """
    printing = np.get_printoptions()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    # Its import switches all of NumPy to an old print format that drops digits.
    np.set_printoptions(**printing)
    return colour


def colour_weights(
    wavelengths: Grid, illuminant: str = "D65", observer: str | int = CIE_1931
) -> Float[np.ndarray, "bands 3"]:
    """Weights w such that ``reflectance @ w`` is XYZ, with Y = 1 for the perfect diffuser.

    The reflectance is interpolated to 1 nm by Lagrange's cubic through the four nearest bands (a
    parabola in the first and last step), and the end bands are repeated outwards to 360 and 780 nm;
    sums over the product of illuminant and observer at 1 nm are the weights. On even grids of 10 or
    20 nm these are the weights of ASTM E2022, which ASTM E308 tabulates; any other grid is treated
    the same way. The columns sum to the white point.

    Args:
        wavelengths: (bands,), nm; even or not.
        illuminant: any name of `glazejax.cie.illuminants`, such as D65, A, FL2, LED-B3.
        observer: full name, or 2, 10, 1931, 1964.

    Returns:
        (bands, 3), read-only; the same array for the same arguments.

    Raises:
        ValueError: a grid that is too coarse or covers too little of the visible range, or an
            unknown name.

    Source: ASTM E308-15, ASTM E2022-11.
    """
    grid = validate_wavelengths(wavelengths)
    return _weights(tuple(grid.tolist()), find_illuminant(illuminant), find_observer(observer))


@lru_cache(maxsize=128)
def _weights(
    grid: tuple[float, ...], illuminant: str, observer: str
) -> Float[np.ndarray, "bands 3"]:
    """Weights for full names, read-only; see `colour_weights`."""
    lamp = illuminants()[illuminant]
    curves = observers()[observer]
    table = curves[0].wavelengths
    visible = (table >= _START) & (table <= _END)
    fine = table[visible]
    # Linear between a lamp's bands, and its end bands repeated outwards.
    power = np.interp(fine, lamp.wavelengths, lamp.values)
    products = np.stack([curve.values[visible] for curve in curves], axis=1) * power[:, None]
    # The y column sums to 1.
    products /= products[:, 1].sum()
    bands = np.asarray(grid)
    # What lies beyond the bands is guessed.
    beyond = (fine < bands[0]) | (fine > bands[-1])
    guessed = float((np.abs(products[beyond]).sum(axis=0) / np.abs(products).sum(axis=0)).max())
    # Share of a tristimulus value that may rest on repeating the end bands; 420-680 nm stays below
    # .07.
    if guessed > 0.1:
        raise ValueError(
            f"{describe_grid(bands)} misses {guessed:.0%} of a tristimulus value: "
            "colour needs spectra from about 420 to 680 nm at least, better from 400 to 700 nm"
        )
    near = bands[(bands > _START - _MAX_STEP) & (bands < _END + _MAX_STEP)]
    if near.size < 4 or np.diff(near).max() > _MAX_STEP:
        raise ValueError(
            f"{describe_grid(bands)} is too coarse for colour: steps may be {_MAX_STEP:g} nm at "
            "most, better 10 or 20 nm"
        )
    weights = _lagrange_matrix(bands, fine).T @ products
    weights.setflags(write=False)
    return weights


def _lagrange_matrix(
    bands: Bands, points: Float[np.ndarray, "points"]
) -> Float[np.ndarray, "points bands"]:
    """Interpolation from the bands to the points: cubic inside, parabolic at the ends, constant
    beyond.
    """
    x = np.clip(points, bands[0], bands[-1])
    last = bands.size - 1
    lower = np.clip(np.searchsorted(bands, x, side="right") - 1, 0, last - 1)
    matrix = np.zeros((points.size, bands.size))
    # Lagrange's polynomials on the four bands around each point, on three at the ends.
    for offset in range(-1, 3):
        node = lower + offset
        present = (node >= 0) & (node <= last)
        term = np.ones_like(x)
        for other_offset in range(-1, 3):
            m = lower + other_offset
            if other_offset == offset:
                continue
            use = present & (m >= 0) & (m <= last)
            a = bands[np.clip(m, 0, last)]
            b = bands[np.clip(node, 0, last)]
            term = np.where(use, term * (x - a) / np.where(use, b - a, 1.0), term)
        rows = np.flatnonzero(present)
        matrix[rows, node[rows]] += term[rows]
    return matrix


def white_point(
    wavelengths: Grid, illuminant: str = "D65", observer: str | int = CIE_1931
) -> Float[np.ndarray, "3"]:
    """XYZ of the perfect diffuser on this grid, (3,), Y = 1; the same on every grid up to
    rounding.
    """
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
        ValueError: as `colour_weights`, the last axis of `reflectance` is not the bands, or it is
            in percent.
    """
    return _compute(matmul, *_band_weights(wavelengths, reflectance, illuminant, observer))


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
    values, weights = _band_weights(wavelengths, reflectance, illuminant, observer)
    return _compute(
        _lab_of_spectra, values, weights, white_point(wavelengths, illuminant, observer)
    )


def xyz_to_lab(xyz: Numbers, white: Numbers) -> Float[Array, "*batch 3"]:
    """CIE 1976 L*a*b* of XYZ, (..., 3), relative to a white, (3,), on the same scale."""
    return _compute(_lab_of_xyz, xyz, white)


def lab_to_xyz(lab: Numbers, white: Grid) -> Float[np.ndarray, "*batch 3"]:
    """XYZ of CIE 1976 L*a*b*, (..., 3), on the scale of the white, (3,): `xyz_to_lab` backwards;
    NumPy only.
    """
    lightness, a, b = np.moveaxis(np.asarray(lab, float), -1, 0)
    fy = (lightness + 16) / 116
    f = np.stack([fy + a / 500, fy, fy - b / 200], axis=-1)
    # Below 6/29 the cube root is replaced by a straight line.
    ratio = np.where(f <= 6 / 29, 3 * (6 / 29) ** 2 * (f - 4 / 29), f**3)
    return ratio * np.asarray(white, float)


def srgb(
    wavelengths: Grid,
    reflectance: Spectra,
    *,
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
    clip: bool = True,
) -> Float[Array, "*batch 3"]:
    """Encoded sRGB of reflectance spectra, for a screen.

    XYZ is adapted by the Bradford transform from the white of the illuminant to that of sRGB (D65),
    so that the perfect diffuser is (1, 1, 1) under every illuminant.

    Args:
        wavelengths, reflectance, illuminant, observer: as `xyz`.
        clip: clip to [0, 1]. Unclipped values show how far outside the gamut a colour lies; below
            zero they follow the straight part of the encoding.

    Raises:
        ValueError: as `xyz`.

    Source: IEC 61966-2-1:1999; matrices from its primaries, not rounded.
    """
    values, weights = _band_weights(wavelengths, reflectance, illuminant, observer)
    matrix = _screen_matrix(white_point(wavelengths, illuminant, observer))
    return _compute(_clipped_srgb if clip else _srgb_of_light, values, weights @ matrix)


def xyz_to_srgb(xyz: Numbers, white: Grid, *, clip: bool = True) -> Float[Array, "*batch 3"]:
    """Encoded sRGB of XYZ, (..., 3), seen under a white, (3,), on the same scale: white becomes (1,
    1, 1).

    Notes and source as `srgb`.
    """
    matrix = _screen_matrix(np.asarray(white, float))
    return _compute(_clipped_srgb if clip else _srgb_of_light, xyz, matrix)


def srgb_to_xyz(encoded: Numbers) -> Float[np.ndarray, "*batch 3"]:
    """XYZ of encoded sRGB, (..., 3), in [0, 1], as a screen shows it, Y = 1 for its white; NumPy
    only.

    Source: IEC 61966-2-1:1999; matrices from its primaries, not rounded.
    """
    return linear_srgb(np.asarray(encoded, float)) @ rgb_matrix().T


def srgb_to_lab(encoded: Numbers) -> Float[Array, "*batch 3"]:
    """CIE 1976 L*a*b* under D65 of encoded sRGB, (..., 3), in [0, 1], relative to the screen's
    white; 8 bits over 255.

    What `srgb` gives under D65 comes back as the `lab` under D65 of the same spectrum. Runs under
    jit and grad.

    Raises:
        ValueError: the last axis is not three long, or known values are those of 8 bits.

    Example:
        >>> print(srgb_to_lab([1.0, 0.0, 0.0]).round(1))
        [53.2 80.1 67.2]

    Source: as `srgb_to_xyz` and `xyz_to_lab`.
    """
    values = as_array(encoded)
    screen = rgb_matrix()
    if values.shape[-1:] != (3,):
        raise ValueError(
            f"sRGB of shape {values.shape} does not end in the three numbers red, green and blue"
        )
    _check_scale("sRGB", values, "like 0 to 255: divide it by 255")
    return _compute(_lab_of_srgb, values, screen.T, screen.sum(axis=1))


def _band_weights(
    wavelengths: Grid, reflectance: Spectra, illuminant: str, observer: str | int
) -> tuple[Array | np.ndarray, Float[np.ndarray, "bands 3"]]:
    """Spectra as an array, and the weights of their bands."""
    weights = colour_weights(wavelengths, illuminant, observer)
    values = as_array(reflectance)
    if values.shape[-1:] != weights.shape[:1]:
        raise ValueError(
            f"reflectance of shape {values.shape} does not end in the {weights.shape[0]} bands "
            "given"
        )
    # Of readings above 1 some are real; half of all bands in percent are above 2 even of blacks.
    _check_scale("reflectance", values, "like percent: divide it by 100")
    return values, weights


def _check_scale(what: str, values: Array | np.ndarray, slip: str) -> None:
    """Refuse known values most of which lie far above 1; of many NumPy's first are looked at."""
    if not (small(values) or isinstance(values, np.ndarray)):
        return
    typical = np.asarray(values).ravel()[: 1 << 16]
    if typical.size and np.median(typical) > 2.0:
        raise ValueError(f"{what} is about {np.median(typical):.3g}, which looks {slip}")


def _compute(
    core: Callable[..., Any], values: Numbers, *constants: Numbers
) -> Float[Array, "*batch 3"]:
    """``core(numpy or jax.numpy, values, ...)``: what is known and small by NumPy, else one
    compiled program.
    """
    arrays = [as_array(value) for value in (values, *constants)]
    # The type that JAX computes in: float32 unless the user has asked for more, and never less.
    kind = arrays[0].dtype if jnp.issubdtype(arrays[0].dtype, jnp.floating) else np.dtype(float)
    kind = kind if kind.itemsize >= 4 else np.dtype(np.float32)
    kind = jax.dtypes.canonicalize_dtype(kind)
    arrays = [array if array.dtype == kind else array.astype(kind) for array in arrays]
    return on_numpy_or_jax(core, *arrays) if small(*arrays) else _compile(core, *arrays)


@partial(jax.jit, static_argnums=0)
def _compile(core: Callable[..., Any], *arrays: Array) -> Array:
    return core(jnp, *arrays)


def _lab_of_spectra(xp: ModuleType, values: Any, weights: Any, white: Any) -> Any:
    return _lab_of_xyz(xp, matmul(xp, values, weights), white)


def _lab_of_xyz(xp: ModuleType, values: Any, white: Any) -> Any:
    ratio = values / white
    dark = ratio <= (6 / 29) ** 3
    # Where the line is taken, the root gets 1, so that its gradient stays finite.
    root = xp.cbrt(xp.where(dark, 1.0, ratio))
    f = xp.where(dark, ratio / (3 * (6 / 29) ** 2) + 4 / 29, root)
    fx = f[..., 0]
    fy = f[..., 1]
    fz = f[..., 2]
    return xp.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], axis=-1)


def _lab_of_srgb(xp: ModuleType, values: Any, matrix: Any, white: Any) -> Any:
    return _lab_of_xyz(xp, matmul(xp, linear_srgb(values, xp), matrix), white)


def linear_srgb(values: Any, xp: ModuleType = np) -> Any:
    """Linear values of encoded sRGB: `encoded_srgb` backwards; `xp` as there."""
    # The end of the straight part, encoded.
    return xp.where(
        values <= 12.92 * _STRAIGHT, values / 12.92, ((abs(values) + 0.055) / 1.055) ** 2.4
    )


def _srgb_of_light(xp: ModuleType, values: Any, matrix: Any) -> Any:
    return encoded_srgb(matmul(xp, values, matrix), xp)


def _clipped_srgb(xp: ModuleType, values: Any, matrix: Any) -> Any:
    # Rounding in the power would otherwise leave white a hair above 1.
    return xp.clip(encoded_srgb(xp.clip(matmul(xp, values, matrix), 0.0, 1.0), xp), 0.0, 1.0)


def encoded_srgb(linear: Any, xp: ModuleType = np) -> Any:
    """Encoded sRGB of linear values, of any shape (IEC 61966-2-1); `xp` is numpy or jax.numpy, as
    the values are.
    """
    dark = linear <= _STRAIGHT
    above = xp.where(dark, 1.0, linear)
    power = 1.055 * (above ** (1 / 2.4) if xp is np else _root(above)) - 0.055
    return xp.where(dark, 12.92 * linear, power)


@jax.custom_jvp
def _root(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """x^(1/2.4) of positive x: in float64 four times faster than its power, to a few units in the
    last place.

    The power in float32 and one step of Halley's iteration for y^12 = x^5, which leaves the cube of
    its error.
    """
    if x.dtype != jnp.float64:
        return x ** (1 / 2.4)
    y = (x.astype(jnp.float32) ** (1 / 2.4)).astype(x.dtype)
    square = y * y
    fourth = square * square
    residual = (x * x) * (x * x) * x / (fourth * fourth * fourth) - 1.0
    return y * (1.0 + residual * (1.0 / 12.0 - (11.0 / 288.0) * residual))


@_root.defjvp
def _root_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    root = _root(*primals)
    return root, root / (2.4 * primals[0]) * tangents[0]


def _screen_matrix(white: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Matrix M such that ``xyz @ M`` is linear sRGB, adapted from the illuminant's white."""
    to_xyz = rgb_matrix()
    adapt = bradford(white, to_xyz.sum(axis=1))
    return (np.linalg.inv(to_xyz) @ adapt).T


def rgb_matrix(
    primaries: Sequence[tuple[float, float]] = SRGB_PRIMARIES,
    white: tuple[float, float] = SRGB_WHITE,
) -> Float[np.ndarray, "3 3"]:
    """Matrix M such that ``M @ linear`` is XYZ of a linear RGB, by default sRGB; its columns sum to
    the white, Y = 1.
    """
    x, y = white
    columns = np.array([[a, b, 1 - a - b] for a, b in primaries]).T
    return columns * np.linalg.solve(columns, [x / y, 1.0, (1 - x - y) / y])


def bradford(
    white: Float[np.ndarray, "3"], seen: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 3"]:
    """Matrix M such that ``M @ xyz`` looks under the white `seen` as the colour does under `white`.

    Source: K. M. Lam, thesis, University of Bradford (1985), linear as in ICC.1:2022, annex E.
    """
    # Into the cones' responses, each scaled from white to white, and back.
    return np.linalg.inv(_BRADFORD) @ np.diag((_BRADFORD @ seen) / (_BRADFORD @ white)) @ _BRADFORD


def delta_e_2000(lab1: Numbers, lab2: Numbers) -> Float[np.ndarray, "*batch"]:
    """CIEDE2000 colour difference between Lab colours, (..., 3) each; NumPy only.

    Raises:
        ValueError: colours that are not of three numbers, or batches that do not broadcast.

    Example:
        >>> round(float(delta_e_2000([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485])), 4)
        2.0425
    """
    first, second = (np.asarray(as_array(lab), float) for lab in (lab1, lab2))
    if first.shape[-1:] != (3,) or second.shape[-1:] != (3,):
        raise ValueError(
            f"Lab colours of shapes {first.shape} and {second.shape}: the last axis of each must "
            "be L*, a*, b*"
        )
    try:
        np.broadcast_shapes(first.shape, second.shape)
    except ValueError:
        raise ValueError(
            f"Lab colours of shapes {first.shape} and {second.shape} are no one batch: give as "
            "many of each, or one; lab[:, None] pairs each with each"
        ) from None
    return ciede2000(first, second)


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
    labs = (
        np.asarray(lab(wavelengths, s, illuminant=illuminant, observer=observer))
        for s in (one, other)
    )
    return delta_e_2000(*labs)
