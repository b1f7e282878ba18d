"""Glazes for other programs: OpenPBR and MaterialX, sets of textures, and what of the glaze is lost
on the way.

`fit_openpbr` finds the parameters of OpenPBR whose light comes nearest to a computed glaze,
`write_materialx` writes them, and `texture_set` writes pictures for a glaze that changes from point
to point. Nothing is imported before it is asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
