"""Paints of a map's sets by name: the map itself holds numbers."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..store.chunk import distinct_sets

if TYPE_CHECKING:
    import xarray


def paint_names(dataset: "xarray.Dataset") -> list[str]:
    """Names of a map's paints, in the order of their numbers."""
    return [str(name) for name in dataset["paint"].values]


def set_words(members: Iterable[int], paints: Sequence[str]) -> str:
    """A set of paints by their numbers in words, in the catalogue's order; empty if there
    are none.
    """
    return " + ".join(paints[member] for member in sorted(members) if member >= 0)


def file_stems(names: Iterable[str]) -> list[str]:
    """Names as parts of files' names; one that repeats, whatever its capitals, has a number: many
    disks do not distinguish them.
    """
    stems: dict[str, str] = {}
    for name in names:
        plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
        stem = plain
        number = 1
        while stem.casefold() in stems:
            number += 1
            stem = f"{plain}_{number}"
        stems[stem.casefold()] = stem
    return [*stems.values()]


def set_labels(found: "xarray.Dataset") -> "xarray.DataArray":
    """Names of the paints in the most probable set of every pixel, such as ``ZincWhite +
    CobaltBlue``.

    Paints stand in the catalogue's order, so one set has one name. What is chunked by dask stays
    lazy.

    Args:
        found: a map, or some pixels of one: from `map_cube`, `open_map`, or its NetCDF file opened
            by xarray.

    Returns:
        Texts, with the dimensions of the map's pixels; empty where a pixel was not mapped. Where
        `explained` is 0 the catalogue does not explain the pixel, and the name is that of the set
        that comes nearest.

    Raises:
        ValueError: it lacks `members` or `paint`, and so is no map.

    Example:
        >>> import xarray
        >>> members = ("x", "place"), [[1, 0, -1], [-1, -1, -1]]
        >>> found = xarray.Dataset({"members": members}, {"paint": ["ZincWhite", "Eosin"]})
        >>> set_labels(found).values.tolist()
        ['ZincWhite + Eosin', '']
    """
    import xarray

    if lacking := [name for name in ("members", "paint") if name not in found.variables]:
        raise ValueError(
            f"this is no map of paints: it has no {' and no '.join(lacking)}; open one by open_map"
        )
    paints = paint_names(found)

    def name_set(members: np.ndarray) -> np.ndarray:
        # What xarray has masked is not a number.
        numbers = np.sort(
            np.nan_to_num(members, nan=-1).astype(np.int64).reshape(-1, members.shape[-1])
        )
        first, which = distinct_sets(numbers)
        labels = np.array([set_words(row.tolist(), paints) for row in numbers[first]], dtype=object)
        return labels[which].reshape(members.shape[:-1])

    labels: Any = xarray.apply_ufunc(
        name_set,
        found["members"],
        input_core_dims=[["place"]],
        dask="parallelized",
        output_dtypes=[object],
    )
    return labels.rename("set").assign_attrs(long_name="paints of the most probable set")
