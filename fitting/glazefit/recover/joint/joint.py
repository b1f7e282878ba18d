"""Joint recovery: k and s of all paints at once, from pure films, tints and shades with known
weights.

A pure opaque film gives only k/s; its tint with a known white gives the rest. So all films
are fitted together (`problem`), each with a thickness of its own, by Levenberg and
Marquardt's method with a linear solver that knows the structure (`solver`). Thicknesses are
relative: the unit is that of a typical film.
"""

from collections.abc import Mapping

import jax
import numpy as np
from jaxtyping import Float

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.progress import Progress, no_progress

from ...film.films import Films, InstrumentLike, Noise
from ...film.model.mixing import MixingLaw, weight_table
from ...film.model.response import Response
from ...film.noise import estimate_noise
from .pose import Gauge, pose
from .problem import Expectations, Unknowns, readings, totals
from .result import JointRecovery
from .solver import JointCovariance, factorise, solve_jointly

UNIT = 25e-6
"""Thickness of a film of unit relative thickness where none is known, m."""


def recover_jointly(
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    law: MixingLaw | None = None,
    expectations: Expectations | None = None,
    use: Float[np.ndarray, "films"] | Float[np.ndarray, "films bands"] | None = None,
    start: Unknowns | None = None,
    max_steps: int = 100,
    response: Response | None = None,
    pigments: Mapping[str, Pigment] | None = None,
    gauge: Gauge | None = None,
    gloss: Mapping[str, float] | None = None,
    unit: float = UNIT,
    progress: Progress = no_progress,
) -> JointRecovery:
    """Absorption and scattering of all paints in some films, fitted together.

    Args:
        films: measured over a black and a white card, or one of them, or opaque.
        recipes: sample -> paint -> weight, in any unit, of every film.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading, by default estimated from the readings' roughness; `expectations` adds
            what the model may be off.
        law: mixing law, by default linear by mass.
        expectations: the prior.
        use: (films,), 0 for films that are held out and predicted, 1 for the others; by default all
            ones. Or (films, bands), 0 for bands that were not read.
        start: where to start, such as `JointRecovery.unknowns` of a fit of the same films.
        max_steps: of the solver, in each of its two stages.
        response: model of one film, by default that of the instrument
            (`glazefit.film.model.response.film_response`).
        pigments: by name, of paints whose k and s are known, with their errors: the films do not
            change them, and they fix the scale of the others.
        gauge: thicknesses of films.
        gloss: film -> share of the surface's reflection that was measured, by readings with the
            specular part and without it (`glazefit.film.gloss.measure_gloss`); of other films it is
            found.
        unit: thickness of a film of unit relative thickness, m; matters where paints or thicknesses
            are known.
        progress: called before each step with the steps that are done, and the most there may be.

    Raises:
        ValueError: a film without a recipe, no film, cards that are not possible (see
            `glazefit.film.films.card_readings`), a known paint that does not cover the films'
            wavelengths, or a film of the gauge's that there is not.
    """
    if len(films) == 0:
        raise ValueError("there are no films to recover")
    instrument = resolve_instrument(instrument)
    law = law or MixingLaw()
    used = np.ones((len(films), 1)) if use is None else np.reshape(use, (len(films), -1))
    read = np.any(used != 0, axis=1)
    noise = noise or estimate_noise(films.take(np.flatnonzero(read).tolist()))
    paints, weights = weight_table(films.names, recipes)
    shares = law.shares(weights, paints)
    expected = expectations or Expectations()
    # A paint is called as it is in the recipes, whatever its pigment is called.
    pigments = {name: paint.renamed(name) for name, paint in (pigments or {}).items()}
    problem, known_modes = pose(
        films,
        paints,
        shares,
        response=response,
        instrument=instrument,
        noise=noise,
        expected=expected,
        references=pigments,
        gauge=gauge,
        gloss=gloss or {},
        unit=unit,
        used=read,
    )
    deviation = np.moveaxis(1.0 / problem.weight, 0, -1)
    counted = films.seen * used.T[..., None]
    problem = problem._replace(weight=problem.weight * counted)
    if start is None:
        # Weights and gloss as stated first: set free at once, they explain what thicknesses and
        # spectra should.
        scale = problem.scale
        stiff_films = np.where(np.arange(scale.films.shape[1]) > 0, 0.03, 1.0)
        stiff = problem._replace(
            scale=scale._replace(films=scale.films * stiff_films, paints=0.03 * scale.paints),
            tail=np.array(1e6),
        )
        # Logarithms of coefficients start far off; undamped first steps would throw some to where
        # nothing has a slope.
        first, _ = solve_jointly(
            problem=stiff,
            # Equal grey paints, and films as expected.
            start=problem.mean,
            first_step=1e-4,
            max_steps=max_steps,
            note=lambda steps: progress(steps, max_steps, "fitting k and s first, steps at most"),
        )
    else:
        first = totals(start, problem, sign=-1.0)
    solution, descent = solve_jointly(
        problem=problem,
        start=first,
        first_step=1.0,
        max_steps=max_steps,
        note=lambda steps: progress(steps, max_steps, "fitting all together, steps at most"),
    )
    covariance = JointCovariance.of(problem, factorise(descent.seen.normal))
    unknowns = totals(solution, problem)
    fitted = np.moveaxis(np.asarray(jax.jit(readings)(unknowns, problem)), 0, -1)
    fitted = films.where_seen(fitted)
    return JointRecovery(
        films=films,
        paints=paints,
        shares=shares,
        law=law,
        unknowns=unknowns,
        log_covariance=covariance.of_bands(len(problem.reading)),
        # Kept for the errors of what the recovery predicts.
        draws=covariance.draw(unknowns, 128),
        fitted_black=fitted[:, 0],
        fitted_white=fitted[:, 1],
        residual_sd=deviation,
        expectations=expected,
        instrument=instrument,
        steps=descent.steps,
        converged=descent.settled,
        noise=noise,
        unit=unit,
        known_paints={paint: pigments[paint] for paint in paints if paint in pigments},
        known_modes=known_modes,
        whole_covariance=covariance,
        problem=problem,
        gauged=gauge is not None,
    )
