"""Joint recovery: k and s of all paints at once, from pure films, tints and shades with known weights.

A pure opaque film tells only k/s; its tint with a white that is known tells the rest. So all films are fitted
together (`joint_problem`), each with a thickness of its own, by optimistix' Levenberg-Marquardt with a linear
solver that knows the structure (`joint_solver`). Thicknesses are relative: the unit is that of a typical film.
"""

import functools
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..film.films import Films, Instrument, Noise, cards
from ..film.gloss import estimate_gloss
from ..film.mixing import MixingLaw, weight_table
from ..film.response import Response, film_response
from .joint_problem import (
    Expectations,
    JointProblem,
    Unknowns,
    curvature_matrix,
    minor_parts,
    model_deviation,
    optical_thickness,
    readings,
    residuals,
)
from .joint_result import JointRecovery
from .joint_solver import JointSteps, covariance, draw, factorise, normal_matrix

MAX_STEPS = 100
# Kept with a recovery, for the errors of what it predicts.
DRAWS = 128
# Logarithms of coefficients start far off; undamped first steps would throw some to where nothing has a slope.
_FIRST_STEP = 1e-4
# In units of a logarithm, and relative for the residuals: a thousandth of a coefficient.
_SETTLED = 1e-3


class _Trust(optx.ClassicalTrustRegion):
    """Trust region whose first step has a given size."""

    first: Any = 1.0

    def init(self, y: Any, f_info_struct: Any) -> Any:
        """State with the first step's size."""
        state = super().init(y, f_info_struct)
        return eqx.tree_at(lambda s: s.step_size, state, jnp.asarray(self.first))


def recover_jointly(
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    instrument: Instrument | None = None,
    noise: Noise | None = None,
    law: MixingLaw | None = None,
    expectations: Expectations | None = None,
    use: Float[np.ndarray, "films"] | None = None,
    start: Unknowns | None = None,
    max_steps: int = MAX_STEPS,
    response: Response | None = None,
) -> JointRecovery:
    """Absorption and scattering of all paints in some films, fitted together.

    Args:
        films: measured over a black and a white card.
        recipes: sample -> paint -> weight, in any unit, of every film.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading; `expectations` adds what the model may be off.
        law: mixing law, by default linear by mass.
        expectations: what is expected beforehand.
        use: (films,), 0 for films that are held out and predicted, 1 for the others; by default all ones.
        start: where to start, such as `JointRecovery.unknowns` of a fit of the same films.
        max_steps: of the solver, in each of its two stages.
        response: model of one film, by default that of the instrument (`glazefit.film.response.film_response`).

    Raises:
        ValueError: a film without a recipe, no film, or cards that are not possible (see `glazefit.film.films.cards`).
    """
    if len(films) == 0:
        raise ValueError("there are no films to recover")
    instrument, noise, law = instrument or Instrument(), noise or Noise(), law or MixingLaw()
    paints, weights = weight_table(films.names, recipes)
    shares = law.shares(weights, paints)
    expected = expectations or Expectations()
    problem = pose(films, shares, law, instrument, noise, expected)
    deviation = np.moveaxis(1.0 / np.asarray(problem.weight), 0, -1)
    if use is not None:
        problem = problem._replace(weight=problem.weight * jnp.asarray(use)[None, :, None])
    response = response or film_response(instrument.geometry, instrument.refractive_index)
    if start is None:
        # Weights and gloss as stated first: set free at once, they explain what thicknesses and spectra should.
        stiff = problem._replace(
            film_scale=problem.film_scale.at[:, 1:].multiply(0.03),
            paint_scale=0.03 * problem.paint_scale,
            tail=jnp.asarray(1e6),
        )
        start, _, _ = fit(stiff, response, first_guess(problem), _FIRST_STEP, max_steps)
    solution, steps, settled = fit(problem, response, start, 1.0, max_steps)
    local, shared, drawn = spread(solution, problem, response, DRAWS)
    kd, sd = optical_thickness(solution, problem.shares, problem.minor)
    fitted = np.moveaxis(np.asarray(readings(solution, problem, response)), 0, -1)
    return JointRecovery(
        films=films,
        paints=paints,
        shares=shares,
        law=law,
        unknowns=jax.tree.map(np.asarray, solution),
        log_covariance=np.asarray(local),
        shared_covariance=np.asarray(shared),
        draws=jax.tree.map(np.asarray, drawn),
        film_absorption=np.asarray(kd).T,
        film_scattering=np.asarray(sd).T,
        fitted_black=fitted[:, 0],
        fitted_white=fitted[:, 1],
        residual_sd=deviation,
        expectations=expected,
        instrument=instrument,
        steps=int(steps),
        converged=bool(settled),
    )


def pose(
    films: Films,
    shares: Float[np.ndarray, "films paints"],
    law: MixingLaw,
    instrument: Instrument,
    noise: Noise,
    expected: Expectations,
) -> JointProblem:
    """Arrays of a joint problem."""
    black, white, sd_black, sd_white = cards(films, instrument, noise)
    measured = np.stack([films.over_black, films.over_white], axis=-1)
    grounds = np.stack([black, white], axis=-1)
    # A card's own error reaches the reading through the film, at most as a bare card's does.
    card = np.stack([sd_black, sd_white], axis=-1) * measured
    deviation = np.hypot(model_deviation(measured, noise, expected), card)
    count, paints = shares.shape
    minor = minor_parts(shares)
    # A paint's own weight error: a share of it, and what the balance leaves open.
    part = np.einsum("fep,fp->fe", minor, shares)
    errors = np.hypot(expected.weight_share, expected.weight_floor / np.where(part > 0, part, 1.0))
    scale = np.concatenate(
        [np.full((count, 1), expected.thickness), np.full((count, 1), expected.gloss), errors], axis=1
    )
    # A law without strengths holds them at nothing.
    strength = expected.strength if law.name == "strength" else 1e-6
    # A sum over the bands of pulls of sd * sqrt(bands) each is a pull of the mean by sd.
    pull = np.repeat([expected.level_k, expected.level_s], paints, axis=0) * [1.0, np.sqrt(len(films.wavelengths))]
    stiffness = np.repeat([1.0 / expected.curvature_k, 1.0 / expected.curvature_s], paints)
    arrays = {
        "reading": np.moveaxis(measured, 1, 0),
        "ground": np.moveaxis(grounds, 1, 0),
        "weight": np.moveaxis(1.0 / deviation, 1, 0),
        "shares": shares,
        "minor": minor,
        "surface": instrument.seen_surface,
        "curvature": curvature_matrix(films.wavelengths),
        "stiffness": stiffness,
        "pull": np.stack([pull[:, 0], 1.0 / pull[:, 1]], axis=1),
        "film_scale": scale,
        "paint_mean": np.stack([paint_gloss(films, shares, instrument, noise), np.zeros(paints)], axis=1),
        "paint_scale": np.tile([expected.paint_gloss, strength], (paints, 1)),
        "tail": expected.tail,
    }
    return JointProblem(**{name: jnp.asarray(array) for name, array in arrays.items()})


def paint_gloss(
    films: Films, shares: Float[np.ndarray, "films paints"], instrument: Instrument, noise: Noise
) -> Float[np.ndarray, "paints"]:
    """Log of the gloss that the films in which a paint is the largest part demand, 0 where they demand none."""
    demanded = np.log(estimate_gloss(films, instrument, noise))
    largest = shares.argmax(axis=1)
    return np.array([demanded[largest == paint].min(initial=0.0) for paint in range(shares.shape[1])])


def first_guess(problem: JointProblem) -> Unknowns:
    """Grey paints, all alike, and films as expected."""
    bands = problem.reading.shape[0]
    return Unknowns(
        jnp.broadcast_to(problem.pull[:, 0], (bands, problem.pull.shape[0])),
        jnp.zeros(problem.film_scale.shape),
        problem.paint_mean,
    )


def _steps(problem: JointProblem) -> JointSteps:
    return JointSteps(problem.curvature.T @ problem.curvature, problem.stiffness)


@functools.partial(jax.jit, static_argnames="max_steps")
def fit(
    problem: JointProblem, response: Response, start: Unknowns, first_step: float, max_steps: int
) -> tuple[Unknowns, Array, Array]:
    """Least squares from a start: solution, number of steps, whether they settled."""
    solver = optx.LevenbergMarquardt(rtol=_SETTLED, atol=_SETTLED, linear_solver=_steps(problem))
    solver = eqx.tree_at(lambda s: s.search, solver, _Trust(first=first_step))
    solution = optx.least_squares(residuals, solver, start, args=(problem, response), max_steps=max_steps, throw=False)
    return solution.value, solution.stats["num_steps"], solution.result == optx.RESULTS.successful


@functools.partial(jax.jit, static_argnames="draws")
def spread(
    solution: Unknowns, problem: JointProblem, response: Response, draws: int
) -> tuple[Float[Array, "bands local local"], Float[Array, "shared shared"], Unknowns]:
    """Laplace: inverse of the normal matrix at the solution, per band and of the shared unknowns; and draws from it."""
    _, tangent = jax.linearize(lambda y: residuals(y, (problem, response)), solution)
    operator = lx.FunctionLinearOperator(tangent, jax.eval_shape(lambda: solution))
    steps = _steps(problem)
    factors = factorise(normal_matrix(operator, steps.curvature, steps.stiffness))
    own, common = jax.random.split(jax.random.key(0))
    pairs = jax.random.normal(own, (draws, *factors.border.shape[:2]))
    shared = jax.random.normal(common, (draws, factors.corner.shape[0]))
    # One after the other: batched triangular solves can deadlock on a CPU.
    off = jax.lax.map(lambda normal: draw(factors, solution, *normal), (pairs, shared))
    return *covariance(factors, problem.reading.shape[0]), jax.tree.map(jnp.add, solution, off)
