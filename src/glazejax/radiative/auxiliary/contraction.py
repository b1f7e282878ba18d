"""Linear systems (E - T) x = b whose T scatters light once: self-adjoint and a contraction.

All but a little of T's spectrum lies at zero, so conjugate gradients need some ten products with T,
where an elimination costs as much as N/3 of them and cannot use that all wavelengths share one
matrix.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_TOLERANCE = {"float64": 1e-11, "float32": 3e-6}


def solve_contraction(
    apply: Callable[[Array], Array],
    weight: Float[Array, "n stacks #cases"],
    b: Float[Array, "n stacks cases"],
) -> Float[Array, "n stacks cases"]:
    """Solve x - T x = b for every stack and case, to rounding of about 1e-11 (3e-6 in float32).

    Args:
        apply: x -> T x, with eigenvalues below one, self-adjoint under sum_i weight_i x_i y_i. Rows
            of weight zero must not act on the others.
        weight: (n, stacks, 1), >= 0.
        b: (n, stacks, cases).

    Returns:
        x, (n, stacks, cases), which can be differentiated by all that `apply` holds and by b.
    """

    def forward(_, b: Array) -> Array:
        return _conjugate_gradients(apply, weight, b)

    def transpose(_, b: Array) -> Array:
        # T = S / W with S symmetric, so W (E - T) y = (E - T') (W y).
        positive = weight > 0
        y = _conjugate_gradients(
            apply, weight, jnp.where(positive, b / jnp.where(positive, weight, 1.0), 0.0)
        )
        return jnp.where(positive, weight * y, b)

    return jax.lax.custom_linear_solve(lambda x: x - apply(x), b, forward, transpose)


def _conjugate_gradients(apply: Callable[[Array], Array], weight: Array, b: Array) -> Array:
    tolerance = _TOLERANCE[str(b.dtype)]

    # Under these weights T is self-adjoint, as conjugate gradients require.
    def dot(x: Array, y: Array) -> Array:
        return jnp.sum(weight * x * y, axis=0)

    goal = tolerance**2 * dot(b, b)

    def goes_on(state) -> Array:
        step, _, _, _, squared_norm = state
        # A thousand mean free paths that absorb nothing take some 1500.
        return (step < 5000) & jnp.any(squared_norm > goal)

    def advance(state: tuple[Array, Array, Array, Array, Array]):
        step, x, residual, direction, squared_norm = state
        image = direction - apply(direction)
        energy = dot(direction, image)
        moving = energy > 0  # a finished case stands still
        # To the least energy along this direction.
        length: Array = jnp.where(moving, squared_norm, 0.0) / jnp.where(moving, energy, 1.0)
        x = x + length * direction
        residual = residual - length * image
        next_norm = dot(residual, residual)
        # The next direction is conjugate to this one.
        share: Array = next_norm / jnp.where(squared_norm > 0, squared_norm, 1.0)
        return (
            step + 1,
            x,
            residual,
            jnp.where(present, residual + share * direction, 0.0),
            next_norm,
        )

    # Steps as long as a slow case wants would make rows of weight zero, which no product sees, grow
    # without bound.
    present = weight > 0
    state = (jnp.asarray(0), jnp.zeros_like(b), b, jnp.where(present, b, 0.0), dot(b, b))
    _, x, residual, _, _ = jax.lax.while_loop(goes_on, advance, state)
    # x + residual = b + T x: one more scattering, which also gives the rows of weight zero their
    # value.
    return x + residual
