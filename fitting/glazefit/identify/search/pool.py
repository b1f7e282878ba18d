"""Candidates of spectra while they are searched for."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from ...film.numerics.columns import Columns

PerSpectrum: TypeAlias = Float[np.ndarray, "spectra"]
"""A number for each spectrum."""
PerCandidate: TypeAlias = Float[np.ndarray, "spectra candidates"]
"""A number for each candidate of each spectrum."""
CandidateReadings: TypeAlias = Float[np.ndarray, "spectra candidates *readings"]
"""Readings of each candidate: while it is fitted over all grounds in one row, then over each
ground.
"""
NOBODY = -1
"""Stands where a candidate has fewer than three paints."""


@dataclass(frozen=True)
class Pool(Columns):
    """Candidates of some spectra, not yet compared; three places each, filled up with `NOBODY`."""

    members: Int[np.ndarray, "spectra candidates 3"]
    coats: Int[np.ndarray, "spectra candidates 3"]
    logs: Float[np.ndarray, "spectra candidates 3"]  # log amounts that come nearest the readings
    weighed: Float[np.ndarray, "spectra candidates 3"]  # and the most probable ones
    covariance: Float[np.ndarray, "spectra candidates 3 3"]
    log_weight: PerCandidate  # log evidence and log prior of the set
    readings: CandidateReadings
    adjusted: CandidateReadings  # moved by the likeliest errors of the paints' coefficients
    gloss: PerCandidate
    # By number, see `unstated_conditions.CONDITIONS`.
    condition: Int[np.ndarray, "spectra candidates"]

    def merge(self, *pools: "Pool") -> "Pool":
        """Candidates of all for the same spectra."""
        arrays = [pool.arrays() for pool in (self, *pools)]
        return Pool(
            **{name: np.concatenate([a[name] for a in arrays], axis=1) for name in arrays[0]}
        )

    def choose(self, chosen: Int[np.ndarray, "spectra kept"]) -> "Pool":
        """Some candidates of each spectrum, by number."""
        rows = np.arange(len(chosen))[:, None]
        return Pool(**{name: values[rows, chosen] for name, values in self.arrays().items()})

    def spread(self, rows: Int[np.ndarray, "rows"], count: int) -> "Pool":
        """This pool of one row or more as rows of `count` spectra, side by side where a spectrum
        comes more than once; all other places are empty, with a weight of -inf.
        """
        order = np.argsort(rows, kind="stable")
        column = np.arange(len(rows)) - np.searchsorted(rows[order], rows[order])
        shape = (count, int(column.max()) + 1)
        at = rows[order], column

        def side_by_side(values: np.ndarray, nothing: float) -> np.ndarray:
            padded = np.full((*shape, *values.shape[1:]), nothing, values.dtype)
            padded[at] = values[order]
            return padded.reshape(count, -1, *values.shape[2:])

        empty = {"members": NOBODY, "log_weight": -np.inf}
        return Pool(
            **{
                name: side_by_side(values, empty.get(name, 0))
                for name, values in self.arrays().items()
            }
        )
