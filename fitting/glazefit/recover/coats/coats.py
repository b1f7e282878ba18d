"""Ladders of coats: the same paint brushed once, twice, three times, each on a ground that was read
bare; and the coat that comes next.

How thick a brushed coat is nobody knows. So the unit of length is the paint's own typical coat: a
film of n coats is n units thick, give or take a factor, and k and s are optical thicknesses of one
coat. They are relative: no number here is a length.

One coat over one ground gives one number at each band, and k d and s d are two. The prior of the
scattering of any film separates them. Ladders of two coats and more separate k
from s themselves, and then hardly feel it.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.colour import delta_e_of_spectra
from glazejax.geometry import resolve_instrument
from glazejax.progress import Progress, no_progress
from glazejax.spectra import Bands, describe_grid

from ...film.films import Films, InstrumentLike, Noise, card_readings, card_reflectance
from ...film.model.errors import smooth_kernel
from ...film.model.response import Response, film_response
from ...film.noise import estimate_noise
from ..joint.joint import UNIT, recover_jointly
from ..joint.pose import Gauge
from ..joint.problem import Expectations, JointProblem, Unknowns, readings
from ..joint.result import JointRecovery
from ..predict.prediction import interval_of, least_by_scanning

_NAME = re.compile(
    r"(?P<paint>\S.*?)\s+(?P<coats>\d+(?:\.\d+)?)\s+coats?(?:\s+(?P<square>\S.*))?", re.IGNORECASE
)

FEWEST_COATS = 0.1
MOST_COATS = 20.0


class CoatScattering(NamedTuple):
    """Expected log of scattering times thickness of one brushed coat, averaged over the bands."""

    mean: float
    sd: float


ANY_FILM = CoatScattering(*Expectations().level_s)
"""Of any film, as a joint recovery expects it."""


class NamedCoat(NamedTuple):
    """Paint and number of coats, as a film's name says."""

    paint: str
    coats: float


def coat_of(name: str) -> NamedCoat | None:
    """Paint and number of coats of a film that is called by them, such as ``Smalt 2 coats`` or
    ``Smalt 2 coats left``; None if it is not.

    Example:
        >>> coat_of("Red ochre 1 coat")
        NamedCoat(paint='Red ochre', coats=1.0)
    """
    match = _NAME.fullmatch(name)
    return NamedCoat(match["paint"], float(match["coats"])) if match else None


class CoatFilm(NamedTuple):
    """A film as it was read: over white where it was read over both."""

    name: str
    coats: float
    reflectance: Bands
    ground: Bands  # bare


@dataclass(frozen=True)
class CoatRecovery:
    """Paints recovered from coats; k and s are optical thicknesses of one coat of each paint.

    Attributes:
        films: as measured.
        paints: by name, each recovered from its own films.
        coats: film -> number of coats.
        spread: standard deviation of the log of a film's thickness about its number of coats.
        response: model of one film.
    """

    films: Films
    paints: Mapping[str, JointRecovery]
    coats: Mapping[str, float]
    spread: float
    response: Response

    def __repr__(self) -> str:
        return f"CoatRecovery({', '.join(self.paints)} from {len(self.films)} films)"

    @property
    def wavelengths(self) -> Bands:
        """nm, (bands,)."""
        return self.films.wavelengths

    def film(self, name: str) -> CoatFilm:
        """A film as it was read.

        Raises:
            ValueError: there is none of that name.
        """
        films = self.films.select([name])
        card = int(films.seen[0, 1])
        return CoatFilm(
            name=name,
            coats=self.coats[name],
            reflectance=films.over_cards[0, card],
            ground=films.bare_cards[0, card],
        )

    def thickest(self, paint: str) -> CoatFilm:
        """The film of a paint with the most coats, the first of several.

        Raises:
            ValueError: no coats of that paint were recovered.
        """
        return self.film(max(self._fit_of(paint).films.names, key=self.coats.__getitem__))

    def scattering(self, paint: str) -> CoatScattering:
        """Log of s d of one coat, averaged over the bands, as it was found."""
        fit = self._fit_of(paint)
        drawn = fit.draws.bands[:, :, 1].mean(axis=1)
        return CoatScattering(float(np.log(fit.scattering[0]).mean()), float(drawn.std()))

    def _fit_of(self, paint: str) -> JointRecovery:
        if paint not in self.paints:
            raise ValueError(
                f"no coats of {paint!r} were recovered; there are {', '.join(self.paints)}"
            )
        return self.paints[paint]


@dataclass(frozen=True)
class CoatPrediction:
    """A film of some coats that was not seen.

    Attributes:
        paint, coats: of the film.
        wavelengths: nm, (bands,).
        draws: reflectance as it may be, (draws, bands).
    """

    paint: str
    coats: float
    wavelengths: Bands
    draws: Float[np.ndarray, "draws bands"]

    def __repr__(self) -> str:
        return (
            f"CoatPrediction({self.coats:g} coats of {self.paint}, "
            f"{describe_grid(self.wavelengths)})"
        )

    @property
    def reflectance(self) -> Bands:
        """Median of the draws."""
        return np.median(self.draws, axis=0)

    def interval(self, level: float = 0.9) -> tuple[Bands, Bands]:
        """Lower and upper end of the band that holds this share of the draws.

        Raises:
            ValueError: a level outside (0, 1).
        """
        return interval_of(self.draws, level)

    def delta_e(
        self,
        measured: Float[np.ndarray, "*n bands"],
        illuminant: str = "D65",
        observer: str | int = 10,
    ) -> Float[np.ndarray, "*n"]:
        """CIEDE2000 between the prediction and other spectra."""
        return delta_e_of_spectra(
            self.wavelengths,
            self.reflectance,
            measured,
            illuminant=illuminant,
            observer=observer,
        )

    def expected_error(self, illuminant: str = "D65", observer: str | int = 10) -> float:
        """Mean CIEDE2000 that the prediction is expected to be off."""
        return float(self.delta_e(self.draws, illuminant, observer).mean())


def recover_coats(
    films: Films,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    expected: CoatScattering = ANY_FILM,
    spread: float = 0.3,
    response: Response | None = None,
    progress: Progress = no_progress,
) -> CoatRecovery:
    """Absorption and scattering of one coat of each paint, from films of one coat or several.

    Each paint is recovered from its own films, each of a thickness of its own about its number of
    coats.

    Args:
        films: over a ground that was read bare, called by their paint and number of coats
            (`coat_of`); films of one paint may lie on different grounds.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading, by default estimated from the readings' roughness.
        expected: of the scattering of a coat.
        spread: standard deviation of the log of a film's thickness about its number of coats.
        response: model of one film, by default that of the instrument.
        progress: called before each paint.

    Raises:
        ValueError: no film; a film whose name says no coats, whose ground was not read, or that is
            said to hide it; a number of coats out of range.
    """
    if len(films) == 0:
        raise ValueError("there are no films to recover")
    if not 0 < spread <= 2:
        raise ValueError(f"the spread is {spread:g}; it must be above 0 and at most 2")
    named_coats = {name: _named_coat(name) for name in films.names}
    _check_grounds(films)
    instrument = resolve_instrument(instrument)
    noise = noise or estimate_noise(films)
    card_readings(films, instrument, noise)  # refuse bad grounds before the first paint
    response = response or film_response(instrument)
    fits: dict[str, JointRecovery] = {}
    paint_names = dict.fromkeys(coat.paint for coat in named_coats.values())
    for paint in paint_names:
        progress(len(fits), len(paint_names), "fitting the coats of each paint")
        thickness = {
            name: coat.coats * UNIT for name, coat in named_coats.items() if coat.paint == paint
        }
        fits[paint] = recover_jointly(
            films.select(list(thickness)),
            {name: {paint: 1.0} for name in thickness},
            instrument=instrument,
            noise=noise,
            response=response,
            expectations=Expectations(thickness=spread, level_s=expected),
            # The unit is the coat itself: no factor is common to all films.
            gauge=Gauge(thickness, error=spread, common=1e-3),
        )
    return CoatRecovery(
        films=films,
        paints=fits,
        coats={name: coat.coats for name, coat in named_coats.items()},
        spread=spread,
        response=response,
    )


def predict_next_coat(
    recovery: CoatRecovery,
    paint: str,
    coats: float,
    ground: Bands,
    *,
    seed: int = 0,
) -> CoatPrediction:
    """Predict a film of some coats of a paint over a ground.

    Each draw takes scattering and thicknesses as the fit leaves them open, the absorption with
    which they meet the paint's readings, a thickness for the new film, and errors of the model.

    Args:
        recovery: of the paint, and others.
        paint: its name.
        coats: number of coats of the film, 0.1 to 20.
        ground: reading of the bare ground, (bands,), fractions.
        seed: of the draws.

    Raises:
        ValueError: a paint that was not recovered, a number of coats out of range, or a ground of
            another length or that cannot be one.
    """
    fit = recovery._fit_of(paint)
    instrument = fit.instrument
    if not FEWEST_COATS <= coats <= MOST_COATS:
        raise ValueError(
            f"{coats:g} coats of {paint}; give a number from {FEWEST_COATS:g} to {MOST_COATS:g}"
        )
    bare = np.asarray(ground, dtype=np.float64)
    grid = recovery.wavelengths
    if bare.shape != grid.shape:
        raise ValueError(
            f"the ground has shape {bare.shape}; the films have {grid.size} bands, "
            f"{describe_grid(grid)}"
        )
    if not (np.isfinite(bare).all() and bare.min() >= 0 and bare.max() <= 1.2):
        raise ValueError("the ground's reflectance must lie between 0 and 1, as fractions")
    internal = np.clip(card_reflectance(bare, instrument)[0], 0.0, 1.0)
    # Another stream than that of the recovery's draws, which start from a seed too.
    rng = np.random.default_rng((seed, 1))
    draws = fit.draws
    count = len(draws.bands)
    log_k = _absorption_that_meets(draws, fit.problem)
    thickness = np.log(coats) + recovery.spread * rng.standard_normal((count, 1))
    kd = np.exp(np.asarray(log_k) + thickness)
    sd = np.exp(draws.bands[:, :, 1] + thickness)
    gloss = np.exp(draws.paints[:, 0] + fit.expectations.gloss * rng.standard_normal(count))
    reading = np.asarray(recovery.response.body(kd, sd, internal))
    reading = reading + instrument.seen_surface * gloss[:, None]
    # The model's own error of a further coat: smooth, and larger for bright readings.
    smooth = rng.multivariate_normal(np.zeros(grid.size), smooth_kernel(grid, 100.0), size=count)
    noise = fit.noise.sd(reading) * rng.standard_normal(reading.shape)
    off = (0.003 + 0.01 * reading) * smooth + noise
    return CoatPrediction(paint, float(coats), grid, np.maximum(reading + off, 0.0))


def _named_coat(name: str) -> NamedCoat:
    """Paint and coats of a film, by its name."""
    named = coat_of(name)
    if named is None:
        raise ValueError(
            f"film {name!r} does not say its paint and number of coats; call it "
            "'PAINT 1 coat', 'PAINT 2 coats', ..."
        )
    if not FEWEST_COATS <= named.coats <= MOST_COATS:
        raise ValueError(
            f"film {name!r} has {named.coats:g} coats; they must be {FEWEST_COATS:g} to "
            f"{MOST_COATS:g}"
        )
    return named


def _check_grounds(films: Films) -> None:
    hides = [name for name, flag in zip(films.names, films.opaque, strict=True) if flag]
    if hides:
        raise ValueError(
            f"coats of {hides[0]!r} lie on a ground that counts: name its rows '{hides[0]}_ow' and "
            f"'{hides[0]}_w' (its bare ground), on a dark ground _ob and _b"
        )
    unread = np.argwhere(films.assumed & films.seen)
    if len(unread):
        row, card = (int(n) for n in unread[0])
        name, ending = films.names[row], "bw"[card]
        raise ValueError(
            f"the bare ground of {name!r} was not read: add a row '{name}_{ending}', or "
            f"'card_{ending}' for all films"
        )


@jax.jit
def _absorption_that_meets(draws: Unknowns, problem: JointProblem) -> Float[Array, "draws bands"]:
    """Log of k of one coat with which each draw of scattering, thicknesses and gloss meets the
    readings best, by scanning and scanning again.
    """

    def one(draw: Unknowns) -> Array:
        start, log_s = draw.bands.T

        def cost(log_k: Array) -> Array:
            tried = draw._replace(bands=jnp.stack([log_k, log_s], axis=-1))
            off = (readings(tried, problem) - problem.reading) * problem.weight
            # A weak prior settles what no reading determines.
            return jnp.sum(off**2, axis=(1, 2)) + 0.01 * (log_k - start) ** 2

        return least_by_scanning(cost, start, 25)

    return jax.lax.map(one, draws)
