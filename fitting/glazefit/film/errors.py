"""Errors of readings: the instrument's noise, the grounds' own error, and paints that are not quite
the catalogue's.

A catalogue never fits to the noise. Its error is a relative one: log k and log s of each coat of
known paints are each off by a smooth random function of wavelength, delta, Gaussian with a
Matérn-3/2 correlation, K = (1 + x) exp(-x) with x = sqrt(3)|l - l'| / length, which forgives
sharper errors than a smoother law. Their standard deviation e may itself be unknown. To these come
the errors that each paint states, M, of which a coat's k has the mean by the paints' parts of k,
its s by those of s; and the model's own smooth error, A, which films over two cards share in part
(`glazefit.film.model.errors.ModelError`, as for a search).

The errors, two a band and coat, are integrated out. Readings are linear in them, so that a film's
readings are Gaussian with covariance C = V + e^2 J K J^T, where V = diag(v) + A + J M M^T J^T has
the variances v by noise and grounds.

Where the slopes J come from a table (`Film.tabulated`), they are those of each place. One set of
slopes for all of a wide posterior would make one end of it too sure: a clear coat shows every error
of the coat below, an opaque one none.

Elsewhere they are those about the errors' likeliest values delta*. A film 30 % off its catalogue
has other slopes than the catalogue's film. With f(delta) the readings, their mean is
f(delta*) - J delta*. With W that makes V unity and J K J^T diagonal, b, the residuals are
W (reading - mean) / sqrt(1 + e^2 b) and the determinant is that of 1 + e^2 b: sampling needs no
factorisation.

The likeliest errors, and J with them, follow the unknowns. What is left of the residuals does not
show it to first order, since these errors are the likeliest; the determinant does: less gloss is
more body, whose slopes are larger and whose errors are the better known. So its slopes are computed
at the mode, by the film's appearance: log readings without the surface's part, and gloss. Those by
the unknowns would go on where a thicker film reads the same. Without them the gloss of dark films
comes out low.
"""

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from .forward import (
    Expansion,
    Film,
    FilmData,
    FilmShared,
    PerUnknown,
    Scalar,
    Slopes,
    Terms,
    slopes,
)
from .model.errors import paint_covariance, whitening
from .numerics.least_squares import root_of_log1p


def _caused(
    by_log: Float[Any, "*films errors bands grounds"], smooth: Float[Any, "bands bands"]
) -> Float[Any, "*films rows rows"]:
    """Covariance J K J^T of readings, band after band and ground after ground, for errors of size
    1 (`paint_covariance`).
    """
    *leading, bands, grounds = by_log.shape
    # Of no error there is no size to be worked out.
    rows = by_log.reshape(*leading, bands * grounds)
    return paint_covariance(rows, smooth.repeat(grounds, axis=0).repeat(grounds, axis=1))


def _model_sd(readings: Float[Any, "*shape"], shared: FilmShared) -> Any:
    """Standard deviation of the model's own error, of readings as they are computed: of measured
    ones, those that happen to be low would count for more.
    """
    amplitude, growth = shared.model_size
    return amplitude + growth * readings


def _of_model(readings: Float[Any, "*films rows"], shared: FilmShared) -> Any:
    """Covariance of the model's own error (`_model_sd`)."""
    size = _model_sd(readings, shared)
    return size[..., :, None] * size[..., None, :] * shared.model


def _stated(film: Film, free: PerUnknown, data: FilmData) -> Float[Array, "modes errors bands"]:
    """Errors M of log k and log s of each coat by what its paints state; of a film that is
    tabulated those of the known coats alone.
    """
    coats = []
    for n, members in enumerate(film.paints):
        if n == film.unknown_coat and film.tabulated:
            continue
        parts = film.parts(n, free, data)
        share = parts / jnp.maximum(parts.sum(axis=-1, keepdims=True), 1e-30)
        coats.append(jnp.einsum("mpcb,cbp->mcb", data.stated[:, members], share))
    modes, *_, bands = data.stated.shape
    return jnp.concatenate([jnp.zeros((modes, 0, bands)), *coats], axis=1)


def _variance(data: FilmData, linear: Slopes) -> Any:
    """Of the readings by the instrument's noise and the grounds' own error."""
    return data.sd**2 + (linear.by_ground * data.ground_sd) ** 2


@dataclass(frozen=True)
class PaintErrors:
    """Misfit of one film over its errors, and the determinant of their covariance, as residuals."""

    film: Film

    def __call__(self, free: PerUnknown, data: FilmData, shared: FilmShared) -> Terms:
        """Of one film."""
        film = self.film
        size = _size(film, free)
        expansion = data.expansion
        if expansion is not None:
            readings, appearance = _appearance(film, free, data, shared, expansion.shift)
            off = data.reflectance - readings - expansion.offset
            root = size * expansion.spread
            white = expansion.whiten @ off.reshape(-1) / jnp.sqrt(1.0 + root**2)
            tilted = _tilted(expansion, appearance)
            return jnp.concatenate([white, root_of_log1p(root), tilted])
        off, linear = _look(film, film.unknown_logs(free, shared), free, data, shared)
        through = linear.by_ground * data.ground_sd / data.sd
        precision = 1.0 / (data.sd * jnp.sqrt(1.0 + through**2))
        white = (off * precision).reshape(-1)
        log_determinants = [root_of_log1p(through).reshape(-1)]
        if film.error:
            by_log = linear.by_log * precision
            modes = _stated_of_known(film, data)
            covariance = jnp.einsum("meb,mfc->ebfc", modes, modes)
            stated = jnp.einsum("ebg,ebfc,fch->bgch", by_log, covariance, by_log)
            of_model = _of_model((data.reflectance - off).reshape(-1), shared)
            of_model = of_model * jnp.outer(precision, precision)
            caused = size**2 * _caused(by_log, shared.smooth) + of_model
            caused += stated.reshape(caused.shape)
            root = jnp.linalg.cholesky(jnp.eye(white.size) + caused)
            white = jax.scipy.linalg.solve_triangular(root, white, lower=True)
            # The diagonal is 1 or more; with a constant added its logarithm has a smooth root.
            log_determinants.append(jnp.sqrt(1.0 + 2.0 * jnp.log(jnp.diagonal(root))))
        return jnp.concatenate([white, *log_determinants])


def _appearance(
    film: Film,
    free: PerUnknown,
    data: FilmData,
    shared: FilmShared,
    shift: Float[Any, "errors bands"],
) -> tuple[Float[Array, "bands grounds"], Float[Array, "appearance"]]:
    """Readings about some errors of the paints; and the appearance: their logs without the
    surface's part, gloss, and the log size of the errors.
    """
    by_coat = jnp.moveaxis(shift.reshape(len(film.sizes), 2, -1), 0, -1)
    readings = film.read(free, data, shared, by_coat)
    # Darker than any paint, their slopes are next to nothing.
    body = jnp.maximum(readings - film.surface(free, shared), 1e-4)
    gloss = jax.nn.sigmoid(free[film.places.gloss])
    return readings, jnp.concatenate([jnp.log(body).reshape(-1), gloss, free[film.places.error]])


def _tilted(expansion: Expansion, appearance: Float[Array, "appearance"]) -> Float[Array, "1"]:
    """Rise of half the logarithm of C's determinant from where it was expanded, as a residual."""
    rows = expansion.spread.shape[-1]
    rise = expansion.tilt @ (appearance - expansion.place)
    # Positive everywhere, and nearly linear where the rise is small for so many readings.
    return jnp.sqrt(2.0 * rows * jnp.logaddexp(0.0, 2.0 * rise / rows))[None]


def _stated_of_known(film: Film, data: FilmData) -> Float[Array, "modes errors bands"]:
    """`_stated` of a film whose fractions are all known: the same at each place, so that it is
    computed once for all.
    """
    return _stated(film, jnp.zeros(film.dims, data.sd.dtype), data)


def _size(film: Film, free: PerUnknown) -> Scalar:
    """Of the paints' errors; of no meaning where there are none."""
    return jnp.exp(jnp.sum(free[film.places.error]))


def _look(
    film: Film,
    logs: Float[Array, "2 bands"],
    free: PerUnknown,
    data: FilmData,
    shared: FilmShared,
) -> tuple[Float[Array, "bands grounds"], Slopes]:
    """Errors of the readings, and their slopes, at log k d and log s d of the unknown coat."""
    linear = film.look_up(jnp.exp(logs), data, shared)
    return data.reflectance - film.surface(free, shared) - linear.body, linear


@dataclass(frozen=True)
class ScaledReadings:
    """Misfits of one film that is tabulated, each over its own standard deviation.

    That the known coats' errors are similar in neighbouring bands is left out, and with it a
    covariance: as a measure of distance this is as good, and its slopes cost a twentieth.
    """

    film: Film

    def __call__(self, free: PerUnknown, data: FilmData, shared: FilmShared) -> Terms:
        """Of one film."""
        return self._at(self.film.unknown_logs(free, shared), free, data, shared).reshape(-1)

    def slopes(
        self, free: PerUnknown, data: FilmData, shared: FilmShared
    ) -> Float[Array, "rows dims"]:
        """By the unknowns: a band's readings hang on its own k d and s d, and these on the paint's
        unknowns.

        So slopes by k d and s d of all bands at once are enough, and by gloss and error each.
        """
        logs = self.film.unknown_logs(free, shared)
        spectra = self.film.spectra

        def read(step: Float[Array, "2+others"]) -> Float[Array, "bands grounds"]:
            shifted = free.at[spectra:].add(step[2:])
            return self._at(logs + step[:2, None], shifted, data, shared)

        by_step = jax.jacfwd(read)(jnp.zeros(2 + len(free) - spectra, free.dtype))
        by_spectra = jnp.einsum("bgw,wbm->bgm", by_step[..., :2], shared.modes)
        by_unknown = jnp.concatenate([by_spectra, by_step[..., 2:]], axis=-1)
        return by_unknown.reshape(-1, len(free))

    def _at(
        self,
        logs: Float[Array, "2 bands"],
        free: PerUnknown,
        data: FilmData,
        shared: FilmShared,
    ) -> Float[Array, "bands grounds"]:
        """From log k d and log s d of the unknown coat; of the unknowns gloss and error count."""
        off, linear = _look(self.film, logs, free, data, shared)
        smooth = _size(self.film, free) ** 2 * jnp.diagonal(shared.smooth)[:, None]
        caused = smooth * jnp.sum(linear.by_log**2, axis=0)
        modes = _stated_of_known(self.film, data)
        # Of each band by itself.
        covariance = jnp.einsum("meb,mfb->efb", modes, modes)
        caused += jnp.einsum("ebg,efb,fbg->bg", linear.by_log, covariance, linear.by_log)
        caused += _model_sd(data.reflectance - off, shared) ** 2
        return off / jnp.sqrt(_variance(data, linear) + caused)


@functools.partial(Program, fixed=("film",))
def without_errors(
    film: Film, free: Float[Array, "films dims"], data: FilmData, shared: FilmShared
) -> tuple[
    Float[Array, "films errors bands"],
    Float[Array, "films"],
    Float[Array, "films modes errors bands"],
]:
    """Log k d and log s d of the coats without error, what the surface adds to a reading, and the
    errors that paints state (`_stated`).
    """

    def one(free: Array, data: FilmData) -> tuple[Array, Array, Array]:
        return (
            film.optical(free, data, shared),
            film.surface(free, shared),
            _stated(film, free, data),
        )

    thickness, above, stated = jax.vmap(one)(free, data)
    logs = jnp.moveaxis(jnp.log(jnp.maximum(thickness, 1e-9)), -1, 1)
    return logs.reshape(len(logs), -1, logs.shape[-1]), above, stated


@functools.partial(Program, fixed=("film",))
def _appearances(
    film: Film,
    free: Float[Array, "films dims"],
    data: FilmData,
    shared: FilmShared,
    shift: Float[Array, "films errors bands"],
) -> tuple[Float[Array, "films appearance"], Float[Array, "films appearance dims"]]:
    """Appearance of films, and its slopes by the unknowns."""

    def one(free: Array, data: FilmData, shift: Array) -> tuple[Array, Array]:
        def at(free: Array) -> Array:
            return _appearance(film, free, data, shared, shift)[1]

        return at(free), jax.jacfwd(at)(free)

    return jax.vmap(one)(free, data, shift)


class _Linear(NamedTuple):
    """Films linear in errors of their paints, at some unknowns and about some errors."""

    shift: Float[np.ndarray, "films errors bands"]  # the errors
    size: Float[np.ndarray, "films 1 1"]  # e^2
    computed: Float[np.ndarray, "films rows"]  # readings
    by_log: Float[np.ndarray, "films errors bands grounds"]  # slopes by log k and log s
    stated: Float[np.ndarray, "films modes errors bands"]  # M
    by_stated: Float[np.ndarray, "films modes rows"]  # slopes by what the paints state
    variance: Float[np.ndarray, "films rows"]  # v

    def caused(self, shared: FilmShared) -> Float[np.ndarray, "films rows rows"]:
        """e^2 J K J^T."""
        return self.size * _caused(self.by_log, np.asarray(shared.smooth))

    def fixed(self, shared: FilmShared) -> Float[np.ndarray, "films rows rows"]:
        """V."""
        of_model = np.asarray(_of_model(self.computed, shared))
        stated = np.swapaxes(self.by_stated, 1, 2) @ self.by_stated
        return of_model + stated + np.eye(self.variance.shape[1]) * self.variance[:, None]


def _linearised(
    film: Film,
    free: Float[np.ndarray, "films dims"],
    shift: Float[np.ndarray, "films errors bands"],
    data: FilmData,
    shared: FilmShared,
    *,
    steps: int,
) -> _Linear:
    """The films about errors that are so many steps likelier than `shift`."""
    logs, above, stated = map(np.asarray, without_errors(film, free, data, shared))

    def about(shift: np.ndarray) -> _Linear:
        linear = slopes(film, shared.response, logs + shift, data.ground)
        by_log = np.asarray(linear.by_log)
        by_stated = np.einsum("fmeb,febg->fmbg", stated, by_log)
        variance = np.asarray(_variance(data, linear)).reshape(len(shift), -1)
        computed = np.asarray(linear.body) + above[:, None, None]
        return _Linear(
            shift=shift,
            size=np.exp(2.0 * free[:, -1])[:, None, None],
            computed=computed.reshape(variance.shape),
            by_log=by_log,
            stated=stated,
            by_stated=by_stated.reshape(*stated.shape[:2], variance.shape[1]),
            variance=variance,
        )

    here = about(shift)
    for _ in range(steps):
        here = about(_likelier(here, data, shared))
    return here


def _likelier(
    linear: _Linear, data: FilmData, shared: FilmShared
) -> Float[np.ndarray, "films errors bands"]:
    """The likeliest errors of the paints, by one step of Gauss and Newton."""
    reflectance = np.asarray(data.reflectance)
    target = reflectance - linear.computed.reshape(reflectance.shape)
    target += np.einsum("febg,feb->fbg", linear.by_log, linear.shift)
    covariance = linear.caused(shared) + linear.fixed(shared)
    flat = np.linalg.solve(covariance, target.reshape(len(target), -1, 1))
    pull = np.einsum("febg,fbg->feb", linear.by_log, flat.reshape(target.shape))
    likely = linear.size * (pull @ np.asarray(shared.smooth))
    likely += np.einsum("fmeb,fm->feb", linear.stated, (linear.by_stated @ flat)[..., 0])
    step = likely - linear.shift
    # A step of more than 1 in log k or log s goes beyond where slopes hold.
    return linear.shift + step / np.maximum(1.0, np.abs(step).max(axis=(1, 2), keepdims=True))


def _tilt(
    film: Film,
    free: Float[np.ndarray, "films dims"],
    here: _Linear,
    data: FilmData,
    shared: FilmShared,
    by_unknown: Float[np.ndarray, "films appearance dims"],
) -> Float[np.ndarray, "films appearance"]:
    """Slopes of half the logarithm of C's determinant by the appearance: the least of all that
    agree with those by the unknowns, which are from differences.

    The sizes of the errors are held: `PaintErrors` counts that of the paints at each place, and the
    model's follows the readings, to which the unknowns are fitted.

    Args:
        film, free, data, shared: as for `expand`.
        here: the films about their likeliest errors.
        by_unknown: slopes of the appearance by the unknowns.
    """

    def half_log_determinant(free: np.ndarray) -> np.ndarray:
        # The first step takes most of the way; what is left would show in thickness.
        at = _linearised(film, free, here.shift, data, shared, steps=3)
        at = at._replace(size=here.size, computed=here.computed)
        covariance = at.caused(shared) + at.fixed(shared)
        return 0.5 * np.linalg.slogdet(covariance)[1]

    step = 1e-3
    before = half_log_determinant(free)
    rises = [half_log_determinant(free + step * unit) - before for unit in np.eye(free.shape[1])]
    slopes = np.stack(rises, axis=-1)[:, None] / step
    # What changes no reading any more, as the share of an absent paint, has no slope.
    return (slopes @ np.linalg.pinv(by_unknown, rcond=1e-6))[:, 0]


def usual_errors(film: Film, data: FilmData) -> Expansion:
    """Before anything is found of the films: each reading is off by itself, by as much as paints of
    a usual error make it.
    """
    films, bands, grounds = data.sd.shape
    errors = 2 * len(film.sizes)
    appearance = np.zeros((films, bands * grounds + film.gloss + film.error))
    root = 1.0 / np.hypot(data.sd, 0.02).reshape(films, -1, 1)
    return Expansion(
        shift=np.zeros((films, errors, bands)),
        offset=np.zeros((films, bands, grounds)),
        whiten=root * np.eye(bands * grounds),
        spread=np.zeros((films, bands * grounds)),
        place=appearance,
        tilt=appearance,
    )


def expand(
    film: Film,
    free: Float[np.ndarray, "films dims"],
    data: FilmData,
    shared: FilmShared,
    *,
    steps: int,
) -> FilmData:
    """The films with their readings linear in errors of the paints about the likeliest ones, a
    Gaussian process fitted to what the coats leave unexplained, by so many steps of Gauss and
    Newton from those before.
    """
    assert data.expansion is not None
    here = _linearised(film, free, np.asarray(data.expansion.shift), data, shared, steps=steps)
    basis = whitening(here.fixed(shared)).basis
    of_unit_size = _caused(here.by_log, np.asarray(shared.smooth))
    spread, axes = np.linalg.eigh(basis @ of_unit_size @ np.swapaxes(basis, 1, 2))
    place, by_unknown = map(np.asarray, _appearances(film, free, data, shared, here.shift))
    # Of errors that are not yet the likeliest it would say nothing.
    tilt = _tilt(film, free, here, data, shared, by_unknown) if steps else np.zeros_like(place)
    return data._replace(
        expansion=Expansion(
            shift=here.shift,
            offset=-np.einsum("febg,feb->fbg", here.by_log, here.shift),
            whiten=np.swapaxes(axes, 1, 2) @ basis,
            spread=np.sqrt(np.maximum(spread, 0.0)),
            place=place,
            tilt=tilt,
        )
    )
