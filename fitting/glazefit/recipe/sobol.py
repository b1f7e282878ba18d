"""Points that fill the unit square evenly: Sobol's, scrambled, as `scipy.stats.qmc.Sobol` draws
them.

Written out because scipy.stats takes as long to import as JAX, for thirty-two points.
"""

import numpy as np
from jaxtyping import Float

_BITS = 30


def scrambled_sobol(exponent: int, seed: int) -> Float[np.ndarray, "points 2"]:
    """The first 2**exponent points of Sobol's sequence in the unit square, scrambled.

    Args:
        exponent: 1 or more.
        seed: of the scrambling, as of ``numpy.random.default_rng``.

    Source: I. M. Sobol (1967); scrambled by a random lower triangular matrix and a digital shift,
    J. Matousek, Journal of Complexity 14 (1998) 527.
    """
    # A child of the seed's generator, as SciPy takes it.
    rng = np.random.default_rng(seed).spawn(1)[0]
    powers = 2 ** np.arange(_BITS, dtype=np.int64)
    shift = rng.integers(2, size=(2, _BITS), dtype=np.uint32).astype(np.int64) @ powers
    lower = np.tril(rng.integers(2, size=(2, _BITS, _BITS), dtype=np.uint32)).astype(np.int64)
    lower[:, np.arange(_BITS), np.arange(_BITS)] = 1
    # Direction numbers, the first bit foremost: van der Corput's, and those of the polynomial x +
    # 1.
    plain = powers[::-1]
    second = [int(plain[0])]
    while len(second) < _BITS:
        second.append(second[-1] ^ (second[-1] >> 1))
    directions = np.stack([plain, np.array(second)])
    digits = (directions[..., None] >> np.arange(_BITS - 1, -1, -1)) & 1
    scrambled = (np.einsum("dpk,djk->djp", lower, digits) % 2) @ plain
    point = shift.copy()
    points = [shift.copy()]
    for number in range(1, 2**exponent):
        # Gray's code: each point differs from the one before in one direction, that of the lowest
        # zero bit.
        point = point ^ scrambled[:, ((number - 1) ^ number).bit_length() - 1]
        points.append(point)
    return np.array(points) / 2.0**_BITS
