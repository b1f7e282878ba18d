"""Work on a batch in pieces, so that memory stays bounded whatever its size."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array


def in_chunks(function: Callable[[Any], Any], batch: Any, chunk: int) -> Any:
    """Apply a function of a batch to at most ``chunk`` entries at a time.

    Unlike `jax.lax.map` with a batch size this compiles the function once: pieces are equal, and the last is filled up
    with copies of the first entry, which are dropped again.

    Args:
        function: maps arrays (entries, ...) to arrays (entries, ...).
        batch: arrays that share their first axis.
        chunk: at least one.
    """
    size = jax.tree.leaves(batch)[0].shape[0]
    if size <= chunk:
        return function(batch)
    pieces = -(-size // chunk)
    each = -(-size // pieces)
    spare = pieces * each - size

    def split(leaf: Array) -> Array:
        padded = jnp.concatenate([leaf, jnp.broadcast_to(leaf[:1], (spare, *leaf.shape[1:]))]) if spare else leaf
        return padded.reshape(pieces, each, *leaf.shape[1:])

    out = jax.lax.map(function, jax.tree.map(split, batch))
    return jax.tree.map(lambda leaf: leaf.reshape(pieces * each, *leaf.shape[2:])[:size], out)
