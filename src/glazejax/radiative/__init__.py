"""The physics: radiative transfer in layered media. Knows arrays, knows no paint.

Public: `stack` and `profile` (the solver, any method), `twoflux`, `plan` (what a scene does not
need), the packages
`auxiliary` (paper A) and `manyflux` (paper C) with their own names, `phase` functions and `fresnel`
interfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
