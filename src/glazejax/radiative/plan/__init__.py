"""Omission, with bounds, of what a scene does not need: `plan_stacks` decides once, `Plan`
computes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
