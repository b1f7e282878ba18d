"""Glazes in Mitsuba 3: a BSDF ``glaze``, from the solver's table of all angles.

`register` makes it known, `glaze_bsdf` makes the dictionary that `mitsuba.load_dict` takes. It
needs a variant that follows wavelengths: scalar_spectral, llvm_ad_spectral or cuda_ad_spectral. See
docs/mitsuba.md.
"""

from .describe import glaze_bsdf
from .registration import register, register_if_set
from .variants import usable_variant

__all__ = ["glaze_bsdf", "register", "usable_variant"]

register_if_set()
