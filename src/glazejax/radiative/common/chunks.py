"""Work on a batch in pieces, so that memory stays bounded whatever its size and no core waits."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array

from .threads import cores, in_threads

# A processor's chunk stays in its cache. A GPU has none to speak of, and each kernel must fill it.
_LARGER_ON_ACCELERATOR = 256
_LEAST_ON_ACCELERATOR = 2**28


def on_cpu(*inputs: Any) -> bool:
    """Whether a program of these inputs runs on a CPU: that is where they are, or else JAX's
    default device.

    Args:
        inputs: of the program, traced or not, JAX's or not.
    """
    for array in inputs:
        if isinstance(array, jax.Array) and not isinstance(array, Tracer):
            return next(iter(array.devices())).platform == "cpu"
    default = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    return (
        jax.default_backend() if default is None else getattr(default, "platform", default)
    ) == "cpu"


def chunk_bytes(on_processor: int, *inputs: Any) -> int:
    """Memory that a chunk may take where a program of these inputs is going to run.

    A program that is moved to another kind of device afterwards is right there too, only slower.

    Args:
        on_processor: bytes that suit a processor's cache.
        inputs: as of `on_cpu`.
    """
    if on_cpu(*inputs):
        return on_processor
    return max(_LARGER_ON_ACCELERATOR * on_processor, _LEAST_ON_ACCELERATOR)


def in_chunks(function: Callable[[Any], Any], batch: Any, chunk: int) -> Any:
    """Apply a function of a batch to at most ``chunk`` entries at a time.

    Unlike `jax.lax.map` with a batch size this compiles the function once: pieces are equal, and
    the last is filled up with copies of the first entry, which are dropped again.

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
        padded = (
            jnp.concatenate([leaf, jnp.broadcast_to(leaf[:1], (spare, *leaf.shape[1:]))])
            if spare
            else leaf
        )
        return padded.reshape(pieces, each, *leaf.shape[1:])

    out = jax.lax.map(function, jax.tree.map(split, batch))
    return jax.tree.map(lambda leaf: leaf.reshape(pieces * each, *leaf.shape[2:])[:size], out)


# Programs of parts, and how many are kept.
_programs: dict[Any, Any] = {}
_MOST_PROGRAMS = 64


def on_all_cores(
    function: Callable[..., Any], batch: Any, *fixed: Any, least: int, shared: Any = None
) -> Any:
    """Apply a function to a batch; to one part of it on each core where it is large and its numbers
    are known.

    On a CPU XLA runs the steps of one program one after the other, divides none as small as a
    chunk's, and runs the calls of one thread in turn. So the parts are calls of one program, each
    from a thread of its own. Where JAX traces the batch, as in a program that the user compiles, it
    stays whole.

    Args:
        function: maps arrays (entries, ...), and what all parts share, to arrays (entries, ...); it
            is compiled.
        batch: arrays that share their first axis.
        fixed: further arguments of the function, fixed when it is compiled.
        least: fewer entries stay together, and no part has less than half as many.
        shared: arrays handed to the function whole, after the batch; None is handed to none.
    """
    leaves = jax.tree.leaves(batch)
    size = leaves[0].shape[0]
    parts = min(cores(), 2 * size // least)
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((batch, shared)))
    if traced or size < max(least, parts) or parts < 2 or not on_cpu(*leaves):
        return _part(function, size, fixed, batch, shared, 0)
    each = -(-size // parts)
    # Compiled here: threads have settings of their own, and would each compile what none has yet.
    config: Any = jax.config
    arrays, structure = jax.tree.flatten((batch, shared))
    setting = config.jax_enable_x64, config.jax_default_device
    key = (function, each, fixed, structure, setting, *map(jax.typeof, arrays))
    if key not in _programs:
        if len(_programs) >= _MOST_PROGRAMS:
            _programs.clear()
        _programs[key] = _part.lower(function, each, fixed, batch, shared, np.int32(0)).compile()
    program = _programs[key]
    # The last part begins earlier instead of being shorter: one program for all.
    starts = [np.int32(min(k * each, size - each)) for k in range(parts)]
    done = in_threads(lambda start: jax.block_until_ready(program(batch, shared, start)), starts)
    known = each - (parts * each - size)
    return jax.tree.map(
        lambda *parts: jnp.concatenate([*parts[:-1], parts[-1][each - known :]]), *done
    )


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def _part(
    function: Callable[..., Any], size: int, fixed: tuple, batch: Any, shared: Any, start: Any
) -> Any:
    if size < jax.tree.leaves(batch)[0].shape[0]:
        batch = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, start, size), batch)
    return function(batch, *fixed) if shared is None else function(batch, shared, *fixed)
