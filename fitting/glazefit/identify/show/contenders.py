"""The nearest film with each paint of the catalogue: what speaks against the paints that were not
found.

A trace of any paint can hide in any film. Films are therefore asked for that have at least
`LEAST_SHARE` of a paint: it alone, in a pair with every other paint, and beside the main paints of
the most probable explanation. The nearest of them is that of the least squared residual, relative
to what counts as near at each reading; the surface's share is free within its prior.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, fields

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax import Pigment
from glazejax.programs import Program

from ...film.films import Instrument
from ...film.model.errors import ModelError, Prior, noise_covariance, whitening
from ...film.model.response import FilmResponse, film_response
from ...film.numerics.least_squares import damped_newton
from ..result import Identification
from ..search.candidates import padded_size
from ..search.chunk import tolerance
from ..search.pool import NOBODY
from ..search.searcher import check_pigments, opaque_prior
from ..search.table import Paints, paints_of
from ..search.task import Measured

LEAST_SHARE = 0.01
"""Of a paint by mass, in the films that are asked for."""

# Shares of the paint and totals, in units of the usual thickness, that films are tried at first.
_SHARES = np.array([0.012, 0.04, 0.12, 0.35, 0.7, 0.97])
_TOTALS = np.exp(np.linspace(-2.5, 2.5, 7))
_THIRD_SHARES = (0.02, 0.2)
# Partners that are fitted for each paint, after all were tried.
_PARTNERS = 2
_STEPS = 14
_LONGEST = 2.0
_FAR = 20.0
# Standard deviations of the log total and of both log odds: they only keep a fit from wandering
# where nothing is seen.
_LOOSE = np.array([2.0, 4.0, 4.0])


@dataclass(frozen=True)
class Contenders:
    """The nearest film with each paint.

    Attributes:
        members: paints of the film by number, (spectra, paints, 3), the one asked for first;
            `NOBODY` where there is none.
        coats: coat of each, 0 the uppermost.
        fractions: by mass, (spectra, paints, 3); 0 where there is no paint.
        thickness: m, (spectra, paints); without a meaning for films that hide their ground.
        rmse: root mean square of the residual, (spectra, paints).
        delta_e: CIEDE2000 (D65, 10 degrees), the largest over the grounds; NaN where the bands give
            no colour.
    """

    members: Int[np.ndarray, "spectra paints 3"]
    coats: Int[np.ndarray, "spectra paints 3"]
    fractions: Float[np.ndarray, "spectra paints 3"]
    thickness: Float[np.ndarray, "spectra paints"]
    rmse: Float[np.ndarray, "spectra paints"]
    delta_e: Float[np.ndarray, "spectra paints"]

    def __len__(self) -> int:
        return len(self.members)

    @classmethod
    def join(cls, parts: Sequence["Contenders"]) -> "Contenders":
        """Those of several batches as one."""
        return cls(
            **{
                f.name: np.concatenate([getattr(part, f.name) for part in parts])
                for f in fields(cls)
            }
        )

    def take(self, count: int) -> "Contenders":
        """Those of the first spectra."""
        return type(self)(**{f.name: getattr(self, f.name)[:count] for f in fields(self)})


def find_contenders(
    found: Identification,
    pigments: Sequence[Pigment],
    instrument: Instrument,
    *,
    prior: Prior,
    discrepancy: ModelError,
    max_paints: int = 3,
) -> Contenders:
    """The nearest film with each paint, for every spectrum of an identification.

    Films of one coat are fitted here; the explanations that were found, of two coats too, count
    where they are nearer.

    Args:
        found: identification of the spectra.
        pigments: its catalogue.
        instrument: that read the spectra.
        prior: its usual thickness is where films are looked for.
        discrepancy: how the surface's share varies.
        max_paints: largest set, 1 to 3.
    """
    measured = found.measured
    known = check_pigments(pigments, measured.wavelengths)
    usual = (opaque_prior(prior, known) if found.opaque else prior).thickness
    response = film_response(instrument.geometry, instrument.refractive_index)
    paints = paints_of(known, usual)
    surface = instrument.seen_surface
    sd = tolerance(measured)
    white = whitening(noise_covariance(sd, surface, discrepancy))[0]
    readings = (measured.readings - discrepancy.gloss * surface).reshape(len(measured), -1)
    target = np.einsum("srt,st->sr", white, readings)
    # Few sizes, so that little is compiled.
    padded = np.resize(
        np.arange(len(measured)), padded_size(len(measured)) if len(measured) > 1 else 1
    )
    grounds, wanted, basis = (jnp.asarray(a[padded]) for a in (measured.grounds, target, white))
    spectra = grounds, wanted, basis
    sets, starts = (
        a[: len(measured)] for a in _starts(response, paints, spectra, max_paints, found.opaque)
    )
    if max_paints == 3 and len(known) > 2:
        third = _beside(found, len(known), usual)
        sets, starts = (
            np.concatenate(both, axis=2) for both in zip((sets, starts), third, strict=True)
        )
    films = sets.shape[1:3]
    sets = sets.reshape(len(measured), -1, 3)
    starts = starts.reshape(len(measured), -1, 3)
    fits = _fit(
        response,
        paints,
        jnp.asarray(sets[padded]),
        jnp.asarray(starts[padded]),
        *spectra,
        found.opaque,
    )
    unknowns, fitted = (np.asarray(a)[: len(measured)] for a in fits)
    response_to_shift = np.einsum("srt,sr->st", white, white.sum(axis=-1))
    off = readings[:, None] - fitted
    shift = np.einsum("scr,sr->sc", off, response_to_shift)
    added = discrepancy.gloss * surface + discrepancy.surface_sd(surface) ** 2 * shift
    fitted = fitted + np.maximum(added, 0.0)[..., None]
    shares = np.where(
        sets == NOBODY, 0.0, np.asarray(_shares(jnp.asarray(unknowns), jnp.asarray(sets)))
    )
    wanted_paint = np.broadcast_to(np.repeat(np.arange(films[0]), films[1]), sets.shape[:2])
    thickness = usual * np.exp(unknowns[..., 0])
    tried = _Fits(
        paint=wanted_paint,
        members=sets,
        coats=np.zeros_like(sets),
        shares=shares,
        thickness=thickness,
        readings=fitted,
    )
    return _nearest(measured, sd, [tried, *_explanations(found)], len(known))


@dataclass(frozen=True)
class _Fits:
    """Fitted films, each as one with a certain paint; `paint` is negative where it has too little
    of it.
    """

    paint: Int[np.ndarray, "spectra films"]
    members: Int[np.ndarray, "spectra films 3"]
    coats: Int[np.ndarray, "spectra films 3"]
    shares: Float[np.ndarray, "spectra films 3"]
    thickness: Float[np.ndarray, "spectra films"]
    readings: Float[np.ndarray, "spectra films readings"]


def _explanations(found: Identification) -> list[_Fits]:
    """The explanations that were found, once for each of their paints."""
    out = []
    readings = found.fitted.reshape(*found.probability.shape, -1)
    for place in range(3):
        order = [place, *(n for n in range(3) if n != place)]
        members, coats, shares = (
            a[..., order] for a in (found.members, found.coats, found.fractions)
        )
        enough = (
            (members[..., 0] != NOBODY) & (shares[..., 0] >= LEAST_SHARE) & (found.probability > 0)
        )
        paint = np.where(enough, members[..., 0], NOBODY)
        out.append(
            _Fits(
                paint=paint,
                members=members,
                coats=coats,
                shares=shares,
                thickness=found.amounts.sum(axis=-1),
                readings=readings,
            )
        )
    return out


def _nearest(measured: Measured, sd: np.ndarray, kinds: list[_Fits], count: int) -> Contenders:
    """The nearest of the films with each paint."""
    paint, members, coats, shares, thickness, readings = (
        np.concatenate([getattr(kind, f.name) for kind in kinds], axis=1) for f in fields(_Fits)
    )
    given = measured.readings.reshape(len(measured), 1, -1)
    cost = np.sum(((given - readings) / sd.reshape(given.shape)) ** 2, axis=-1)
    mine = paint[:, None, :] == np.arange(count)[:, None]
    best = np.argmin(np.where(mine, cost[:, None, :], np.inf), axis=-1)
    rows = np.arange(len(measured))[:, None]
    fitted = readings[rows, best].reshape(*best.shape, *measured.readings.shape[1:])
    off = measured.readings[:, None] - fitted
    seen = measured.delta_e(fitted)
    rmse = np.sqrt(np.mean(off**2, axis=(-1, -2)))
    members, coats, shares, thickness = (a[rows, best] for a in (members, coats, shares, thickness))
    return Contenders(
        members=members, coats=coats, fractions=shares, thickness=thickness, rmse=rmse, delta_e=seen
    )


def _starts(
    response: FilmResponse,
    paints: Paints,
    spectra: tuple[Array, Array, Array],
    max_paints: int,
    opaque: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """For each spectrum and paint the best partners, (spectra, paints, partners, 3), and unknowns
    to start from.
    """
    count = paints.absorption.shape[0]
    alone = max_paints == 1 or count == 1
    tries = np.ones(1) if opaque else _TOTALS, np.ones(1) if alone else _SHARES
    total, share = (a.reshape(-1) for a in np.meshgrid(*tries, indexing="ij"))
    others = [[NOBODY] if alone else np.delete(np.arange(count), paint) for paint in range(count)]
    partners = np.asarray(others)
    tried = _screen(response, paints, *(jnp.asarray(a) for a in (partners, total, share)), *spectra)
    cost, where = (np.swapaxes(np.asarray(a), 0, 1) for a in tried)
    best = np.argsort(cost, axis=-1, kind="stable")[..., :_PARTNERS]
    place = np.take_along_axis(where, best, axis=-1)
    sets = np.full((*best.shape, 3), NOBODY)
    sets[..., 0] = np.arange(count)[:, None]
    sets[..., 1] = np.take_along_axis(np.broadcast_to(partners, cost.shape), best, axis=-1)
    return sets, _unknowns(total[place], share[place], np.asarray(0.5))


@Program
def _screen(
    response: FilmResponse,
    paints: Paints,
    partners: Array,
    total: Array,
    share: Array,
    grounds: Array,
    target: Array,
    white: Array,
) -> tuple[Float[Array, "paints spectra partners"], Int[Array, "paints spectra partners"]]:
    """Least squared misfit of films of each paint with each partner over totals and shares, and
    where it is.
    """

    def one(pair: tuple[Array, Array]) -> tuple[Array, Array]:
        paint, others = pair
        rest = jnp.where(others[:, None] >= 0, 1.0 - share[:, None, None], 0.0)

        def thick(values: Array) -> Array:
            mixed = share[:, None, None] * values[paint] + rest * values[others]
            return total[:, None, None] * mixed

        black, gain, back = (
            a[:, :, None, :]
            for a in response.numbers(thick(paints.absorption), thick(paints.scattering))
        )

        def over(spectrum: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            ground, target, white = spectrum
            body = black + gain * ground / (1.0 - back * ground)
            cost = jnp.sum((target - body.reshape(*body.shape[:2], -1) @ white.T) ** 2, axis=-1)
            return cost.min(axis=0), cost.argmin(axis=0)

        return jax.lax.map(over, (grounds, target, white))

    return jax.lax.map(one, (jnp.arange(partners.shape[0]), partners))


def _beside(found: Identification, count: int, usual: float) -> tuple[np.ndarray, np.ndarray]:
    """Each paint beside the two main ones of the most probable explanation: sets, and unknowns to
    start from.
    """
    sets = np.full((len(found), count, len(_THIRD_SHARES), 3), NOBODY)
    starts = np.zeros(sets.shape)
    sets[..., 0] = np.arange(count)[:, None]
    for row in range(len(found)):
        amounts = found.amounts[row, 0]
        members = found.members[row, 0]
        order = [i for i in np.argsort(-amounts) if members[i] != NOBODY and amounts[i] > 0]
        for paint in range(count):
            main = [i for i in order if members[i] != paint][:2]
            sets[row, paint, :, 1 : 1 + len(main)] = members[main]
            first = amounts[main[0]] / amounts[main].sum() if main else 0.5
            given = amounts.sum() / usual, _THIRD_SHARES, np.clip(first, 1e-4, 1.0 - 1e-4)
            starts[row, paint] = _unknowns(*(np.asarray(a) for a in given))
    return sets, starts


def _unknowns(total: np.ndarray, share: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Log total, log odds of the paint's share above the least, and log odds of the first of the
    others.
    """
    above = np.clip((share - LEAST_SHARE) / (1.0 - LEAST_SHARE), 1e-4, 1.0 - 1e-4)
    parts = np.log(total), np.log(above / (1.0 - above)), np.log(first / (1.0 - first))
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _shares(unknowns: Float[Array, "*n 3"], sets: Int[Array, "*n 3"]) -> Float[Array, "*n 3"]:
    """Fractions of the three paints."""
    present = sets >= 0
    paint = LEAST_SHARE + (1.0 - LEAST_SHARE) * jax.nn.sigmoid(unknowns[..., 1])
    paint = jnp.where(present[..., 1] | present[..., 2], paint, 1.0)
    first = jnp.where(present[..., 2], jax.nn.sigmoid(unknowns[..., 2]), 1.0)
    first = jnp.where(present[..., 1], first, 0.0)
    return jnp.stack([paint, (1.0 - paint) * first, (1.0 - paint) * (1.0 - first)], axis=-1)


@functools.partial(Program, fixed=("opaque",))
def _fit(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    starts: Array,
    grounds: Array,
    target: Array,
    white: Array,
    opaque: bool,
) -> tuple[Float[Array, "spectra films 3"], Float[Array, "spectra films readings"]]:
    """Unknowns of the nearest films, and their readings without the surface."""

    def one(spectrum: tuple) -> tuple[Array, Array]:
        sets, starts, ground, target, white = spectrum

        def film(members: Array, start: Array) -> tuple[Array, Array]:
            free = _free(members, opaque).astype(start.dtype)

            def read_film(unknowns: Array) -> tuple[Array, Array]:
                amounts = jnp.exp(unknowns[0]) * _shares(unknowns, members)
                amounts = jnp.where(members >= 0, amounts, 0.0)
                body = response.body(
                    amounts @ paints.absorption[members],
                    amounts @ paints.scattering[members],
                    ground,
                )
                return body.reshape(-1), body.reshape(-1)

            def look(unknowns: Array) -> tuple[Array, Array, Array, Array]:
                # Whitened slopes, of what is free only.
                slopes, readings = jax.jacfwd(read_film, has_aux=True)(unknowns)
                slopes = white @ slopes * free
                off = target - white @ readings
                # A loose prior keeps unknowns that the spectrum does not fix.
                pull = unknowns / _LOOSE**2
                cost = 0.5 * off @ off + 0.5 * unknowns @ pull
                return (
                    cost,
                    (pull - slopes.T @ off) * free,
                    jnp.diag(1.0 / _LOOSE**2) + slopes.T @ slopes,
                    readings,
                )

            unknowns, seen = damped_newton(
                look, start, (-_FAR, _FAR), steps=_STEPS, longest=_LONGEST
            )
            return unknowns, seen[3]

        return jax.vmap(film)(sets, starts)

    return jax.lax.map(one, (sets, starts, grounds, target, white))


def _free(members: Int[Array, "3"], opaque: bool) -> Bool[Array, "3"]:
    """Which unknowns a film of these paints has."""
    others = (members[1] >= 0) | (members[2] >= 0)
    return jnp.stack([jnp.asarray(not opaque), others, (members[1] >= 0) & (members[2] >= 0)])
