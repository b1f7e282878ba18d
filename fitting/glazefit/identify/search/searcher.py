"""A search that is set up once and takes any number of spectra: from options to pools of
candidates and their odds.

A spectrum's way is one arc: screen, fit, refine, weigh. Where the odds leave it in doubt, it goes
the same way again under conditions that nobody stated.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Bool

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.names import first_repeated
from glazejax.paint.media import MAX_THICKNESS
from glazejax.radiative.common.chunks import pieces_of
from glazejax.spectra import Bands, validate_wavelengths

from ...film.films import Noise
from ...film.model.errors import ModelError, Prior, error_modes, relative_errors
from ...film.model.mixing import Pigments, check_paints, listed_pigments
from ...film.model.optics import Optics
from ...film.model.response import film_response
from ...film.noise import noise_of_each
from ...film.shared_bands import SEARCHED, means_of_steps
from .candidates import CHUNK, find_candidates
from .options import IdentificationOptions
from .pool import Pool
from .refine import compile_ahead
from .table import Paints, paints_of
from .task import THOROUGH, USUAL, Chunk, IdentificationTask, Measured, Tasks
from .unstated_conditions import search_unstated_conditions
from .weigh import Odds

# Spectra whose doubtful ones are searched again together: a few in each chunk would cost as much as
# all of it.
_TOGETHER = 4 * CHUNK
# Bands at most: a wide range is averaged to longer steps.
_MOST_BANDS = 100
# Above this a reflectance is a mistake, such as percent; below, it may be a highlight or a
# calibration.
_TOO_BRIGHT = 1.5
UNSEEN_GROUND = 0.5
"""Ground under films that hide it."""


class Searcher(NamedTuple):
    """Search that all spectra of a catalogue, an instrument and an expectation share.

    Attributes:
        tasks: for films that hide their ground, that let it through, and that lie as stated.
        paints: names of the catalogue's paints.
        varnish: what was stated of it.
        averaged: of fine bands, a search at fewer, and the steps that it averages to, nm.
    """

    tasks: Tasks
    paints: tuple[str, ...]
    varnish: str
    averaged: "tuple[Searcher, float] | None"

    @classmethod
    def of(
        cls,
        wavelengths: ArrayLike,
        pigments: Pigments,
        options: IdentificationOptions,
        *,
        opaque: bool = False,
    ) -> "Searcher":
        """From the options of `glazefit.identify`.

        Raises:
            ValueError: an empty catalogue, repeated names, pigments that do not cover the
                wavelengths.
        """
        instrument = resolve_instrument(options.instrument)
        discrepancy = options.discrepancy or ModelError()
        prior = options.prior or Prior()
        grid = validate_wavelengths(wavelengths)
        resampled = check_pigments(pigments, grid)
        paints = paints_of(resampled, prior.thickness)
        showing = IdentificationTask(
            response=film_response(instrument),
            paints=paints,
            errors=relative_errors(resampled, discrepancy),
            modes=error_modes(resampled, discrepancy).astype(np.float32),
            wavelengths=grid,
            optics=Optics.of(instrument),
            surface=instrument.seen_surface,
            noise=options.noise or Noise(),
            discrepancy=discrepancy,
            prior=prior,
            extenders=find_extenders(paints),
            max_paints=min(options.max_paints, len(resampled)),
            effort=THOROUGH if options.thorough else USUAL,
            hides=False,
        )
        thick = opaque_prior(prior, resampled)
        hiding = showing._replace(
            paints=paints_of(resampled, thick.thickness), prior=thick, hides=True
        )
        averaged = None
        step = max(SEARCHED, float(np.ptp(grid)) / _MOST_BANDS)
        mean = means_of_steps(grid, step)
        # Fits at one mean alone say nothing of the bands.
        if mean is not None and mean.shape[1] > 1:
            averaged = cls.of(grid @ mean, pigments, options, opaque=opaque), step
        return cls(
            tasks={False: showing, True: hiding, None: hiding if opaque else showing},
            paints=tuple(p.name for p in resampled),
            varnish=options.varnish or "unknown",
            averaged=averaged,
        )

    @property
    def task(self) -> IdentificationTask:
        """The task for films as they were stated to be."""
        return self.tasks[None]

    @property
    def spread(self) -> float:
        """Standard deviation of the log thickness before the readings, of films that let their
        ground through: the others show no thickness.
        """
        return self.tasks[False].prior.spread

    def measure(
        self, spectra: ArrayLike, ground: ArrayLike | None, names: Sequence[str] | None = None
    ) -> Measured:
        """Spectra and grounds in one shape, with the noise of their readings.

        Raises:
            ValueError: shapes that do not match, values that are not reflectances, repeated names.
        """
        return check_spectra(self.task.wavelengths, spectra, ground, names, self.task.noise)

    def search(self, measured: Measured) -> Iterator[tuple[Measured, Pool, Odds]]:
        """Candidates and their odds, some hundred spectra at a time."""
        searcher, step = self.averaged or (self, 0.0)
        compile_ahead(searcher.task, measured.readings.shape[1])
        for rows in pieces_of(np.arange(len(measured)), _TOGETHER):
            batch = measured.take(rows)
            few = batch.in_steps(step)
            pool = find_candidates(Chunk(searcher.task, few))
            pool, odds = search_unstated_conditions(searcher.tasks, few, pool, self.varnish)
            if few is not batch:
                # Most searches do not need this, and begin sooner without.
                from scipy.interpolate import make_interp_spline

                # Between the means, lines, which go on beyond the first and the last.
                lines = make_interp_spline(few.wavelengths, np.eye(few.wavelengths.size), k=1)
                to_bands = lines(batch.wavelengths).T
                pool = replace(
                    pool, readings=pool.readings @ to_bands, adjusted=pool.adjusted @ to_bands
                )
            yield batch, pool, odds


def check_spectra(
    grid: Bands,
    spectra: ArrayLike,
    ground: ArrayLike | None,
    names: Sequence[str] | None,
    noise: Noise,
) -> Measured:
    """Spectra at wavelengths that were validated, and grounds of legal values, as (spectra,
    grounds, bands); see `glazefit.identify`.

    Raises:
        ValueError: shapes that do not match, values that are not reflectances, or repeated names.
    """
    readings = np.asarray(spectra, dtype=np.float64)
    shape = readings.shape
    if readings.ndim == 1:
        readings = readings[None]
    if readings.ndim == 2:
        readings = readings[:, None]
    if readings.ndim != 3 or readings.shape[-1] != grid.size or 0 in readings.shape:
        raise ValueError(
            f"spectra of shape {shape} are not (bands,), (spectra, bands) or (spectra, grounds, "
            f"bands) with {grid.size} bands"
        )
    # A name for each spectrum, and no name twice.
    labels = tuple(map(str, range(1, len(readings) + 1)) if names is None else names)
    if len(labels) != len(readings):
        raise ValueError(f"{len(labels)} names were given for {len(readings)} spectra")
    if (twice := first_repeated(labels)) is not None:
        raise ValueError(f"two spectra are called {twice!r}; names must differ")
    # Readings are fractions.
    wrong = ~((readings >= 0) & (readings <= _TOO_BRIGHT))
    if wrong.any():
        row, _, band = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(
            f"the reflectance of {labels[row]!r} at {grid[band]:g} nm is {readings[wrong][0]:g}; "
            f"it must be a fraction from 0 to {_TOO_BRIGHT:g} (divide percent by 100)"
        )
    # One ground for all, for each ground of a film, or for each spectrum.
    below = np.asarray(UNSEEN_GROUND if ground is None else ground, dtype=np.float64)
    try:
        below = np.broadcast_to(below, readings.shape)
    except ValueError:
        raise ValueError(
            f"a ground of shape {below.shape} does not fit spectra of shape (spectra, grounds, "
            f"bands) = {readings.shape}"
        ) from None
    # Spectra that are rougher than the stated noise are as noisy as they are rough.
    roughness = noise_of_each(readings).max(axis=-1)[:, None, None]
    return Measured(
        names=labels,
        wavelengths=grid,
        readings=readings,
        grounds=below,
        noise_sd=np.maximum(noise.sd(readings), roughness),
        doubt=np.empty((len(readings), 0, *readings.shape[1:])),
    )


def check_pigments(pigments: Pigments, wavelengths: Bands) -> list[Pigment]:
    """The catalogue on the grid of the spectra.

    Raises:
        ValueError: no pigment, repeated names, several spectra in one pigment, or a grid that is
            too short.
    """
    paints = listed_pigments(pigments)
    if not paints:
        raise ValueError("the catalogue is empty; give at least one pigment")
    check_paints(paints)
    try:
        return [pigment.resample(wavelengths) for pigment in paints]
    except ValueError as error:
        raise ValueError(f"the catalogue does not cover the spectra: {error}") from None


def opaque_prior(prior: Prior, pigments: Sequence[Pigment]) -> Prior:
    """Of films so thick that their ground does not matter: the thickness is set, not searched."""
    typical = np.median([np.median(np.asarray(p.scattering)) for p in pigments])
    # Scattering optical thickness of a film that hides its ground.
    return replace(
        prior, thickness=min(200.0 / max(float(typical), 1.0), MAX_THICKNESS), spread=0.05
    )


def find_extenders(paints: Paints) -> Bool[np.ndarray, "paints"]:
    """True for paints that are extenders: a film of usual thickness lets most light through at
    every wavelength.
    """
    absorption, scattering = (np.asarray(values).max(axis=1) for values in paints)
    return absorption + scattering < 1.0
