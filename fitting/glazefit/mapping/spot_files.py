"""Files of spectra that no paints explain, next to the report: their readings, and paints for a
second map.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from glazejax import Pigment
from glazejax.geometry import Instrument
from glazejax.io.write import write_table
from glazejax.paint.pigment_table import write_pigments
from glazejax.spectra import common_range

from ..identify.families.expected import has_families
from .show.page_rows import PAINTS, REFERENCES, SPECTRA
from .solve.spots import with_spots

if TYPE_CHECKING:
    import xarray


def write_spots(
    folder: Path,
    paint_map: "xarray.Dataset",
    grid: Float[np.ndarray, "stored"],
    paints: Sequence[Pigment],
    *,
    instrument: Instrument,
    overwrite: bool = False,
) -> list[Path]:
    """Write the spectra that no paints explain, and a table of paints that has them too; of a map
    by family, a table of references whose families are left open.

    Args:
        folder: of the report.
        paint_map: the map.
        grid: wavelengths of the image, nm.
        paints: that were tried.
        instrument: that read the image.
        overwrite: whether files that exist may be replaced.

    Returns:
        The files; none where the map has no such spectra.
    """
    spots = {
        spot["name"]: np.asarray(spot["reading"], float)
        for spot in paint_map.attrs.get("spots", ())
    }
    if not spots:
        return []
    bands = np.asarray(paint_map.attrs["working_wavelengths"], float)
    if has_families(paints):
        rows = [[name, "", *np.round(reading, 5)] for name, reading in spots.items()]
        titles = ["name", "family", *(f"{nm:g}" for nm in bands)]
        write_table(folder / REFERENCES, titles, rows, overwrite=overwrite)
        return [folder / REFERENCES]
    files = [folder / SPECTRA, folder / PAINTS]
    rows = [[nm, *(reading[n] for reading in spots.values())] for n, nm in enumerate(bands)]
    write_table(files[0], ["wavelength_nm", *spots], rows, overwrite=overwrite)
    # As wide as the image: beyond the outermost readings k and s go on as there.
    first, last = common_range([grid, *(p.wavelengths for p in paints)])
    wide = np.unique(np.clip([first, *bands, last], first, last))
    # No hiding paint reads less than its surface, or more than all light.
    possible = {
        name: np.interp(wide, bands, np.clip(reading, instrument.seen_surface, 1.0))
        for name, reading in spots.items()
    }
    comments = [
        f"glazejax map: the paints that were tried, and {', '.join(spots)}: spectra that none of "
        "them explains, taken as thick paint; s is the median of the others."
    ]
    all_paints = with_spots(paints, possible, wide, instrument)
    write_pigments(files[1], all_paints, comments, overwrite=overwrite)
    return files
