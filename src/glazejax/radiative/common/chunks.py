"""Work on a batch in pieces, so that memory stays bounded whatever its size and no core waits."""

import functools
import math
import operator
from collections.abc import Callable, Collection, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Int

from .inputs import concrete
from .threads import cores, in_threads

# A processor's chunk stays in its cache. A GPU has none to speak of, and each kernel must fill it.
_LARGER_ON_ACCELERATOR = 256
_LEAST_ON_ACCELERATOR = 2**28


def on_cpu(*inputs: Any) -> bool:
    """Test whether a program of these inputs runs on a CPU: that is where they are, or else JAX's
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
    the last is filled up with copies of the first entry, which are dropped again. A piece takes as
    much of each device's share, so that a batch which is split over devices stays split.

    Args:
        function: maps arrays (entries, ...) to arrays (entries, ...).
        batch: arrays that share their first axis.
        chunk: at least one, of each device.
    """
    size = jax.tree.leaves(batch)[0].shape[0]
    # Devices that hold shares of the batch keep them: each share is cut on its own.
    devices = math.gcd(size, jax.device_count())
    share = size // devices
    if share <= chunk:
        return function(batch)
    pieces = -(-share // chunk)
    size_of_piece = -(-share // pieces)

    def split(leaf: Array) -> Array:
        shares = leaf.reshape(devices, share, *leaf.shape[1:])
        copies = jnp.repeat(shares[:, :1], pieces * size_of_piece - share, axis=1)
        filled = jnp.concatenate([shares, copies], axis=1)
        return jnp.moveaxis(filled.reshape(-1, pieces, *leaf.shape[1:]), 1, 0)

    def join(leaf: Array) -> Array:
        inner_shape = leaf.shape[2:]
        shares = jnp.moveaxis(leaf, 0, 1).reshape(devices, -1, *inner_shape)
        return shares[:, :share].reshape(size, *inner_shape)

    return jax.tree.map(join, jax.lax.map(function, jax.tree.map(split, batch)))


def pieces_of(rows: np.ndarray, size: int) -> list[np.ndarray]:
    """The rows in order, at most so many at a time; of none, one piece of none."""
    return np.split(rows, range(size, len(rows), size))


def by_blocks(count: int, block: int, run: Callable[[Int[np.ndarray, "block"]], Any]) -> Any:
    """Results of `run` for all rows, at least one, as numpy arrays; it is called with numbers of
    `block` rows.

    The last block is filled up with rows that were there before: one shape, one program.
    """
    results = [run(np.resize(rows, block)) for rows in pieces_of(np.arange(count), block)]
    return jax.tree.map(lambda *a: np.concatenate(a)[:count], *results)


def on_its_devices(
    function: Callable[[Mapping[str, Any]], Any],
    arguments: Mapping[str, Any],
    inner: Collection[str],
) -> Any:
    """Apply a function whose results have the shape of the batch that it is given: where arrays
    say how they are split over devices (axes of an Explicit mesh), results are split the same way.

    Args:
        function: of arrays by name, numbers and None among them.
        arguments: they broadcast but for inner axes.
        inner: names of those that have one more axis, the last.
    """
    traced = {
        name: jax.typeof(array).sharding.mesh.explicit_axes
        for name, array in arguments.items()
        if isinstance(array, Tracer) and concrete(array) is None
    }
    if not any(traced.values()):
        return function(arguments)
    # What a traced function closes over lies there too.
    arrays = {
        name: array
        for name, array in arguments.items()
        if name in traced
        or (isinstance(array, jax.Array) and jax.typeof(array).sharding.mesh.explicit_axes)
    }
    # Of what kind their sum over inner axes would be.
    finite = {name: jnp.isfinite(array) for name, array in arguments.items() if array is not None}
    outer = [array.all(axis=-1) if name in inner else array for name, array in finite.items()]
    sharding = jax.typeof(functools.reduce(operator.and_, outer)).sharding
    # The compiler divides the work; what is fixed in the program stays out of it.
    run = jax.sharding.auto_axes(
        lambda there: function({**arguments, **there}), out_sharding=sharding
    )
    return run(arrays)


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
    pieces = min(cores(), 2 * size // least)
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((batch, shared)))
    if traced or size < max(least, pieces) or pieces < 2 or not on_cpu(*leaves):
        return _part(function, size, fixed, batch, shared, 0)
    share = -(-size // pieces)
    # Compiled here: threads have settings of their own, and would each compile what none has yet.
    config: Any = jax.config
    arrays, structure = jax.tree.flatten((batch, shared))
    setting = config.jax_enable_x64, config.jax_default_device
    key = (function, share, fixed, structure, setting, *map(jax.typeof, arrays))
    if key not in _programs:
        if len(_programs) >= _MOST_PROGRAMS:
            _programs.clear()
        _programs[key] = _part.lower(function, share, fixed, batch, shared, np.int32(0)).compile()
    program = _programs[key]
    # The last part begins earlier instead of being shorter: one program for all.
    starts = [np.int32(min(k * share, size - share)) for k in range(pieces)]
    done = in_threads(lambda start: jax.block_until_ready(program(batch, shared, start)), starts)
    length = share - (pieces * share - size)
    return jax.tree.map(
        lambda *results: jnp.concatenate([*results[:-1], results[-1][share - length :]]), *done
    )


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def _part(
    function: Callable[..., Any], size: int, fixed: tuple, batch: Any, shared: Any, start: Any
) -> Any:
    if size < jax.tree.leaves(batch)[0].shape[0]:
        batch = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, start, size), batch)
    return function(batch, *fixed) if shared is None else function(batch, shared, *fixed)
