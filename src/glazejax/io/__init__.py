"""Files of spectra in and out: tables, Excel, ENVI, CGATS, CxF3, JCAMP-DX, ASD, SVC; each format is
told by its content.

Images of any size and kind are opened by `open_cube`.
"""

from .cube import SpectraCube
from .cubes.hashes import quick_source_hash
from .cubes.regions import Spot, read_mask, read_spot
from .cubes.source import CubeSource, open_cube
from .read import read_cube, read_spectra
from .resample import resample
from .sample import read_sample
from .spectra_table import SpectraTable
from .write import write_spectra, write_table

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
