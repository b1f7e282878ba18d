"""Parts of an array that can only be read by windows: lists of lines, points that are scattered."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

Take: TypeAlias = Callable[[tuple[slice, ...]], np.ndarray]
"""Reads a window: a slice with a positive step along each axis."""

# Lines that lie no further apart are read together, and points that lie in one square of this size.
_NEAR = 16
_SQUARE = 64


def outer(take: Take, key: Sequence[Any], shape: tuple[int, ...]) -> np.ndarray:
    """Part of an array at a whole number, a slice or a list of numbers along each axis, each for
    itself.

    Args:
        take: reads a window.
        key: along each axis; a whole number takes the axis away.
        shape: of the array.
    """
    single = [np.ndim(part) == 0 and not isinstance(part, slice) for part in key]
    parts = [
        np.reshape(part, 1) if alone else part for part, alone in zip(key, single, strict=True)
    ]
    values = _lists(take, [], parts, shape)
    return np.squeeze(values, axis=tuple(int(axis) for axis in np.flatnonzero(single)))


def _lists(
    take: Take, done: list[slice], rest: Sequence[Any], shape: tuple[int, ...]
) -> np.ndarray:
    """Part of an array of which the first axes are windows already, and the rest slices or lists of
    numbers.
    """
    if not rest:
        sizes = [len(range(size)[part]) for part, size in zip(done, shape, strict=True)]
        return take(tuple(done)) if 0 not in sizes else np.empty(sizes, np.float32)
    axis = len(done)
    part = rest[0]
    size = shape[len(done)]
    if isinstance(part, slice):
        wanted = range(size)[part]
        if wanted.step > 0:
            window = slice(wanted.start, max(wanted.start, wanted.stop), wanted.step)
            return _lists(take, [*done, window], rest[1:], shape)
        part = np.asarray(wanted, int)
    numbers, back = np.unique(
        np.where(part < 0, part + size, part).astype(int), return_inverse=True
    )
    found = []
    for run in np.split(numbers, np.flatnonzero(np.diff(numbers) > _NEAR) + 1):
        window = slice(int(run[0]), int(run[-1]) + 1, 1) if run.size else slice(0, 0, 1)
        values = _lists(take, [*done, window], rest[1:], shape)
        found.append(np.take(values, run - window.start, axis=axis))
    return np.take(np.concatenate(found, axis=axis), back.ravel(), axis=axis)


def pointwise(take: Take, key: Sequence[Any], shape: tuple[int, int, int]) -> np.ndarray:
    """Elements at points (y, x, band) of which the numbers are broadcast against each other.

    Args:
        take: reads a window.
        key: three arrays of whole numbers.
        shape: of the array.
    """
    y, x, bands = (
        np.where(part < 0, part + size, part) for part, size in zip(key, shape, strict=True)
    )
    y, x = np.broadcast_arrays(y, x)
    whole = np.broadcast_shapes(y.shape, bands.shape)
    if 0 in whole:
        return np.empty(whole, np.float32)
    first = int(bands.min())
    run = slice(first, int(bands.max()) + 1, 1)
    spectra = np.empty((y.size, run.stop - first), np.float32)
    lines = y.ravel()
    samples = x.ravel()
    _, square = np.unique(
        (lines // _SQUARE) * (shape[1] // _SQUARE + 1) + samples // _SQUARE, return_inverse=True
    )
    order = np.argsort(square, kind="stable")
    for points in np.split(order, np.flatnonzero(np.diff(square[order])) + 1):
        top = int(lines[points].min())
        left = int(samples[points].min())
        window = (
            slice(top, int(lines[points].max()) + 1, 1),
            slice(left, int(samples[points].max()) + 1, 1),
            run,
        )
        spectra[points] = take(window)[lines[points] - top, samples[points] - left]
    rows = np.broadcast_to(np.arange(y.size).reshape(y.shape), whole)
    return spectra[rows, np.broadcast_to(bands - first, whole)]
