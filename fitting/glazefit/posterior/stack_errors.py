"""Where the error of a stack's paints is made linear: as for one film, coat by coat and by the
solver's own slopes.

The first slopes are those at the stack that fits best if readings were as wrong as paints of a
usual error make them. Where only one coat's k and s are open, posteriors are wide, and slopes are
those of each place in them (`glazefit.posterior.stack_table`).
"""

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from ..film.model.errors import Prior, smooth_kernel
from ..film.reading import Reading
from .film_errors import Slopes, expand, settle
from .laplace import Modes, climb, find_modes
from .layout import Layout
from .problem import Problem
from .stack import (
    TOLERANCE,
    ScaledReadings,
    StackData,
    StackResiduals,
    StackShared,
    optical,
    surface,
)
from .stack_table import can_be_tabulated, tabulated

# An opaque coat and a thin one may read alike, and each is a narrow valley.
_MANY_STARTS = 24
# Standard deviation of a reading that the first fit takes for granted: that of paints some per cent
# off.
_ROUGH = 0.02


class Solved(NamedTuple):
    """Films of several coats: an `Optical`."""

    layout: Layout

    def slopes(self, logs: np.ndarray, ground: np.ndarray) -> Slopes:
        """See `glazefit.posterior.film_errors.Optical`; an unknown paint has no error."""
        count = len(logs)
        bands = logs.shape[-1]
        body, by_log, by_ground = (np.array(a) for a in _slopes(self.layout, logs, ground))
        if (unknown := self.layout.unknown_coat) is not None:
            by_log[..., unknown] = 0.0
        by_log = np.moveaxis(by_log, -1, 1).reshape(count, -1, bands, ground.shape[-1])
        return Slopes(body, by_log, by_ground)

    def at(self, problem: Problem, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `glazefit.posterior.film_errors.Optical`."""
        thickness, above = (
            np.asarray(a) for a in _at(self.layout, free, problem.data, problem.shared)
        )
        logs = np.log(np.maximum(np.moveaxis(thickness, -1, 1), 1e-9))
        return logs.reshape(len(logs), -1, logs.shape[-1]), above


@functools.partial(Program, fixed=("layout",))
def _slopes(
    layout: Layout,
    logs: Float[Array, "films errors bands"],
    ground: Float[Array, "films bands grounds"],
) -> tuple[Array, Array, Array]:
    """Body, its slopes by (films, 2, bands, grounds, coats), and by the ground."""
    coats = jnp.moveaxis(logs.reshape(len(logs), len(layout.sizes), 2, -1), 1, -1)

    def total(coats: Array, ground: Array) -> tuple[Array, Array]:
        k, s = jnp.moveaxis(jnp.exp(coats), 1, 0)
        body = layout.optics.body(k, s, ground, TOLERANCE)
        return jnp.sum(body), body

    wide = jnp.broadcast_to(
        coats[:, :, :, None], (*coats.shape[:3], ground.shape[-1], coats.shape[-1])
    )
    (by_log, by_ground), body = jax.grad(total, argnums=(0, 1), has_aux=True)(wide, ground)
    return body, by_log, by_ground


@functools.partial(Program, fixed=("layout",))
def _at(
    layout: Layout, free: Float[Array, "films dims"], data: StackData, shared: StackShared
) -> tuple[Array, Array]:
    """Optical thicknesses (films, 2, bands, coats), and what the surface adds, (films,)."""
    thickness = jax.vmap(lambda f, d: optical(layout, f, d, shared))(free, data)
    return thickness, jax.vmap(lambda f: surface(layout, f, shared))(free)


def pose_stack_errors(
    problem: Problem, films: Sequence[Reading], prior: Prior, *, seed: int = 0
) -> tuple[Problem, Modes]:
    """The problem of `glazefit.posterior.stack.pose_stack` with the paints' error, and
    its modes.
    """
    assert isinstance(problem.residuals, StackResiduals)
    layout = problem.residuals.layout
    how = Solved(layout)
    smooth = smooth_kernel(films[0].wavelengths, prior.error_length)
    if can_be_tabulated(layout):
        nothing = np.zeros((len(films), problem.dims))
        coats, _ = _at(layout, nothing, problem.data, problem.shared)
        problem = tabulated(problem, np.asarray(coats), films, smooth, TOLERANCE)
        problem = replace(problem, scaled=ScaledReadings(layout))
        return problem, find_modes(problem, starts=_MANY_STARTS, seed=seed)
    rough = [np.eye(film.sd.size) / np.hypot(film.sd, _ROUGH).ravel() for film in films]
    first = find_modes(
        replace(problem, data=problem.data._replace(whiten=jnp.asarray(np.stack(rough)))),
        seed=seed,
    )
    logs, _ = how.at(problem, first.points[:, 0])
    problem = expand(problem, films, how, logs, np.zeros_like(logs), smooth)
    return settle(problem, films, how, climb(problem, first.points), smooth)
