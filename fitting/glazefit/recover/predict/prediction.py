"""Predictions of a joint recovery for a film that it has not seen: from its weights, with only its
thickness free.

How sure it is comes from draws: of the paints' k and s as the recovery knows them, and of the
film's own errors (`film.model.variation`): a paint in another mixture is not quite the same
paint.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from glazejax.colour import delta_e_of_spectra
from glazejax.spectra import Bands, describe_grid

from ...film.films import Films, Noise, card_readings
from ...film.model.errors import ModelError, draw_coefficient_errors, draw_model_errors
from ...film.model.mixing import weight_table
from ...film.model.response import Response, hiding_factor
from ...film.model.variation import MIXED, SIZES, SizeEvidence, Variation, log_likelihood
from ...film.numerics.weighted import numbers_at
from ...film.tables import WAVELENGTH, Tabulated, Variables
from ..joint.problem import model_deviation
from ..joint.result import JointRecovery

PARTS = ("scale", "paint", "film")
CardSpectra: TypeAlias = Float[np.ndarray, "2 bands"]
"""Over black and over white."""
DrawnSpectra: TypeAlias = Float[np.ndarray, "draws 2 bands"]
"""The same of each draw."""


@dataclass(frozen=True)
class Prediction(Tabulated):
    """Predicted film.

    Attributes:
        name: of the film.
        wavelengths: (bands,), nm.
        over_black, over_white: reflectance, (bands,).
        paints: in it.
        deviations: what each of `PARTS` may add to the reflectance over black and white, (draws, 2,
            bands): the scale of the paints' k and s, their shape, and the film's own errors, of
            size one.
        variation: how large the film's own errors are.
    """

    name: str
    wavelengths: Bands
    over_black: Bands
    over_white: Bands
    paints: tuple[str, ...]
    deviations: Mapping[str, DrawnSpectra]
    variation: Variation

    def __repr__(self) -> str:
        return (
            f"Prediction({self.name!r} of {', '.join(self.paints)}, "
            f"{describe_grid(self.wavelengths)})"
        )

    @property
    def reflectance(self) -> CardSpectra:
        """Over black and over white."""
        return np.stack([self.over_black, self.over_white])

    def arrays_and_axes(self) -> Variables:
        """Reflectance, and the ends of its 90 % intervals."""
        axes = {"over": ["black", "white"], WAVELENGTH: self.wavelengths}
        lower, upper = self.interval()
        columns = {"reflectance": self.reflectance, "lower_90": lower, "upper_90": upper}
        return {name: (tuple(axes), values) for name, values in columns.items()}, axes

    @property
    def draws(self) -> DrawnSpectra:
        """Reflectance over black and white as it may be too."""
        return self._draw(PARTS)

    def _draw(self, sources: tuple[str, ...]) -> DrawnSpectra:
        count = len(self.deviations["film"])
        # Each size as often as it is probable, in an order that has nothing to do with the other
        # draws'.
        ranks = (np.random.default_rng(0).permutation(count) + 0.5) / count
        sizes = np.asarray(SIZES)[numbers_at(self.variation.of(self.paints), ranks)]
        film = sizes[:, None, None] * self.deviations["film"]
        deviations = {**self.deviations, "film": film}
        return np.maximum(self.reflectance + sum(deviations[part] for part in sources), 0.0)

    def interval(self, level: float = 0.9) -> tuple[CardSpectra, CardSpectra]:
        """Lower and upper end of the band that holds this share of the draws, over black and white.

        Raises:
            ValueError: a level outside (0, 1).
        """
        return interval_of(self.draws, level)

    def delta_e(
        self,
        over_black: Float[np.ndarray, "*n bands"],
        over_white: Float[np.ndarray, "*n bands"],
        illuminant: str = "D65",
        observer: str | int = 10,
    ) -> Float[np.ndarray, "*n 2"]:
        """CIEDE2000 between the prediction and other spectra, over black and over white."""
        measured = np.stack([over_black, over_white], axis=-2)
        return delta_e_of_spectra(
            self.wavelengths,
            self.reflectance,
            measured,
            illuminant=illuminant,
            observer=observer,
        )

    def expected_error(
        self, illuminant: str = "D65", observer: str | int = 10, parts: tuple[str, ...] = PARTS
    ) -> float:
        """Mean CIEDE2000 that the prediction is expected to be off, over both cards, by some of
        `PARTS` or by all.
        """
        return float(self.expected_errors(illuminant, observer, parts).mean())

    def expected_errors(
        self, illuminant: str = "D65", observer: str | int = 10, parts: tuple[str, ...] = PARTS
    ) -> Float[np.ndarray, "2"]:
        """The same over the black and over the white card."""
        over_black, over_white = np.moveaxis(self._draw(parts), 1, 0)
        return self.delta_e(over_black, over_white, illuminant, observer).mean(axis=0)

    def between_mixings(self, illuminant: str = "D65", observer: str | int = 10) -> float:
        """Mean CIEDE2000 between two films of the recipe, over both cards, by the films' own
        errors.
        """
        drawn = self._draw(("film",))
        half = len(drawn) // 2
        off = delta_e_of_spectra(
            self.wavelengths,
            drawn[:half],
            drawn[half : 2 * half],
            illuminant=illuminant,
            observer=observer,
        )
        return float(off.mean())

    def size_evidence(
        self, measured: CardSpectra, cards: Bool[np.ndarray, "2"] | None = None
    ) -> SizeEvidence:
        """Evidence of the film on how large films' own errors are, now that it was measured.

        Args:
            measured: reflectance over black and white.
            cards: whether it was read over black and over white; by default over both.
        """
        rows = np.flatnonzero(np.ones(2) if cards is None else cards)
        paint_errors = self.deviations["scale"] + self.deviations["paint"]
        likelihood = log_likelihood(
            (measured - self.reflectance)[rows],
            paint_errors[:, rows],
            self.deviations["film"][:, rows],
            self.wavelengths,
        )
        return SizeEvidence(frozenset(self.paints), likelihood)


def mean_part_errors(
    predictions: Sequence[Prediction], eye: tuple[str, str] = ("D65", "10")
) -> dict[str, float]:
    """Mean CIEDE2000 that each of `PARTS` is expected to make predictions off, for an illuminant
    and an observer.
    """
    return {
        source: float(np.mean([p.expected_error(*eye, parts=(source,)) for p in predictions]))
        for source in PARTS
    }


def say_paint_errors(predictions: Sequence[Prediction], eye: tuple[str, str]) -> str:
    """Say what errors of the paints' own k and s add to a colour, Delta E 2000."""
    errors = mean_part_errors(predictions, eye)
    return (
        f"{errors['scale']:.1f} by the level of their k and s, and {errors['paint']:.1f} by their "
        "shape"
    )


def interval_of(
    draws: Float[np.ndarray, "draws *n"], level: float
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Lower and upper end of the band that holds this share of draws.

    Raises:
        ValueError: a level outside (0, 1).
    """
    if not 0 < level < 1:
        raise ValueError(f"the level is {level:g}; give a share between 0 and 1, such as 0.9")
    low, high = np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return low, high


def split_draws(
    spectra: Float[np.ndarray, "all 2 bands"],
) -> tuple[CardSpectra, dict[str, DrawnSpectra]]:
    """The expected film, and how draws deviate from it by each of `PARTS`, of spectra of the one
    and then of as many draws of each.
    """
    mean = spectra[0]
    deviations = np.split(spectra[1:] - mean, len(PARTS))
    return mean, dict(zip(PARTS, deviations, strict=True))


def predict_films(
    recovery: JointRecovery,
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    noise: Noise | None = None,
    discrepancy: ModelError | None = None,
    variation: Variation | None = None,
    response: Response | None = None,
) -> list[Prediction]:
    """Spectra of films of known weights over their own cards; each film's thickness is fitted to
    its readings, where it does not hide the cards.

    Gloss is what the paints in it showed elsewhere.

    Args:
        recovery: of the paints.
        films: to predict.
        recipes: sample -> paint -> weight, in any unit.
        noise: of a reading, by default as the recovery has it.
        discrepancy: a film's own errors of size one, by default `film.model.variation.MIXED`.
        variation: how large these are: what films that were left out taught (`LeftOut.variation`),
            by default the prior.
        response: model of one film, by default that of the recovery.

    Raises:
        ValueError: a film without a recipe, or with a paint that the recovery does not know, other
            wavelengths, or a card that is not possible (see `glazefit.film.films.card_readings`).
    """
    if not np.array_equal(films.wavelengths, recovery.wavelengths):
        raise ValueError(
            f"the films are at {describe_grid(films.wavelengths)}, the recovery is at "
            f"{describe_grid(recovery.wavelengths)}: bring the films to its wavelengths"
        )
    noise = noise or recovery.noise
    discrepancy = discrepancy or MIXED
    variation = variation or Variation()
    instrument = recovery.instrument
    paints = len(recovery.paints)
    response = response or recovery.problem.response
    card_data = card_readings(films, instrument, noise)
    named, weights = weight_table(films.names, recipes)
    columns = np.zeros((len(films), paints))
    columns[:, [recovery.row(paint) for paint in named]] = weights
    shares = recovery.law.shares(columns, recovery.paints)
    # Errors of the paints as the recovery has them: their level over the bands, and their shape.
    off = recovery.draws.bands - recovery.unknowns.bands
    count = len(off)
    level = np.broadcast_to(off.mean(axis=1, keepdims=True), off.shape)
    # The same draws for every film, so that films compare.
    rng = np.random.default_rng(0)
    varied = draw_coefficient_errors(rng, (count, 2 * paints), films.wavelengths, discrepancy)
    model = draw_model_errors(rng, count, 2, films.wavelengths, discrepancy)
    # The film as it is expected, then draws of the errors of each of `PARTS`.
    errors = np.concatenate([np.zeros_like(off[:1]), level, off - level, np.swapaxes(varied, 1, 2)])
    coefficients = np.exp(recovery.unknowns.bands + errors)
    log_gloss = np.tile(recovery.unknowns.paints, (len(errors), 1))
    log_gloss[1 + count : 1 + 2 * count] = recovery.draws.paints
    out = []
    for row, name in enumerate(films.names):
        measured = card_data.reflectance[row]
        share = shares[row]
        surface = (np.exp(log_gloss @ share) * instrument.seen_surface)[:, None, None]
        deviation = model_deviation(measured, noise, recovery.expectations)
        body = _fit_thickness(
            absorption=coefficients[..., :paints] @ share,
            scattering=coefficients[..., paints:] @ share,
            ground=card_data.ground[row],
            body=measured - surface,
            # A reading that there is not says nothing of the thickness.
            deviation=np.where(films.seen[row], deviation, np.inf),
            expected=recovery.expectations.thickness,
            opaque=films.opaque[row],
            response=response,
        )
        mean, deviations = split_draws(np.moveaxis(np.asarray(body), -1, 1) + surface)
        deviations["film"] += model
        out.append(
            Prediction(
                name=name,
                wavelengths=films.wavelengths,
                over_black=mean[0],
                over_white=mean[1],
                paints=tuple(recovery.paints[paint] for paint in np.flatnonzero(share > 0)),
                deviations=deviations,
                variation=variation,
            )
        )
    return out


def least_by_scanning(
    cost: Callable[[Array], Array], start: Float[Array, "*n"], points: int
) -> Float[Array, "*n"]:
    """Find where the cost of each logarithm by itself is least, within a factor of e^4 of a start,
    by scanning so many points, and again around the best.
    """
    best, half = start, 4.0
    for _ in range(4):
        tried = best + half * jnp.linspace(-1.0, 1.0, points).reshape(-1, *[1] * start.ndim)
        least = jnp.argmin(jax.vmap(cost)(tried), axis=0)
        best = jnp.take_along_axis(tried, least[None], axis=0)[0]
        half = 4.0 * half / points
    return best


@jax.jit
def _fit_thickness(
    absorption: Float[Array, "draws bands"],
    scattering: Float[Array, "draws bands"],
    ground: Float[Array, "bands 2"],
    body: Float[Array, "draws bands 2"],
    deviation: Float[Array, "bands 2"],
    expected: float | Array,
    opaque: Bool[Array, ""],
    response: Response,
) -> Float[Array, "draws bands 2"]:
    """Spectra of each draw at its best thickness, or of one that hides the ground."""

    def one(draw: tuple[Array, Array, Array]) -> Array:
        absorption, scattering, body = draw

        def spectra(d: Array) -> Array:
            return response.body((d * absorption)[:, None], (d * scattering)[:, None], ground)

        def cost(log_thickness: Array) -> Array:
            return (
                jnp.sum(((spectra(jnp.exp(log_thickness)) - body) / deviation) ** 2)
                + (log_thickness / expected) ** 2
            )

        d = jax.lax.cond(
            opaque,
            lambda: hiding_factor(absorption, scattering),
            lambda: jnp.broadcast_to(
                jnp.exp(least_by_scanning(cost, jnp.asarray(0.0), 161)), absorption.shape
            ),
        )
        return spectra(d)

    return jax.lax.map(one, (absorption, scattering, body))
