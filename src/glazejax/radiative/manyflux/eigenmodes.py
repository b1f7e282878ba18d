r"""Reflection and transmission operators of one homogeneous layer from its eigenvectors, in
symmetric half-size form.

A layer is u' = -A v, v' = -B u for the sum and difference of down- and upward light
(`scattering.rates`), hence u'' = A B u. With A = W W^T and W^T B W = diag(kappa^2), both from one
symmetric eigenproblem over the directions of a hemisphere, every even function of the depth is a
function of kappa^2 alone:

    t(A B) = W t(kappa^2) W^-1,      t(z) = tanh(sqrt(z) h)/sqrt(z),

and `doubling` makes R and T of it. For a direction without weight (`bordered`) the same function
acts through its divided differences: that is the integral of the source function along the
direction, without resonances.

The eigenproblem is solved by rotations (`jacobi`), so that no LAPACK call is left that could hang
in bulk. Derivatives are those of the function, finite at an albedo of one. They ask for eigenvalues
that differ, as these do.

Source: paper C (Shinya et al.), equations (18)-(20); Stamnes and Swanson, J. Atmos. Sci. 38 (1981)
387, the half size.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.kernels import phi, tanh_sech
from ..common.linalg import Matrices, einsum, inverse, matmul, transpose
from ..common.quadrature import gauss
from .bordered import Bordered
from .doubling import LayerOperators, pair, reflection_and_loss
from .jacobi import symmetric_eigen


class Eigenvectors(NamedTuple):
    """Eigenvectors of a layer."""

    decay_squared: Float[Array, "*batch n"]
    """kappa^2, ascending."""
    shapes: Matrices
    """W, columns: the sum of down- and upward light, sqrt(mu w) I, in each mode."""
    projection: Matrices
    """W^-1."""


def layer_modes(a: Matrices, b: Matrices) -> Eigenvectors:
    """Eigenvectors of layers.

    Args:
        a: A, symmetric positive definite.
        b: B, symmetric, positive semidefinite.
    """
    squared, shapes = _eigen(a, b)
    return Eigenvectors(squared, shapes, matmul(transpose(shapes), inverse(a)))


def layer_by_modes(a: Bordered, b: Bordered, thickness: Float[Array, "*batch"]) -> LayerOperators:
    """Reflection R and loss U = 1 - T of layers; the same as `layer_by_doubling`.

    Args:
        a, b: operators A and B of each layer.
        thickness: optical thickness D, (...), >= 0.
    """
    modes = layer_modes(a.core, b.core)
    half = 0.5 * thickness[..., None]
    # X = B t(A B), Y = A t(B A). As A and B are symmetric, B A has the transposed eigenvectors.
    even = b @ _tangent(a @ b, modes, half)
    transposed = Eigenvectors(
        decay_squared=modes.decay_squared,
        shapes=transpose(modes.projection),
        projection=transpose(modes.shapes),
    )
    odd = a @ _tangent(b @ a, transposed, half)
    return reflection_and_loss(pair(even, odd).symmetric())


def _tangent(product: Bordered, modes: Eigenvectors, depth: Array) -> Bordered:
    """t of a bordered operator by the eigenvectors of its core; depth is (..., 1)."""
    squared, shapes, projection = modes
    # Added directions are modes of their own, in addition to those of the core.
    # In modes: what each incidence excites, and what each viewing direction collects.
    columns = matmul(projection, product.columns)
    rows = matmul(product.rows, shapes)
    # t at the modes' kappa^2, and at each added direction's own 1/mu^2.
    core_modes = tanh_sech(squared, depth)[0]
    viewing = product.viewing
    incidence = product.incidence
    passed = [tanh_sech(x, depth)[0] for x in (viewing, incidence)]
    # Where two of them have one decay, t's divided difference becomes its derivative.
    lit_modes = first_difference(squared[..., :, None], incidence[..., None, :], depth[..., None])
    seen_modes = first_difference(squared[..., None, :], viewing[..., :, None], depth[..., None])
    straight = first_difference(viewing[..., :, None], incidence[..., None, :], depth[..., None])
    corner = product.corner * straight
    # From one added direction to another by way of the core.
    if corner.size:
        by_modes = second_difference(
            viewing[..., :, None, None],
            squared[..., None, None, :],
            incidence[..., None, :, None],
            depth[..., None, None],
        )
        corner += einsum("...vk,...vik,...ki->...vi", rows, by_modes, columns)
    # Back from modes to nodes.
    core = matmul(shapes * core_modes[..., None, :], projection)
    from_incidence = matmul(shapes, lit_modes * columns)
    to_viewing = matmul(seen_modes * rows, projection)
    return Bordered(jnp.block([[core, from_incidence], [to_viewing, corner]]), *passed)


def first_difference(z: Array, x: Array, depth: Array) -> Array:
    """(t(z) - t(x))/(z - x), regular where they meet; x > 0, z >= 0."""
    z, x, depth = jnp.broadcast_arrays(z, x, depth)
    close = _close(z, x)
    # Where close, the quotient below is not used, but its slope must be finite too.
    distinct = jnp.where(close, 0.0, z)
    slope = tanh_sech(distinct, depth)[0] - tanh_sech(x, depth)[0]
    return jnp.where(
        close,
        _close_difference(jnp.where(close, z, x), x, depth),
        slope / jnp.where(close, 1.0, z - x),
    )


def _close(x: Array, y: Array) -> Array:
    """Test whether points are so near that a difference of function values would lose digits."""
    return jnp.abs(x - y) < 0.1 * jnp.maximum(x, y)


def _close_difference(z: Array, x: Array, depth: Array) -> Array:
    low = jnp.sqrt(jnp.minimum(z, x))
    high = jnp.sqrt(jnp.maximum(z, x))
    fades = [jnp.exp(-2.0 * depth * k) for k in (low, high)]
    # tanh(b) - tanh(a) over b - a, without a difference.
    tangents = (
        4.0
        * depth
        * fades[0]
        * phi(2.0 * depth * (high - low))
        / ((1.0 + fades[0]) * (1.0 + fades[1]))
    )
    # (tanh(b h)/b - tanh(a h)/a)/(b^2 - a^2) with b - a divided out.
    return (tangents - jnp.tanh(low * depth) / low) / (high * (high + low))


def second_difference(x: Array, z: Array, y: Array, depth: Array) -> Array:
    """Second divided difference of t at x, z and y, regular where any of them meet; x, y > 0, z >=
    0.
    """
    x, z, y, depth = jnp.broadcast_arrays(x, z, y, depth)
    close = _close(x, y)
    # The recursion of divided differences, where x and y are apart.
    quotient = (first_difference(z, x, depth) - first_difference(z, y, depth)) / jnp.where(
        close, 1.0, x - y
    )
    # Where x and y are close: the mean slope of the first difference between them.
    points, weights = gauss(5)
    between = jnp.where(close, y, x)[..., None] + jnp.where(close, x - y, 0.0)[..., None] * points
    _, slope = jax.jvp(
        lambda s: first_difference(z[..., None], s, depth[..., None]),
        (between,),
        (jnp.ones_like(between),),
    )
    return jnp.where(close, jnp.sum(slope * weights, axis=-1), quotient)


@jax.custom_jvp
def _eigen(a: Array, b: Array) -> tuple[Array, Array]:
    """kappa^2 and W with A = W W^T, W^T B W = diag(kappa^2)."""
    # With A = L L^T and W = L V one symmetric matrix L^T B L is left.
    factor = _cholesky(a)
    reduced = matmul(transpose(factor), matmul(b, factor))
    squared, vectors = symmetric_eigen(0.5 * (reduced + transpose(reduced)))
    # At an albedo of one kappa^2 is 0, which rounding may make negative.
    return jnp.maximum(squared, 0.0), matmul(factor, vectors)


@_eigen.defjvp
def _eigen_jvp(primals, tangents):
    a, b = primals
    squared, shapes = _eigen(a, b)
    across = transpose(shapes)
    back = matmul(across, inverse(a))

    # Both changes in the frame of the modes: W^-1 dA W^-T and W^T dB W.
    by_a = matmul(matmul(back, tangents[0]), transpose(back))
    by_b = matmul(matmul(across, tangents[1]), shapes)
    # With dW = W S: S + S^T is dA there, and off the diagonal S_ij (kappa_j^2 - kappa_i^2) is dB +
    # dA kappa_j^2.
    turn = by_b + by_a * squared[..., None, :]
    on_diagonal = np.eye(squared.shape[-1], dtype=bool)
    gap = squared[..., None, :] - squared[..., :, None]
    safe = jnp.where(gap == 0, 1.0, gap)
    turn_shapes = jnp.where(on_diagonal, 0.5 * by_a, jnp.where(gap == 0, 0.0, turn / safe))
    slope = jnp.diagonal(turn, axis1=-2, axis2=-1)
    return (squared, shapes), (slope, matmul(shapes, turn_shapes))


def _cholesky(a: Array) -> Array:
    """Triangular factor of symmetric positive definite matrices, last row first: steep directions
    stay apart.

    With the nodes in descending order of cosine, the entries of grazing ones, which are largest,
    are eliminated first, so that they leave no rounding in the others.
    """
    n = a.shape[-1]

    def eliminate(step: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        work, factor = state
        j = n - 1 - step
        row = jax.lax.dynamic_index_in_dim(work, j, work.ndim - 2, keepdims=False)
        pivot = jax.lax.dynamic_index_in_dim(row, j, row.ndim - 1)
        column = jnp.where(jnp.arange(n) <= j, row, 0.0) / jnp.sqrt(pivot)
        work = work - column[..., :, None] * column[..., None, :]
        return work, factor + jnp.where(jnp.arange(n) == j, column[..., :, None], 0.0)

    return jax.lax.fori_loop(0, n, eliminate, (a, jnp.zeros_like(a)))[1]
