"""A film of coats as a problem: which unknowns, what is likely of them, and what is reported."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.special import expit, softmax

from glazejax.spectra import Bands

from ..film.errors import PaintErrors, ScaledReadings, usual_errors, without_errors
from ..film.films import CardReadings, Instrument, Reading
from ..film.forward import Film, FilmData, FilmShared, tabulate
from ..film.model.errors import ModelError, Prior, model_correlation, smooth_kernel, stated_modes
from ..film.model.optics import Optics
from ..film.model.response import film_response
from ..film.model.variation import STRENGTH
from ..film.prior import FilmPrior
from ..film.problem import FilmProblem, Quantity, fingerprint
from .coats import CoatPrior, SpectraPrior

FreeAndRandom: TypeAlias = Float[np.ndarray, "*n numbers"]
"""Free unknowns, and random numbers where these follow."""


def pose_stack(
    reading: Reading,
    coats: Sequence[CoatPrior],
    instrument: Instrument,
    prior: Prior,
    spectra: SpectraPrior,
    *,
    discrepancy: ModelError | None = None,
    kind: str = "stack",
) -> FilmProblem:
    """Problem of a film of coats.

    Args:
        reading: of the film.
        coats: top first (see `glazefit.posterior.coats.check_coats`).
        instrument: that read it.
        prior: usual thickness, its spread, fractions' concentration and the paints' error.
        spectra: of an unknown paint.
        discrepancy: of the model; by default that of a search. A paint that does not state its
            errors has those of unknown size alone (`Prior.error`).
        kind: of the problem; names of "paints" do not say which coat they are of.

    Raises:
        ValueError: paints that do not cover the film's wavelengths.
    """
    grid = reading.wavelengths
    coats = [coat.on(grid) for coat in coats]
    modes = np.zeros((2, grid.size, 0))
    if any(coat.unknown for coat in coats):
        modes = spectra.modes(grid)
    film = Film(
        sizes=tuple(len(coat.paints) for coat in coats),
        fractions=tuple(coat.open_fractions for coat in coats),
        thickness=tuple(coat.open_thickness for coat in coats),
        spectra=modes.shape[-1],
        gloss=instrument.seen_surface > 0,
        error=True,
        optics=Optics.of(instrument),
    )
    # What is expected of each coat's thickness.
    median = np.array(
        [prior.thickness if coat.thickness is None else coat.thickness for coat in coats]
    )
    spread = np.array([coat.spread or prior.spread for coat in coats])
    # What a paint does not state is left to the error of unknown size.
    discrepancy = replace(discrepancy or ModelError(), unstated=0.0)
    grounds = len(reading.grounds)
    model = model_correlation(grid, grounds, discrepancy.length, discrepancy.shared)
    bands_first = np.arange(len(model)).reshape(grounds, grid.size).T.ravel()
    # k and s of all paints, (paints, 2, bands).
    paints = [paint for coat in coats for paint in coat.paints]
    coefficients = np.array(
        [[paint.absorption, paint.scattering] for paint in paints], float
    ).reshape(-1, 2, grid.size)
    stated = np.zeros((0, 0, 2, grid.size))
    if paints:
        stated = stated_modes(paints, discrepancy)
    depth = coefficients * np.repeat(median, film.sizes)[:, None, None]
    law = FilmPrior(film, prior.concentration_known)
    shares = [coat.shares for coat in coats]
    mean, sd = law.moments(spread, shares, prior)
    shared = FilmShared(
        response=film_response(instrument) if len(coats) == 1 else None,
        surface=np.array(float(instrument.seen_surface)),
        smooth=smooth_kernel(grid, prior.error_length),
        model_size=np.array([discrepancy.amplitude, discrepancy.share]),
        model=model[bands_first][:, bands_first],
        mean=mean,
        sd=sd,
        levels=np.log([spectra.absorption, spectra.scattering]),
        modes=modes,
    )
    # A block is a film, and here is one.
    absorption, scattering = depth.transpose(1, 2, 0)[:, None]
    data = FilmData(
        absorption=absorption,
        scattering=scattering,
        shares=np.concatenate(shares)[None],
        stated=stated[None],
        **{what: getattr(reading, what)[None] for what in CardReadings._fields},
    )
    if not film.tabulated:
        data = data._replace(expansion=usual_errors(film, data))
    elif len(coats) > 1:
        logs, *_ = without_errors(film, np.zeros((1, film.dims)), data, shared)
        data = data._replace(table=tabulate(film, np.asarray(logs)[0], reading.ground)[None])
    unknowns, quantities = name_unknowns(
        film, kind=kind, coats=coats, median=median, spread=spread, grid=grid, shared=shared
    )
    # The fingerprint holds all numbers that the posterior rests on; nested as in chains that are on
    # disk.
    expectation = repr([[(coat.thickness, coat.spread, coat.fractions) for coat in coats]])
    return FilmProblem(
        kind=kind,
        blocks=(reading.name,),
        unknowns=unknowns,
        film=film,
        misfit=PaintErrors(film),
        prior=law,
        data=data,
        shared=shared,
        quantities=quantities,
        # A band of a solved stack costs some ten times that of a tabulated film.
        bands=grid.size * (1 if len(coats) == 1 or film.tabulated else 10),
        fingerprint=fingerprint(
            kind,
            reading,
            coefficients,
            stated,
            discrepancy,
            expectation,
            prior,
            spectra,
            instrument,
        ),
        random=sum(film.sizes) + len(film.sizes) if any((*film.fractions, *film.thickness)) else 0,
        # An opaque coat and a thin one may read the same, and each is a narrow valley.
        starts=24 if film.tabulated else 8,
        scaled=ScaledReadings(film) if film.tabulated else None,
    )


@dataclass(frozen=True, eq=False)
class _CoatAmounts:
    """A coat's thickness and fractions from the free unknowns, (..., dims), and from random numbers
    where these follow.

    Readings show an amount of each paint, thickness times fraction times strength.
    """

    median: float  # thickness expected, m
    spread: float  # standard deviation of its log; 0 where the thickness is known
    thickness: slice  # places of the unknowns
    ratios: slice
    random: slice  # one for the thickness, one for each paint
    shares: Float[np.ndarray, "paints"]  # fractions that are known

    def shown(self, values: FreeAndRandom) -> Float[np.ndarray, "*n paints"]:
        """Fractions, were all paints as strong as elsewhere."""
        if self.ratios.start == self.ratios.stop:
            return self.shares
        logs = values[..., self.ratios]
        return softmax(np.concatenate([logs, np.zeros_like(logs[..., :1])], axis=-1), axis=-1)

    def log_strengths(self, values: FreeAndRandom) -> Float[np.ndarray, "*n paints"]:
        """Of the paints, from their distribution and the thickness expected; 0 without random
        numbers.

        Draws of both before the readings are moved by what the readings show of their product
        (Matheron's rule: Journel, Huijbregts, Mining Geostatistics, 1978).
        """
        fractions = self.shown(values)
        if values.shape[-1] < self.random.stop:
            return np.zeros_like(fractions)
        thickness, *strengths = np.moveaxis(values[..., self.random], -1, 0)
        before = STRENGTH * np.stack(strengths, axis=-1)
        product = self.spread * thickness + np.sum(fractions * before, axis=-1)
        variance = self.spread**2 + STRENGTH**2 * np.sum(fractions**2, axis=-1)
        off = (values[..., self.thickness].sum(axis=-1) - product) / variance
        return before + STRENGTH**2 * fractions * off[..., None]

    def fraction(self, values: FreeAndRandom, which: int) -> np.ndarray:
        """Of one paint."""
        amounts = self.shown(values) * np.exp(-self.log_strengths(values))
        return amounts[..., which] / amounts.sum(axis=-1)

    def total(self, values: FreeAndRandom) -> np.ndarray:
        """Thickness, m."""
        stronger = np.sum(self.shown(values) * self.log_strengths(values), axis=-1)
        return self.median * np.exp(values[..., self.thickness].sum(axis=-1) - stronger)


def name_unknowns(
    film: Film,
    *,
    kind: str,
    coats: Sequence[CoatPrior],
    median: Float[np.ndarray, "coats"],
    spread: Float[np.ndarray, "coats"],
    grid: Bands,
    shared: FilmShared,
) -> tuple[tuple[str, ...], tuple[Quantity, ...]]:
    """Names of the free unknowns, of which a log-ratio is called by the paint whose share it moves,
    and what is reported of a film.

    Args:
        film: whose unknowns they are.
        kind: of the problem.
        coats: of the film.
        median, spread: of the thicknesses' prior, m, and standard deviation of the log.
        grid: wavelengths, nm.
        shared: with the levels and modes of an unknown paint.
    """
    positions = film.places
    reported: list[Quantity] = []
    names: list[str] = []

    def report(name: str, mean: float, weights: np.ndarray, spectrum: str = "") -> None:
        # Its logarithm is linear in the unknowns.
        def values(free: np.ndarray) -> np.ndarray:
            return np.exp(mean + free[..., : film.dims] @ weights)

        reported.append(Quantity(name, True, values, spectrum))

    unit = np.eye(film.dims)
    for n, coat in enumerate(coats):
        suffix = "" if kind == "paints" else f" of coat {n + 1}"
        members = film.paints[n]
        amounts = _CoatAmounts(
            median=median[n],
            spread=spread[n] if film.thickness[n] else 0.0,
            thickness=positions.thickness[n],
            ratios=positions.ratios[n],
            random=slice(film.dims + members.start + n, film.dims + members.stop + n + 1),
            shares=coat.shares,
        )
        if film.fractions[n]:
            fractions = [f"fraction {paint.name}{suffix}" for paint in coat.paints]
            names += fractions[:-1]
            reported += [
                Quantity(name, False, functools.partial(amounts.fraction, which=i))
                for i, name in enumerate(fractions)
            ]
        if film.thickness[n]:
            names.append(f"thickness{suffix}")
            reported.append(Quantity(names[-1], True, amounts.total))
    if film.spectra:
        # A mode is of k d or of s d alone.
        counts = np.any(shared.modes != 0, axis=1).sum(axis=1)
        for what, count in zip(("k d", "s d"), counts, strict=True):
            names += [f"mode {i + 1} of {what}" for i in range(count)]
        weights = np.swapaxes(shared.modes, 0, 1) @ unit[positions.spectra]
        level_k, level_s = shared.levels
        for wavelength, (k, s) in zip(grid, weights, strict=True):
            for what, mean, weight in (
                ("absorption", level_k, k),
                ("scattering", level_s, s),
                ("ratio", level_k - level_s, k - s),
            ):
                report(f"{what} at {wavelength:g} nm", mean, weight, spectrum=what)
    if film.gloss:
        names.append("gloss")
        reported.append(
            Quantity("gloss", False, lambda free: expit(free[..., positions.gloss.start]))
        )
    names.append("model error")
    report("model error", 0.0, unit[-1])
    return tuple(names), tuple(reported)
