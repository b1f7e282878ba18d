"""Grounds that reflect by a table over angles, as operators like any other."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.inputs import Numbers, concrete
from ..common.linalg import einsum
from .bordered import Bordered, Diagonal
from .star_product import lambert, reflector


class GroundTable(NamedTuple):
    """Reflectance factor pi L_out/E_in of a ground, as seen inside the paint; make it with
    `ground_table`.
    """

    cosines: Float[Array, "t"]
    """Descending from 1, for viewing and incidence."""
    modes: Float[Array, "m t t"]
    """Means of factor times cos(m azimuth)."""


def ground_table(cosines: Numbers, factor: Numbers) -> GroundTable:
    """A ground by its reflectance factor over angles, linear in the cosines between them.

    Args:
        cosines: of the angles inside the paint, for viewing and incidence, (t,), in [0, 1],
            descending. Below the last the table goes on as it ends.
        factor: pi L_out/E_in, (viewing, incidence) or (viewing, incidence, azimuths) at equal steps
            of the relative azimuth from 0 (the side of the mirror) to 180 degrees, both included.
            Everywhere 1 is a perfect white.

    Raises:
        ValueError: shapes that do not fit, negative values, a table that is not reciprocal, or that
            reflects more light than falls in.
    """
    x = np.asarray(cosines, float)
    values = np.asarray(factor, float)
    # A table without azimuths holds for all of them.
    if values.ndim == 2:
        values = values[..., None]
    if x.ndim != 1 or values.shape[:-1] != (x.size, x.size) or values.shape[-1] < 1:
        raise ValueError(
            f"factor has shape {values.shape}; for {x.size} cosines it must begin with "
            f"({x.size}, {x.size})"
        )
    if not (x.size and np.all(np.diff(x) < 0) and x[0] <= 1 and x[-1] >= 0):
        raise ValueError(f"cosines must descend within 1 to 0; they are {x}")
    if not np.all(values >= 0):
        raise ValueError(
            f"factor holds {values[~(values >= 0)].flat[0]}; a reflectance factor is >= 0"
        )
    change = np.max(np.abs(values - np.swapaxes(values, 0, 1)))
    # A measured table is not reciprocal to the last digit.
    if change > 1e-3 * np.max(values):
        raise ValueError(
            f"factor is not reciprocal: light and eye exchanged change it by up to {change:.3g}; "
            "average the table with its transpose"
        )
    azimuths = values.shape[-1]
    # The trapezium rule over half a turn; modes beyond the table's resolution are not in it.
    orders = np.arange(max(1, azimuths - 1))
    angles = np.linspace(0.0, np.pi, azimuths)
    weights = np.full(azimuths, 1.0 / max(1, azimuths - 1))
    if azimuths > 1:
        weights[[0, -1]] *= 0.5
    modes = np.einsum("vik,mk,k->mvi", values, np.cos(orders[:, None] * angles), weights)
    # The solver takes grounds to be reciprocal to the last digit.
    modes = 0.5 * (modes + np.swapaxes(modes, 1, 2))
    # However light falls in, no more may come back: all directions of exit by a fine rule.
    fine, share = np.polynomial.legendre.leggauss(64)
    mu = 0.5 * (1 + fine)
    reflected = _between(x, mu) @ modes[0] @ (_between(x, mu).T @ (mu * share))
    if np.max(reflected) > 1 + 1e-6:
        raise ValueError(
            f"the ground reflects {np.max(reflected):.4g} of the light in some direction; at "
            "most 1 can come"
        )
    return GroundTable(jnp.asarray(x), jnp.asarray(modes))


def ground_operator(
    reflectance: Float[Array, ""],
    table: GroundTable | None,
    cosines: Diagonal,
    roots: Diagonal,
    modes: int,
) -> Bordered:
    """A ground as an operator: reflectance times the table, Lambertian without one.

    Args:
        reflectance: (), a share of the table.
        table: over angles.
        cosines: of nodes and added directions in the last layer.
        roots: sqrt(mu w) of these there, over whatever the operators are scaled with.
        modes: number of azimuth modes; the result has them as its leading axis.
    """
    if table is None:
        return lambert(reflectance, roots, modes)
    # The table between its knots, linear in the cosines of viewing and of incidence.
    to_viewing, to_incidence = (
        _between(table.cosines, jnp.concatenate([cosines.nodes, c])) for c in cosines[1:]
    )
    knots = table.modes.astype(roots.nodes.dtype)
    means = einsum("vs,mst,it->mvi", to_viewing, knots, to_incidence)[:modes]
    # Modes finer than the table resolves come back black.
    spare = modes - means.shape[0]
    return reflector(reflectance, roots, jnp.pad(means, [(0, spare), (0, 0), (0, 0)]))


def _between(knots, cosines):
    """Matrix of linear interpolation from descending knots to cosines, (cosines, knots)."""
    # Cosines that are known make a constant of the compiled program.
    xp = np if concrete(cosines) is not None and concrete(knots) is not None else jnp
    count = knots.shape[0]
    if count == 1:
        return xp.ones((cosines.shape[0], 1))
    # Beyond its ends the table goes on as it ends.
    cosines = cosines[:, None]
    interval = xp.clip(xp.sum(cosines < knots, axis=1, keepdims=True) - 1, 0, count - 2)
    share = xp.clip((knots[interval] - cosines) / (knots[interval] - knots[interval + 1]), 0.0, 1.0)
    knot = xp.arange(count)
    above = xp.where(knot == interval, 1.0 - share, 0.0)
    return above + xp.where(knot == interval + 1, share, 0.0)
