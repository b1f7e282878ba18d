"""A map that has no window yet: its folder, arrays and attributes."""

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from .layout import PLACES, STATUS_WORDS, VARIABLES, Variable, Way

FORMAT = 5
"""Version of the format, in the attribute `glazejax` of a map."""

WORK = ".glazejax"
"""Folder within a map that holds what a run needs to go on."""


def plain(value: Any) -> Any:
    """A value as JSON has it: paths as text, arrays and tuples as lists, what is not finite as
    text.

    Raises:
        TypeError: something that JSON has not.
    """
    return json.loads(json.dumps(value, default=_plainer), parse_constant=str)


def _plainer(value: Any) -> Any:
    """A value that JSON lacks, as one that it has."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{value!r} cannot be kept as an attribute")


def lay_out(
    path: Path,
    shape: Sequence[int],
    chunk: Sequence[int],
    paints: Sequence[str],
    options: Mapping[str, Any],
    attrs: Mapping[str, Any],
    coords: Mapping[str, tuple[np.ndarray, Mapping[str, Any]]],
) -> None:
    """Write an empty map into a new folder; see `store.MapStore.create`."""
    import zarr
    from zarr.codecs import BloscCodec, Crc32cCodec

    metadata = {
        "Conventions": "CF-1.11",
        **attrs,
        "paints": paints,
        "options": options,
        "glazejax": {"format": FORMAT, "run": uuid4().hex, "shape": shape, "chunk": chunk},
    }
    group = zarr.create_group(path, attributes=plain(metadata))
    packed = [BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec()]
    sizes = {"paint": len(paints), "place": PLACES, "rgb": 3}
    for variable in VARIABLES:
        further = [sizes[name] for name in variable.further]
        group.create_array(
            variable.name,
            shape=(*shape, *further),
            chunks=(*chunk, *further),
            dtype=variable.dtype,
            fill_value=variable.fill
            if np.dtype(variable.dtype).kind == "f"
            else int(variable.fill),
            compressors=packed,
            dimension_names=["y", "x", *variable.further],
            attributes=_words(variable, paints),
        )
    for name, length in zip(("y", "x"), shape, strict=True):
        values, attributes = coords.get(name, (np.arange(length) + 0.5, {"units": "pixel"}))
        group.create_array(
            name,
            data=np.asarray(values),
            compressors=packed,
            dimension_names=[name],
            attributes=plain(attributes),
        )
    names = group.create_array(
        "paint",
        shape=(len(paints),),
        chunks=(max(len(paints), 1),),
        dtype=str,
        compressors=packed,
        dimension_names=["paint"],
    )
    names[:] = np.array([*paints], dtype=object)
    with warnings.catch_warnings():
        # zarr warns that others may not know this list of arrays; without it readers complain of
        # the folder that is no array.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(group.store)
    (path / WORK).mkdir()


def _words(variable: Variable, paints: Sequence[str]) -> dict[str, Any]:
    """Attributes of an array, by the conventions CF; numbers that stand for words have a legend."""
    # It loads JAX, which wrong options need not wait for.
    from ...identify.search.unstated_conditions import CONDITIONS

    attributes: dict[str, Any] = {"long_name": variable.meaning}
    if variable.unit:
        attributes["units"] = variable.unit
    legends: dict[str, dict[int, str]] = {
        "status": {int(flag): text for flag, text in STATUS_WORDS.items()},
        "way": {int(flag): flag.name.lower() for flag in Way},
        "members": {-1: "none", **dict(enumerate(paints))},
        "condition": {
            number: condition.words or "as stated" for number, condition in enumerate(CONDITIONS)
        },
    }
    if legend := legends.get(variable.name):
        attributes["flag_values"] = list(legend)
        attributes["flag_meanings"] = " ".join("_".join(text.split()) for text in legend.values())
    return attributes
