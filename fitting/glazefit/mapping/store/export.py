"""A map as one NetCDF or ENVI file for other programs, written window by window."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from glazejax.extras import require
from glazejax.io.outputs import check_output
from glazejax.progress import Progress, no_progress
from glazejax.whole_file import whole_file

from .atomic_files import explain_full_disk
from .layout import BY_NAME, VARIABLES, Status, Variable
from .store import MapStore, open_map
from .windows import Window

if TYPE_CHECKING:
    import xarray

_NETCDF = (".nc", ".nc4", ".h5")
_ENVI = (".hdr", ".img", ".dat", ".bsq")


def check_export(path: str | Path, *, overwrite: bool = False, argument: str = "") -> list[Path]:
    """The files that a map would be exported to, if they can be written; asked before anything is
    computed.

    Args:
        path: its ending says the format: .nc, .nc4 or .h5 for NetCDF; .hdr, .img, .dat or .bsq for
            ENVI (two files).
        overwrite: whether files that exist may be replaced.
        argument: what the path was given as; errors begin with it.

    Raises:
        ValueError: no format has the ending.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
        `glazejax.io.outputs.check_output`. ModuleNotFoundError: what writes the format is not
        installed.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending in _NETCDF:
        require("h5netcdf", "dask")
        files = [path]
    elif ending in _ENVI:
        files = [path.with_suffix(".hdr"), path if ending != ".hdr" else path.with_suffix(".img")]
    else:
        subject = f"{argument} {path}" if argument else f"{path}"
        raise ValueError(
            f"{subject}: maps are exported as NetCDF (.nc) or ENVI (.hdr or .img); name such a file"
        )
    return [check_output(file, overwrite=overwrite, argument=argument) for file in files]


def export_map(
    map: str | Path,
    path: str | Path,
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Write a map as one NetCDF file, or as an ENVI image and its header.

    NetCDF holds all that the map holds. The ENVI image is float32, band after band: status, way,
    condition, probability, none, explained, thickness and its standard deviation in um, misfit and
    rmse, then of each paint its probability,
    its share by mass (0 where the pixel's set is without it) and that share's standard deviation;
    NaN where a pixel was not mapped. So ENVI has its paints by name; `set_labels` names those of a
    set in NetCDF.

    Args:
        map: folder of the map.
        path: see `check_export`.
        overwrite: whether files that exist may be replaced.
        progress: called with windows done, windows in all and what is done; of ENVI only.

    Returns:
        The files.

    Raises:
        ValueError, FileExistsError, FileNotFoundError, IsADirectoryError, ModuleNotFoundError: see
        `check_export`. OSError: the disk is full; nothing is left of the file then.
    """
    files = check_export(path, overwrite=overwrite)
    store = MapStore(map)
    if files[0].suffix.lower() in _NETCDF:
        with _whole(files[0]) as partial:
            _write_netcdf(store, partial)
    else:
        header, data = files
        with _whole(data) as partial:
            names = _write_bands(store, partial, progress)
        with _whole(header) as partial:
            bands = {
                "bands": len(names),
                "file type": "ENVI Standard",
                "data type": 4,
                "data ignore value": "nan",
                "band names": "{ " + ", ".join(names) + " }",
            }
            partial.write_text(envi_header(open_map(map), bands), encoding="utf-8")
    return files


def _write_netcdf(store: MapStore, path: Path) -> None:
    from dask.config import set as configured

    dataset = open_map(store.path)
    dataset.attrs = _flat(dataset.attrs)
    encoding: dict[str, dict[str, Any]] = {}
    for name, array in dataset.variables.items():
        array.attrs = _flat(array.attrs)
        array.encoding = {}
        settings: dict[str, Any] = {}
        if name in BY_NAME:
            settings = {
                "zlib": True,
                "complevel": 1,
                "shuffle": True,
                "chunksizes": (*store.chunk, *array.shape[2:]),
            }
        if array.dtype.kind in "iu" or name in ("y", "x"):
            # A fill value would turn whole numbers into others in programs that mask it.
            settings["_FillValue"] = None
        encoding[str(name)] = settings
    # One window after another: the cores would only hold more of them in memory.
    with configured(scheduler="synchronous"):
        dataset.chunk({"y": store.chunk[0], "x": store.chunk[1]}).to_netcdf(
            path, engine="h5netcdf", encoding=encoding
        )


def _flat(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes as NetCDF has them: numbers, texts and lists of one of them; all else as JSON."""
    flat: dict[str, Any] = {}
    for name, value in attrs.items():
        kinds = {type(item) for item in (value if isinstance(value, list) else [value])}
        plain = len(kinds) == 1 and kinds <= {int, float, str}
        flat[str(name)] = value if plain else json.dumps(value)
    return flat


def _label(variable: Variable) -> str:
    """Name of an array as a band, with its unit; lengths are in um."""
    unit = {"m": "um", "1": ""}.get(variable.unit, variable.unit)
    return f"{variable.name} ({unit})" if unit else variable.name


def _write_bands(store: MapStore, path: Path, progress: Progress) -> tuple[str, ...]:
    """Write the image of bands, band after band; their names."""
    dataset = open_map(store.path)
    lines, samples = store.shape
    all_windows = store.windows()
    names: tuple[str, ...] = ()
    with path.open("wb") as file:
        for number, window in enumerate(all_windows, start=1):
            names, bands = zip(*_bands(dataset, window, store.paints), strict=True)
            # Windows come row by row within bands: what is not written yet must be there to be
            # skipped.
            file.truncate(4 * len(bands) * lines * samples)
            for band, plane in enumerate(bands):
                for line, row in enumerate(plane.astype("<f4"), start=window.y0):
                    file.seek(4 * ((band * lines + line) * samples + window.x0))
                    file.write(row.tobytes())
            progress(number, len(all_windows), "writing the bands")
    return names


def _bands(
    dataset: "xarray.Dataset", window: Window, paints: Sequence[str]
) -> Iterator[tuple[str, Float[np.ndarray, "y x"]]]:
    """Bands of a window, and their names."""
    y, x = window.slices
    arrays = {name: dataset[name][y, x].values for name in BY_NAME if name != "true_colour"}
    mapped = arrays["status"] == Status.MAPPED
    # Arrays of one number a pixel, then those of paints.
    for variable in (variable for variable in VARIABLES if not variable.further):
        factor = np.float32(1e6 if variable.unit == "m" else 1.0)
        values = arrays[variable.name].astype(np.float32) * factor
        whole = variable.name in ("status", "way")
        yield _label(variable), values if whole else np.where(mapped, values, np.nan)
    for number, paint in enumerate(paints):
        present = arrays["members"] == number
        share, sd = (
            np.where(present, arrays[name], 0).sum(-1) for name in ("fraction", "fraction_sd")
        )
        of_paint = {
            "probability of": arrays["paint_probability"][..., number],
            "fraction of": share,
            "fraction standard deviation of": sd,
        }
        for label, values in of_paint.items():
            yield f"{label} {braceless(paint)}", np.where(mapped, values, np.nan)


def envi_header(dataset: "xarray.Dataset", bands: Mapping[str, object]) -> str:
    """The header of an ENVI image of a map, with its place if the map knows it.

    Args:
        dataset: the map.
        bands: fields that say what the numbers are.
    """
    title = str(dataset.attrs.get("title", "map of paints"))
    fields: dict[str, object] = {
        "description": f"{{ {braceless(title)}, by glazejax }}",
        "samples": dataset.sizes["x"],
        "lines": dataset.sizes["y"],
        "header offset": 0,
        "interleave": "bsq",
        "byte order": 0,
        **bands,
        **_place(dataset),
    }
    return "ENVI\n" + "".join(f"{title} = {value}\n" for title, value in fields.items())


def _place(dataset: "xarray.Dataset") -> dict[str, str]:
    """Position of the image in a header, or the size of its pixels; nothing for bare pixels."""
    unit, *sizes = _pixels(dataset)
    if unit == "pixel" or not all(sizes):
        return {}
    place = map_place(dataset)
    if not place:
        return {"pixel size": f"{{ {sizes[0]!r}, {sizes[1]!r}, units={unit} }}"}
    titles = {"map_info": "map info", "crs_wkt": "coordinate system string"}
    return {titles[name]: f"{{ {text} }}" for name, text in place.items()}


def map_place(image: "xarray.DataArray | xarray.Dataset") -> dict[str, str]:
    """Attributes ``map_info`` and ``crs_wkt`` of an image or a map for its own coordinates, which
    follow windows and bins; nothing for bare pixels, nor for a turned image, which has no
    coordinates of the map.
    """
    info = [entry.strip() for entry in str(image.attrs.get("map_info", "")).split(",")]
    turned = any(
        re.fullmatch(r"rotation\s*=\s*-?0*\.?0*", e, re.I) is None
        for e in info
        if "rotation" in e.lower()
    )
    if len(info) < 7 or turned:
        return {}
    unit, *sizes = _pixels(image)
    if unit == "pixel" or not all(sizes):
        return {}
    east = float(image["x"][0]) - sizes[0] / 2
    north = float(image["y"][0]) + sizes[1] / 2
    placed = [info[0], "1", "1", *(repr(value) for value in (east, north, *sizes)), *info[7:]]
    system = {"crs_wkt": str(image.attrs["crs_wkt"])} if "crs_wkt" in image.attrs else {}
    return {"map_info": ", ".join(placed), **system}


def _pixels(image: "xarray.DataArray | xarray.Dataset") -> tuple[str, float, float]:
    """Unit of an image's coordinates, and width and height of its pixels, 0 where not stated."""
    x = image["x"]
    width, height = (float(axis.attrs.get("pixel_size", 0)) for axis in (x, image["y"]))
    return str(x.attrs.get("units", "pixel")), width, height


def braceless(text: str) -> str:
    """A text without what ends a name in an ENVI header."""
    return re.sub(r"[{},\n]", " ", text).strip()


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A name to write under; what was written takes its own once it is whole, and is taken away if
    it fails.
    """
    with (
        explain_full_disk(path, lambda: "the map itself is kept, without this file"),
        whole_file(path) as partial,
    ):
        yield partial
