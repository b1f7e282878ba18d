"""Images of spectra that tests write with programs of others and open with ours."""

import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import spectral.io.envi as spy
import tifffile
import xarray as xr

WAVELENGTHS = (400.0, 410.0, 420.0, 430.0, 450.0, 470.0, 500.0)
LINES, SAMPLES, BANDS = 23, 31, len(WAVELENGTHS)


def image(seed=0, lines=LINES, samples=SAMPLES):
    """Fractions of four digits, so that whole numbers and floats hold them alike."""
    return np.random.default_rng(seed).integers(1, 10_000, (lines, samples, BANDS)) / 10_000


IMAGE = image()
"""The usual one, which no test writes into."""
IMAGE.setflags(write=False)


def binned(values, each):
    """Means that ignore NaN, of the bins that are full."""
    y, x, z = (n // k for n, k in zip(values.shape, each, strict=True))
    whole = values[: y * each[0], : x * each[1], : z * each[2]]
    parts = whole.reshape(y, each[0], x, each[1], z, each[2])
    with np.errstate(invalid="ignore"):
        return np.nansum(parts, axis=(1, 3, 5)) / np.isfinite(parts).sum(axis=(1, 3, 5))


def envi(
    values: np.ndarray = IMAGE,
    /,
    *,
    folder: Any = ".",
    interleave: Any = "bsq",
    dtype: Any = "u2",
    order: Any = 0,
    name: Any = "image",
    wavelengths: Any = WAVELENGTHS,
    **fields: Any,
) -> Path:
    """Image that Spectral Python writes: whole numbers in ten thousandths, of 8 bits in hundredths."""
    kind = np.dtype(dtype).kind
    if kind != "f":
        fields.setdefault("reflectance scale factor", 100 if dtype == "u1" else 10_000)
        values = np.round(values * float(fields["reflectance scale factor"]))
    if wavelengths is not None:
        fields["wavelength"] = list(wavelengths)
    path = Path(folder, f"{name}.hdr")
    spy.save_image(
        str(path),
        values.astype(dtype),
        dtype=dtype,
        interleave=interleave,
        byteorder=order,
        metadata=fields,
        force=True,
    )
    return path


def holes(interleave, lines, samples, wavelengths):
    """A large image that takes no room."""
    fields = {
        "lines": lines,
        "samples": samples,
        "bands": len(wavelengths),
        "data type": 12,
        "interleave": interleave,
        "wavelength": list(wavelengths),
        "reflectance scale factor": 10_000,
        "byte order": 0,
    }
    spy.create_image("big.hdr", fields, force=True)
    return Path("big.hdr")


def bright_image() -> Path:
    """Such an image with one reading as high as there are."""
    path = envi()
    raw = np.memmap(path.with_suffix(".img"), "<u2", "r+", shape=(BANDS, LINES, SAMPLES))
    raw[2, 5, 6] = 65535
    raw.flush()
    return path


def labelled(values, **attributes):
    """The same as a data set of xarray, with coordinates in millimetres."""
    places = {
        "wavelength": ("wavelength", np.asarray(WAVELENGTHS, float), {"units": "nm"}),
        "y": ("y", np.arange(values.shape[0]) * 0.5, {"units": "mm"}),
        "x": ("x", np.arange(values.shape[1]) * 0.5 + 7, {"units": "mm"}),
    }
    return xr.DataArray(
        values, places, ("y", "x", "wavelength"), "reflectance", attributes
    ).to_dataset()


PACKED = {"reflectance": {"dtype": "u2", "scale_factor": 1e-4, "_FillValue": 65535}}


def zarr(dataset, *, folder: str | Path = ".", version=3, encoding=None, name="image.zarr"):
    path = Path(folder, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of zarr, on consolidated metadata
        dataset.to_zarr(path, zarr_format=version, encoding=encoding or {}, mode="w")
    return path


def hdf5(values: np.ndarray = IMAGE, *, folder: str | Path = ".", dtype="f4", **further):
    """Cube in groups, as airborne spectrometers' files have it."""
    path = Path(folder, "image.h5")
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "SITE/Reflectance/Reflectance_Data", data=values.astype(dtype), **further
        )
        spectral = file.create_dataset(
            "SITE/Reflectance/Metadata/Spectral_Data/Wavelength", data=WAVELENGTHS
        )
        spectral.attrs["Units"] = "nanometers"
    return path


def tiff(
    values: np.ndarray = IMAGE,
    *,
    folder: str | Path = ".",
    name="image.tif",
    pages=False,
    **further,
):
    """A page a band: as one series (BigTIFF, big-endian), or each page for itself and described."""
    path = Path(folder, name)
    planes = np.moveaxis(values, 2, 0).astype("f4")
    if not pages:
        tifffile.imwrite(
            path,
            planes,
            photometric="minisblack",
            byteorder=">",
            bigtiff=True,
            metadata={"wavelengths": list(WAVELENGTHS)},
            **further,
        )
        return path
    with tifffile.TiffWriter(path) as writer:
        for wavelength, plane in zip(WAVELENGTHS, planes, strict=True):
            writer.write(
                plane, contiguous=False, description=f"filter {wavelength:g} nm", **further
            )
    return path


def tiffs(
    values: np.ndarray = IMAGE, *, folder: str | Path = ".", form="band_{:g}nm.tif", **further
):
    """A file a band."""
    path = Path(folder, "bands")
    path.mkdir()
    for i, wavelength in enumerate(WAVELENGTHS):
        tifffile.imwrite(path / form.format(wavelength), values[..., i].astype("f4"), **further)
    return path


def every(folder: Path, values: np.ndarray) -> dict[str, dict[str, Any]]:
    """The same image in every kind of file: what `open_cube` needs to open it."""
    dataset = labelled(values.astype("f4"))
    dataset.to_netcdf(
        folder / "new.nc", engine="h5netcdf", encoding={"reflectance": {"chunksizes": (8, 8, 3)}}
    )
    dataset.to_netcdf(folder / "old.nc", engine="scipy")
    np.save(folder / "image.npy", values.astype("f4"))
    return {
        "envi": {"path": envi(values, folder=folder, dtype="f4")},
        "npy": {"path": folder / "image.npy", "wavelengths": WAVELENGTHS},
        "zarr": {
            "path": zarr(dataset, folder=folder, encoding={"reflectance": {"chunks": (8, 10, 3)}})
        },
        "netcdf": {"path": folder / "new.nc"},
        "classic": {"path": folder / "old.nc"},
        "hdf5": {"path": hdf5(values, folder=folder, chunks=(4, 9, 7))},
        "tiff": {"path": tiff(values, folder=folder)},
        "packed tiff": {
            "path": tiff(
                values, folder=folder, name="packed.tif", compression="zlib", tile=(16, 16)
            )
        },
        "pages": {
            "path": tiff(
                values,
                folder=folder,
                name="pages.tif",
                pages=True,
                compression="zlib",
                rowsperstrip=5,
            )
        },
        "tiffs": {"path": tiffs(values, folder=folder)},
    }


KINDS = (
    "envi",
    "npy",
    "zarr",
    "netcdf",
    "classic",
    "hdf5",
    "tiff",
    "packed tiff",
    "pages",
    "tiffs",
)
