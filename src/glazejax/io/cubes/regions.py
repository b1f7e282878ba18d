"""Parts of an image: masks from pictures and polygons, and spots of which the spectrum is
wanted.
"""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...extras import require
from ..source import explain_errors, is_there, open_source, refusal
from ..spectra_table import Bands, Mask
from .tiffs import TIFF

if TYPE_CHECKING:
    import xarray


def read_mask(path: str | Path, image: Any) -> Mask:
    """Read which pixels are used, from a picture or from polygons.

    A picture (PNG or what Pillow reads) uses the pixels that are not black and not transparent.
    Polygons are GeoJSON (Polygon, MultiPolygon, or features of them) or a CSV of x, y vertices, an
    empty line between polygons; a pixel is used if its centre lies inside. Their numbers are pixels
    of the whole image: 0, 0 is its upper left corner, and the first pixel's centre is at 0.5, 0.5.
    Polygons may overlap; holes are GeoJSON's, rings after a polygon's first.

    Args:
        path: of the picture or of the polygons.
        image: the cube that `open_cube` gave, or (lines, samples). The picture has the size of the
            whole image, or that of the cube as it was opened, windowed and binned; a bin is used if
            at least half of its pixels are.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a picture of another size, a file that is neither, or nothing is used.
    """
    path = Path(path)
    shape = tuple(image) if not hasattr(image, "dims") else image.shape[:2]
    attributes = getattr(image, "attrs", {})
    whole = tuple(attributes.get("shape_in_file", shape))[:2]
    with open_source(path) as source:
        head = source.head[:64]
        picture = head.startswith((b"\x89PNG", *TIFF, b"BM", b"\xff\xd8", b"GIF8"))
        text = "" if picture else source.text()
    if picture:
        used = _picture(path)
        if used.shape == shape:
            whole = shape
        if used.shape != whole:
            size = f"{whole[0]} lines x {whole[1]} samples"
            if shape != whole:
                size += f", opened as {shape[0]} x {shape[1]}"
            raise refusal(
                path,
                f"the mask has {used.shape[0]} lines x {used.shape[1]} samples; the image has "
                f"{size}",
            )
    else:
        used = np.logical_or.reduce([inside(polygon, whole) for polygon in _polygons(path, text)])
    if shape != whole:
        y0, y1, x0, x1 = attributes.get("window", (0, whole[0], 0, whole[1]))
        by, bx, _ = attributes.get("binning", (1, 1, 1))
        cropped = used[y0:y1, x0:x1][: shape[0] * by, : shape[1] * bx]
        used = cropped.reshape(shape[0], by, shape[1], bx).mean((1, 3)) >= 0.5
    if not used.any():
        raise refusal(path, "the mask uses no pixel of the image")
    return used


def _picture(path: Path) -> Mask:
    """Pixels of a picture that are neither black nor transparent."""
    require("PIL")
    from PIL import Image

    with explain_errors(path):
        try:
            with Image.open(path) as picture:
                if picture.mode == "P":
                    picture = picture.convert("RGBA")
                values = np.atleast_3d(np.asarray(picture)) != 0
        except (OSError, SyntaxError, Image.DecompressionBombError) as error:
            # What the system says is explained elsewhere.
            if isinstance(error, OSError) and error.errno is not None:
                raise
            raise refusal(path, f"not a whole picture: {error}") from None
    # The last of two or four is how opaque the pixel is.
    if values.shape[2] in (2, 4):
        return values[..., :-1].any(axis=2) & values[..., -1]
    return values.any(axis=2)


def _polygons(path: Path, text: str) -> list[list[Float[np.ndarray, "_ 2"]]]:
    """Polygons, each the rings of its edge and its holes, from GeoJSON or from rows of numbers."""
    if text.lstrip().startswith(("{", "[")):
        try:
            rings_of_polygons = _coordinates(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise refusal(path, f"not GeoJSON of polygons: {error}") from None
    else:
        rings: list[Any] = [[]]
        for number, line in enumerate(text.splitlines(), start=1):
            words = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
            if not words:
                rings.append([])
                continue
            try:
                point = [float(word) for word in words]
            except ValueError:
                if number == 1:  # titles
                    continue
                raise refusal(path, f"{line.strip()[:40]!r} is not x,y", number) from None
            if len(point) != 2:
                raise refusal(path, f"{len(point)} numbers where a vertex has x,y", number)
            rings[-1].append(point)
        rings_of_polygons = [[ring] for ring in rings if ring]
    polygons = [[_ring(path, ring) for ring in polygon] for polygon in rings_of_polygons if polygon]
    if not polygons:
        raise refusal(path, "holds no polygon")
    return polygons


def _ring(path: Path, ring: Any) -> Float[np.ndarray, "vertices 2"]:
    """Vertices of a ring, checked."""
    try:
        points: np.ndarray = np.asarray(ring, float)
    except (ValueError, TypeError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] < 2 or not np.isfinite(points).all():
        raise refusal(path, "a polygon is a list of x, y pairs of finite numbers")
    if len(points) < 3:
        raise refusal(path, f"a polygon needs three vertices; one has {len(points)}")
    return points[:, :2]


def _coordinates(node: Any) -> list[Any]:
    """Polygons in GeoJSON, each a list of rings; a bare list is a ring."""
    if isinstance(node, list):
        return [[node]]
    kind = node.get("type")
    collections = {"FeatureCollection": "features", "GeometryCollection": "geometries"}
    if kind in collections:
        return [polygon for child in node[collections[kind]] for polygon in _coordinates(child)]
    if kind == "Feature":
        return _coordinates(node["geometry"])
    if kind == "Polygon":
        return [list(node["coordinates"])]
    if kind == "MultiPolygon":
        return [list(polygon) for polygon in node["coordinates"]]
    raise ValueError(f"{kind!r} is neither Polygon nor MultiPolygon")


def inside(rings: list[Float[np.ndarray, "_ 2"]], shape: tuple[int, int]) -> Mask:
    """Pixels of which the centre lies inside: a ray to the left crosses the rings an odd number of
    times.
    """
    lines, samples = shape
    used = np.zeros(shape, bool)
    start = np.concatenate(rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    centres = np.arange(samples) + 0.5
    for line in range(max(0, int(start[:, 1].min()) - 1), min(lines, int(start[:, 1].max()) + 2)):
        y = line + 0.5
        # Half-open, so that a vertex on the line counts once.
        met = (start[:, 1] <= y) != (end[:, 1] <= y)
        if met.any():
            xa, ya = start[met].T
            xb, yb = end[met].T
            crossings = np.sort(xa + (y - ya) / (yb - ya) * (xb - xa))
            used[line] = np.searchsorted(crossings, centres, side="right") % 2 == 1
    return used


class Spot(NamedTuple):
    """Mean spectrum of a part of an image.

    Attributes:
        wavelengths: (bands,), nm.
        reflectance: (bands,), mean over the pixels that have data; NaN where none has.
        deviation: (bands,), standard deviation of one pixel about that mean; NaN where fewer than
            two have data.
        pixels: how many have data at any band.
    """

    wavelengths: Bands
    reflectance: Bands
    deviation: Bands
    pixels: int


# Readings of a spot that are read at a time.
_AT_ONCE = 1 << 22
_SPOT = re.compile(r"\s*(\d+)(?:\s*:\s*(\d+))?\s*,\s*(\d+)(?:\s*:\s*(\d+))?\s*")


def read_spot(cube: "xarray.DataArray", spot: str | Path) -> Spot:
    """Mean spectrum of a pixel, of a box or of a mask of a cube; readings that are missing or
    saturated are left out.

    Args:
        cube: what `open_cube` gave.
        spot: ``x,y`` or ``x0:x1,y0:y1`` in pixels of the cube as it was opened, from 0 on, ends not
            included; or a file that `read_mask` reads.

    Raises:
        FileNotFoundError: neither a place nor a file.
        ValueError: the place lies outside of the cube, or has no data.
    """
    lines, samples = cube.shape[:2]
    match = _SPOT.fullmatch(str(spot))
    if match is None or is_there(spot):
        if not is_there(spot):
            raise FileNotFoundError(
                f"{str(spot)!r} is neither a place such as 120,45 or 100:140,30:60, nor a file"
            )
        used = read_mask(spot, cube)
    else:
        x0, x1, y0, y1 = (int(number or -1) for number in match.groups())
        x1 = x0 + 1 if x1 < 0 else x1
        y1 = y0 + 1 if y1 < 0 else y1
        if not (x0 < x1 <= samples and y0 < y1 <= lines):
            raise ValueError(
                f"the spot {spot} does not lie in the image: x goes from 0 to {samples}, y from "
                f"0 to {lines}"
            )
        used = np.zeros((lines, samples), bool)
        used[y0:y1, x0:x1] = True
    places = np.argwhere(used)
    y0, x0 = places.min(axis=0).tolist()
    y1, x1 = (places.max(axis=0) + 1).tolist()
    x = slice(x0, x1)
    bands = cube.sizes["wavelength"]
    sums = np.zeros((3, bands))  # of ones, values and squares
    shift = np.zeros(bands)
    pixels = 0
    top = cube.attrs.get("saturated", np.inf)
    step = max(1, _AT_ONCE // ((x1 - x0) * bands))
    for start in range(y0, y1, step):
        y = slice(start, min(start + step, y1))
        values = cube.isel(y=y, x=x).values[used[y, x]].astype(float)
        there = np.isfinite(values) & (values < top)
        if not pixels and there.any():
            # About a mean of the first part, so that squares lose no digits.
            shift = np.where(there, values, 0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        values = np.where(there, values - shift, 0.0)
        sums += [term.sum(axis=0) for term in (there, values, values**2)]
        pixels += int(there.any(axis=1).sum())
    if not pixels:
        raise ValueError(f"the spot {spot} has no data: all readings are missing or saturated")
    count, total, square = sums
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
        deviation = np.where(
            count > 1, np.sqrt(np.maximum(square - total * mean, 0) / (count - 1)), np.nan
        )
    return Spot(np.asarray(cube["wavelength"].values, float), mean + shift, deviation, pixels)
