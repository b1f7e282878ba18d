"""Problems to solve and sample: many small posteriors side by side, each the exponential of minus
half a sum of squares.

A block is one posterior of a few unknowns: a film, or one band of a film. Blocks know nothing of
each other, so that all of them times all walkers are one compiled call, and each block accepts or
refuses a step on its own.

Every part of a block's log-probability is written as a squared residual: misfits divided by their
errors, and also logarithms of determinants and of prior densities, which are kept positive by an
added constant. So least squares finds the mode.
"""

import functools
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program
from glazejax.radiative.common.chunks import in_chunks

from .films import Reading
from .forward import Film, PerUnknown, Scalar, Terms
from .prior import Law, UnknownsCovariance

FreeDraws: TypeAlias = Float[np.ndarray, "draws blocks dims"]
"""Draws of the free unknowns of each block."""
FreeValues: TypeAlias = Float[np.ndarray, "*shape dims"]
"""Any values of the free unknowns."""
QuantityValues: TypeAlias = Float[np.ndarray, "*shape"]
"""Values of a reported quantity."""
SpectraDraws: TypeAlias = Mapping[str, Float[np.ndarray, "draws bands"]]
"""Draws of k d, s d and k/s by name, in this order."""

Residuals = Callable[[PerUnknown, Any, Any], Terms]
"""Residuals of one block, (rows,), from its free unknowns, (dims,), its own data and what all
blocks share. Half their squares, summed, are minus the log-probability up to a constant.
"""


@dataclass(frozen=True)
class PosteriorResiduals:
    """Misfit and prior of one block."""

    misfit: Residuals
    prior: Law

    def __call__(self, free: PerUnknown, data: Any, shared: Any) -> Terms:
        """Of one block."""
        terms = (self.misfit(free, data, shared), self.prior.residuals(free, shared))
        return jnp.concatenate(terms)


class Quantity(NamedTuple):
    """Reported quantity: a function of the free unknowns.

    Attributes:
        name: such as "fraction ZincWhite".
        logarithmic: positive, and best looked at by its logarithm.
        values: of the free unknowns, (..., dims) -> (...); NumPy. Random numbers may follow,
            for what the readings leave open of the paints' strengths, (..., dims + random).
        spectrum: "absorption", "scattering" or "ratio" if it is one band of that; else empty.
    """

    name: str
    logarithmic: bool
    values: Callable[[np.ndarray], np.ndarray]
    spectrum: str = ""

    def scaled(self, free: FreeValues) -> QuantityValues:
        """Values, or their logarithms where these are looked at."""
        values = self.values(free)
        return np.log(values) if self.logarithmic else values


@dataclass(frozen=True)
class FilmProblem:
    """Independent posteriors with the same unknowns.

    Attributes:
        kind: "paints" (a block is a film), "stack" (a block is a film of coats) or "bands" (a block
            is a wavelength).
        blocks: their names.
        unknowns: names of the free unknowns of a block; each may be any real number.
        film: what the instrument reads.
        misfit: see `Residuals`; hashable, since compiled programs are kept by it.
        prior: of the unknowns.
        data: arrays with the blocks as leading axis.
        shared: arrays that all blocks use.
        quantities: what is reported.
        bands: wavelengths that one evaluation of a block computes.
        fingerprint: of the measurement and the settings; two chains may be joined if theirs are
            equal.
        random: how many random numbers the quantities take for paints that may be stronger or
            weaker in this film than in others: readings show thickness times strength.
        starts: points from which modes are looked for.
        scaled: readings in units of their errors, (rows,), from the same arguments as the
            residuals: how far they change is how far apart two places of the posterior are
            (`glazefit.film.hamiltonian`). None where they cost too much, or where the posterior is
            as wide everywhere. Its method `slopes`, if it has one, gives the slopes by the
            unknowns, (rows, dims), from the same arguments.
    """

    kind: str
    blocks: tuple[str, ...]
    unknowns: tuple[str, ...]
    film: Film
    misfit: Residuals
    prior: Law
    data: Any
    shared: Any
    quantities: tuple[Quantity, ...]
    bands: int
    fingerprint: str
    random: int = 0
    starts: int = 8
    scaled: Residuals | None = None

    def __post_init__(self) -> None:
        # On the device once, and not for every call of a program.
        for name in ("data", "shared"):
            object.__setattr__(self, name, jax.tree.map(jnp.asarray, getattr(self, name)))

    @property
    def dims(self) -> int:
        """Unknowns of a block."""
        return len(self.unknowns)

    @property
    def residuals(self) -> PosteriorResiduals:
        """Of one block."""
        return PosteriorResiduals(self.misfit, self.prior)

    @functools.cached_property
    def prior_covariance(self) -> UnknownsCovariance:
        """Of the free unknowns."""
        return self.prior.covariance(self.shared)

    def prior_draws(self, rng: np.random.Generator, n: int) -> Float[np.ndarray, "n dims"]:
        """Of the free unknowns."""
        return self.prior.draws(rng, n, self.shared)

    def log_probability(
        self, free: Float[np.ndarray, "walkers blocks dims"]
    ) -> Float[np.ndarray, "walkers blocks"]:
        """Log-probabilities up to a constant, all walkers and blocks in one compiled call; never
        NaN.
        """
        return np.asarray(log_probability(self.residuals, self.data, self.shared, free, self.chunk))

    @property
    def chunk(self) -> int:
        """Walkers computed at a time."""
        # One block takes some 12 kB a band for one walker; more than so many bands fall out of
        # cache.
        return max(1, 12_000 // (self.bands * len(self.blocks)))

    def log_likelihood(self, free: FreeDraws) -> Float[np.ndarray, "draws blocks"]:
        """The part of `log_probability` that the measurement has, up to a constant."""
        return np.asarray(log_probability(self.misfit, self.data, self.shared, free, self.chunk))

    def readings(self, free: FreeDraws) -> Float[np.ndarray, "draws blocks *reading"]:
        """Readings of the instrument, without noise and errors of the paints."""
        reading = np.asarray(_readings(self.film, self.data, self.shared, free))
        return reading[..., 0, :] if self.kind == "bands" else reading

    def draws(self, free: FreeValues) -> Mapping[str, QuantityValues]:
        """The reported quantities of some values of the free unknowns; strengths of the paints are
        drawn, alike at each call for one measurement.
        """
        rng = np.random.default_rng(list(self.fingerprint[:16].encode()))
        random = rng.standard_normal((*free.shape[:-1], self.random))
        return self.shown(np.concatenate([free, random], axis=-1))

    def shown(self, free: FreeValues) -> Mapping[str, QuantityValues]:
        """The reported quantities as the readings show them, were paints as strong as elsewhere."""
        return {quantity.name: quantity.values(free) for quantity in self.quantities}

    def spectra(self, free: FreeDraws) -> SpectraDraws:
        """K d, s d and k/s of all bands, or of the first block's unknown paint; empty without
        one.
        """
        if self.kind == "bands":
            return self.draws(free)
        spectra: dict[str, list[np.ndarray]] = {}
        for quantity in self.quantities:
            if quantity.spectrum:
                spectra.setdefault(quantity.spectrum, []).append(quantity.values(free[:, 0]))
        return {name: np.stack(values, axis=-1) for name, values in spectra.items()}


def block_log_probability(residuals: Residuals, free: PerUnknown, data: Any, shared: Any) -> Scalar:
    """Log-probability of one block up to a constant, minus half the sum of squares of the
    residuals; what overflows, so far out, counts as impossible.
    """
    value = -0.5 * jnp.sum(residuals(free, data, shared) ** 2)
    return jnp.where(jnp.isnan(value), -jnp.inf, value)


@functools.partial(Program, fixed=("residuals", "chunk"))
def log_probability(
    residuals: Residuals,
    data: Any,
    shared: Any,
    free: Float[Array, "walkers blocks dims"],
    chunk: int,
) -> Float[Array, "walkers blocks"]:
    """Log-probabilities of all walkers and blocks, see `block_log_probability`."""

    def walker(free: Float[Array, "blocks dims"]) -> Float[Array, "blocks"]:
        return jax.vmap(lambda f, d: block_log_probability(residuals, f, d, shared))(free, data)

    return in_chunks(jax.vmap(walker), free, chunk)


@functools.partial(Program, fixed=("film",))
def _readings(
    film: Film, data: Any, shared: Any, free: Float[Array, "draws blocks dims"]
) -> Float[Array, "draws blocks bands grounds"]:
    def blocks(free: Float[Array, "blocks dims"]) -> Array:
        return jax.vmap(lambda f, d: film.read(f, d, shared))(free, data)

    return in_chunks(jax.vmap(blocks), free, 64)


def fingerprint(kind: str, film: Reading, *settings: Any) -> str:
    """A hash of what decides a posterior: of a film, and of settings that are arrays, numbers,
    strings or dataclasses that print themselves.
    """
    digest = hashlib.sha256()
    measured = (film.wavelengths, film.reflectance, film.ground, film.sd, film.ground_sd)
    for item in (kind, *measured, *settings):
        array = np.asarray(item)
        digest.update(array.tobytes() if array.dtype.kind == "f" else repr(item).encode())
        digest.update(b"|")
    return digest.hexdigest()


class Draws(NamedTuple):
    """Some steps of a sampler."""

    free: Float[Any, "steps walkers blocks dims"]
    height: Float[Any, "steps walkers blocks"]  # log posterior
    accepted: Float[Any, ""]  # sum over the steps of the shares that were accepted
    state: dict[str, Any]  # arrays that the next step goes on from, by name
