"""Files of spectra in and out: tables, Excel, ENVI, CGATS, CxF3, JCAMP-DX, ASD, SVC; each format is
recognised by its content.

Images of any size and kind are opened by `open_cube`.
"""

import lazy_loader

# Formats and images take a tenth of a second, and most commands read neither.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# A module of the same name: once that is imported, it would stand in the function's place.
from .resample import resample as resample  # noqa: E402
