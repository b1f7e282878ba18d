"""A report in the making: looks closer at what an identification finishes, and files it
in the end.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from glazejax import Pigment

from ...film.films import Instrument
from ...film.model.errors import ModelError, Prior
from ..result import Identification
from .bands import expected_bands
from .figures import FITS
from .page import write_page
from .record import Provenance, make_record


class ReportBuilder:
    """What a report needs beside the identification itself.

    Args:
        pigments: the catalogue.
        instrument, discrepancy, prior: of the identification.
    """

    def __init__(
        self,
        pigments: Sequence[Pigment],
        instrument: Instrument,
        *,
        discrepancy: ModelError,
        prior: Prior,
    ):
        self._pigments, self._instrument = pigments, instrument
        self._discrepancy, self._prior = discrepancy, prior
        self._parts: list[np.ndarray] = []

    def watch(self, chunks: Iterable[Identification]) -> Iterator[Identification]:
        """The parts of an identification, each looked at before it is passed on."""
        given = self._pigments, self._instrument
        for part in chunks:
            errors = {"prior": self._prior, "discrepancy": self._discrepancy}
            self._parts.append(expected_bands(part, *given, **errors, count=FITS))
            yield part

    def write(
        self,
        found: Identification,
        about: Provenance,
        path: Path,
        top: int,
        *,
        overwrite: bool = False,
    ) -> tuple[Path, Path]:
        """Write the page of the parts that were passed on; see
        `glazefit.identify.show.page.write_page`.
        """
        # An interrupt may have come after a part was looked at and before it was taken.
        bands = np.concatenate(self._parts)[: len(found)]
        return write_page(make_record(found, bands, about, top), path, overwrite=overwrite)
