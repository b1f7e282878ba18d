"""Work on a batch in pieces, so that memory stays bounded whatever its size."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array

# A processor's chunk stays in its cache. A GPU has none to speak of, and each kernel must fill it.
_LARGER_ON_ACCELERATOR = 256


def chunk_bytes(on_processor: int, *inputs: Any) -> int:
    """Memory that a chunk may take where a program is going to run.

    That is where its inputs are, or else JAX's default device. A program that is moved to another kind of device
    afterwards is right there too, only slower.

    Args:
        on_processor: bytes that suit a processor's cache.
        inputs: of the program, traced or not, JAX's or not.
    """
    for array in inputs:
        if isinstance(array, jax.Array) and not isinstance(array, Tracer):
            platform = next(iter(array.devices())).platform
            break
    else:
        default = getattr(jax.config, "jax_default_device")  # noqa: B009  type checkers do not know it
        platform = jax.default_backend() if default is None else getattr(default, "platform", default)
    return on_processor if platform == "cpu" else _LARGER_ON_ACCELERATOR * on_processor


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
