"""A report in the making: looks closer at what an identification finishes."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from glazejax import Pigment

from ...film.films import Instrument
from ...film.model.errors import ModelError, Prior
from ..result import Identification
from .bands import expected_bands
from .figures import FITS
from .record import RunProvenance, make_record


class ReportBuilder:
    """Builder of a report's record next to the identification itself.

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
        arguments = self._pigments, self._instrument
        for chunk in chunks:
            errors = {"prior": self._prior, "discrepancy": self._discrepancy}
            self._parts.append(expected_bands(chunk, *arguments, **errors, count=FITS))
            yield chunk

    def record(
        self, identification: Identification, about: RunProvenance, top: int
    ) -> dict[str, Any]:
        """Record of the parts that were passed on; see `glazefit.identify.show.record`."""
        # An interrupt may have come after a part was looked at and before it was taken.
        return make_record(
            identification, np.concatenate(self._parts)[: len(identification)], about, top
        )
