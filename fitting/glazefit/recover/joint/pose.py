"""A joint problem from films and recipes, from paints that are known already, and from thicknesses
by a gauge.

A known paint keeps its k and s, as far as they are known: its error modes become unknowns of the
fit, each expected to be nought with a standard deviation of one. So does the level of a card that
was not measured, and a factor that all thicknesses share: the scale of a known paint may rest on an
assumed length, and a gauge has an error of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from glazejax import Pigment
from glazejax.spectra import Bands, describe_grid

from ...film.films import Films, Instrument, Noise, card_readings
from ...film.gloss import GLOSS_SD, estimate_gloss
from ...film.model.errors import ModelError, stated_modes
from ...film.model.response import Response, film_response
from ..films.result import PerFilm
from .problem import Expectations, FilmShares, JointProblem, Unknowns, model_deviation

MOST_ERROR = 0.5
"""Largest standard deviation of log k or log s that error modes state: errors are propagated by
first derivatives, which do not hold for larger ones."""
ModeNumbers: TypeAlias = Mapping[int, int]
"""Numbers of a known paint's error modes: among the fit's others, and among its own."""


@dataclass(frozen=True)
class Gauge:
    """Thicknesses that were measured or set: a wet-film gauge, or the gap of a drawdown bar.

    Attributes:
        thickness: film -> m; films that are not named are as thick as these, more or less.
        error: standard deviation of the log of one film's thickness.
        common: of a factor that all of them share: the gauge's scale, and what the paint loses as
            it dries.

    Raises:
        ValueError: no film, or a number out of range.
    """

    thickness: Mapping[str, float]
    error: float = 0.1
    common: float = 0.1

    def __post_init__(self) -> None:
        if not self.thickness:
            raise ValueError("a gauge needs the thickness of one film at least")
        for film, value in self.thickness.items():
            if not 0 < value <= 0.01:
                raise ValueError(
                    f"the thickness of {film!r} is {value:g} m; it must be above 0 and at most "
                    "0.01 m"
                )
        for name in ("error", "common"):
            if not 0 < getattr(self, name) <= 2:
                raise ValueError(
                    f"the gauge's {name} is {getattr(self, name):g}; it must be above 0 and at "
                    "most 2"
                )

    @property
    def typical(self) -> float:
        """Geometric mean, m."""
        return float(np.exp(np.mean(np.log(list(self.thickness.values())))))


def pose(
    films: Films,
    paints: Sequence[str],
    shares: FilmShares,
    *,
    response: Response | None,
    instrument: Instrument,
    noise: Noise,
    expected: Expectations,
    references: Mapping[str, Pigment],
    gauge: Gauge | None,
    gloss: Mapping[str, float],
    unit: float,
    used: Bool[np.ndarray, "films"],
) -> tuple[JointProblem, dict[str, ModeNumbers]]:
    """Arrays of a joint problem, and where each known paint has its error modes.

    Args:
        films: measured.
        paints: of all films.
        shares: of each paint in each film.
        response: model of a film, by default that of the instrument.
        instrument: that read the films.
        noise: of a reading.
        expected: the prior.
        references: paints that are known, by name; those that no film holds do not matter.
        gauge: thicknesses.
        gloss: film -> gloss that was measured, of some films.
        unit: thickness of a film of unit relative thickness, m.
        used: whether a film counts; of paints the readings of the others say nothing.

    Raises:
        ValueError: a known paint does not cover the films' wavelengths, or the gauge names a film
            that there is not.
    """
    grid = films.wavelengths
    count = len(paints)
    known = {
        column: _on(references[name], grid)
        for column, name in enumerate(paints)
        if name in references
    }
    # Errors of known paints, and those of cards, of the common scale and of gains, are unknowns of
    # the fit.
    band_modes, mode_numbers = _paint_modes(known, grid.size, count)
    film_mean, thickness_sd, factor = _thicknesses(
        films, gauge, unit, expected.thickness, expected.scale if known else 0.0
    )
    # A black and a white card that were not measured have one level each, for all films: of
    # log(rho / (1 - rho)), the same at all bands.
    cards = films.assumed & films.seen & ~films.opaque[:, None]
    # The log of its gain is each reading's own.
    gains = expected.gain * np.eye(films.seen.size).reshape(-1, *films.seen.shape)
    modes = {
        "band_modes": band_modes,
        "ground_modes": (0.5 * np.eye(2)[:, None] * cards)[cards.any(axis=0)],
        "thickness_modes": factor,
        "gain_modes": gains[films.seen.ravel() & (expected.gain > 0)],
    }
    first = 0
    count_of_others = sum(map(len, modes.values()))
    # Each group where it stands among the others.
    for name, group in modes.items():
        modes[name] = np.zeros((count_of_others, *group.shape[1:]))
        modes[name][first : first + len(group)] = group
        first += len(group)

    card_data = card_readings(films, instrument, noise)
    measured = card_data.reflectance
    deviation = model_deviation(measured, noise, expected, card_data.ground_sd)
    # Expected errors of each film's thickness, gloss and weights.
    minor = minor_parts(shares)
    # A paint's own weight error: a share of it, and what the balance leaves open.
    minor_share = np.einsum("fep,fp->fe", minor, shares)
    errors = np.hypot(
        expected.weight_share, expected.weight_floor / np.where(minor_share > 0, minor_share, 1.0)
    )
    log_gloss = np.log([gloss.get(name, np.nan) for name in films.names])
    gloss_sd = np.where(np.isnan(log_gloss), expected.gloss, GLOSS_SD)
    film_scale = np.column_stack([thickness_sd, gloss_sd, errors])
    # Of log k of all paints, then of log s, at each band.
    means, sds = np.transpose([expected.level_k, expected.level_s])
    level = np.tile(np.repeat(means, count), (grid.size, 1))
    # A sum over the bands of pulls of sd * sqrt(bands) each is a pull of the mean by sd.
    level_sd = np.sqrt(grid.size) * np.tile(np.repeat(sds, count), (grid.size, 1))
    stiffness = np.repeat([1.0 / expected.curvature_k, 1.0 / expected.curvature_s], count)
    black_at = nearly_black(
        np.moveaxis(measured, -1, 1),
        np.where(used[:, None], shares, 0.0),
        instrument.seen_surface,
    )
    step = expected.slope_s * np.sqrt(np.diff(grid) / 10.0)
    steepness = np.tile((black_at[1:] & black_at[:-1]) / step[:, None], 2)
    steepness = steepness * np.repeat([0.0, 1.0], count)
    # Known paints keep their k and s: only what their modes leave out is free, band by band.
    for column, paint in known.items():
        optical = unit * np.column_stack([paint.absorption, paint.scattering])
        level[:, column::count] = np.log(np.maximum(optical, 1e-7))
        level_sd[:, column::count] = 0.01
        stiffness[column::count] = 0.0
        steepness[:, column::count] = 0.0
    # The gloss that the films in which a paint is the largest part demand.
    demanded = np.log(estimate_gloss(films, instrument, noise))
    paint_mean = np.zeros(count)
    np.minimum.at(paint_mean, shares.argmax(axis=1)[used], demanded[used])
    # Bands first, where arrays have them.
    problem = JointProblem(
        response=response or film_response(instrument),
        reading=np.moveaxis(measured, 1, 0),
        ground=np.moveaxis(card_data.ground, 1, 0),
        weight=np.moveaxis(1.0 / deviation, 1, 0),
        shares=shares,
        minor=minor,
        surface=np.array(instrument.seen_surface),
        curvature=curvature_matrix(grid),
        stiffness=stiffness,
        steepness=steepness,
        mean=Unknowns(
            bands=level,
            films=np.zeros_like(film_scale),
            paints=paint_mean,
            others=np.zeros(count_of_others),
        ),
        scale=Unknowns(
            bands=level_sd,
            films=film_scale,
            paints=np.full(count, expected.paint_gloss),
            others=np.ones(count_of_others),
        ),
        film_mean=film_mean,
        tail=np.array(expected.tail),
        opaque=films.opaque,
        gloss=log_gloss,
        **modes,
    )
    return problem, mode_numbers


def _on(paint: Pigment, grid: Bands) -> Pigment:
    try:
        return paint.resample(grid)
    except ValueError:
        raise ValueError(
            f"{paint.name!r} is known at {describe_grid(paint.wavelengths)}, which does not cover "
            f"the films' {describe_grid(grid)}: crop the films"
        ) from None


def _paint_modes(
    references: Mapping[int, Pigment], bands: int, paints: int
) -> tuple[Float[np.ndarray, "modes bands local"], dict[str, ModeNumbers]]:
    """Modes of known paints, by column, and the numbers of each; those of one provenance share
    theirs.

    Modes that are nought for all of them, such as those of other paints of their file, are left
    out.
    """
    # Paints of one provenance, with as many modes, err together.
    groups: dict[object, dict[int, Pigment]] = {}
    for column, paint in references.items():
        stated_modes = paint.error_modes
        source = column if stated_modes is None else (paint.provenance, len(stated_modes))
        groups.setdefault(source, {})[column] = paint
    blocks = [np.zeros((0, bands, 2 * paints))]
    mode_numbers: dict[str, ModeNumbers] = {}
    first = 0
    for group in groups.values():
        modes = np.stack([error_modes(paint) for paint in group.values()], axis=-1)
        nonzero = np.flatnonzero(modes.any(axis=(1, 2, 3)))
        block = np.zeros((nonzero.size, bands, 2, paints))
        block[..., list(group)] = np.swapaxes(modes[nonzero], 1, 2)
        blocks.append(block.reshape(nonzero.size, bands, 2 * paints))
        numbers = dict(enumerate(nonzero.tolist(), first))
        mode_numbers |= {paint.name: numbers for paint in group.values()}
        first += nonzero.size
    return np.concatenate(blocks), mode_numbers


def error_modes(paint: Pigment) -> Float[np.ndarray, "modes 2 bands"]:
    """Error modes of a paint: its own, or smooth errors of the size that its standard deviations
    say.
    """
    if paint.error_modes is not None:
        return np.asarray(paint.error_modes, dtype=np.float64)
    # A paint that says nothing of its errors is known to a tenth.
    return stated_modes([paint], ModelError(most=MOST_ERROR, unstated=0.1))[:, 0]


def _thicknesses(
    films: Films, gauge: Gauge | None, unit: float, spread: float, common: float
) -> tuple[PerFilm, PerFilm, Float[np.ndarray, "modes films"]]:
    """Log of each film's expected relative thickness, its standard deviation, and the factor that
    they share.
    """
    count = len(films)
    mean = np.zeros(count)
    sd = np.full(count, spread)
    if gauge is not None:
        for film in gauge.thickness:
            if film not in films.names:
                raise ValueError(f"no film is called {film!r}, whose thickness was given")
        gauged = np.isin(films.names, list(gauge.thickness))
        mean = np.log([gauge.thickness.get(name, gauge.typical) / unit for name in films.names])
        sd = np.where(gauged, gauge.error, spread)
        common = max(common, gauge.common)
    # No factor where nothing is common.
    return mean, sd, np.full((int(common > 0), count), common)


def curvature_matrix(wavelengths: Bands) -> Float[np.ndarray, "inner bands"]:
    """Second divided differences times (10 nm)^2, each weighted by the root of its share of 10 nm.

    So the sum of squares is the same integral over the wavelengths on any grid.
    """
    slopes = np.diff(np.eye(len(wavelengths)), axis=0) / np.diff(wavelengths)[:, None]
    spans = wavelengths[2:] - wavelengths[:-2]
    return np.diff(slopes, axis=0) * (200.0 / spans * np.sqrt(spans / 20.0))[:, None]


def nearly_black(
    readings: Float[np.ndarray, "films cards bands"],
    shares: FilmShares,
    surface: float,
) -> Bool[np.ndarray, "bands paints"]:
    """True where the films with most of a paint, if it is the larger part, reflect hardly more than
    their surface does.
    """
    body = np.max(readings, axis=1, initial=0.0) - surface
    most = shares.max(axis=0)
    purest = (shares == most)[..., None]
    brightest = np.where(purest, body[:, None], -np.inf).max(axis=0)
    return (brightest.T < 0.03) & (most > 0.5)


def minor_parts(shares: FilmShares) -> Float[np.ndarray, "films parts paints"]:
    """Assign each error of weight to its paint: all parts of a film but the largest, on as many
    places as needed.
    """
    present = shares > 0
    order = np.argsort(-shares, axis=1)[:, 1 : int(present.sum(axis=1).max())]
    return np.eye(shares.shape[1])[order] * np.take_along_axis(present, order, axis=1)[..., None]
