"""The report of a map: one HTML file without anything from elsewhere, and its pictures as PNG
files.
"""

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.extras import require
from glazejax.io.write import write_files

from ...page.templates import fill_template
from ..store.chunk import Members, SetSums
from ..store.layout import Way, status_counts
from .classes import CLASSES, write_classes
from .legend import OTHERS
from .overview import overview
from .page_rows import (
    PAINTS,
    REFERENCES,
    family_rows,
    set_rows,
    share_words,
    small_spectrum,
    spot_rows,
)
from .pictures import (
    RGB,
    colour_numbers,
    enlarge,
    false_colour,
    found_paints,
    legend_map,
    legend_places,
    numbers_of,
    paint_pictures,
    write_pictures,
)

if TYPE_CHECKING:
    import xarray as xr

_WAYS = {
    Way.UPDATED: "from the representative next to it, in closed form",
    Way.SEARCHED: "by a search of its own",
    Way.NEIGHBOUR: "from a pixel nearby that was searched, in closed form",
}


def write_report(
    dataset: "xr.Dataset",
    sets: SetSums,
    provenance: Mapping[str, Any],
    folder: Path,
    *,
    cube: "xr.DataArray",
    facts: Mapping[Members, Mapping[str, Any]] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write report.html and the map of classes into a folder, and pictures as PNG files into its
    folder pictures.

    Args:
        dataset: the map, with the variables of `layout.VARIABLES` and the coordinate `paint`.
        sets: sums over the pixels of each set, by its members ascending; () for none.
        provenance: what else is to be said, by `map_provenance`; empty values are left out.
        folder: is made.
        cube: the readings (y, x, wavelength) for a picture in false colour.
        facts: of each set of a map by family, by `describe_sets`.
        overwrite: replace an older report.

    Returns:
        Path of the page.

    Raises:
        FileExistsError: there is a report, and `overwrite` is false.
    """
    path = folder / "report.html"
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} is there already: --overwrite replaces it")
    look = overview(dataset, sets)
    tallies = dataset.attrs["tallies"]
    grid = np.asarray(dataset.attrs["working_wavelengths"], float)
    false = false_colour(cube, look.step)
    numbers = numbers_of(look)
    families = None if facts is None else family_rows(look)
    paints = (
        [paint_pictures(look, paint) for paint in found_paints(look)] if families is None else []
    )
    order = found_paints(look, least=0.0)
    ways = {words: tallies.get(f"way {way.name.lower()}") for way, words in _WAYS.items()}
    pieces = fill_template(
        "mapping/show/page.html",
        title=f"Map of paints: {provenance['title']}",
        look=look,
        provenance=provenance,
        statuses=status_counts(tallies),
        frequent=[look.paints[paint] for paint in found_paints(look, 0.01)],
        colour=enlarge(look.colour),
        legend=legend_map(look),
        marks=legend_places(look),
        false_colour=false,
        sets=list(set_rows(look, grid, facts)),
        families=families,
        classes=CLASSES,
        others=OTHERS,
        unexplained=small_spectrum(sets.get(()), grid),
        numbers=numbers,
        order=order,
        never=[name for n, name in enumerate(look.paints) if n not in order],
        paints=paints,
        spots=list(spot_rows(dataset.attrs.get("spots", ()), grid)),
        spots_file=PAINTS if facts is None else REFERENCES,
        ways={words.capitalize(): f"{count:,.0f} pixels" for words, count in ways.items() if count},
        grid=grid,
        share=share_words,
        encode=_encode,
        stops=_stops,
        colour_numbers=colour_numbers,
    )
    html = "".join(pieces).encode("utf-8", "xmlcharrefreplace")
    (folder / "pictures").mkdir(parents=True, exist_ok=True)
    flat = [*numbers, *(picture for pair in paints for picture in pair)]
    plain = [("false_colour", "False colour", false[0])]
    for family in families or ():
        flat.append(family["probability"])
        plain.append((family["key"], f"Where {family['name']} is", family["place"]))
    write_pictures(look, folder / "pictures", flat, plain)
    write_classes(dataset, look, folder, overwrite=overwrite)
    write_files({path: [html]}, overwrite=overwrite)
    return path


def _encode(image: RGB) -> str:
    """A picture as a PNG, in base 64."""
    require("PIL")
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(file, "PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode("ascii")


def _stops(colours: str) -> str:
    """Colours of a scale, from its low end to its high one."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return ", ".join(to_hex(colour) for colour in colormaps[colours](np.linspace(0, 1, 17)))
