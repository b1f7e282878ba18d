r"""One homogeneous layer as a symmetric two-port: what it passes on and what a beam excites in it.

In modes (see `modes`) a layer obeys y'' = lambda y - q zeta e^(-a t). With sigma given at its near
face (y0) and delta at its far face, and with T = tanh(kappa D)/kappa, S = sech(kappa D),

    delta at the near face   lambda T y0 + S f - near,         near = q zeta int u(t) e^(-a t) dt,
    sigma at the far face    S y0 - T f,                       far  = q zeta int v(t) e^(-a t) dt,

u being the mode with u = 1 at the near face and u = 0 at the far one, v the other way round. f is
delta at the far face but for what the beam itself drives out there, `far`, while sigma is held at
zero at both faces. Those are what stays bounded for an empty layer, an opaque one and an albedo of
one: with delta held instead, all that a layer without absorption scatters would have to leave by
its other face, and sigma, of the size of D, would have to cancel. The near face is the top, or, in
a layer that is looked at from below ("mirrored"), the bottom; the beam runs downwards in both.
Stacks lie side by side on the last axis.
"""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from ..common.kernels import fading, quotient, tanh_sech, two_decays

Facing: TypeAlias = Bool[np.ndarray, "l"]
"""Whether each layer is mirrored: its near face is its bottom."""

# Modes slower than this take the form that is even in kappa; no beam (decay >= 1) resonates with
# them.
_SLOW = 0.25
# Layers thinner than this, in units of their mode and of the beam, take a series of what a beam
# excites.
_THIN = 1e-4


class Beams(NamedTuple):
    """Collimated directions inside the medium: incidence first, then, unless all exit directions
    count, viewing.
    """

    decay: Array  # (beams, batch), 1/mu inside
    transmittance: Array  # (beams, batch), 1 - R of the interface
    survival: Array  # (beams, layers, batch), exp(-tau/mu) at each layer's top
    at_ground: Array  # (beams, batch), exp(-tau/mu) at the ground


class LayerPorts(NamedTuple):
    """Two-ports of a set of layers, and what the beams excite in them."""

    restoring: Array  # (layers, n, batch), lambda T
    tanh: Array  # (layers, n, batch), T
    sech: Array  # (layers, n, batch), S
    near: Array  # (layers, beams, n, batch)
    far: Array  # (layers, beams, n, batch)
    # (layers, batch), light scattered once between incidence and viewing; 0 without viewing
    once: Array
    # (layers, batch), all light scattered while sigma is zero at both faces, `once` included
    direct: Array


def two_ports(
    albedo: Array,
    decay_squared: Array,
    coupling: Array,
    thickness: Array,
    beams: Beams,
    mirrored: Facing,
) -> LayerPorts:
    """Two-ports of layers.

    Args:
        albedo: q, (layers, batch).
        decay_squared: lambda, (layers, n, batch).
        coupling: zeta, (layers, n, batch).
        thickness: D, (layers, batch).
        beams: directions of the light and, if there is one, of the view.
        mirrored: (layers,), whether the near face is the bottom.
    """
    depth = thickness[:, None]
    tanh, sech = tanh_sech(decay_squared, depth)
    kappa, faded = (x[:, None] for x in fading(decay_squared, depth))
    restoring = decay_squared * tanh
    # From here on with an axis for the beams, (layers, beams, n, batch).
    depth = depth[:, None]
    lam = decay_squared[:, None]
    slow = lam < _SLOW
    a = beams.decay[:, None]
    survival = jnp.moveaxis(beams.survival, 0, 1)[:, :, None]
    strength = albedo[:, None, None] * survival * coupling[:, None]
    gone = jnp.expm1(-a * depth)
    fade = 1.0 + faded
    transmitted = 1.0 + gone
    # int e^(-(kappa + a) t) and int e^(-kappa (D - t)) e^(-a t), regular at kappa = a.
    together = quotient(-(faded + gone + faded * gone), kappa + a)
    opposed = two_decays(kappa, a, depth, faded, gone)
    # The integrals at the top and at the bottom, times what both are divided by.
    thin = (lam * depth**2 < _THIN**2) & (a * depth < _THIN)
    bend = quotient(restoring, 1.0 + sech)[:, None]
    rate = quotient(-gone, jnp.where(thin, 1.0, tanh[:, None]))
    top = jnp.where(slow, a - bend - sech[:, None] * rate, together - fade * opposed)
    bottom = jnp.where(slow, rate - bend - a * transmitted, opposed - fade * together)
    divisor = jnp.where(thin, 1.0, jnp.where(slow, a * a - lam, -faded * (1.0 + fade)))
    shallow = jnp.where(thin, depth, 0.0)
    # In thin layers series in the depth, where those differences have no digits left.
    x = lam * shallow**2
    y = a * shallow
    top = jnp.where(thin, shallow * (1 / 2 - y / 6 + (y * y - x) / 24), top)
    bottom = jnp.where(thin, shallow * (1 / 2 - y / 3 + (3 * y * y - x) / 24), bottom)
    # The loads of the beams at both faces.
    top = quotient(strength * top, divisor)
    bottom = quotient(strength * bottom, divisor)
    # Without a viewing direction no path leads straight from beam to eye.
    once = direct = jnp.zeros_like(thickness)
    if beams.decay.shape[0] == 2:
        b = a[1]
        a = a[0]
        lam = lam[:, 0]
        slow = slow[:, 0]
        kappa = kappa[:, 0]
        faded = faded[:, 0]
        # int e^(-(a + b) t), light scattered once from beam to view.
        single = quotient(-(gone[:, 0] + gone[:, 1] + gone[:, 0] * gone[:, 1]), a + b)
        # The mode's answer to the view, zero at both faces, seen along the light.
        lit_bottom = bottom[:, 1]
        slow_again = top[:, 1] + transmitted[:, 0] * lit_bottom - strength[:, 1] * single
        # One choice for both, so that slopes are right at kappa = a too; of equals `maximum` would
        # take half of each.
        below = kappa < a
        by_mode = quotient(-(faded + gone[:, 1] + faded * gone[:, 1]), kappa + b)
        lesser = jnp.where(below, by_mode, single)
        area = strength[:, 1] * (lesser - transmitted[:, 1] * opposed[:, 0])
        area = quotient(area, jnp.where(below, a, kappa) + b)
        # Light scattered more often, mode by mode; slow modes by the form that is even in kappa.
        again = quotient(
            jnp.where(slow, slow_again, area - opposed[:, 0] * lit_bottom),
            jnp.where(slow, a * a - lam, a + kappa),
        )
        once = (albedo * survival[:, 0, 0]) * (survival[:, 1, 0] * single[:, 0])
        direct = once + jnp.sum(strength[:, 0] * again, axis=-2)
    flip = mirrored[:, None, None, None]
    return LayerPorts(
        restoring=restoring,
        tanh=tanh,
        sech=sech,
        near=jnp.where(flip, bottom, top),
        far=jnp.where(flip, top, bottom),
        once=once,
        direct=direct,
    )


class Fields(NamedTuple):
    """Fields inside the layers for the light and for the view, in modes. Axes (layers, 2, n,
    batch).
    """

    near: Array  # y0, sigma at the near face
    far: Array  # sigma at the far face
    flux: Array  # f, delta at the far face but for the beam's


def load_work(ports: LayerPorts, fields: Fields) -> Array:
    """b . x of every layer, of each beam with the field of the other, (layers, beams, batch)."""
    partner = slice(None, None, -1) if ports.near.shape[1] == 2 else slice(1, 2)
    return jnp.sum(
        ports.near * fields.near[:, partner] + ports.far * fields.far[:, partner], axis=-2
    )


def layer_energy(ports: LayerPorts, fields: Fields) -> Array:
    """b_F.x_I + x_F.b_I - x_F.K x_I + G of every layer, its far face's continuity included,
    (layers, batch).
    """
    # Of light and view: each term couples the field of one with that of the other.
    (y0, y1), (u0, u1), (f0, f1) = (jnp.moveaxis(field, 1, 0) for field in fields)
    stored = ports.restoring * y0 * y1 - ports.tanh * f0 * f1 + ports.sech * (y0 * f1 + y1 * f0)
    stored = jnp.sum(stored - f0 * u1 - f1 * u0, axis=-2)
    return jnp.sum(load_work(ports, fields), axis=1) - stored + ports.direct
