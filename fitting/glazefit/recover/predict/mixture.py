"""One mixture as a paint of its own: its prediction from paints and weights, and what one reading
of it adds.

A priori k and s of a mixture are uncertain as those of its paints are, and as films differ from
their recipes (`film.model.variation`). All of that is linear in a few errors that are standard
normal: error modes of the mixture. A joint fit takes a paint with error modes as known (`pose`),
and finds them from a reading: strength above all. What is then predicted of other
thicknesses and grounds is that same mixing, no more another one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.paint.describe import format_length
from glazejax.progress import Progress, no_progress
from glazejax.spectra import Bands, common_range, lie_between

from ...film.films import SPECTRA, Films, InstrumentLike, Noise, check_ground, usual_cards
from ...film.model.errors import (
    ModelError,
    draw_model_errors,
    smooth_modes,
    stated_modes,
)
from ...film.model.mixing import MixingLaw
from ...film.model.response import Response, film_response
from ...film.model.variation import MIXED, Spread, Variation
from ...film.noise import estimate_noise
from ..joint.joint import UNIT, recover_jointly
from ..joint.pose import Gauge
from ..joint.problem import Expectations, readings_of_draws
from ..joint.result import JointRecovery
from .prediction import PARTS, CardSpectra, DrawnSpectra, Prediction, split_draws

CLOSE = Expectations(model_floor=0.002, model_share=0.006)
"""A reading of the mixture itself counts as far as the optics is exact, not as a paint between
films.
"""
SMOOTH = ModelError(amplitude=1.0, length=60.0, shared=0.8)
"""Errors of the model, of size one: similar at neighbouring bands."""
# Shapes of a smooth error over the bands: eight hold nearly all of it.
_SHAPES = 8


class _MixedPaint(NamedTuple):
    """A mixture by the mixing law."""

    name: str
    wavelengths: Bands
    coefficients: Float[np.ndarray, "2 bands"]  # k and s, 1/m
    modes: dict[str, Float[np.ndarray, "modes 2 bands"]]  # of the errors of their logs


def mix(
    pigments: Mapping[str, Pigment],
    recipe: Mapping[str, float],
    *,
    wavelengths: Bands | None = None,
    law: MixingLaw | None = None,
    variation: Variation | None = None,
    name: str = "",
) -> Pigment:
    """A mixture as a pigment: k and s by the mixing law, and all that is open of them as error
    modes.

    Args:
        pigments: by name.
        recipe: paint -> weight, in any unit.
        wavelengths: (bands,), nm, by default those of the first paint that all paints reach.
        law: mixing law, by default linear by mass.
        variation: how far films are from their recipes, by default the prior.
        name: of the mixture, by default its recipe.

    Raises:
        ValueError: no paint, a weight that is negative, an unknown paint, or wavelengths that a
            paint does not cover.
    """
    mixture = _mix(pigments, recipe, wavelengths, law)
    paints = [paint for paint, weight in recipe.items() if weight > 0]
    size = (variation or Variation()).size_of(paints)
    mode_groups = mixture.modes
    modes = np.concatenate(
        [mode_groups["scale"] + mode_groups["paint"], size * mode_groups["film"]]
    )
    modes = modes[modes.any(axis=(1, 2))]
    sd = mixture.coefficients * np.sqrt(np.sum(modes**2, axis=0))
    name = name or mixture.name
    return Pigment(
        name,
        mixture.wavelengths,
        *mixture.coefficients,
        absorption_sd=sd[0],
        scattering_sd=sd[1],
        error_modes=modes,
        provenance=name,
    )


def predict_mixture(
    pigments: Mapping[str, Pigment],
    recipe: Mapping[str, float],
    thickness: Sequence[float],
    *,
    wavelengths: Bands | None = None,
    ground: tuple[Any, Any] | None = None,
    instrument: InstrumentLike | None = None,
    law: MixingLaw | None = None,
    variation: Variation | None = None,
    calibrated: JointRecovery | None = None,
    response: Response | None = None,
    spread: Spread | None = None,
) -> list[Prediction]:
    """Predict what a mixture of known paints will look like at some thicknesses, over a black and a
    white ground.

    Args:
        pigments, recipe, wavelengths, law, variation: as for `mix`.
        thickness: m; with `calibrated` on the scale of its film, which is as thick as was found.
        ground: internal reflectance of the black and the white ground, each a number or (bands,);
            by default usual cards.
        instrument: by default that of `calibrated`, or d:8 with the specular part, refractive
            index 1.5.
        calibrated: what `calibrate_mixture` found; then that mixing is predicted, and a
            film as thick as one that was read is that film.
        response: model of one film, by default that of `calibrated`, or of the instrument where
            it is given.
        spread: its `alike` says how much of what the reading was off holds over another card; as
            for `calibrate_mixture`.

    Returns:
        A `Prediction` for each thickness.

    Raises:
        ValueError: as `mix`, a thickness that is not positive, or a reflectance of a ground that is
            not in [0, 1].
    """
    for reflectance in () if ground is None else ground:
        check_ground(reflectance)
    if calibrated is not None and instrument is None:
        instrument = calibrated.instrument
        response = response or calibrated.problem.response
    instrument = resolve_instrument(instrument)
    response = response or film_response(instrument)
    paints = tuple(paint for paint, weight in recipe.items() if weight > 0)
    if calibrated is None:
        _, grid, coefficients, modes = _mix(pigments, recipe, wavelengths, law)
        # Draws of the errors of the paints, and of the film's own.
        rng = np.random.default_rng(0)
        paint_draws, film = (
            rng.standard_normal((256, len(modes[source]))) for source in ("paint", "film")
        )
        # Scale and shape are two sides of the same errors.
        normal = {"scale": paint_draws, "paint": paint_draws, "film": film}
        off = [np.einsum("dm,mcb->dcb", normal[source], modes[source]) for source in PARTS]
        gloss = 1.0
    else:
        grid = calibrated.wavelengths
        coefficients = np.exp(calibrated.unknowns.bands.T) / UNIT
        # It is that mixing, and errors of its paints are errors of it.
        drawn = drawn_mixture(calibrated)
        off = [np.zeros_like(drawn), drawn, np.zeros_like(drawn)]
        gloss = float(calibrated.gloss[0])
    # Film by film: the mean reading, and the deviations of each draw from it.
    errors = [np.zeros((1, 2, grid.size)), *off]
    grounds = usual_cards(grid) if ground is None else ground
    surface = instrument.seen_surface * gloss
    alike = (spread or Spread()).alike
    out = []
    for metres in thickness:
        if not metres > 0:
            raise ValueError(
                f"a thickness of {metres:g} m; it must be above 0, in metres, such as 25e-6"
            )
        # Part by part: of so few films NumPy has the readings before JAX has compiled anything.
        parts = [film_readings(response, coefficients * metres, part, grounds) for part in errors]
        mean, deviations = split_draws(np.concatenate(parts) + surface)
        if calibrated is not None:
            shift, extra = reading_errors(calibrated, alike, metres / UNIT, mean)
            mean = mean + shift
            deviations["paint"] += extra
        over_black, over_white = mean
        out.append(
            Prediction(
                name=format_length(metres),
                wavelengths=grid,
                over_black=over_black,
                over_white=over_white,
                paints=paints,
                deviations=deviations,
                variation=variation or Variation(),
            )
        )
    return out


def reading_errors(
    calibrated: JointRecovery, correlation: float, thickness: float, reflectance: CardSpectra
) -> tuple[CardSpectra, DrawnSpectra]:
    """Expected errors of readings of a mixture, by their surface, their gain, and the model; and
    each draw's deviation from them.

    One draw of them holds for films of every thickness. A film that was read, over another card,
    is off as its reading was, as far as the two are correlated.

    Args:
        calibrated: fit of what was read.
        correlation: of errors of one film over two cards.
        thickness: of the film, relative.
        reflectance: of the film.
    """
    films = calibrated.films
    size = calibrated.expectations
    # Readings that the films should have given without a gain, by the solution and by each draw:
    # what the measured ones differ by is error.
    ungained = calibrated.problem._replace(gain_modes=np.zeros_like(calibrated.problem.gain_modes))
    points = jax.tree.map(
        lambda best, draws: np.concatenate([best[None], draws]),
        calibrated.unknowns,
        calibrated.draws,
    )
    computed = np.moveaxis(np.asarray(readings_of_draws(points, ungained)), 1, -1)
    expected = computed[0]
    # Noise and cards are in the residual's size, and a gain of its own is not.
    all_of_it = np.hypot(calibrated.residual_sd, size.gain * expected)
    # In standard deviations: by the solution, and by each draw of what is unknown.
    off = (films.over_cards - computed) / all_of_it
    # How much of what a reading was off is gain and model, no noise; nothing where none was read.
    reach = np.minimum(_error_size(size, expected) / all_of_it, 1.0) * films.seen[:, :, None]
    log_gloss = calibrated.draws.paints[:, 0] + calibrated.draws.films[:, 0, 1]
    gloss = (np.exp(log_gloss) - calibrated.gloss[0])[:, None, None]
    surface = calibrated.instrument.seen_surface * gloss
    # Of films that were not read.
    rng = np.random.default_rng(1)
    gain = rng.standard_normal((len(gloss), 2, 1))
    model = draw_model_errors(rng, len(gloss), 2, calibrated.wavelengths, SMOOTH)
    new = size.gain * reflectance * gain + size.model_sd(reflectance) * model
    # A film as thick as the one that was read is that film. With thickness a tenth off, as a
    # standard deviation, less and less of the reading's errors goes. How thick one is that hides
    # its ground nobody knows.
    distances = np.abs(np.log(calibrated.thickness / thickness))
    distances = np.where(films.opaque, np.inf, distances)
    film = distances.argmin()
    same = correlation * np.exp(-0.5 * (distances.min() / 0.1) ** 2)
    # Simple kriging (Journel, Huijbregts, Mining Geostatistics, 1978), band by band, from what was
    # read over one card or two.
    reached = reach[film].T  # (bands, 2)
    card_covariance = correlation * reached[:, :, None] * reached[:, None, :]
    card_covariance[:, [0, 1], [0, 1]] = 1.0
    towards = same * reached
    share = np.linalg.solve(card_covariance, towards[:, :, None])[:, :, 0]
    remaining = np.sqrt(np.maximum(1.0 - np.sum(share * towards, axis=1), 0.0))
    kept = np.einsum("bc,dcb->db", share, off[:, film])[:, None]
    kept = kept * _error_size(size, reflectance)
    shift = kept[0]
    return shift, surface + (kept[1:] - shift) + remaining * new


def _error_size(
    expected: Expectations, reflectance: Float[np.ndarray, "*n bands"]
) -> Float[np.ndarray, "*n bands"]:
    """Standard deviation of a reading by its gain and by the model."""
    return np.hypot(expected.gain * reflectance, expected.model_sd(reflectance))


def film_readings(
    response: Response,
    optical: Float[np.ndarray, "2 bands"],
    off: Float[np.ndarray, "draws 2 bands"],
    grounds: Sequence[float | Bands],
) -> DrawnSpectra:
    """Reflectance of the body over two grounds, of films of k d and s d with errors of their
    logs.
    """
    kd, sd = np.split(optical * np.exp(off), 2, axis=1)
    ground = np.stack([np.broadcast_to(each, optical.shape[1]) for each in grounds])
    return np.asarray(response.body(kd, sd, ground))


def calibrate_mixture(
    pigments: Mapping[str, Pigment],
    recipe: Mapping[str, float],
    films: Films,
    *,
    law: MixingLaw | None = None,
    variation: Variation | None = None,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    response: Response | None = None,
    spread: Spread | None = None,
    gauge: Gauge | None = None,
    wavelengths: Bands | None = None,
    progress: Progress = no_progress,
) -> JointRecovery:
    """k and s of one mixture, from its paints and a reading of it: above all how strong it came
    out.

    Thickness, strength, scattering and the reading's gain are open together, each as far as films
    scatter: what one reading cannot separate stays in the errors.

    Args:
        pigments, recipe, law, variation: as for `mix`.
        films: of that one mixture; over one card or two, or opaque.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading, by default estimated from its roughness.
        response: model of one film, by default that of the instrument.
        spread: how far films scatter in thickness and gain, by default what predicts revigo's
            best (`python -m benchmarks.paint.prediction` chooses it again without each film).
        gauge: thicknesses of the films, in metres on the scale of the paints; by default each is
            about `glazefit.recover.joint.joint.UNIT`.
        wavelengths: nm, of the mixture in addition to those of the reading, which may be few:
            filters of a camera, say. By default those of the reading alone.
        progress: see `recover_jointly`.

    Returns:
        A joint recovery whose only paint is the mixture: `pigment` gives its k and s, `thickness`
        that of the films (in units of `glazefit.recover.joint.joint.UNIT`, on the scale of the
        paints), `fitted_black` and `fitted_white` the reading as it is met.

    Raises:
        ValueError: as `mix` and `recover_jointly`.
    """
    noise = noise or estimate_noise(films)
    # At further wavelengths readings are interpolated, and do not count.
    bands = films.wavelengths
    grid = bands if wavelengths is None else np.union1d(bands, wavelengths)
    read = np.isin(grid, bands)
    wider = {
        what: np.stack([np.interp(grid, bands, row) for row in getattr(films, what)])
        for what in SPECTRA
    }
    films = replace(films, wavelengths=grid, **wider)
    mixture = mix(pigments, recipe, wavelengths=grid, law=law, variation=variation)
    spread = spread or Spread()
    recovery = recover_jointly(
        films,
        {film: {mixture.name: 1.0} for film in films.names},
        instrument=instrument,
        noise=noise,
        # Films of known paints: their scale is the films' own.
        expectations=CLOSE._replace(thickness=spread.thickness, gain=spread.gain, scale=0.0),
        use=np.tile(read.astype(float), (len(films), 1)),
        response=response,
        pigments={mixture.name: mixture},
        progress=progress,
        gauge=gauge,
    )
    # What was not read is as it was found to be.
    filled = replace(
        films,
        over_black=np.where(read, films.over_black, recovery.fitted_black),
        over_white=np.where(read, films.over_white, recovery.fitted_white),
    )
    # As if read with an error that has no bounds.
    return replace(recovery, films=filled, residual_sd=np.where(read, recovery.residual_sd, np.inf))


def drawn_mixture(calibrated: JointRecovery) -> Float[np.ndarray, "draws 2 bands"]:
    """Errors of log k and log s of a film as thick as those that were read, or as many times as
    thick.

    A stronger mixture goes with a thinner film: their product is known better than either.
    """
    bands = calibrated.draws.bands - calibrated.unknowns.bands
    depth = calibrated.depth(calibrated.draws.films - calibrated.unknowns.films)
    return np.swapaxes(bands, 1, 2) + depth[:, None, None]


def is_another(calibrated: JointRecovery) -> bool:
    """Return whether a reading took k and s that are off by more than those of 99 of 100 such
    mixtures: it is another paint's, or the recipe is wrong.
    """
    (modes,) = calibrated.known_modes.values()
    errors = calibrated.unknowns.others[list(modes)]
    # Standard normal a priori.
    return bool(errors @ errors > chdtri(errors.size, 0.01))


def _mix(
    pigments: Mapping[str, Pigment],
    recipe: Mapping[str, float],
    wavelengths: Bands | None,
    law: MixingLaw | None,
) -> _MixedPaint:
    """A mixture, called by its recipe.

    The modes of the paints are split into the scale of k and s and their shape, which go together;
    those of the film are others, of size one.
    """
    for paint, weight in recipe.items():
        if paint not in pigments:
            raise ValueError(f"no paint is called {paint!r}; known: {', '.join(pigments)}")
        if not (weight >= 0 and np.isfinite(weight)):
            raise ValueError(f"the weight of {paint} is {weight:g}; it must be 0 or more")
    names = [paint for paint, weight in recipe.items() if weight > 0]
    if not names:
        raise ValueError("the recipe holds no paint with a weight above 0")
    used = [pigments[name] for name in names]
    grid = np.asarray(used[0].wavelengths if wavelengths is None else wavelengths)
    if wavelengths is None:
        shared = lie_between(grid, *common_range(np.asarray(paint.wavelengths) for paint in used))
        # Where none is shared, resampling says so.
        grid = grid[shared] if shared.any() else grid
    paints = [paint.resample(grid) for paint in used]
    shares = (law or MixingLaw()).shares(np.array([[recipe[n] for n in names]]), names)[0]
    contributions = (
        np.stack([[p.absorption, p.scattering] for p in paints]) * shares[:, None, None]
    )  # (paints, 2, bands)
    coefficients = contributions.sum(axis=0)
    # What 1 % more of a paint's k adds to that of the mixture, in per cent.
    elasticity = contributions / np.maximum(coefficients, 1e-300)

    stated = stated_modes(paints, ModelError(), _SHAPES)

    def mixed(
        modes: Float[np.ndarray, "modes paints 2 bands"],
    ) -> Float[np.ndarray, "modes 2 bands"]:
        return np.einsum("mpcb,pcb->mcb", modes, elasticity)

    # Their level over the bands, and what is left of them.
    level = np.broadcast_to(stated.mean(axis=-1, keepdims=True), stated.shape)
    # Films differ from recipes by one coefficient of one paint at a time.
    varied = MIXED.coefficient * smooth_modes(grid, MIXED.coefficient_length, _SHAPES)
    varied = np.concatenate([varied, np.full((1, grid.size), MIXED.level)])
    each = np.einsum("sb,pcb,cd->pcsdb", varied, elasticity, np.eye(2))
    components = (f"{100 * share:.3g} {paint}" for share, paint in zip(shares, names, strict=True))
    return _MixedPaint(
        name=" + ".join(components),
        wavelengths=grid,
        coefficients=coefficients,
        modes={
            "scale": mixed(level),
            "paint": mixed(stated - level),
            "film": each.reshape(-1, 2, grid.size),
        },
    )
