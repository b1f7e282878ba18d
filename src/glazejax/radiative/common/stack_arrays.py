"""Input of every solver: a batch of stacks as arrays; and derivatives by them."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array

LeafNames: TypeAlias = tuple[str, ...]
"""Names of the arrays of stacks to differentiate by."""
ValueAndGradient: TypeAlias = tuple[Array, dict[str, Array]]
"""A number a stack, (batch,), and by name its derivative by the wanted arrays in their shapes."""


class StackArrays(NamedTuple):
    """Everything a reflectance depends on. Batch axis first; layers top first."""

    albedo: Array  # (batch, layers)
    optical_thickness: Array  # (batch, layers)
    ground: Array  # (batch,)
    refractive_index: Any  # (batch,), or one number
    cos_incidence: Array  # (batch,), in air
    cos_viewing: Array | None  # (batch,), in air; None for the hemispherical flux


def with_its_gradient(
    evaluate: Callable[[Any, Any, LeafNames | None], Any],
) -> Callable[[Any, Any], Array]:
    """Function of arrays and settings whose derivative is the gradient that comes with its value.

    Only what is differentiated by is computed, and nothing but the gradient itself is kept for a
    reverse pass.

    Args:
        evaluate: of a named tuple of arrays, of settings, which are static, and of the names of
            leaves to differentiate by: a number a stack, (batch,), or, where names are given,
            `ValueAndGradient`. A leaf that it gives no derivative of counts as constant.
    """

    @functools.partial(jax.custom_jvp, nondiff_argnums=(1,))
    def value_alone(arrays: Any, settings: Any) -> Array:
        return evaluate(arrays, settings, None)

    def derivative(settings: Any, primals, tangents):
        (arrays,), (d_arrays,) = primals, tangents
        changes = {
            name: leaf
            for name, leaf in d_arrays._asdict().items()
            if not isinstance(leaf, SymbolicZero | type(None))
        }
        value, gradient = evaluate(arrays, settings, tuple(changes))
        # A stack's value depends on its own numbers alone: slopes times changes, summed by stack.
        tangent = jnp.zeros_like(value)
        for name, slope in gradient.items():
            product = slope * changes[name]
            tangent += jnp.sum(product, axis=tuple(range(value.ndim, product.ndim)))
        return value, tangent

    value_alone.defjvp(derivative, symbolic_zeros=True)
    return value_alone
