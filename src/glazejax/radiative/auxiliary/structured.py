"""Products with H + U that never make the matrix: H is Toeplitz, U is Hankel (paper A, section
4.1).

Filled up to length 2 Q a Toeplitz matrix is a cyclic convolution and a Hankel matrix a cyclic
correlation, so

    (H + U) x = F^-1 (h F x + u conj(F x)),     h, u the transforms of their Q and 2Q - 1 numbers:

two fast Fourier transforms a product for both, Q log Q in place of Q^2, and no memory but a few
vectors. All stacks go through one program, whether they share the numbers (a fixed step) or have
their own.

Only one transform is ever under way: each waits for the one before, and the two of the kernels are
one call. On the CPU two at once might wait for each other's threads.
"""

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float


def spectra(
    toeplitz: Float[Array, "*stacks n"], hankel: Float[Array, "*stacks m"]
) -> Complex[Array, "2 *stacks frequencies"]:
    """Transforms of the numbers of H and U, for `times`; n + 1 frequencies.

    Args:
        toeplitz: first row of H, H_ij = toeplitz[|i - j|].
        hankel: U_ij = hankel[i + j]; m >= 2n - 1, what is beyond is not used.
    """
    n = toeplitz.shape[-1]
    # To length 2n: in their first n rows the cyclic products are those of H and U.
    nothing = jnp.zeros_like(toeplitz[..., :1])
    around = jnp.concatenate([toeplitz, nothing, toeplitz[..., :0:-1]], axis=-1)
    along = jnp.concatenate([hankel[..., : 2 * n - 1], nothing], axis=-1)
    return jnp.fft.rfft(jnp.stack([around, along]))


def times(
    kernels: Complex[Array, "2 *stacks frequencies"], x: Float[Array, "n stacks cases"]
) -> Float[Array, "n stacks cases"]:
    """(H + U) x for all stacks and cases; the stacks share the kernels or have their own."""
    n = x.shape[0]
    h, u = kernels[..., None, :]
    transformed = jnp.fft.rfft(jnp.moveaxis(x, 0, -1), 2 * n)
    product = jnp.fft.irfft(h * transformed + u * jnp.conj(transformed), 2 * n)
    return jnp.moveaxis(product[..., :n], -1, 0)
