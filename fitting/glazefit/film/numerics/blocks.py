"""Many rows through a compiled program that takes so many at a time."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jaxtyping import Int


def by_blocks(count: int, block: int, run: Callable[[Int[np.ndarray, "block"]], Any]) -> Any:
    """Results of `run` for all rows, as numpy arrays; it is called with numbers of `block` rows.

    The last block is filled up with rows that were there before: one shape, one program.
    """
    results = []
    for first in range(0, count, block):
        rows = np.arange(first, min(first + block, count))
        results.append(run(np.resize(rows, block)))
    return jax.tree.map(lambda *a: np.concatenate(a)[:count], *results)
