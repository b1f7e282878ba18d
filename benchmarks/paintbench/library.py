"""What a method may learn from, what it is asked, and what it answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from .sources import FOREIGN, UNCLEAR, Sample, Source
from .spectra import GRID, on_grid

NEAREST = 3
"""Spectra of a family that a neighbour's distance is the mean of."""
FALSE_ALARMS = 0.05
"""Share of known paints that a method which only has a distance refuses, on what it learns from."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Samples of several sources on one grid, one row each.

    Attributes:
        readings: of the first camera that covers a band, NaN where none does, (samples, bands).
        families: of each sample's first paint.
        groups: of each sample's source.
        samples: the samples.
    """

    readings: Float[np.ndarray, "samples bands"]
    families: np.ndarray
    groups: np.ndarray
    samples: tuple[Sample, ...]

    def __len__(self) -> int:
        return len(self.samples)

    def take(self, rows: Bool[np.ndarray, "samples"] | Sequence[int]) -> "Table":
        """Some of the samples, by number or by mark."""
        index = [int(i) for i in (np.flatnonzero(rows) if isinstance(rows, np.ndarray) else rows)]
        return Table(
            readings=self.readings[index],
            families=self.families[index],
            groups=self.groups[index],
            samples=tuple(self.samples[i] for i in index),
        )

    def within(self, bands: Bool[np.ndarray, "bands"]) -> "Table":
        """The same samples in some of the bands."""
        return Table(
            readings=self.readings[:, bands],
            families=self.families,
            groups=self.groups,
            samples=self.samples,
        )


def pure_table(sources: Sequence[Source], grid: Float[np.ndarray, "bands"] = GRID) -> Table:
    """All pure samples of some sources whose family is clear, foreign ones among them; there may
    be none.
    """
    readings = [np.empty((0, grid.size))]
    families = []
    groups = []
    samples = []
    for source in sources:
        rows = [row for row in source.chosen("pure") if source.clear(source.samples[row])]
        if not rows:
            continue
        readings.append(grid_readings(source, rows, grid))
        families += [source.families(source.samples[row])[0] for row in rows]
        groups += [source.group] * len(rows)
        samples += [source.samples[row] for row in rows]
    return Table(
        readings=np.concatenate(readings),
        families=np.array(families, dtype=str),
        groups=np.array(groups, dtype=str),
        samples=tuple(samples),
    )


def grid_readings(
    source: Source, rows: Sequence[int], grid: Float[np.ndarray, "bands"] = GRID
) -> Float[np.ndarray, "rows bands"]:
    """Readings of some samples on the grid: of the first camera that covers a band."""
    out = np.full((len(rows), grid.size), np.nan)
    for camera in source.cameras:
        values = on_grid(camera.wavelengths, camera.readings[list(rows)], grid)
        # A second camera is not stitched to the first: it stands where the first has nothing.
        beyond = np.isnan(out).all(axis=0)
        out[:, beyond] = values[:, beyond]
    return out


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a method says of one reading.

    Attributes:
        ranked: sets of families, most probable first; each family of a set is a tuple of those that
            it may be, of one name where it is stated.
        chances: probability of each set, where the method states one.
        doubt: what 'none' is judged by: larger is more foreign.
        refused: whether it says that nothing it knows explains the reading.
        film: what its first set reflects on the grid, where it says so; NaN where it does not.
    """

    ranked: tuple[tuple[tuple[str, ...], ...], ...]
    chances: tuple[float, ...] = ()
    doubt: float
    refused: bool
    film: Float[np.ndarray, "bands"] | None = None


class Namer(Protocol):
    """A method that names families, set up with what it may learn from.

    `families` takes a reading's hidden families: they are not in the answer, as if no source had
    them.
    """

    name: str

    def learn(self, library: Table) -> None:
        """Take a library of pure paints."""
        ...

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Answer for each sample.

        Args:
            unnamed: samples; only their readings may be looked at.
            hidden: for each a family that is to be unknown, or None.
            pairs: whether the samples are of two paints.
        """
        ...


def known_families(library: Table) -> list[str]:
    """Families of a library, without 'foreign'."""
    return sorted(set(library.families.tolist()) - {FOREIGN, *UNCLEAR})


def family_distances(
    distances: Float[np.ndarray, "unnamed known"],
    families: np.ndarray,
    wanted: Sequence[str],
    nearest: int = NEAREST,
) -> Float[np.ndarray, "unnamed families"]:
    """Mean distance to the nearest few spectra of each family; infinite where there is none."""
    out = np.full((len(distances), len(wanted)), np.inf)
    for column, family in enumerate(wanted):
        near = np.sort(distances[:, families == family], axis=1)[:, :nearest]
        there = np.isfinite(near)
        total = np.where(there, near, 0.0).sum(axis=1)
        out[:, column] = np.where(
            there.any(axis=1), total / np.maximum(there.sum(axis=1), 1), np.inf
        )
    return out


def rank_families(
    distances: Float[np.ndarray, "unnamed families"],
    wanted: Sequence[str],
    hidden: Sequence[str | None],
    limit: float,
) -> list[Answer]:
    """Answers by distance: nearest family first, refused beyond a limit."""
    answers = []
    for row, unknown in zip(distances, hidden, strict=True):
        order = [
            int(i)
            for i in np.argsort(row, kind="stable")
            if np.isfinite(row[i]) and wanted[int(i)] != unknown
        ]
        doubt = float(row[order[0]]) if order else np.inf
        answers.append(
            Answer(
                ranked=tuple(((wanted[i],),) for i in order),
                doubt=doubt,
                refused=not doubt <= limit,
            )
        )
    return answers
