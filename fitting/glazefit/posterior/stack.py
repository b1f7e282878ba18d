"""The posterior of a film of several coats: thickness and fractions of each, and k and s of one
unknown paint.

Every reading comes from the solver itself (`glazejax.stack_hemispherical_reflectance` or
`stack_reflectance_factor`), and its slopes from the solver's own. The rest is as for one film
(`glazefit.posterior.film`): a coat's k and s are its paints' sums, weighted by fraction, times its
thickness; log k and log s of each coat of known paints are off by smooth random functions of
wavelength, all of one unknown size, and these are integrated out about the likeliest.

A coat of unknown paint has log k d and log s d instead, sums of the modes of
`glazefit.posterior.spectra`.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.films import Instrument
from ..film.model.errors import Prior
from ..film.model.optics import Optics
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from . import stack_table
from .bands import reading_parts
from .coats import CoatPrior
from .film import log_fractions
from .layout import Layout, prior_covariance, prior_draws, quantities, unknowns
from .problem import Problem, fingerprint, uniform_residual
from .spectra import SpectraPrior

TOLERANCE = 1e-4
"""Error of the solver in a reading, well below any instrument's."""

# A band of a stack costs some ten times that of a tabulated film.
_COST = 10


class StackData(NamedTuple):
    """One film of coats."""

    absorption: Float[
        Array, "*blocks bands paints"
    ]  # k times the median thickness of the paint's coat
    scattering: Float[Array, "*blocks bands paints"]
    shares: Float[Array, "*blocks paints"]  # fractions; of no meaning where they are unknown
    thickness_spread: Float[Array, "*blocks coats"]  # standard deviations of log thickness
    reading: Float[Array, "*blocks bands grounds"]
    ground: Float[Array, "*blocks bands grounds"]
    shift: Float[
        Array, "*blocks errors bands"
    ]  # likeliest errors of log k and log s of each coat in turn
    offset: Float[Array, "*blocks bands grounds"]
    whiten: Float[Array, "*blocks rows rows"]
    spread: Float[Array, "*blocks rows"]  # roots of b
    # Of the unknown coat, where nothing else is unknown of any coat (see `stack_table`).
    table: stack_table.StackTable | None = None


class StackShared(NamedTuple):
    """What all films have in common."""

    surface: Float[Array, ""]
    log_error: Float[Array, ""]
    error_spread: Float[Array, ""]
    means: Float[Array, "2"]  # of log k d and log s d of an unknown paint
    modes: tuple[Float[Array, "bands modes"], Float[Array, "bands others"]]


def optical(
    layout: Layout, free: Float[Array, "dims"], data: StackData, shared: StackShared
) -> Float[Array, "2 bands coats"]:
    """Optical thicknesses k d and s d of all coats, top first, without errors of the paints."""
    places = layout.places
    coats = []
    for n, members in enumerate(layout.paints):
        if layout.sizes[n] == 0:
            logs = [
                m + modes @ free[at]
                for m, modes, at in zip(shared.means, shared.modes, places.spectra, strict=True)
            ]
            coats.append(jnp.exp(jnp.stack(logs)))
            continue
        amounts = data.shares[members]
        if layout.fractions[n]:
            amounts = jnp.exp(log_fractions(free[places.ratios[n]], layout.sizes[n]))
        if (at := places.thickness[n]) is not None:
            amounts = amounts * jnp.exp(free[at])
        coats.append(
            jnp.stack(
                [data.absorption[:, members] @ amounts, data.scattering[:, members] @ amounts]
            )
        )
    return jnp.stack(coats, axis=-1)


def surface(layout: Layout, free: Float[Array, "dims"], shared: StackShared) -> Float[Array, ""]:
    """What the surface adds to a reading."""
    at = layout.places.gloss
    return shared.surface if at is None else shared.surface * jax.nn.sigmoid(free[at])


def body(
    layout: Layout, thickness: Float[Array, "2 bands coats"], ground: Float[Array, "bands grounds"]
) -> Float[Array, "bands grounds"]:
    """What the coats read over the grounds, by the solver, without the surface's part."""
    k, s = thickness[:, :, None, :]
    return layout.optics.body(k, s, ground, TOLERANCE)


@dataclass(frozen=True)
class ErrorFreeReadings:
    """What the instrument would read if the known paints had no error."""

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: StackData, shared: StackShared
    ) -> Float[Array, "bands grounds"]:
        """Of one film."""
        coats = optical(self.layout, free, data, shared)
        return surface(self.layout, free, shared) + body(self.layout, coats, data.ground)


@dataclass(frozen=True)
class StackResiduals:
    """Misfit, log-determinant and prior of one film; see `glazefit.posterior.film`."""

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: StackData, shared: StackShared
    ) -> Float[Array, "rows"]:
        """Of one film."""
        layout = self.layout
        places = self.layout.places
        coats = optical(layout, free, data, shared)
        above = surface(layout, free, shared)
        size = jnp.exp(free[places.error])
        if data.table is None:
            off = jnp.moveaxis(data.shift.reshape(len(layout.sizes), 2, -1), 0, -1)
            mean = above + body(layout, coats * jnp.exp(off), data.ground) + data.offset
            root = size * data.spread
            misfit = data.whiten @ (data.reading - mean).reshape(-1) / jnp.sqrt(1.0 + root**2)
            parts = [misfit, root_of_log1p(root)]
        else:
            seen = stack_table.look_up(data.table, coats[..., layout.unknown_coat])
            off = data.reading - above - seen.body
            parts = [stack_table.misfit(data.table, off, seen, size)]
        for n, sought in enumerate(layout.fractions):
            if sought:
                parts.append(
                    jnp.sqrt(
                        -2.0
                        * layout.concentration
                        * log_fractions(free[places.ratios[n]], layout.sizes[n])
                    )
                )
            if (at := places.thickness[n]) is not None:
                parts.append(free[at : at + 1] / data.thickness_spread[n])
        parts += [free[at] for at in places.spectra]
        if places.gloss is not None:
            parts.append(uniform_residual(free[places.gloss : places.gloss + 1]))
        parts.append((free[places.error :] - shared.log_error) / shared.error_spread)
        return jnp.concatenate(parts)


@dataclass(frozen=True)
class ScaledReadings:
    """Misfits of one film whose only open coat is tabulated, each over its own standard deviation.

    That the known coats' errors are alike in neighbouring bands is left out, and with it a
    covariance: as a measure of distance this is as good, and its slopes cost a twentieth.
    """

    layout: Layout

    def __call__(
        self, free: Float[Array, "dims"], data: StackData, shared: StackShared
    ) -> Float[Array, "rows"]:
        """Of one film."""
        logs = self._logs(free, data, shared)
        return self._at(logs, free, data, shared).reshape(-1)

    def slopes(
        self, free: Float[Array, "dims"], data: StackData, shared: StackShared
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
        self, free: Float[Array, "dims"], data: StackData, shared: StackShared
    ) -> Float[Array, "2 bands"]:
        """Log k d and log s d of the unknown coat."""
        return jnp.log(optical(self.layout, free, data, shared)[..., self.layout.unknown_coat])

    def _at(
        self,
        logs: Float[Array, "2 bands"],
        free: Float[Array, "dims"],
        data: StackData,
        shared: StackShared,
    ) -> Float[Array, "bands grounds"]:
        """From log k d and log s d of the unknown coat; of the unknowns gloss and error count."""
        assert data.table is not None
        seen = stack_table.look_up(data.table, jnp.exp(logs))
        off = data.reading - surface(self.layout, free, shared) - seen.body
        size = jnp.exp(free[self.layout.places.error])
        return off / stack_table.standard_deviation(data.table, seen, size)


def pose_stack(
    films: Sequence[Reading],
    coats: Sequence[Sequence[CoatPrior]],
    instrument: Instrument,
    prior: Prior,
    spectra: SpectraPrior,
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
    count, (bands, grounds), rows = (
        len(films),
        films[0].reflectance.shape,
        films[0].reflectance.size,
    )

    def gather(what: str) -> Array:
        each = [
            [
                np.asarray(getattr(p, what)) * d
                for coat, d in zip(stack, thick, strict=True)
                for p in coat.paints
            ]
            for stack, thick in zip(stacks, median, strict=True)
        ]
        return jnp.asarray(np.moveaxis(np.asarray(each, float).reshape(count, -1, bands), 1, 2))

    def stack_films(what: str) -> Array:
        return jnp.asarray(np.stack([getattr(film, what) for film in films]))

    # What is each film's own, ...
    data = StackData(
        absorption=gather("absorption"),
        scattering=gather("scattering"),
        shares=jnp.asarray(
            np.stack(
                [np.concatenate([np.empty(0), *(c.shares for c in stack)]) for stack in stacks]
            )
        ),
        thickness_spread=jnp.asarray(spread),
        reading=stack_films("reflectance"),
        ground=stack_films("ground"),
        shift=jnp.zeros((count, 2 * len(first), bands)),
        offset=jnp.zeros((count, bands, grounds)),
        whiten=jnp.asarray(np.stack([np.eye(rows) / film.sd.ravel() for film in films])),
        spread=jnp.zeros((count, rows)),
    )
    # ... and what all share.
    shared = StackShared(
        *(
            jnp.asarray(float(v))
            for v in (instrument.seen_surface, np.log(prior.error), prior.error_spread)
        ),
        means=jnp.log(jnp.asarray([spectra.absorption, spectra.scattering])),
        modes=(jnp.asarray(modes[0]), jnp.asarray(modes[1])),
    )
    # The fingerprint holds all numbers that the posterior rests on.
    paints = [
        np.asarray(getattr(p, w))
        for s in stacks
        for c in s
        for p in c.paints
        for w in ("absorption", "scattering")
    ]
    parts = [part for film in films for part in reading_parts(film)]
    known = repr([[(c.thickness, c.spread, c.fractions) for c in stack] for stack in coats])
    named = first if count == 1 else None
    return Problem(
        kind="stack",
        blocks=tuple(film.name for film in films),
        unknowns=unknowns(layout, named),
        residuals=StackResiduals(layout),
        fitted=ErrorFreeReadings(layout),
        prior_rows=layout.prior_rows,
        data=data,
        shared=shared,
        quantities=quantities(layout, named, median[0], grid, np.asarray(shared.means), modes),
        prior_draws=functools.partial(prior_draws, layout=layout, spread=spread[0], prior=prior),
        prior_covariance=prior_covariance(layout, spread[0], prior),
        bands=grid.size * _COST,
        fingerprint=fingerprint("stack", *parts, *paints, known, prior, spectra, instrument),
    )
