"""Arguments of the functions of this package: one check of values and one rule of shapes for all of
them.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import ArrayLike

# What callers may pass. What takes it checks shapes and values itself, and says in words what is
# wrong.
Numbers: TypeAlias = ArrayLike | Sequence[Any]
BatchShape: TypeAlias = tuple[int, ...]
"""Shape of a batch, or the part of an array's shape that belongs to it."""

INDEX_RANGE = (1.0, 2.5)
"""Refractive indices the directions were calibrated for."""
LEAST_COSINE = 1e-4
"""A cosine that is traced may be as small as this."""

# Numbers up to which NumPy does what must be done to a known array.
_SMALL = 1 << 16


def _is_fraction(x: Any) -> Any:
    return (x >= 0) & (x <= 1)


def is_amount(x: Any) -> Any:
    """Where numbers are >= 0 and finite."""
    return (x >= 0) & (x < np.inf)


_AMOUNT = (">= 0 and finite", is_amount)
_FRACTION = ("in [0, 1] (a fraction, not percent)", _is_fraction)
# What is computed may be a hair beyond its range, by rounding.
_COMPUTED = (_FRACTION[0], lambda x: (x >= 0) & (x <= 1 + 1e-5))
_SIGNED_COSINE = ("in [-1, 1] (a cosine, not an angle)", lambda x: abs(x) <= 1 + 1e-5)
_COSINE = ("in (0, 1] (a cosine, not an angle)", lambda x: (x > 0) & (x <= 1))
_RANGES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "albedo": ("in [0, 1]", _is_fraction),
    "optical_thickness": _AMOUNT,
    "substrate_reflectance": _FRACTION,
    "refractive_index": ("in [1, 2.5]", lambda x: (x >= INDEX_RANGE[0]) & (x <= INDEX_RANGE[1])),
    "cos_incidence": _COSINE,
    "cos_viewing": _COSINE,
    "azimuth": ("a finite number of degrees", lambda x: abs(x) < np.inf),
    # Of two fluxes, times the thickness.
    "absorption": _AMOUNT,
    "scattering": _AMOUNT,
    "share": ("in [0, 1]", _is_fraction),
    "reflectance": _COMPUTED,
    "outer": _FRACTION,
    "inner": _FRACTION,
    "mean_cosine": ("in (-1, 1)", lambda x: abs(x) < 1),
    # Of two planes that are joined.
    "body_a": _COMPUTED,
    "body_b": _COMPUTED,
    "cos_light_a": _SIGNED_COSINE,
    "cos_light_b": _SIGNED_COSINE,
}


def concrete(value: Numbers) -> np.ndarray | None:
    """The value as a numpy array, or None while it is traced by jit or vmap.

    A value that is only differentiated by is known here (`glazejax.spectra.concrete` counts it as
    traced).
    """
    # Constants must not pass through a JAX function, which under jit would trace them too.
    primal = jax.lax.stop_gradient(value) if isinstance(value, Tracer) else value
    try:
        return np.asarray(primal)
    except jax.errors.TracerArrayConversionError:
        return None


def plain_number(value: Any) -> float | None:
    """A number of Python or numpy; None for an array, and for what is traced."""
    return float(value) if isinstance(value, int | float | np.floating | np.integer) else None


def smallest_cosine(*cosines: Any) -> float:
    """Smallest known cosine; one that is traced may be as small as 1e-4, None is a direction not
    asked for.
    """
    return min((_smallest(cosine) for cosine in cosines if cosine is not None), default=1.0)


def _smallest(cosine: Any) -> float:
    if isinstance(cosine, float):
        return cosine
    values = concrete(cosine)
    return LEAST_COSINE if values is None else float(values.min(initial=1.0))


def check_choice(name: str, value: str, choices: Any) -> None:
    """Refuse a value that is none of those of a `Literal`.

    Raises:
        ValueError: names the argument, the value and the choices.
    """
    legal = _legal(choices)
    if value not in legal:
        raise ValueError(f"{name} {value!r} is unknown; use one of {', '.join(map(repr, legal))}")


_legal = functools.cache(get_args)


def check_given(arguments: Mapping[str, Numbers | None]) -> None:
    """Refuse None for an argument that must be given.

    Raises:
        ValueError: names the argument.
    """
    for name, value in arguments.items():
        if value is None:
            raise ValueError(f"{name} is None; it must be a number or an array of numbers")


def check_values(arguments: Mapping[str, Numbers | None]) -> None:
    """Refuse known values out of their range, by the name of the argument; None is an argument not
    given.

    Raises:
        ValueError: names the argument, the value and the range.
    """
    for name, value in arguments.items():
        requirement, test = _RANGES[name]
        # Of a number that is right no array need be made.
        if value is None or (isinstance(value, float) and test(value)):
            continue
        refuse(name, _real_numbers(name, value), requirement, test)


def refuse(
    name: str, numbers: np.ndarray | None, requirement: str, test: Callable[[Any], Any]
) -> None:
    """Refuse numbers, None while they are not known, that do not all pass a test.

    Raises:
        ValueError: names the argument, the value and the requirement.
    """
    if numbers is not None and not (good := test(numbers)).all():
        raise ValueError(f"{name} holds {numbers[~good].flat[0]}; it must be {requirement}")


def _real_numbers(name: str, value: Numbers) -> np.ndarray | None:
    """The value as an array of real numbers, or None while it is traced; words, None, ragged rows
    and masked numbers are refused.
    """
    check_mask(name, value)
    try:
        numbers = concrete(value)
    except (ValueError, TypeError):
        raise ValueError(f"{name} is no array of numbers: its rows differ in length") from None
    # Kind V is bfloat16 and its kin, which NumPy does not know.
    if numbers is not None and numbers.dtype.kind not in "biufV":
        wrong = (
            f"complex, such as {numbers.flat[0]}"
            if numbers.dtype.kind == "c" and numbers.size
            else repr(value)[:60]
        )
        raise ValueError(f"{name} is {wrong}; it must be a real number or an array of them")
    return numbers


def check_mask(name: str, value: Any) -> None:
    """Refuse an array of NumPy some of whose values are masked.

    Raises:
        ValueError: names the argument.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.getmaskarray(value).any():
        raise ValueError(
            f"{name} has masked values, and what they are is not known: leave them out, or fill "
            "them: values.filled(0.5)"
        )


def check_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that is not a known number between 0 and 1.

    Raises:
        ValueError: names the value.
    """
    if isinstance(tolerance, float) and 0 < tolerance < 1:
        return
    if isinstance(tolerance, Tracer):
        raise ValueError(
            "tolerance is traced by JAX, and chooses the program: make it static, as in "
            "jax.jit(f, static_argnames='tolerance'), or close over it"
        )
    if np.ndim(tolerance) or not isinstance(
        tolerance, int | float | np.number | np.ndarray | jax.Array
    ):
        raise ValueError(
            f"tolerance is {tolerance!r}; it must be one number between 0 and 1, such as 1e-6"
        )
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance is {tolerance}; it must be between 0 and 1, such as 1e-6")


def at_least_one_layer(albedo: Any, thickness: Any, *, xp: Any) -> tuple[Any, Any, int]:
    """Albedo and optical thickness with a last axis of layers, and how many; a bare ground gets one
    empty layer.

    Raises:
        ValueError: an axis of layers is missing, or the two have different ones.
    """
    if albedo.ndim == 0 or thickness.ndim == 0:
        raise ValueError(
            "albedo and optical_thickness need a last axis of layers; a single layer is [q]"
        )
    layers = (albedo.shape[-1], thickness.shape[-1])
    if layers[0] != layers[1] and 1 not in layers:
        raise ValueError(
            f"albedo has {layers[0]} layers (last axis) but optical_thickness has {layers[1]}"
        )
    if 0 in layers:
        albedo, thickness = (
            xp.zeros((*array.shape[:-1], 1), array.dtype) for array in (albedo, thickness)
        )
    return albedo, thickness, max(albedo.shape[-1], thickness.shape[-1])


def batch_shape(shapes: Mapping[str, BatchShape], last: str = "layers") -> BatchShape:
    """Shape that all batch shapes broadcast to; ``last`` says what was on the axis that they leave
    out.

    Raises:
        ValueError: they do not; lists them by name.
    """
    # Few batches are of several shapes, and NumPy takes some microseconds to broadcast.
    several = {shape for shape in shapes.values() if shape}
    if len(several) <= 1:
        return several.pop() if several else ()
    try:
        return np.broadcast_shapes(*several)
    except ValueError:
        listing = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(
            f"batch shapes do not broadcast: {listing} ({last}, the last axis, not counted)"
        ) from None


class BatchOfStacks(NamedTuple):
    """Arguments that describe a batch of stacks, checked."""

    arrays: dict[str, Any]
    """By name: albedo and optical_thickness (..., layers), the others (...); they broadcast."""
    batch: BatchShape
    layers: int

    def flat(self) -> dict[str, Any]:
        """The arrays with one batch axis: (stacks, layers) and (stacks,)."""
        return {
            name: flat_batch(a, self.batch, *[self.layers] * (name in OF_LAYERS))
            for name, a in self.arrays.items()
        }


OF_LAYERS = ("albedo", "optical_thickness")


def batch_of_stacks(
    arguments: Mapping[str, Any],
    *,
    xp: Any = None,
    dtype: Any = None,
    shapes: Mapping[str, BatchShape] | None = None,
) -> BatchOfStacks:
    """Checked arguments as arrays.

    Args:
        arguments: by name, albedo and optical_thickness among them; None is an argument not given.
        xp: numpy or jax.numpy; by default numpy where all is known and small.
        dtype: of the arrays; by default JAX's, single or double.
        shapes: batch shapes of what else must broadcast, by name.

    Raises:
        ValueError: a known value out of range, axes of layers that do not fit, or shapes that do
            not broadcast.

    A value that is traced can't be refused; out of its range it is NaN here, and so is the result.
    """
    check_given({name: arguments[name] for name in (*OF_LAYERS, "substrate_reflectance")})
    check_values(arguments)
    dtype = dtype or jax.dtypes.canonicalize_dtype(float)
    if xp is None:
        xp = np if _known_and_small(arguments) else jnp
    arrays = {
        name: np.asarray(value, dtype) if xp is np else _in_range(name, _as_array(value, dtype))
        for name, value in arguments.items()
        if value is not None
    }
    albedo, thickness, layers = at_least_one_layer(*(arrays[name] for name in OF_LAYERS), xp=xp)
    arrays |= {"albedo": albedo, "optical_thickness": thickness}
    own_shapes = {
        name: array.shape[:-1] if name in OF_LAYERS else array.shape
        for name, array in arrays.items()
    }
    return BatchOfStacks(arrays, batch_shape({**own_shapes, **(shapes or {})}), layers)


def _known_and_small(arguments: Mapping[str, Any]) -> bool:
    """Test whether JAX traces nothing, and NumPy is done before an array has come to JAX."""
    leaves = jax.tree.leaves(dict(arguments))
    concrete_only = not any(isinstance(leaf, Tracer) for leaf in leaves)
    return concrete_only and sum(map(np.size, leaves)) <= _SMALL


def _as_array(value: Any, dtype: Any) -> Any:
    # NumPy changes the type of its own numbers and of Python's: JAX would compile a program for
    # that.
    plain = isinstance(value, np.ndarray | np.generic | float | int)
    return jnp.asarray(np.asarray(value, dtype) if plain else value, dtype)


def _in_range(name: str, array: Any) -> Any:
    """An array as it is, but NaN where JAX traces it and it is out of the argument's range."""
    if concrete(array) is not None:
        return array
    _, test = _RANGES[name]
    return jnp.where(test(array), array, jnp.nan)


def flat_batch(array: Any, batch: BatchShape, *last: int) -> Any:
    """An array (..., *last) that broadcasts against the batch, with the batch as one axis.

    What is known and small becomes a NumPy array: each other shape would be another two programs to
    compile.
    """
    full = (*batch, *last)
    flat = (math.prod(batch), *last)
    if math.prod(full) <= _SMALL and not isinstance(array, Tracer):
        array = np.asarray(array)
    if array.shape != full:
        if isinstance(array, jax.Array):
            array = jnp.broadcast_to(array, full)
        else:
            array = np.broadcast_to(array, full) if array.ndim else np.full(full, array)
    return array if full == flat else array.reshape(flat)
