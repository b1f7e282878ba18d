"""Paper C: many fluxes, any phase function; layers of different index, free-standing layers, the
light inside.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
