"""What a joint recovery foretells of a film that it has not seen: from its weights, with only its thickness free."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .films import Films, Noise, cards
from .joint_problem import model_deviation
from .joint_result import JointRecovery
from .mixing import strengthen
from .response import Response, film_response

_SPAN, _POINTS, _REFINEMENTS = 4.0, 161, 4


class Prediction(NamedTuple):
    """Predicted film."""

    thickness: float
    gloss: float
    over_black: Float[np.ndarray, "bands"]
    over_white: Float[np.ndarray, "bands"]


def predict_films(
    recovery: JointRecovery,
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    noise: Noise | None = None,
    response: Response | None = None,
) -> list[Prediction]:
    """Spectra of films of known weights over their own cards; each film's thickness is fitted to its readings.

    Gloss is what the paints in it showed elsewhere.

    Raises:
        ValueError: a film without a recipe, or with a paint that the recovery does not know.
    """
    noise = noise or Noise()
    response = response or film_response(recovery.instrument.geometry, recovery.instrument.refractive_index)
    black, white, _, _ = cards(films, recovery.instrument, noise)
    out = []
    for row, name in enumerate(films.names):
        if name not in recipes:
            raise ValueError(f"nothing is known of what film {name!r} is made of; add it to the list of recipes")
        weights = np.zeros((1, len(recovery.paints)))
        for paint, weight in recipes[name].items():
            weights[0, recovery.row(paint)] = weight
        share = recovery.law.shares(weights, recovery.paints)[0]
        gloss = float(np.exp(share @ recovery.unknowns.paints[:, 0]))
        counted = strengthen(share, recovery.unknowns.paints[:, 1])
        measured = np.stack([films.over_black[row], films.over_white[row]], axis=-1)
        deviation = model_deviation(measured, noise, recovery.expectations)
        log_thickness, spectra = _fit_thickness(
            jnp.asarray(counted @ recovery.absorption),
            jnp.asarray(counted @ recovery.scattering),
            jnp.stack([black[row], white[row]], axis=-1),
            jnp.asarray(measured - gloss * recovery.instrument.seen_surface),
            jnp.asarray(deviation),
            recovery.expectations.thickness,
            response,
        )
        spectra = np.asarray(spectra) + gloss * recovery.instrument.seen_surface
        out.append(Prediction(float(np.exp(log_thickness)), gloss, spectra[:, 0], spectra[:, 1]))
    return out


@jax.jit
def _fit_thickness(
    absorption: Float[Array, "bands"],
    scattering: Float[Array, "bands"],
    ground: Float[Array, "bands 2"],
    body: Float[Array, "bands 2"],
    deviation: Float[Array, "bands 2"],
    expected: float,
    response: Response,
) -> tuple[Float[Array, ""], Float[Array, "bands 2"]]:
    """Log of the best thickness, by scanning and scanning again around the best, and its spectra."""

    def spectra(log_thickness: Array) -> Array:
        d = jnp.exp(log_thickness)
        return response.body((d * absorption)[:, None], (d * scattering)[:, None], ground)

    def cost(log_thickness: Array) -> Array:
        return jnp.sum(((spectra(log_thickness) - body) / deviation) ** 2) + (log_thickness / expected) ** 2

    centre, half = jnp.asarray(0.0), _SPAN
    for _ in range(_REFINEMENTS):
        points = centre + half * jnp.linspace(-1.0, 1.0, _POINTS)
        centre = points[jnp.argmin(jax.vmap(cost)(points))]
        half = 4.0 * half / _POINTS
    return centre, spectra(centre)
