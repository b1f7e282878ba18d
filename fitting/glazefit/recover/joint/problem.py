"""All films at once: what is unknown, and how far a guess is from the readings and from what was
expected.

Unknown are log k and log s of every paint at every band, and a few numbers that all bands share: of
every film the logs of its relative thickness, of its gloss relative to that of its paints, and of
the error of each weight but the largest; of every paint the log of its gloss. A
reading over a card rho is

    R = R_s exp(sum_p w_p m_p + g_f) + body(d_f sum_p c_p k_p, d_f sum_p c_p s_p, rho)

with c from the mixing law and the weights, each weight times exp(e). Everything is a sum of
squares: residuals of the readings, the curvature of log k and log s along the wavelengths, the
steps of log s where a paint is nearly black, and the priors.

What else may be off, all standard normal a priori, are the `others` (see `pose`): error modes of
paints that are known already, the level of cards that were not measured, a factor of all
thicknesses, and a factor of each reading. They are added to the bands' and the films'
unknowns, which are then deviations; `totals` adds them up.
"""

from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...film.films import Noise
from ...film.model.response import Response, hiding_factor
from ...film.numerics.least_squares import root_of_log1p

FilmShares: TypeAlias = Float[np.ndarray, "films paints"]
"""Shares of the paints in each film."""


class Expectations(NamedTuple):
    """Expectations before any reading, as standard deviations.

    Chosen so that films which are left out of a fit are predicted best: `python -m
    benchmarks.paint.prediction --scan`.
    """

    thickness: float = 0.3
    """Of the log of a film's relative thickness."""
    gloss: float = 0.03
    """Of the log of one film's gloss, its share of a smooth surface's reflection, about that of its
    paints.
    """
    paint_gloss: float = 0.03
    """Of the log of a paint's gloss, about what its darkest readings allow (see
    `glazefit.film.gloss`).
    """
    weight_share: float = 0.01
    """Of the log of a weight: what weighing leaves open;"""
    weight_floor: float = 0.0005
    """and of a weight as a share of the film: recipes are rounded to a tenth of a per cent."""
    tail: float = 3.0
    """Degrees of freedom of Student's t that errors of weights follow: a recipe may be plainly
    wrong.
    """
    curvature_k: float = 0.3
    """Of the second difference of log k over 10 nm."""
    curvature_s: float = 0.1
    """Of the second difference of log s over 10 nm."""
    slope_s: float = 0.25
    """Of the first difference of log s over 10 nm where a paint's own film is nearly black, each
    step independent of the others. There s is read from thousandths of reflectance, and bronzing
    would pass for it."""
    level_k: tuple[float, float] = (0.0, 3.0)
    """Mean and standard deviation of a paint's log(k d) for a film of unit thickness, averaged over
    the bands: little.

    An opaque paint that is in no mixture gives k/s alone; these two set the rest.
    """
    level_s: tuple[float, float] = (1.0, 1.5)
    """The same of log(s d)."""
    scale: float = 1.0
    """Of the log of a factor of all thicknesses where paints are known: theirs may be in another
    unit than the films'."""
    gain: float = 0.0
    """Of the log of a factor of all bands of one reading: texture, and how the film was held."""
    model_floor: float = 0.01
    """What the model itself may be off, added to the noise: near black,"""
    model_share: float = 0.01
    """and for each unit of reflectance. Larger than residuals are: errors of neighbouring bands are
    correlated, so that thirty of them count as a few independent ones."""

    def model_sd(self, reflectance: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Error of the model at a reflectance, one standard deviation."""
        return self.model_floor + self.model_share * reflectance


class Unknowns(NamedTuple):
    """Point of the search; also the shape of a step."""

    bands: Float[Any, "bands local"]  # log k of all paints, then log s, for unit thickness
    films: Float[
        Any, "films 2+parts"
    ]  # log thickness, log gloss relative to its paints', errors of log weights
    paints: Float[Any, "paints"]  # log gloss
    others: Float[Any, "others"] = np.zeros(0)  # errors of what is known


class JointProblem(NamedTuple):
    """Model of a film, data and expectations; arrays have a leading axis of bands where they depend
    on it.
    """

    response: Response  # of a film
    reading: Float[Any, "bands films 2"]
    ground: Float[Any, "bands films 2"]
    weight: Float[Any, "bands films 2"]  # one over the standard deviation; 0 leaves a reading out
    shares: Float[Any, "films paints"]
    minor: Float[Any, "films parts paints"]  # 1 where an error of weight belongs
    surface: Float[Any, ""]
    curvature: Float[
        Any, "inner bands"
    ]  # second difference in units of (10 nm)^-2, for a weight of 1
    stiffness: Float[Any, "local"]  # one over the expected curvature
    steepness: Float[
        Any, "steps local"
    ]  # one over the expected step from band to band, 0 where any will do
    mean: Unknowns  # of the prior
    scale: Unknowns  # standard deviations of the prior
    tail: Float[Any, ""]  # degrees of freedom of Student's t of weights' errors
    opaque: Bool[Any, "films"]  # whether a film hides whatever is below
    film_mean: Float[Any, "films"]  # log thickness expected
    gloss: Float[Any, "films"]  # log of the gloss that was measured, else NaN: that of the paints
    band_modes: Float[Any, "others bands local"]
    ground_modes: Float[Any, "others films 2"]  # of log(rho / (1 - rho))
    thickness_modes: Float[Any, "others films"]
    gain_modes: Float[Any, "others films 2"]


class JointResiduals(NamedTuple):
    """Residuals in standard deviations, of readings and of the prior."""

    data: Float[Array, "bands films 2"]
    curvature: Float[Array, "inner local"]
    steps: Float[Array, "steps local"]
    prior: Unknowns


def totals(unknowns: Unknowns, problem: JointProblem, sign: float = 1.0) -> Unknowns:
    """Logs of coefficients and of thicknesses as they are: unknowns with what the others add, in
    NumPy or JAX. With a `sign` of -1 that is taken away again.
    """
    thickness = problem.film_mean + unknowns.others @ problem.thickness_modes
    coefficients = unknowns.others @ problem.band_modes.reshape(-1, unknowns.bands.size)
    thickness_column = np.eye(unknowns.films.shape[1])[0]
    return unknowns._replace(
        bands=unknowns.bands + sign * coefficients.reshape(unknowns.bands.shape),
        films=unknowns.films + sign * thickness[:, None] * thickness_column,
    )


def optical_thickness(
    unknowns: Unknowns, problem: JointProblem
) -> tuple[Float[Array, "bands films"], Float[Array, "bands films"]]:
    """Optical thicknesses k d and s d of the films, from `totals`."""
    paints = problem.shares.shape[1]
    errors = jnp.einsum("fe,fep->fp", unknowns.films[:, 2:], problem.minor)
    amounts = jnp.exp(unknowns.films[:, :1] + errors) * problem.shares
    coefficients = jnp.exp(unknowns.bands)
    kd = coefficients[:, :paints] @ amounts.T
    sd = coefficients[:, paints:] @ amounts.T
    # As thick as the response goes, so that only k/s counts.
    thick = jnp.where(problem.opaque, hiding_factor(kd, sd), 1.0)
    return kd * thick, sd * thick


def readings(unknowns: Unknowns, problem: JointProblem) -> Float[Array, "bands films 2"]:
    """Readings of the instrument over both cards, from `totals`."""
    odds = jnp.exp(jnp.einsum("o,ofc->fc", unknowns.others, problem.ground_modes))
    ground = problem.ground * odds / (1.0 - problem.ground + problem.ground * odds)
    kd, sd = optical_thickness(unknowns, problem)
    expected = jnp.where(jnp.isnan(problem.gloss), problem.shares @ unknowns.paints, problem.gloss)
    gloss = jnp.exp(expected + unknowns.films[:, 1])
    reading = problem.surface * gloss[:, None] + problem.response.body(
        kd[..., None], sd[..., None], ground
    )
    return reading * jnp.exp(jnp.einsum("o,ofc->fc", unknowns.others, problem.gain_modes))


@jax.jit
def readings_of_draws(
    draws: Unknowns, problem: JointProblem
) -> Float[Array, "draws bands films 2"]:
    """Readings of the instrument, from draws of `totals`."""
    return jax.vmap(lambda draw: readings(draw, problem))(draws)


def residuals(unknowns: Unknowns, problem: JointProblem) -> JointResiduals:
    """Residuals of the whole problem, from deviations."""
    prior = jax.tree.map(
        lambda value, mean, scale: (value - mean) / scale, unknowns, problem.mean, problem.scale
    )
    weights = heavy_tail(prior.films[:, 2:], problem.tail)
    return JointResiduals(
        data=(readings(totals(unknowns, problem), problem) - problem.reading) * problem.weight,
        curvature=(problem.curvature @ unknowns.bands) * problem.stiffness,
        steps=jnp.diff(unknowns.bands, axis=0) * problem.steepness,
        prior=prior._replace(films=jnp.hstack([prior.films[:, :2], weights])),
    )


def heavy_tail(x: Float[Array, "*shape"], freedom: Float[Array, ""]) -> Float[Array, "*shape"]:
    """Residual whose square is minus twice the log density of Student's t, up to a constant."""
    return jnp.sqrt(freedom + 1.0) * root_of_log1p(x / jnp.sqrt(freedom))


def model_deviation(
    measured: Float[np.ndarray, "*shape"],
    noise: Noise,
    expected: Expectations,
    ground_sd: Float[np.ndarray, "*#shape"] | float = 0.0,
) -> Float[np.ndarray, "*shape"]:
    """Standard deviation of a reading from the model's: the instrument's noise, what the model may
    be off, and a card's own error, which reaches the reading through the film, at most as a bare
    card's does.
    """
    of_model = np.hypot(noise.sd(measured), expected.model_sd(measured))
    return np.hypot(of_model, ground_sd * measured)
