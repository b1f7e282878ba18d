"""Phase functions of paint: which are legal, how mixing blends them, how layers of several kinds
line up.
"""

from collections.abc import Sequence
from types import ModuleType
from typing import TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..radiative.common.phase import check_moments
from ..spectra import Numbers, as_array, as_float_array, concrete

Known: TypeAlias = Array | np.ndarray
"""Moments: of NumPy where their values are known, so that they stay so under jit."""
Phases: TypeAlias = Sequence[Float[Known, "... _"] | None]
"""Moments of several paints or layers; None scatters isotropically."""


def legal_phase(what: str, phase: Numbers, bands: int) -> Float[Array, "*bands terms"]:
    """Legendre moments of a paint, (terms,) for all its bands or (bands, terms).

    Raises:
        ValueError: another shape, or moments that no phase function has.
    """
    values = as_array(phase)
    if values.ndim not in (1, 2) or (values.ndim == 2 and values.shape[0] not in (1, bands)):
        raise ValueError(
            f"phase of {what} has shape {values.shape}: give Legendre moments (terms,) for all "
            f"bands, such as phase.henyey_greenstein(0.8), or ({bands}, terms)"
        )
    numbers = concrete(values)
    if numbers is not None:
        try:
            check_moments(numbers)
        except ValueError as error:
            raise ValueError(f"{what}: {error}") from None
    return as_float_array(values)


def same_terms(phases: Phases) -> list[Float[Known, "... terms"]]:
    """Moments side by side: all with as many terms as the longest, isotropic where there
    is None.
    """
    terms = max(1 if p is None else p.shape[-1] for p in phases)
    moments = [np.ones(1) if p is None else p for p in phases]
    return [
        _module(p).pad(p, [(0, 0)] * (p.ndim - 1) + [(0, terms - p.shape[-1])]) for p in moments
    ]


def stack_moments(phases: Phases) -> Float[Known, "*batch bands layers terms"] | None:
    """Moments of layers, (..., bands or 1, layers, terms); None if all are isotropic."""
    if all(p is None for p in phases):
        return None
    moments = [p[None] if p.ndim == 1 else p for p in same_terms(phases)]
    xp = _module(*moments)
    return xp.stack(xp.broadcast_arrays(*moments), axis=-2)


def _module(*arrays: Array | np.ndarray) -> ModuleType:
    """numpy for what is known, so that it stays known under jit: how many moments count is read
    from it.
    """
    return np if all(concrete(a) is not None for a in arrays) else jnp


def mix_moments(
    phases: Phases, scattering: Sequence[Float[Array, "*#batch bands"]]
) -> Float[Array, "*batch bands terms"] | None:
    """Moments of a mixture: each paint's by its share of the light scattered; None if all are
    isotropic.

    Args:
        phases: of the parts.
        scattering: what each part scatters in the mixture, s in 1/m.
    """
    if all(p is None for p in phases):
        return None
    total = sum(scattering[1:], scattering[0])
    clear = total <= 0
    # Where nothing is scattered the moments do not count; those of equal parts are as good as any.
    shares = [
        jnp.where(clear, 1.0 / len(scattering), s / jnp.where(clear, 1.0, total))
        for s in scattering
    ]
    terms = [share[..., None] * p for share, p in zip(shares, same_terms(phases), strict=True)]
    return sum(terms[1:], terms[0])
