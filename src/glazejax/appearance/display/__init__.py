"""Colours on a measured or standard display, and back (paper B, section 2)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
