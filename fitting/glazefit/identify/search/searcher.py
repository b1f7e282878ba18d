"""A search that is set up once and takes any number of spectra: from checked options to pools of
candidates.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Bool

from glazejax import Pigment
from glazejax.geometry import Geometry, resolve_instrument
from glazejax.spectra import validate_wavelengths

from ...film.errors import BETWEEN_FILMS, Discrepancy, Prior, error_modes, relative_errors
from ...film.films import Instrument, Noise
from ...film.mixing import Pigments
from ...film.optics import Optics
from ...film.response import film_response
from ..result import Pool
from .effort import THOROUGH, USUAL
from .screen import paints_of
from .search import CHUNK, compile_ahead, first_starts, pieces, search
from .table import FilmTables
from .task import IdentificationTask, Measured, check_pigments, check_spectra, hiding
from .unstated_conditions import search_unstated_conditions
from .weigh import Odds

# Spectra whose doubtful ones are sought again together: a few in each chunk would cost as much as
# all of it.
_TOGETHER = 4 * CHUNK


class Searcher(NamedTuple):
    """What all spectra of a catalogue, an instrument and an expectation share.

    Attributes:
        tasks: for films that let their ground through (False), and for films that hide it (True).
        opaque: what was told of the films.
        paints: names of the catalogue's paints.
    """

    tasks: Mapping[bool, IdentificationTask]
    opaque: bool
    paints: tuple[str, ...]

    @classmethod
    def of(
        cls,
        wavelengths: ArrayLike,
        pigments: Pigments,
        *,
        opaque: bool,
        instrument: Instrument | None = None,
        geometry: Geometry | None = None,
        noise: Noise | None = None,
        discrepancy: Discrepancy | None = None,
        prior: Prior | None = None,
        max_paints: int = 3,
        layers: int = 1,
        thorough: bool = False,
    ) -> "Searcher":
        """From the options of `glazefit.identify.identify.identify_chunks`.

        Raises:
            ValueError: an empty catalogue, repeated names, pigments that do not cover the
                wavelengths, numbers of paints or coats that cannot be tried.
        """
        instrument = resolve_instrument(geometry or instrument)
        noise = noise or Noise()
        prior = prior or Prior()
        discrepancy = discrepancy or BETWEEN_FILMS
        if max_paints not in (1, 2, 3):
            raise ValueError(f"max_paints is {max_paints}; sets of 1, 2 or 3 paints can be tried")
        if layers not in (1, 2):
            raise ValueError(f"layers is {layers}; one coat or two can be tried")
        if layers == 2 and opaque:
            raise ValueError(
                "two coats need to know the ground; an opaque film shows its top coat only: use "
                "layers=1"
            )
        grid = validate_wavelengths(np.asarray(wavelengths, dtype=np.float64))
        known = check_pigments(pigments, grid)
        largest = min(max_paints, len(known))
        response = film_response(instrument.geometry, instrument.refractive_index)
        thick = hiding(prior, known)
        errors = relative_errors(known, discrepancy)
        modes = error_modes(known, discrepancy).astype(np.float32)
        seen = hardly_seen(known, prior.thickness)
        optics = Optics.of(instrument.geometry, instrument.refractive_index)

        def task(hidden: bool) -> IdentificationTask:
            expected = thick if hidden else prior
            paints = paints_of(known, expected.thickness)
            return IdentificationTask(
                response=response,
                paints=paints,
                errors=errors,
                modes=modes,
                wavelengths=grid,
                optics=optics,
                surface=instrument.seen_surface,
                noise=noise,
                discrepancy=discrepancy,
                prior=expected,
                extenders=seen,
                max_paints=largest,
                layers=layers,
                effort=THOROUGH if thorough else USUAL,
                tables=FilmTables(response, paints, largest, expected.spread),
            )

        return cls(
            {hidden: task(hidden) for hidden in (False, True)}, opaque, tuple(p.name for p in known)
        )

    @property
    def task(self) -> IdentificationTask:
        """For films as they were told to be."""
        return self.tasks[self.opaque]

    def check(
        self, spectra: ArrayLike, grounds: ArrayLike | None, names: Sequence[str] | None = None
    ) -> Measured:
        """Spectra and grounds in one shape.

        Raises:
            ValueError: shapes that do not match, values that are not reflectances, repeated names.
        """
        return check_spectra(spectra, self.task.wavelengths, grounds, names, self.task.noise)

    def search(self, measured: Measured) -> Iterator[tuple[Measured, Pool, Odds]]:
        """Candidates and their odds, some hundred spectra at a time."""
        compile_ahead(self.task, measured)
        starts = first_starts(self.task, measured)
        for together in pieces(np.arange(len(measured)), _TOGETHER):
            pool = search(self.task, measured, together, starts)
            batch = measured.take(together)
            yield batch, *search_unstated_conditions(self.tasks, self.opaque, batch, pool)


def hardly_seen(pigments: Sequence[Pigment], thickness: float) -> Bool[np.ndarray, "paints"]:
    """Which paints are extenders: a film of this thickness (m) lets most light through at every
    wavelength.
    """
    depth = [
        [float(np.max(np.asarray(values))) for values in (p.absorption, p.scattering)]
        for p in pigments
    ]
    return thickness * np.sum(depth, axis=1) < 1.0
