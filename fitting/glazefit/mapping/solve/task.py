"""Inputs of a map, checked: the image, the search for its paints, the ground, all that the map
depends on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from jaxtyping import ArrayLike, Bool

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.spectra import Bands, validate_wavelengths

from ...film.films import check_ground
from ...film.model.errors import ModelError, Prior
from ...film.model.mixing import Pigments, digest, listed_pigments
from ...identify.families.expected import EXPECTED, has_families
from ...identify.search.options import IdentificationOptions, SearchKeywords
from ...identify.search.searcher import Searcher
from .atlas import ImageSearcher
from .by_family import FamilySearcher
from .by_paint import PaintSearcher
from .image import Image, identity, working_bands
from .spots import with_spots

if TYPE_CHECKING:
    import xarray

    from glazejax.io import CubeSource


@dataclass(frozen=True)
class MapTask:
    """A map that is to be made.

    Attributes:
        image: how its spectra are worked with.
        searcher: of the paints, or of their families.
        options: all that the map depends on; without noise it is estimated from the image.
    """

    image: Image
    searcher: ImageSearcher
    options: dict[str, Any]


def map_task(
    cube: "CubeSource | str | Path | xarray.DataArray",
    pigments: Pigments,
    *,
    ground: ArrayLike | None = None,
    opaque: bool = False,
    mask: Bool[np.ndarray, "y x"] | str | Path | None = None,
    spots: Mapping[str, Bands] | None = None,
    **search: Unpack[SearchKeywords],
) -> MapTask:
    """Options of `glazefit.map_cube`, checked; nothing of the image is read but what it is.

    Raises:
        ValueError: options or shapes that do not fit.
    """
    from glazejax.io import CubeSource, read_mask

    chosen = IdentificationOptions(**search)
    check_ground(ground, opaque=opaque)
    # The image, of which only shape and wavelengths are known so far.
    source = CubeSource(Path(cube)) if isinstance(cube, str | Path) else cube
    array = source.open() if isinstance(source, CubeSource) else _check_image(source)
    shape = array.shape[:2]
    stored = np.asarray(array["wavelength"], float)
    use = read_mask(mask, array) if isinstance(mask, str | Path) else mask
    if use is not None:
        use = np.asarray(use, bool)
        if use.shape != shape:
            raise ValueError(f"the mask has {_pixels(use.shape)}, the image {_pixels(shape)}")
    # The expected paints: those of the catalogue, and of spots.
    seen_by = resolve_instrument(chosen.instrument)
    catalogue = listed_pigments(pigments)
    by_family = has_families(catalogue)
    if by_family and spots:
        raise ValueError(
            f"the spot {next(iter(spots))!r} has no family, and families are searched: leave it "
            "out, or use the oils or the acrylics (--catalogue oils)"
        )
    if not by_family:
        chosen.refuse_facts()
    expected = chosen.prior or (EXPECTED if by_family else Prior())
    errors = chosen.discrepancy or ModelError()
    noise = chosen.noise
    paints = with_spots(catalogue, spots or {}, stored, seen_by)
    # Internal reflectance of the ground at the bands that the image is averaged to.
    bands = working_bands(stored, paints)
    below = None
    if ground is not None:
        values = np.asarray(ground, float)
        if values.shape not in ((), stored.shape):
            raise ValueError(
                f"a ground of shape {values.shape} is neither a number nor one for each of "
                f"{stored.size} bands"
            )
        below = np.broadcast_to(values, stored.shape) @ bands.mean
    asked = replace(chosen, instrument=seen_by, discrepancy=errors, prior=expected, noise=None)
    searcher = (
        FamilySearcher(bands.wavelengths, tuple(paints), asked, below)
        if by_family
        else PaintSearcher(Searcher.of(bands.wavelengths, paints, asked, opaque=opaque), below)
    )
    same_image = identity(source, array)
    # All that decides what a pixel's answer is: a map goes on only where these are the same.
    options = {
        # Of what a map's store holds.
        "version": 6,
        "image": same_image,
        "catalogue": {paint.name: _identity_of_paint(paint) for paint in paints},
        "ground": below,
        "mask": None if use is None else digest(use),
        "geometry": seen_by.geometry.describe(),
        "refractive_index": seen_by.refractive_index,
        "noise": None if noise is None else [noise.floor, noise.share],
        "discrepancy": asdict(errors),
        "prior": asdict(expected),
        "max_paints": chosen.max_paints,
        "elements": [chosen.elements, chosen.without_elements],
        "painted": chosen.painted,
    }
    return MapTask(
        image=Image(
            source=source,
            bands=bands,
            noise=noise,
            mask=use,
            changed=tuple(same_image.get("time of change", {}).values()),
        ),
        searcher=searcher,
        options=options,
    )


def _identity_of_paint(paint: Pigment) -> str:
    """Sixteen hexadecimal digits of all of a paint that an answer depends on."""
    arrays = (
        paint.wavelengths,
        paint.absorption,
        paint.scattering,
        paint.absorption_sd,
        paint.scattering_sd,
        paint.error_modes,
    )
    # The provenance is left out: it may be the path of the table, which may be moved.
    each = ["" if array is None else digest(array) for array in arrays]
    return digest(np.array([paint.family, paint.source, *each]))


def _check_image(array: "xarray.DataArray") -> "xarray.DataArray":
    """An image that was made by the caller.

    Raises:
        ValueError: other dimensions, or no legal wavelengths.
    """
    if array.dims != ("y", "x", "wavelength") or "wavelength" not in array.coords:
        raise ValueError(
            "an image has the dimensions y, x, wavelength, with wavelengths in nm; this one has "
            f"{array.dims}"
        )
    validate_wavelengths(np.asarray(array["wavelength"]))
    return array


def _pixels(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) + " pixels"
