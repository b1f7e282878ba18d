"""The surface of a glaze as its table needs it: how light gets through, and in which coordinate angles are smooth."""

import copy
import functools
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ...radiative.stack import stack_reflectance_factor
from ...spectra import Numbers
from . import lookup
from .lookup import Arithmetic

_BLOCK = 4096
_STEPS, _QUADRATURE = 257, 64
# Without a surface the factor has no bound where both directions graze; there it is this sum of cosines' value.
_LEAST_SUM = 1e-6


@runtime_checkable
class Surface(Protocol):
    """What the table of a body asks of the surface above it."""

    refractive_index: float

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        ...

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air, for NumPy."""
        ...

    def transmittance(self, ops: Arithmetic, cosine: Any) -> Any:
        """Share of light from air that the surface lets in; cosine of incidence."""
        ...

    def factor(self, stack: dict[str, Numbers], cos_in: Numbers, cos_out: Numbers, tolerance: float) -> np.ndarray:
        """The solver's reflectance factor of what lies below, with this surface."""
        ...

    def on(self, kept: Callable[[np.ndarray], Any]) -> "Surface":
        """The same with its tables as `Arithmetic.packet` takes them."""
        ...


class Smooth:
    """Fresnel's surface: what is smooth is smooth in the cosine inside the paint."""

    def __init__(self, refractive_index: float):
        self.refractive_index = refractive_index
        self._steepest = float(np.sqrt((refractive_index - 1.0) * (refractive_index + 1.0)) / refractive_index)

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        return (inside(ops, cosine, self.refractive_index) - self._steepest) / (1.0 - self._steepest)

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air."""
        n, within = self.refractive_index, self._steepest + coordinate * (1.0 - self._steepest)
        return np.sqrt(np.clip(n**2 * (within**2 - 1.0) + 1.0, 0.0, 1.0))

    def transmittance(self, ops: Arithmetic, cosine: Any) -> Any:
        """1 - Fresnel's reflectance; `dielectric_reflectance` is the same for NumPy and JAX."""
        n = self.refractive_index
        within = n * inside(ops, cosine, n)
        s = (cosine - within) / (cosine + within)
        p = (n * n * cosine - within) / (n * n * cosine + within)
        return 1.0 - 0.5 * (s * s + p * p)

    def factor(self, stack: dict[str, Numbers], cos_in: Numbers, cos_out: Numbers, tolerance: float) -> np.ndarray:
        """`stack_reflectance_factor`."""
        return in_blocks(stack_reflectance_factor, stack, cos_in, cos_out, tolerance, self.refractive_index)

    def on(self, kept: Callable[[np.ndarray], Any]) -> "Smooth":
        """It has no tables."""
        return self


class Rough:
    """GGX facets on both sides, their loss made good (`glazejax.radiative.rough`)."""

    def __init__(self, refractive_index: float, roughness: float):
        from ...radiative.rough import loss_constant, surface_albedo, surface_loss

        self.refractive_index, self.roughness = refractive_index, roughness
        given = {"refractive_index": refractive_index, "roughness": roughness}
        self.lost = float(loss_constant(**given))
        cosines = np.maximum(self.cosine(np.linspace(0.0, 1.0, _STEPS)), 1e-6)
        albedo, loss = (np.asarray(f(cosines, **given), float) for f in (surface_albedo, surface_loss))
        # How much of the light lost by single facets comes back to the air.
        fine, weights = np.polynomial.legendre.leggauss(_QUADRATURE)
        fine = 0.5 * (fine + 1.0)
        back = float(np.sum(weights * fine * np.asarray(surface_loss(fine, **given)))) / self.lost
        share = np.clip(loss * back / albedo, 0.0, 1.0)
        columns = np.stack([albedo, loss, share, 0.0 * share], axis=-1)
        self.table: Any = np.ascontiguousarray(columns[:, None], np.float32)

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        return ops.sqrt(cosine)

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air."""
        return coordinate * coordinate

    def columns(self, ops: Arithmetic, cosine: Any) -> Any:
        """At cosines in air: all that is reflected, what single facets lose, and the share of that in the former."""
        return lookup.line_sum(ops, self.table, lookup.place(ops, self.coordinate(ops, cosine), _STEPS), 1)[0]

    def transmittance(self, ops: Arithmetic, cosine: Any) -> Any:
        """All that is not reflected."""
        return 1.0 - self.columns(ops, cosine)[0]

    def factor(self, stack: dict[str, Numbers], cos_in: Numbers, cos_out: Numbers, tolerance: float) -> np.ndarray:
        """`rough_reflectance_factor`."""
        from ...radiative.rough import rough_reflectance_factor

        solve = functools.partial(rough_reflectance_factor, roughness=self.roughness)
        return in_blocks(solve, stack, cos_in, cos_out, tolerance, self.refractive_index)

    def on(self, kept: Callable[[np.ndarray], Any]) -> "Rough":
        """With its table as `Arithmetic.packet` takes it."""
        other = copy.copy(self)
        other.table = kept(self.table)
        return other


def in_blocks(
    solve: Callable[..., Any],
    stack: dict[str, Numbers],
    cos_in: Numbers,
    cos_out: Numbers,
    tolerance: float,
    refractive_index: float,
) -> np.ndarray:
    """Reflectance factors of stacks that broadcast, in blocks of one size, so that one program is compiled."""
    names = ("substrate_reflectance", "cos_incidence", "cos_viewing")
    albedo, depth = np.broadcast_arrays(*(np.asarray(stack[k]) for k in ("albedo", "optical_thickness")))
    others = [np.asarray(x, float) for x in (stack["substrate_reflectance"], cos_in, cos_out)]
    shape = np.broadcast_shapes(albedo.shape[:-1], *(x.shape for x in others))
    layers = [np.broadcast_to(x, (*shape, x.shape[-1])).reshape(-1, x.shape[-1]) for x in (albedo, depth)]
    rows = [*layers, *(np.broadcast_to(x, shape).reshape(-1) for x in others)]
    given = {"refractive_index": refractive_index, "tolerance": tolerance}
    found = []
    for start in range(0, len(rows[0]), _BLOCK):
        albedo, depth, *rest = (np.resize(x[start : start + _BLOCK], (_BLOCK, *x.shape[1:])) for x in rows)
        found.append(np.asarray(solve(albedo, depth, **dict(zip(names, rest, strict=True)), **given)))
    return np.concatenate(found)[: len(rows[0])].reshape(shape)


def inside(ops: Arithmetic, cosine: Any, refractive_index: float) -> Any:
    """Cosine inside the paint, in any arithmetic; see `cos_refracted`."""
    n = refractive_index
    return ops.sqrt((n - 1.0) * (n + 1.0) + cosine * cosine) / n


def known_part(ops: Arithmetic, surface: Surface, cos_in: Any, cos_out: Any) -> Any:
    """T T/(mu_I + mu_F), which the table divides by."""
    n = surface.refractive_index
    total = ops.maximum(inside(ops, cos_in, n) + inside(ops, cos_out, n), _LEAST_SUM)
    return surface.transmittance(ops, cos_in) * surface.transmittance(ops, cos_out) / total
