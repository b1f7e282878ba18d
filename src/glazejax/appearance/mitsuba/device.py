"""The table's arithmetic in Dr.Jit, for whichever variant of Mitsuba is set, and the variants that
will do.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ...extras import require
from .lookup import Arithmetic
from .table import TABLES, Body

VARIANTS = ("scalar_spectral", "llvm_ad_spectral", "cuda_ad_spectral")


def renderer() -> tuple[Any, Any]:
    """Mitsuba, with a variant set that follows wavelengths, and Dr.Jit.

    Raises:
        ModuleNotFoundError: Mitsuba is not installed.
        ValueError: no variant is set, or one without spectra, or one that follows polarisation.
    """
    require("mitsuba")
    import drjit as dr  # pyright: ignore[reportMissingImports]
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    variant = mi.variant()
    use = f"call mitsuba.set_variant with one of {', '.join(VARIANTS)}"
    if variant is None:
        raise ValueError(f"Mitsuba has no variant set: {use}")
    if not mi.is_spectral:
        raise ValueError(
            f"a glaze is known by its spectrum, and the variant {variant} has none: {use}"
        )
    if mi.is_polarized:
        raise ValueError(
            f"a glaze is known for unpolarised light, and the variant {variant} follows "
            f"polarisation: {use}"
        )
    return mi, dr


class DrJit(Arithmetic):
    """Of Dr.Jit: packets are four-vectors; in a scalar variant all numbers are
    Python's.
    """

    def __init__(self, mi: Any, dr: Any, active: Any = True):
        self._mi = mi
        self._dr = dr
        self._active = active
        self._jit = bool(dr.is_jit_v(mi.Float))

    def sqrt(self, x: Any) -> Any:
        """Square root."""
        return self._dr.sqrt(x)

    def clip(self, x: Any, low: float, high: float) -> Any:
        """Within [low, high]."""
        return self._dr.clip(x, low, high)

    def maximum(self, x: Any, y: Any) -> Any:
        """The larger one."""
        return self._dr.maximum(x, y)

    def dot(self, a: Any, b: Any) -> Any:
        """Sum of the four products."""
        return self._dr.dot(a, b)

    def packet(self, table: Any, number: Any) -> Any:
        """A vector of four numbers."""
        if not self._jit:
            return self._mi.Vector4f(table[number])
        return self._dr.gather(
            self._mi.Vector4f, table, self._mi.UInt32(number), self._mi.Bool(self._active)
        )

    def whole(self, x: Any) -> Any:
        """Whole numbers."""
        return self._mi.UInt32(self._dr.detach(x)) if self._jit else int(x)

    def log1p(self, x: Any) -> Any:
        """Of what is not much smaller than 1."""
        return self._dr.log(1.0 + x)

    def asinh(self, x: Any) -> Any:
        """Of x >= 0."""
        return self._dr.log(x + self._dr.sqrt(x * x + 1.0))

    def upload(self, table: np.ndarray | None) -> Any:
        """A table as `packet` takes it."""
        if table is None:
            return None
        return self._mi.Float(table.ravel()) if self._jit else table.reshape(-1, 4).tolist()

    def body(self, body: Body) -> Body:
        """A body's table on the device."""
        tables = {name: self.upload(getattr(body, name)) for name in TABLES}
        return replace(body, **tables)
