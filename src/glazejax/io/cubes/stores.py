"""Images in files that hold named arrays: zarr 2 and 3, NetCDF 4 and 3, HDF5, MATLAB."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...extras import require
from ..raw_cube import RawCube
from ..source import refusal
from .entries import FolderEntry, describe


def zarr_cube(path: Path, dataset: str | None, count: int | None) -> RawCube:
    """Array of a zarr store (2 or 3), or a store that is an array itself; only the chunks that are
    needed are read.

    Raises:
        ValueError: no array in it that can be meant.
    """
    require("zarr")
    import zarr

    opened = _zarr_array(path, "")
    members = [("", opened)] if isinstance(opened, zarr.Array) else opened.members(max_depth=None)
    entries = [_zarr_entry(name, array) for name, array in members if hasattr(array, "shape")]
    return describe(path, "zarr", entries, dataset, count, _zarr_array)


def _zarr_entry(name: str, array: Any) -> FolderEntry:
    attributes = dict(array.attrs)
    old = attributes.get("_ARRAY_DIMENSIONS")
    # xarray's mark of missing data is the fill value of zarr 2, and an attribute in zarr 3.
    if old is not None and array.fill_value is not None:
        attributes.setdefault("_FillValue", array.fill_value)
    names = getattr(array.metadata, "dimension_names", None) or old or (None,) * array.ndim
    return FolderEntry(name, array, attributes, dims=tuple(names), chunks=tuple(array.chunks))


def _zarr_array(path: Path, name: str) -> Any:
    import zarr

    opened: Any = zarr.open(str(path), mode="r")
    return opened[name] if name else opened


def matlab_cube(path: Path, dataset: str | None, count: int | None) -> RawCube:
    """Array of a MATLAB 5 file, which is read as a whole.

    Raises:
        ValueError: it holds no array that can be meant.
    """
    from scipy.io import loadmat

    arrays = loadmat(path, mat_dtype=True).items()
    entries = [FolderEntry(name, array) for name, array in arrays if hasattr(array, "dtype")]
    return describe(path, "MATLAB 5", entries, dataset, count, _matlab_array)


def _matlab_array(path: Path, name: str) -> Any:
    from scipy.io import loadmat

    return loadmat(path, mat_dtype=True, variable_names=[name])[name]


def hdf5_cube(path: Path, dataset: str | None, count: int | None) -> RawCube:
    """Array of an HDF5 file, such as NetCDF 4.

    Raises:
        ValueError: it holds no array that can be meant.
    """
    require("h5py")
    import h5py

    entries: list[FolderEntry] = []

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.shape is not None:
            entries.append(_hdf5_entry(name, node))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
        # MATLAB 7.3 writes the last axis first.
        matlab = path.suffix.lower() == ".mat" or file.userblock_size > 0
        kind = "MATLAB 7.3" if matlab else "HDF5"
        return describe(path, kind, entries, dataset, count, _hdf5_array, reverse=matlab)


def _hdf5_entry(name: str, node: Any) -> FolderEntry:
    names = [axis[0].name if len(axis) else axis.label or None for axis in node.dims]
    attributes = {title: node.attrs[title] for title in node.attrs if title not in _OWN}
    # A dimension of NetCDF that has no coordinates is a scale of zeros.
    real = (
        not str(node.attrs.get("NAME", b""))
        .lstrip("b'")
        .startswith("This is a netCDF dimension but not")
    )
    chunks = node.chunks or (1, 1, 1)
    return FolderEntry(name if real else "", node, attributes, dims=tuple(names), chunks=chunks)


# Attributes by which HDF5 ties axes together.
_OWN = ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")


def _hdf5_array(path: Path, name: str) -> Any:
    import h5py

    return h5py.File(path, "r")[name]


def classic_cube(path: Path, dataset: str | None, count: int | None) -> RawCube:
    """Variable of a classic NetCDF file (3), mapped into memory.

    Raises:
        ValueError: the file is not whole, or it holds no variable that can be meant.
    """
    entries = [
        FolderEntry(name, variable.data, dict(variable._attributes), dims=variable.dimensions)
        for name, variable in _classic(path, lambda file: dict(file.variables)).items()
    ]
    return describe(path, "NetCDF 3", entries, dataset, count, _classic_array)


def _classic_array(path: Path, name: str) -> Any:
    return _classic(path, lambda file: file.variables[name].data)


def _classic(path: Path, take: Callable[[Any], Any]) -> Any:
    """Contents of a classic file; arrays stay mapped after it is closed."""
    from scipy.io import netcdf_file

    with warnings.catch_warnings():
        # SciPy warns that arrays outlive the file, which is what is wanted.
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            file = netcdf_file(str(path), "r", mmap=True)
            stored = take(file)
            file.close()
            return stored
        except Exception as error:  # whatever a damaged header leads it to
            complaint = str(error)
        # Only now is the file that could not be opened forgotten, and its warning with it.
        raise refusal(path, f"cannot be read; is the file whole? {complaint}")
