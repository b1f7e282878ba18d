"""What the surface of a glaze reflects by itself, in Dr.Jit."""

from typing import Any

from .device import DrJit
from .surfaces import Smooth


class Mirror:
    """A smooth surface: Fresnel's mirror."""

    delta = True

    def __init__(self, mi: Any, dr: Any, refractive_index: float):
        self._mi = mi
        self._ops, self._surface = DrJit(mi, dr), Smooth(refractive_index)
        self.kind = mi.BSDFFlags.DeltaReflection
        self.flag = int(self.kind)

    def albedo(self, cosine: Any) -> Any:
        """Share of the light that it reflects."""
        return 1.0 - self._surface.transmittance(self._ops, cosine)

    def sample(self, wi: Any, sample1: Any, sample2: Any) -> Any:
        """The mirrored direction."""
        return self._mi.reflect(wi)

    def mirrored(self, wi: Any) -> Any:
        """What the mirrored direction carries."""
        return self.albedo(abs(wi.z))
