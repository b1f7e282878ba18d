"""Light scattered once: by the whole phase function, less what the moments and modes kept make of
it.

Source: Nakajima and Tanaka, J. Quant. Spectrosc. Radiat. Transfer 40 (1988) 51, their TMS.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..common.kernels import decay_integral, two_decays
from ..common.linalg import einsum
from ..common.phase import evaluate
from .scattering import Layers, ScaledScattering, sine


class ScatteredOnce(NamedTuple):
    """A stack and the ways of light in it, top layer first."""

    layers: Layers
    scaled: ScaledScattering
    cos_seen: Float[Array, "layers v"]
    cos_lit: Float[Array, "layers i"]
    passing: Float[Array, "layers v i"]
    """Share that the surfaces let through on the way to each layer and from it, over n^2 of the
    layer.
    """


def missing_once(
    once: ScatteredOnce,
    azimuth: Float[Array, "k"],
    waves: Float[Array, "modes k"],
    *,
    downward: bool = False,
) -> Float[Array, "v i k"]:
    """Addition to the factor pi L_out/E_in of light that leaves upwards, or downwards, to have it
    whole.

    Args:
        once: stack and ways.
        azimuth: radians.
        waves: from `scattering.azimuth_waves`.
        downward: whether the light leaves below.
    """
    scaled = once.scaled
    # Between the added directions.
    nodes = scaled.even.shape[-1] - once.cos_lit.shape[-1]
    even, odd = (c[..., nodes:, nodes:] for c in (scaled.even, scaled.odd))
    # C+ between directions that both go down, C- where the light turns back (`scattering`).
    truncated = (even + odd if downward else even - odd) * scaled.albedo[:, None, None, None]
    truncated_phase = einsum("lmvi,mk->lvik", truncated, waves)
    viewing = once.cos_seen[:, :, None]
    incidence = once.cos_lit[:, None, :]
    # Cosine of the scattering angle: mu mu' + sin sin' cos(azimuth), mu mu' < 0 where light turns
    # back.
    along = viewing * incidence if downward else -viewing * incidence
    turn = (sine(viewing) * sine(incidence))[..., None] * jnp.cos(azimuth) + along[..., None]
    exact_phase = evaluate(once.layers.moments[:, None, None, None, :], turn)
    # Albedo per scaled depth with the peak still in it.
    thickness = once.layers.optical_thickness
    present = thickness > 0
    share = jnp.where(present, thickness, 1.0) / jnp.where(present, scaled.thickness, 1.0)
    difference = (once.layers.albedo * share)[:, None, None, None] * exact_phase - truncated_phase
    # pi L/E of light scattered once is q p/(4 mu mu_0) times an integral over the depth.
    lights = (
        once.passing * _lengths(once, viewing, incidence, downward) / (4.0 * viewing * incidence)
    )
    return jnp.sum(lights[..., None] * difference, axis=0)


def _lengths(once: ScatteredOnce, viewing: Array, incidence: Array, downward: bool) -> Array:
    """Integral over the depth of each layer of what reaches it and from there the outside, (layers,
    v, i).
    """
    depth = once.scaled.thickness[:, None, None]
    into = depth / incidence
    out = depth / viewing
    # Optical path through the layers above, on the way in.
    before = jnp.cumsum(into, axis=0) - into
    through = jnp.cumsum(out, axis=0)
    if not downward:
        # Light that turns back crosses the same layers once more.
        before += through - out
        return jnp.exp(-before) * decay_integral(1.0 / viewing + 1.0 / incidence, depth)
    # Light that goes on crosses those below.
    after = jnp.sum(out, axis=0) - through
    faded = [jnp.expm1(-x) for x in (into, out)]
    return jnp.exp(-before - after) * two_decays(1.0 / incidence, 1.0 / viewing, depth, *faded)
