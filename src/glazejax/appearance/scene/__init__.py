"""A scene: shapes, materials, lights, a camera, and the picture of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
