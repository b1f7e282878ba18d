"""The posterior of a film of one coat or several: thickness and fractions of each, gloss, how wrong
the paints' k and s are, and k and s of one unknown paint.

A coat's k and s are its paints' sums, weighted by fraction, times its thickness. Fractions are
Dirichlet beforehand, thickness log-normal, gloss uniform in [0, 1]. A coat of unknown paint has log
k d and log s d instead, sums of the modes of `glazefit.posterior.spectra`. A single coat is read by
its table, several by the solver (`glazefit.posterior.forward`).

A catalogue never fits to the noise. Its error is a relative one: log k and log s of each coat of
known paints are each off by a smooth random function of wavelength, delta, Gaussian with a
Matérn-3/2 correlation, K = (1 + x) exp(-x) with x = sqrt(3)|l - l'| / length, which forgives
sharper errors than a smoother law. Their standard deviation is itself unknown: the model error e,
log-normal beforehand.

The errors, two a band and coat, are integrated out. About their likeliest values delta* readings
are linear in them, f(coats, delta) = f(coats, delta*) + J (delta - delta*), so that a film's
readings are Gaussian with

    mean f(coats, delta*) - J delta*,     covariance C = diag(v) + e^2 J K J^T

and variances v by noise and grounds. With W that makes diag(v) unity and J K J^T diagonal, b, the
residuals are W (reading - mean) / sqrt(1 + e^2 b) and the determinant is that of 1 + e^2 b:
sampling needs no factorisation.
`glazefit.posterior.film_errors` finds delta* and J.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax import Pigment

from ..film.films import Instrument
from ..film.model.errors import Prior
from ..film.model.optics import Optics
from ..film.model.response import FilmResponse, film_response
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from . import forward, stack_table
from .bands import reading_parts
from .coats import CoatPrior
from .layout import (
    Layout,
    log_fractions,
    name_unknowns,
    prior_covariance,
    prior_draws,
    prior_moments,
)
from .problem import Problem, fingerprint, uniform_residual
from .spectra import SpectraPrior


class FilmData(NamedTuple):
    """One film of coats; rows are its readings, band after band and ground after ground."""

    # k and s times the median thickness of the paint's coat
    absorption: Float[Array, "*blocks bands paints"]
    scattering: Float[Array, "*blocks bands paints"]
    shares: Float[Array, "*blocks paints"]  # fractions; of no meaning where they are unknown
    reading: Float[Array, "*blocks bands grounds"]
    ground: Float[Array, "*blocks bands grounds"]
    shift: Float[Array, "*blocks errors bands"]  # delta*, of log k and log s of each coat in turn
    offset: Float[Array, "*blocks bands grounds"]  # -J delta*
    whiten: Float[Array, "*blocks rows rows"]  # W
    spread: Float[Array, "*blocks rows"]  # roots of b
    # Of the unknown coat, where nothing else is unknown of any coat (see `stack_table`).
    table: stack_table.StackTable | None = None


class FilmShared(NamedTuple):
    """What all films have in common."""

    response: FilmResponse | None  # of a single coat
    surface: Float[Array, ""]
    mean: Float[Array, "dims"]  # of the unknowns beforehand
    sd: Float[Array, "dims"]
    levels: Float[Array, "2"]  # means of log k d and log s d of an unknown paint
    modes: tuple[Float[Array, "bands modes"], Float[Array, "bands others"]]


def optical(
    layout: Layout, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
) -> Float[Array, "2 bands coats"]:
    """Optical thicknesses k d and s d of all coats, top first, without errors of the paints."""
    places = layout.places
    coats = []
    for n, members in enumerate(layout.paints):
        if layout.sizes[n] == 0:
            logs = [
                m + modes @ free[at]
                for m, modes, at in zip(shared.levels, shared.modes, places.spectra, strict=True)
            ]
            coats.append(jnp.exp(jnp.stack(logs)))
            continue
        amounts = data.shares[members]
        if layout.fractions[n]:
            amounts = jnp.exp(log_fractions(free[places.ratios[n]]))
        # Of no unknown the sum is 0.
        amounts = amounts * jnp.exp(jnp.sum(free[places.thickness[n]]))
        coats.append(
            jnp.stack(
                [data.absorption[:, members] @ amounts, data.scattering[:, members] @ amounts]
            )
        )
    return jnp.stack(coats, axis=-1)


def surface(layout: Layout, free: Float[Array, "dims"], shared: FilmShared) -> Float[Array, ""]:
    """What the surface adds to a reading."""
    return shared.surface * jnp.prod(jax.nn.sigmoid(free[layout.places.gloss]))


def _readings(
    layout: Layout,
    free: Float[Array, "dims"],
    data: FilmData,
    shared: FilmShared,
    errors: Float[Array, "2 #bands #coats"],
) -> Float[Array, "bands grounds"]:
    """What the instrument reads where log k and log s of the coats are off by these errors."""
    coats = optical(layout, free, data, shared) * jnp.exp(errors)
    body = forward.body(layout, shared.response, coats[:, :, None], data.ground)
    return surface(layout, free, shared) + body


@dataclass(frozen=True)
class ErrorFreeReadings:
    """What the instrument would read if the known paints had no error."""

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
    ) -> Float[Array, "bands grounds"]:
        """Of one film."""
        return _readings(self.layout, free, data, shared, jnp.zeros((2, 1, 1)))


@dataclass(frozen=True)
class FilmResiduals:
    """Misfit, log-determinant and prior of one film."""

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
    ) -> Float[Array, "rows"]:
        """Of one film."""
        layout = self.layout
        places = layout.places
        size = jnp.exp(free[-1])
        if data.table is None:
            errors = jnp.moveaxis(data.shift.reshape(len(layout.sizes), 2, -1), 0, -1)
            mean = _readings(layout, free, data, shared, errors) + data.offset
            root = size * data.spread
            misfit = data.whiten @ (data.reading - mean).reshape(-1) / jnp.sqrt(1.0 + root**2)
            parts = [misfit, root_of_log1p(root)]
        else:
            coats = optical(layout, free, data, shared)
            seen = stack_table.look_up(data.table, coats[..., layout.unknown_coat])
            off = data.reading - surface(layout, free, shared) - seen.body
            parts = [stack_table.misfit(data.table, off, seen, size)]
        # Dirichlet's density in the log-ratios is the product of the fractions to their
        # concentrations.
        parts += [
            jnp.sqrt(-2.0 * layout.concentration * log_fractions(free[at]))
            for at, sought in zip(places.ratios, layout.fractions, strict=True)
            if sought
        ]
        parts.append(uniform_residual(free[places.gloss]))
        normal = layout.normal
        parts.append((free[normal] - shared.mean[normal]) / shared.sd[normal])
        return jnp.concatenate(parts)


@dataclass(frozen=True)
class ScaledReadings:
    """Misfits of one film whose only open coat is tabulated, each over its own standard deviation.

    That the known coats' errors are alike in neighbouring bands is left out, and with it a
    covariance: as a measure of distance this is as good, and its slopes cost a twentieth.
    """

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
    ) -> Float[Array, "rows"]:
        """Of one film."""
        logs = self._logs(free, data, shared)
        return self._at(logs, free, data, shared).reshape(-1)

    def slopes(
        self, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
    ) -> Float[Array, "rows dims"]:
        """By the unknowns: a band's readings hang on its own k d and s d, and these on the modes.

        So two slopes of all bands at once are enough, and one for gloss and error each.
        """
        logs = self._logs(free, data, shared)

        def along(logs_off: Array, free_off: Array) -> Array:
            def read(logs: Array, free: Array) -> Array:
                return self._at(logs, free, data, shared)

            return jax.jvp(read, (logs, free), (logs_off, free_off))[1]

        each_log = jnp.eye(2)[:, :, None] * jnp.ones_like(logs)
        others = jnp.eye(len(free))[sum(self.layout.modes) :]
        by_log = jax.vmap(along, (0, None))(each_log, jnp.zeros_like(free))
        by_other = jax.vmap(along, (None, 0))(jnp.zeros_like(logs), others)
        rows = by_log[0].size
        by_modes = [
            (slope[..., None] * modes[:, None, :]).reshape(rows, -1)
            for slope, modes in zip(by_log, shared.modes, strict=True)
        ]
        return jnp.concatenate([*by_modes, by_other.reshape(len(others), rows).T], axis=1)

    def _logs(
        self, free: Float[Array, "dims"], data: FilmData, shared: FilmShared
    ) -> Float[Array, "2 bands"]:
        """Log k d and log s d of the unknown coat."""
        return jnp.log(optical(self.layout, free, data, shared)[..., self.layout.unknown_coat])

    def _at(
        self,
        logs: Float[Array, "2 bands"],
        free: Float[Array, "dims"],
        data: FilmData,
        shared: FilmShared,
    ) -> Float[Array, "bands grounds"]:
        """From log k d and log s d of the unknown coat; of the unknowns gloss and error count."""
        assert data.table is not None
        seen = stack_table.look_up(data.table, jnp.exp(logs))
        off = data.reading - surface(self.layout, free, shared) - seen.body
        return off / stack_table.standard_deviation(data.table, seen, jnp.exp(free[-1]))


def pose_films(
    films: Sequence[Reading],
    paints: Sequence[Sequence[Pigment]],
    instrument: Instrument,
    prior: Prior,
) -> Problem:
    """Problem of one film of a single coat of known paints or of several with as many paints each,
    without the paints' error yet.

    Raises:
        ValueError: no paint, paints of which there is no coat (see `CoatPrior`), or that do not
            cover the film's wavelengths.
    """
    for film, chosen in zip(films, paints, strict=True):
        if not chosen:
            raise ValueError(f"0 paints were given for {film.name!r}; name one at least")
    coats = [[CoatPrior(chosen)] for chosen in paints]
    return pose_stack(films, coats, instrument, prior, SpectraPrior(), kind="paints")


def pose_stack(
    films: Sequence[Reading],
    coats: Sequence[Sequence[CoatPrior]],
    instrument: Instrument,
    prior: Prior,
    spectra: SpectraPrior,
    *,
    kind: str = "stack",
) -> Problem:
    """Problem of one film of coats, or of several of the same layout, without the paints' error
    yet.

    Args:
        films: on the same wavelengths and over as many grounds each.
        coats: of each film, top first (see `glazefit.posterior.coats.check_coats`); what is unknown
            is the same for all, and what is expected of unknown thicknesses.
        instrument: that read them.
        prior: usual thickness, its spread, fractions' concentration and the paints' error.
        spectra: of an unknown paint.
        kind: of the problem; names of "paints" do not say which coat they are of.

    Raises:
        ValueError: paints that do not cover the films' wavelengths, or unknown thicknesses that are
            expected to differ.
    """
    grid = films[0].wavelengths
    stacks = [[coat.on(grid) for coat in stack] for stack in coats]
    first = stacks[0]
    any_unknown = any(coat.unknown for coat in first)
    modes = (
        spectra.modes(grid) if any_unknown else (np.zeros((grid.size, 0)), np.zeros((grid.size, 0)))
    )
    layout = Layout(
        sizes=tuple(len(coat.paints) for coat in first),
        fractions=tuple(coat.open_fractions for coat in first),
        thickness=tuple(coat.open_thickness for coat in first),
        modes=(modes[0].shape[1], modes[1].shape[1]),
        gloss=instrument.seen_surface > 0,
        concentration=prior.concentration_known,
        optics=Optics.of(instrument),
    )
    # What is expected of each coat's thickness; side by side, films must expect the same.
    median = np.array(
        [
            [prior.thickness if c.thickness is None else c.thickness for c in stack]
            for stack in stacks
        ]
    )
    spread = np.array([[c.spread or prior.spread for c in stack] for stack in stacks])
    apart = layout.thickness & np.any((median != median[0]) | (spread != spread[0]), axis=0)
    if apart.any():
        raise ValueError(
            f"coat {int(apart.argmax()) + 1} is expected to be of other thickness in one film "
            "than in another; films that are sampled side by side must be expected alike"
        )
    count = len(films)
    bands, grounds = films[0].reflectance.shape
    rows = bands * grounds
    # k and s of all paints of a film, (films, paints, 2, bands).
    coefficients = np.array(
        [[[p.absorption, p.scattering] for coat in stack for p in coat.paints] for stack in stacks],
        float,
    ).reshape(count, -1, 2, bands)
    depth = coefficients * np.repeat(median, layout.sizes, axis=1)[..., None, None]
    absorption, scattering = jnp.asarray(np.moveaxis(depth, (2, 1), (0, -1)))

    def stack_films(what: str) -> Array:
        return jnp.asarray(np.stack([getattr(film, what) for film in films]))

    # What is each film's own, ...
    data = FilmData(
        absorption=absorption,
        scattering=scattering,
        shares=jnp.asarray(
            [[share for coat in stack for share in coat.shares] for stack in stacks], float
        ).reshape(count, -1),
        reading=stack_films("reflectance"),
        ground=stack_films("ground"),
        shift=jnp.zeros((count, 2 * len(first), bands)),
        offset=jnp.zeros((count, bands, grounds)),
        whiten=jnp.asarray(np.stack([np.eye(rows) / film.sd.ravel() for film in films])),
        spread=jnp.zeros((count, rows)),
    )
    # ... and what all share.
    mean, sd = prior_moments(layout, spread[0], prior)
    levels = np.log([spectra.absorption, spectra.scattering])
    shared = FilmShared(
        response=film_response(instrument) if len(first) == 1 else None,
        surface=jnp.asarray(float(instrument.seen_surface)),
        mean=jnp.asarray(mean),
        sd=jnp.asarray(sd),
        levels=jnp.asarray(levels),
        modes=(jnp.asarray(modes[0]), jnp.asarray(modes[1])),
    )
    unknowns, quantities = name_unknowns(
        layout,
        # Paints of several films side by side differ.
        paints=[
            [p.name for p in coat.paints] if count == 1 else range(1, len(coat.paints) + 1)
            for coat in first
        ],
        suffixes=["" if kind == "paints" else f" of coat {n + 1}" for n in range(len(first))],
        median=median[0],
        grid=grid,
        levels=levels,
        modes=modes,
    )
    # The fingerprint holds all numbers that the posterior rests on.
    parts = [part for film in films for part in reading_parts(film)]
    known = repr([[(c.thickness, c.spread, c.fractions) for c in stack] for stack in coats])
    return Problem(
        kind=kind,
        blocks=tuple(film.name for film in films),
        unknowns=unknowns,
        residuals=FilmResiduals(layout),
        fitted=ErrorFreeReadings(layout),
        prior_rows=layout.prior_rows,
        data=data,
        shared=shared,
        quantities=quantities,
        prior_draws=functools.partial(prior_draws, layout=layout, mean=mean, sd=sd),
        prior_covariance=prior_covariance(layout, sd),
        # A band of a stack costs some ten times that of a tabulated film.
        bands=grid.size * (1 if len(first) == 1 else 10),
        fingerprint=fingerprint(kind, *parts, coefficients, known, prior, spectra, instrument),
    )
