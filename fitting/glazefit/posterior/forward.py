"""What coats reflect over their grounds, and its slopes: one coat by its table, several by the
solver.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from glazejax.programs import Program

from ..film.model.response import FilmResponse
from .layout import Layout


class Slopes(NamedTuple):
    """Reflectance of coats without the surface's part, and its slopes.

    Errors are those of log k and of log s of the top coat, then of the next one.
    """

    body: Float[Array, "*films bands grounds"]
    by_ground: Float[Array, "*films bands grounds"]
    by_log: Float[Array, "*films errors bands grounds"]


def body(
    layout: Layout,
    response: FilmResponse | None,
    thickness: Float[Array, "2 *#batch coats"],
    ground: Float[Array, "*#batch"],
) -> Float[Array, "*batch"]:
    """Reflectance without the surface's part, from k d and s d of all coats, top first.

    Args:
        layout: of the coats.
        response: table of a single coat; None for the solver.
        thickness: optical thicknesses.
        ground: internal reflectance.
    """
    k, s = thickness
    if response is not None:
        return response.body(k[..., 0], s[..., 0], ground)
    # The solver's error is well below any instrument's.
    return layout.optics.body(k, s, ground, tolerance=1e-4)


@functools.partial(Program, fixed=("layout",))
def slopes(
    layout: Layout,
    response: FilmResponse | None,
    logs: Float[Array, "films errors bands"],
    ground: Float[Array, "films bands grounds"],
) -> Slopes:
    """Reflectance and slopes at these log k d and log s d; an unknown paint has no error."""
    films, errors, bands = logs.shape
    coats = jnp.moveaxis(logs.reshape(films, errors // 2, 2, bands), (2, 1), (0, -1))
    wide = jnp.broadcast_to(coats[..., None, :], (2, *ground.shape, errors // 2))

    def total(coats: Array, ground: Array) -> tuple[Array, Array]:
        seen = body(layout, response, jnp.exp(coats), ground)
        return jnp.sum(seen), seen

    (by_log, by_ground), seen = jax.grad(total, argnums=(0, 1), has_aux=True)(wide, ground)
    if layout.unknown_coat is not None:
        by_log = by_log.at[..., layout.unknown_coat].set(0.0)
    by_log = jnp.moveaxis(by_log, (-1, 0), (1, 2)).reshape(films, errors, *ground.shape[1:])
    return Slopes(body=seen, by_ground=by_ground, by_log=by_log)
