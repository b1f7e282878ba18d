"""Files of spectra in and out: tables, Excel, ENVI, CGATS, CxF3, JCAMP-DX, ASD, SVC; each format is
told by its content.

Images of any size and kind are opened by `open_cube`.
"""

from typing import TYPE_CHECKING

import lazy_loader

# A module of the same name: once that is imported, it would stand in the function's place.
from .resample import resample

if TYPE_CHECKING:
    from .cube import SpectraCube
    from .cubes.hashes import quick_source_hash
    from .cubes.regions import Spot, read_mask, read_spot
    from .cubes.source import CubeSource, open_cube
    from .read import read_cube, read_spectra
    from .sample import read_sample
    from .spectra_table import SpectraTable
    from .write import write_spectra, write_table

# Formats and images take a tenth of a second, and most commands read neither.
__getattr__, __dir__, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "cube": ["SpectraCube"],
        "cubes.hashes": ["quick_source_hash"],
        "cubes.regions": ["Spot", "read_mask", "read_spot"],
        "cubes.source": ["CubeSource", "open_cube"],
        "read": ["read_cube", "read_spectra"],
        "sample": ["read_sample"],
        "spectra_table": ["SpectraTable"],
        "write": ["write_spectra", "write_table"],
    },
)

__all__ = [
    "CubeSource",
    "SpectraCube",
    "SpectraTable",
    "Spot",
    "open_cube",
    "quick_source_hash",
    "read_cube",
    "read_mask",
    "read_sample",
    "read_spectra",
    "read_spot",
    "resample",
    "write_spectra",
    "write_table",
]
