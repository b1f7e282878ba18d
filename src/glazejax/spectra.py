"""Wavelength grids in nm, and checks and resampling of spectra that live on them."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

Bands: TypeAlias = Float[np.ndarray, "bands"]
"""A number a band."""

# What callers may pass: arrays of either kind, numbers, or lists of them. What takes them checks
# the shape itself, in words: a grid is (bands,), spectra are (..., bands).
Numbers: TypeAlias = ArrayLike | Sequence[Any]
Grid: TypeAlias = Numbers
Spectra: TypeAlias = Numbers

DEFAULT_WAVELENGTHS: Float[np.ndarray, "41"] = np.arange(380.0, 781.0, 10.0)
DEFAULT_WAVELENGTHS.setflags(write=False)

# White paper under an ultraviolet-rich lamp and highlights on a calibrated camera both exceed 1.
MAX_FRACTION = 1.7
# A whole spectrum below 2 % is darker than any smooth varnished paint, whose surface alone gives 4
# %.
MIN_PERCENT = 2.0
# CxF3's own bound for a reflectance. Above it the unit or the scale that a file declares is wrong.
MAX_DECLARED = 3.0

# Numbers up to which NumPy computes what is known.
_SMALL = 1 << 16


def as_array(values: Numbers) -> Array | np.ndarray:
    """Values as they are if an array, else as a NumPy array, or as a JAX one if JAX traces a part
    of them.

    Raises:
        ValueError: some are masked.
    """
    if isinstance(values, float):
        return np.asarray(values)
    if isinstance(values, np.ma.MaskedArray):
        if missing := int(np.ma.getmaskarray(values).sum()):
            raise ValueError(
                f"{missing} of {values.size} values are masked, and what they are is not known: "
                "leave them out, or fill them: values.filled(0.5)"
            )
        return np.asarray(values)
    if isinstance(values, np.ndarray | jax.Array):
        return values
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(values))
    return jnp.asarray(values) if traced else np.asarray(values)


def concrete(values: Numbers) -> np.ndarray | None:
    """Values as a NumPy array, or None while JAX traces them and they have no value yet."""
    array = as_array(values)
    return None if isinstance(array, Tracer) else np.asarray(array)


# Python's numbers have a weak type, which the one that is written here takes from them.
_to_jax = jax.jit(lambda number: jnp.asarray(number, number.dtype))


def as_float_array(values: Numbers) -> Float[Array, "..."]:
    """Values as a JAX floating-point array; integers become the default float type."""
    # A program takes a number to JAX in a tenth of the time that `asarray` needs, and Python's
    # numbers faster than NumPy's arrays.
    if isinstance(values, float):
        return _to_jax(values)
    array = as_array(values)
    array = _to_jax(array) if np.ndim(array) == 0 else jnp.asarray(array)
    return (
        array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(jnp.result_type(float))
    )


def small(*arrays: Any) -> bool:
    """Test whether all arrays are known real numbers, and so few that NumPy is done before JAX has
    compiled anything.
    """
    concrete_only = all(
        not isinstance(array, Tracer) and array.dtype.kind in "fiub" for array in arrays
    )
    return concrete_only and sum(array.size for array in arrays) <= _SMALL


def numpy_or_jax(function: Callable[..., Any], *arrays: Any) -> Any:
    """``function(numpy or jax.numpy, *arrays)``, an array of the library that computed it: NumPy
    where all arrays are known and small.

    JAX compiles a program for each operation and each shape. That takes some 20 ms, and is what the
    first answer waits for; NumPy takes microseconds.
    """
    arrays = tuple(map(as_array, arrays))
    if not small(*arrays):
        return function(jnp, *arrays)
    with np.errstate(all="ignore"):
        return function(np, *map(np.asarray, arrays))


def on_numpy_or_jax(function: Callable[..., Any], *arrays: Any) -> Float[Array, "..."]:
    """Result of `numpy_or_jax`, as a JAX array."""
    return jnp.asarray(numpy_or_jax(function, *arrays))


def matmul(xp: Any, one: Any, other: Any) -> Any:
    """Matrix product by NumPy or JAX (``xp``), in full precision on any device."""
    return np.matmul(one, other) if xp is np else jnp.matmul(one, other, precision="highest")


def validate_wavelengths(wavelengths: Grid) -> Bands:
    """Check a wavelength grid and return it as a read-only float64 array.

    Args:
        wavelengths: (bands,), nm, strictly ascending, finite, positive. They must be concrete: the
            grid of a spectrum is part of a program, not of its data.

    Raises:
        ValueError: the grid is traced, empty, not one-dimensional, or holds a wrong value (which is
            named).
    """
    grid = concrete(wavelengths)
    if grid is None:
        raise ValueError(
            "wavelengths must be known when a function is traced: close over them, or pass NumPy"
        )
    try:
        grid = np.array(grid, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError("wavelengths must be numbers, in nm") from None
    if grid.ndim != 1 or grid.size == 0:
        raise ValueError(
            f"wavelengths must be a non-empty one-dimensional array, not of shape {grid.shape}"
        )
    wrong = np.flatnonzero(~np.isfinite(grid) | (grid <= 0))
    if wrong.size:
        i = int(wrong[0])
        raise ValueError(
            f"wavelengths must be finite and positive: number {i + 1} is {grid[i]:g} nm"
        )
    if (again := np.flatnonzero(np.diff(np.sort(grid)) == 0)).size:
        raise ValueError(
            f"wavelengths must differ: {np.sort(grid)[again[0]]:g} nm is given twice; leave one out"
        )
    falls = np.flatnonzero(np.diff(grid) <= 0)
    if falls.size:
        i = int(falls[0]) + 1
        raise ValueError(
            f"wavelengths must ascend: number {i + 1} is {grid[i]:g} nm after {grid[i - 1]:g} "
            "nm; sort them"
        )
    if grid[-1] < 1e-4:
        raise ValueError(
            f"wavelengths are in nm, and {grid[-1]:g} looks like metres: multiply them by 1e9"
        )
    if grid[-1] < 10:
        raise ValueError(
            f"wavelengths are in nm, and {grid[-1]:g} looks like micrometres: multiply them by 1000"
        )
    grid.setflags(write=False)
    return grid


def describe_grid(wavelengths: Bands) -> str:
    """Grid in a few words, such as ``380-780 nm step 10 (41 bands)``."""
    steps = np.diff(wavelengths)
    even = steps.size > 0 and np.allclose(steps, steps[0])
    step = f" step {steps[0]:g}" if even else " uneven" if steps.size else ""
    bands = "1 band" if wavelengths.size == 1 else f"{wavelengths.size} bands"
    return f"{wavelengths[0]:g}-{wavelengths[-1]:g} nm{step} ({bands})"


def ranges(wavelengths: Bands, chosen: Bool[np.ndarray, "bands"]) -> str:
    """The chosen bands in words, such as ``400-470, 600 nm``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    runs = [
        (wavelengths[a], wavelengths[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    if not runs:
        return "none"
    return ", ".join(f"{a:g}" if a == b else f"{a:g}-{b:g}" for a, b in runs) + " nm"


def common_range(grids: Iterable[Float[np.ndarray, "_"]]) -> tuple[float, float]:
    """First and last wavelength, nm, that all grids reach; the first may lie above the last."""
    ends = [(float(grid[0]), float(grid[-1])) for grid in grids]
    return max(low for low, _ in ends), min(high for _, high in ends)


def lie_between(wavelengths: Bands, low: float, high: float) -> Bool[np.ndarray, "bands"]:
    """Test whether each band lies between two wavelengths, nm, to a millionth of a nanometre."""
    return (wavelengths >= low - 1e-6) & (wavelengths <= high + 1e-6)


def same_grid(first: Bands, second: Float[np.ndarray, "others"]) -> bool:
    """Test whether two grids agree to a millionth of a nanometre."""
    return first.shape == second.shape and bool((np.abs(first - second) <= 1e-6).all())


def as_fraction(reflectance: Spectra, name: str) -> Bands:
    """Check a measured spectrum, (bands,), fraction or percent, and express it as a fraction.

    It is in percent if it exceeds 2, see `scale_by_size`. Fractions may overshoot 1 up to 1.7,
    which fluorescence and calibration do.

    Raises:
        ValueError: another shape, or a value that is NaN, infinite, negative or too large; it is
            named.
    """
    values = np.array(reflectance, dtype=np.float64)
    if values.ndim != 1 or values.size == 0:
        raise ValueError(f"reflectance of {name} must be of shape (bands,), not {values.shape}")
    for complaint, wrong in (("not finite", ~np.isfinite(values)), ("negative", values < 0)):
        if wrong.any():
            i = int(wrong.argmax())
            raise ValueError(f"reflectance of {name} is {complaint} at band {i + 1}: {values[i]:g}")
    peak = values.max(keepdims=True)
    cure = "divide by what stands for a reflectance of 1"
    scale = scale_by_size(values[None], peak, [name], [], cure)
    if peak[0] > MAX_FRACTION * scale:
        raise ValueError(
            f"reflectance of {name} reaches {peak[0]:g}, too much for a fraction (at most "
            f"{MAX_FRACTION:g}); {cure}"
        )
    return values / scale


def scale_by_size(
    rows: Float[np.ndarray, "rows bands"],
    peaks: Float[np.ndarray, "rows"],
    names: Sequence[str],
    notes: list[str],
    cure: str,
) -> float:
    """100 for spectra in percent, 1 for fractions, where nobody says their unit: judged by the
    brightest, which exceeds 2 in percent.

    Args:
        rows: finite.
        peaks: their largest values.
        names: of the rows.
        notes: one is added that names what is dark in percent.
        cure: what to do about values that are too much for both.

    Raises:
        ValueError: percent and fraction are mixed, or values are too much for both.
    """
    brightest = float(peaks.max())
    if brightest <= MIN_PERCENT:
        return 1.0
    brightest_name = names[int(peaks.argmax())]
    dark = np.flatnonzero(peaks <= MAX_FRACTION)
    # Few paints are below 0.5 % at half of the bands, or below 0.2 % at a tenth: such a spectrum
    # is in fractions.
    half = (rows[dark] < 0.5).mean(axis=1) > 0.5
    fractions = dark[half | ((rows[dark] < 0.2).mean(axis=1) > 0.1)]
    if fractions.size:
        if brightest <= MAX_DECLARED:
            return 1.0
        raise ValueError(
            f"percent and fraction are mixed: {brightest_name} in percent (maximum above "
            f"{MIN_PERCENT:g}), {list_names([names[int(i)] for i in fractions])} in fractions; "
            "bring all to one unit, or say it: --unit percent"
        )
    if brightest > 100 * MAX_FRACTION:
        raise ValueError(
            f"reflectance of {brightest_name} reaches {brightest:g}, too much for a fraction (at "
            f"most {MAX_FRACTION:g}) and for percent (at most {100 * MAX_FRACTION:g}); {cure}"
        )
    if dark.size:
        notes.append(
            f"{list_names([names[int(i)] for i in dark])}: dark, in percent as {brightest_name} is"
        )
    return 100.0


def list_names(names: Sequence[str]) -> str:
    """First few of some names."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def interpolation_matrix(
    wavelengths: Grid, new_wavelengths: Grid
) -> Float[np.ndarray, "bands new"]:
    """Matrix of linear interpolation: ``values @ matrix`` lies on the new grid.

    Raises:
        ValueError: a grid is not legal, or the new one reaches beyond the old one.
    """
    old = validate_wavelengths(wavelengths)
    new = validate_wavelengths(new_wavelengths)
    inside = lie_between(new, old[0], old[-1])
    if not inside.all():
        covered = new[inside]
        fix = (
            f"keep to {describe_grid(covered)}"
            if covered.size
            else "they do not meet; choose another spectrum"
        )
        raise ValueError(
            f"cannot resample {describe_grid(old)} to {describe_grid(new)} without guessing: {fix}"
        )
    # Unit spectra of all bands, on the new grid.
    return np.stack([np.interp(new, old, unit) for unit in np.eye(old.size)])


def resample(
    wavelengths: Grid,
    values: Spectra,
    new_wavelengths: Grid,
) -> Float[Array, "*batch new"] | Float[np.ndarray, "*batch new"]:
    """Spectra on another grid, by linear interpolation, never extrapolated.

    Linear interpolation keeps values between their neighbours (no negative coefficient can appear)
    and is linear in the values, hence differentiable; its error is at most step^2 / 8 times the
    curvature.
    It samples and does not average: smooth a noisy fine spectrum first.

    Args:
        wavelengths: (bands,), nm.
        values: (..., bands), any quantity. NumPy in, NumPy out; JAX in, JAX out.
        new_wavelengths: (new,), nm, within the range of `wavelengths`.

    Raises:
        ValueError: a grid is not legal, the new one reaches beyond the old one, or shapes do not
            match.
    """
    matrix = interpolation_matrix(wavelengths, new_wavelengths)
    values = as_array(values)
    if values.shape[-1:] != matrix.shape[:1]:
        raise ValueError(f"values of shape {values.shape} do not end in {matrix.shape[0]} bands")
    if isinstance(values, jax.Array):
        array = as_float_array(values)
        return matmul(jnp, array, matrix.astype(array.dtype))
    return np.asarray(values, dtype=np.float64) @ matrix
