"""Paper A: the auxiliary function method, on a uniform grid as printed (`uniform`) and on graded
panels (`graded`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
