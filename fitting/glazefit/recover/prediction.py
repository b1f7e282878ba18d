"""What a joint recovery foretells of a film that it has not seen: from its weights, with only its thickness free.

How sure it is comes from draws: of the paints' k and s as the recovery knows them, each followed by the errors that
films which were left out of a fit showed (`glazefit.film.errors.Discrepancy`): a paint in another mixture is not quite
the same paint.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.errors import Discrepancy, coefficient_errors, model_errors
from ..film.films import Films, Noise, cards
from ..film.mixing import strengthen
from ..film.response import Response, film_response
from .joint_problem import Unknowns, model_deviation
from .joint_result import JointRecovery
from .result import delta_e_over_cards

# Errors of k and s that a paint has in one film beside others. With these, nine tenths of the readings of films that
# were left out lie in their 90 % bands (benchmarks/prediction.py).
MIXED = Discrepancy(coefficient=0.2, level=0.2, amplitude=0.004)
_SPAN, _POINTS, _REFINEMENTS = 4.0, 161, 4


@dataclass(frozen=True)
class Prediction:
    """Predicted film.

    Attributes:
        name: of the film.
        wavelengths: (bands,), nm.
        thickness: relative, fitted.
        gloss: share of the smooth surface's reflection.
        over_black, over_white: reflectance, (bands,).
        draws: reflectance over black and white as it may be too, (draws, 2, bands).
    """

    name: str
    wavelengths: Float[np.ndarray, "bands"]
    thickness: float
    gloss: float
    over_black: Float[np.ndarray, "bands"]
    over_white: Float[np.ndarray, "bands"]
    draws: Float[np.ndarray, "draws 2 bands"]

    def interval(self, level: float = 0.9) -> tuple[Float[np.ndarray, "2 bands"], Float[np.ndarray, "2 bands"]]:
        """Lower and upper end of the band that holds this share of the draws, over black and white.

        Raises:
            ValueError: a level outside (0, 1).
        """
        if not 0 < level < 1:
            raise ValueError(f"the level is {level:g}; give a share between 0 and 1, such as 0.9")
        low, high = np.quantile(self.draws, [(1 - level) / 2, (1 + level) / 2], axis=0)
        return low, high

    def delta_e(
        self,
        over_black: Float[np.ndarray, "*n bands"],
        over_white: Float[np.ndarray, "*n bands"],
        illuminant: str = "D65",
        observer: str | int = 10,
    ) -> Float[np.ndarray, "*n 2"]:
        """CIEDE2000 between the prediction and other spectra, over black and over white."""
        predicted, others = (self.over_black, self.over_white), (over_black, over_white)
        return delta_e_over_cards(self.wavelengths, predicted, others, illuminant, observer)

    def expected_error(self, illuminant: str = "D65", observer: str | int = 10) -> float:
        """Mean CIEDE2000 that the prediction is expected to be off, over both cards."""
        return float(np.mean(self.delta_e(self.draws[:, 0], self.draws[:, 1], illuminant, observer)))


def predict_films(
    recovery: JointRecovery,
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    noise: Noise | None = None,
    discrepancy: Discrepancy | None = None,
    response: Response | None = None,
) -> list[Prediction]:
    """Spectra of films of known weights over their own cards; each film's thickness is fitted to its readings.

    Gloss is what the paints in it showed elsewhere.

    Args:
        recovery: of the paints.
        films: to predict.
        recipes: sample -> paint -> weight, in any unit.
        noise: of a reading.
        discrepancy: errors beside those of the recovery, by default `MIXED`.
        response: model of one film, by default that of the recovery's instrument.

    Raises:
        ValueError: a film without a recipe, or with a paint that the recovery does not know.
    """
    noise, discrepancy = noise or Noise(), discrepancy or MIXED
    instrument, paints = recovery.instrument, len(recovery.paints)
    response = response or film_response(instrument.geometry, instrument.refractive_index)
    black, white, _, _ = cards(films, instrument, noise)
    best = jax.tree.map(lambda leaf: leaf[None], recovery.unknowns)
    # The same draws for every film, so that films compare.
    rng, count = np.random.default_rng(0), len(recovery.draws.paints)
    off = np.swapaxes(coefficient_errors(rng, (count, 2 * paints), films.wavelengths, discrepancy), 1, 2)
    model = model_errors(rng, count, 2, films.wavelengths, discrepancy)
    out = []
    for row, name in enumerate(films.names):
        measured = np.stack([films.over_black[row], films.over_white[row]], axis=-1)
        film = _MeasuredFilm(
            _shares(recovery, name, recipes),
            np.stack([black[row], white[row]], axis=-1),
            measured,
            model_deviation(measured, noise, recovery.expectations),
        )
        thickness, surface, (mean,) = _spectra(recovery, response, film, best, np.zeros((1, *best.bands.shape[1:])))
        _, _, draws = _spectra(recovery, response, film, recovery.draws, off)
        draws = np.maximum(draws + model, 0.0)
        gloss = float(surface[0] / instrument.seen_surface) if instrument.seen_surface else 0.0
        out.append(Prediction(name, films.wavelengths, float(thickness[0]), gloss, mean[0], mean[1], draws))
    return out


class _MeasuredFilm(NamedTuple):
    """One film."""

    share: Float[np.ndarray, "paints"]
    ground: Float[np.ndarray, "bands 2"]  # internal reflectance
    measured: Float[np.ndarray, "bands 2"]
    deviation: Float[np.ndarray, "bands 2"]  # expected of a reading


def _shares(
    recovery: JointRecovery, name: str, recipes: Mapping[str, Mapping[str, float]]
) -> Float[np.ndarray, "paints"]:
    if name not in recipes:
        raise ValueError(f"nothing is known of what film {name!r} is made of; add it to the list of recipes")
    weights = np.zeros((1, len(recovery.paints)))
    for paint, weight in recipes[name].items():
        weights[0, recovery.row(paint)] = weight
    return recovery.law.shares(weights, recovery.paints)[0]


def _spectra(
    recovery: JointRecovery,
    response: Response,
    film: _MeasuredFilm,
    unknowns: Unknowns,
    off: Float[np.ndarray, "draws bands coefficients"],
) -> tuple[Float[np.ndarray, "draws"], Float[np.ndarray, "draws"], Float[np.ndarray, "draws 2 bands"]]:
    """Thickness, reflection of the surface, and reflectance over both cards for each draw of the unknowns."""
    surface = np.exp(unknowns.paints[:, :, 0] @ film.share) * recovery.instrument.seen_surface
    k, s = _mixed(unknowns, film.share, off)
    logs, body = _fit_thickness(
        jnp.asarray(k),
        jnp.asarray(s),
        jnp.asarray(film.ground),
        jnp.asarray(film.measured - surface[:, None, None]),
        jnp.asarray(film.deviation),
        recovery.expectations.thickness,
        response,
    )
    return np.exp(logs), surface, np.moveaxis(np.asarray(body), -1, 1) + surface[:, None, None]


def _mixed(
    unknowns: Unknowns, share: Float[np.ndarray, "paints"], off: Float[np.ndarray, "draws bands coefficients"]
) -> tuple[Float[np.ndarray, "draws bands"], Float[np.ndarray, "draws bands"]]:
    """k d and s d of a film of unit thickness for each draw; `off` is added to the logs."""
    counted = strengthen(share, unknowns.paints[:, :, 1])
    coefficients = np.exp(np.asarray(unknowns.bands) + off)
    paints = share.size
    return tuple(
        np.einsum("dp,dbp->db", counted, part) for part in (coefficients[..., :paints], coefficients[..., paints:])
    )


@jax.jit
def _fit_thickness(
    absorption: Float[Array, "draws bands"],
    scattering: Float[Array, "draws bands"],
    ground: Float[Array, "bands 2"],
    body: Float[Array, "draws bands 2"],
    deviation: Float[Array, "bands 2"],
    expected: float | Array,
    response: Response,
) -> tuple[Float[Array, "draws"], Float[Array, "draws bands 2"]]:
    """Log of the best thickness of each draw, by scanning and scanning again around the best, and its spectra."""

    def one(draw: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        absorption, scattering, body = draw

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

    return jax.lax.map(one, (absorption, scattering, body))
