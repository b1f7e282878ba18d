"""Odds of sets of pigment families for readings: evidence of each computed film, summed by set.

Evidence is the log of how much more probable a reading is as a paint like a template than as any
paint at all (`metric.py`). What it is worth is learnt from the exemplars (`sureness.py`,
`calibration.py`).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax import Pigment
from glazejax.radiative.common.chunks import pieces_of
from glazejax.spectra import Bands

from ...film.numerics.columns import Columns
from ..result.groups import COLOURLESS, GROUPS, answer_of
from ..search.options import IdentificationOptions
from ..search.pool import NOBODY, PerSpectrum
from .evidence import facts_of, log_odds_of_elements, log_odds_of_year
from .features import colours, surface_in, views, with_one_gloss
from .metric import Metric, as_columns, squares_between
from .sureness import PerFamilySet, PerSet, Sureness, log_sum
from .templates import PerExemplar, Templates

ReadSpectra: TypeAlias = Float[np.ndarray, "spectra bands"]
"""A spectrum a row, as it was read or without the surface's part."""
Sources: TypeAlias = Int[np.ndarray, "spectra"]
"""Number of the source whose exemplars are left out, for each spectrum."""
PerTemplate: TypeAlias = Float[np.ndarray, "spectra templates"]
"""A number for each template, of each spectrum."""
Possible: TypeAlias = Bool[np.ndarray, "spectra templates"]
"""True where a template may have the colour of a spectrum."""
ANOTHER_COLOUR = 12.0
"""Colour difference (nearly CIE94) beyond which a film is no explanation of a reading; but for
colours near black, CIEDE2000 is then below 15.
"""
MOST_CHROMA = 14.3
"""Chroma (20 in CIELAB) that a reading without a coloured pigment has at most."""
LIGHTEST_BLACK = 50.0
"""Lightness L* that a reading of a black alone has at most: middle grey."""
# Log evidence of a set whose films all have another colour, however similar the slopes are.
_IMPOSSIBLE = -30.0
# Comparisons of readings with templates that are held at a time.
_COMPARISONS = 3_000_000


def points_in(
    metrics: Sequence[Metric], wavelengths: Bands, readings: Float[np.ndarray, "n bands"]
) -> list[Float[np.ndarray, "n components"]]:
    """Readings without the surface's part as points in the metric of each view."""
    return [
        metric.place(features)
        for metric, features in zip(metrics, views(wavelengths, readings), strict=True)
    ]


class _SetSums(NamedTuple):
    """Evidence of templates, summed over each set's.

    Attributes:
        logs: log mean of each set, next to nothing where all its films have another colour.
        tempered: evidence of the templates, times a power.
        weights: exponentials of these, the largest of each set 1.
        sums: of the weights of each set.
    """

    logs: PerSet
    tempered: PerTemplate
    weights: PerTemplate
    sums: PerSet


@dataclass(frozen=True, kw_only=True)
class FamilyOdds(Columns):
    """Odds that a search gives for some readings.

    Attributes:
        sets: probability of each set of families, (spectra, sets).
        none: probability that it is none of them, (spectra,).
        unlike: whether the reading looks less like them than nearly all paints that are of them.
        best: number of the most probable template of each set, (spectra, sets).
        fraction: mean fraction of each set's first family, (spectra, sets).
        fraction_sd: its standard deviation.
        evidence: log evidence of the best template, (spectra,).
    """

    sets: PerSet
    none: PerSpectrum
    unlike: Bool[np.ndarray, "spectra"]
    best: Int[np.ndarray, "spectra sets"]
    fraction: PerSet
    fraction_sd: PerSet
    evidence: PerSpectrum


@dataclass(frozen=True, kw_only=True)
class FamilySearch:
    """A search among families that is set up once and takes any number of readings.

    Attributes:
        wavelengths: of the readings, nm.
        families: by name.
        exemplars: the paints, and number of each one's family.
        family_of: number of each exemplar's family.
        source_of: number of each exemplar's source.
        members: families of each set by number, `NOBODY` for none, (sets, 2).
        log_prior: of each set.
        unknown: prior probability that it is none of them.
        bands: of the readings, at which they are compared with films.
        metrics: of each view of a spectrum.
        templates: films of all exemplars and of their mixtures.
        usual_coat: unit of their thicknesses, m.
        points: of the templates in each metric (`metric.as_columns`).
        colours: of the templates; None where the bands do not hold the visible.
        set_of: number of each template's set of families, ascending.
        surface: what the outer surface adds to readings.
        sureness: what evidence is worth.
    """

    wavelengths: Bands
    families: tuple[str, ...]
    exemplars: tuple[Pigment, ...]
    family_of: PerExemplar
    source_of: PerExemplar
    members: Int[np.ndarray, "sets 2"]
    log_prior: PerFamilySet
    unknown: float
    bands: Bool[np.ndarray, "bands"]
    metrics: tuple[Metric, ...]
    templates: Templates
    usual_coat: float
    points: tuple[Float[np.ndarray, "components+2 templates"], ...]
    colours: Float[np.ndarray, "templates 3"] | None
    set_of: Int[np.ndarray, "templates"]
    surface: float
    sureness: Sureness

    def odds(
        self,
        readings: ReadSpectra,
        hidden: Bool[np.ndarray, "spectra families"] | None = None,
        sources: Sources | None = None,
    ) -> FamilyOdds:
        """Probabilities of all sets of families.

        Args:
            readings: reflectance factors.
            hidden: families that are taken to be unknown, for each reading.
            sources: number of the source whose exemplars are left out, for each reading.
        """
        chunks = []
        for rows in pieces_of(np.arange(len(readings)), self.chunk):
            any_paint, evidence, possible = self.compare(
                readings[rows], None if sources is None else sources[rows]
            )
            sums = self._sum_by_set(evidence, possible, self.sureness.power)
            best, mean, sd = self._films_of_sets(sums, possible)
            log_sets = sums.logs + self.log_prior
            if hidden is not None:
                # `NOBODY` is the last column, and in no reading hidden.
                padded = np.pad(hidden[rows], ((0, 0), (0, 1)))
                log_sets = np.where(padded[:, self.members].any(axis=-1), -np.inf, log_sets)
            none = self.sureness.none(log_sets, any_paint, self.unknown)
            chunk = FamilyOdds(
                sets=(1.0 - none[:, None]) * self.sureness.share(log_sets, self.log_prior),
                none=none,
                unlike=log_sum(log_sets) < self.sureness.least,
                best=best,
                fraction=mean,
                fraction_sd=sd,
                evidence=evidence.max(axis=1),
            )
            chunks.append(chunk)
        return FamilyOdds.join(chunks)

    def with_facts(self, options: IdentificationOptions) -> "FamilySearch":
        """The same search with odds of its sets that hold what else is known of a painting:
        elements, and the year.

        Raises:
            ValueError: no such element, or one that was found and not found.
        """
        if not (options.elements or options.without_elements) and options.painted is None:
            return self
        sets = [facts_of(names) for names in self.sets]
        fits = log_odds_of_elements(sets, options.elements, options.without_elements)
        fits += log_odds_of_year(sets, options.painted)
        return replace(self, log_prior=self.log_prior + fits)

    @cached_property
    def sets(self) -> list[list[str]]:
        """Names of each set's families."""
        return [
            [self.families[member] for member in row if member != NOBODY]
            for row in self.members.tolist()
        ]

    @cached_property
    def answers(self) -> list[frozenset[str]]:
        """The answer that each set is of (`groups.answer_of`), once for all readings."""
        return [answer_of(names) for names in self.sets]

    @property
    def chunk(self) -> int:
        """Readings that are compared at a time."""
        return max(1, _COMPARISONS // len(self.templates))

    @property
    def grid(self) -> Bands:
        """Wavelengths at which readings are compared with films, nm."""
        return self.wavelengths[self.bands]

    def compare(
        self, readings: ReadSpectra, sources: Sources | None
    ) -> tuple[PerSpectrum, PerTemplate, Possible]:
        """Log density of readings as any paint (`Metric.log_any_paint`), evidence of all templates
        (-inf where one may not be used), and which of these may have their colour; arguments as for
        `odds`.
        """
        body = self.body(readings)
        points = points_in(self.metrics, self.grid, body[:, self.bands])
        # Views are not independent: their mean, a logarithmic pool (Genest and Zidek,
        # Statistical Science 1 (1986) 114), says what both say.
        evidence = np.zeros((len(body), len(self.templates)), dtype=np.float32)
        for metric, places, references in zip(self.metrics, points, self.points, strict=True):
            evidence += metric.log_evidence(places, references)
        evidence /= len(self.metrics)
        if sources is not None:
            of_members = np.append(self.source_of, NOBODY)[self.templates.members]
            same_source = (of_members[None] == sources[:, None, None]).any(axis=-1)
            evidence = np.where(same_source, -np.inf, evidence)
        return self.metrics[0].log_any_paint(points[0]), evidence, self._possible(body)

    def gloss(self, readings: ReadSpectra) -> PerSpectrum:
        """Share of a smooth surface's reflection that is in each reading, 1 or less
        (`features.surface_in`).
        """
        if self.surface == 0:
            return np.ones(len(readings))
        return surface_in(readings, self.surface) / self.surface

    def films(
        self, templates: Int[np.ndarray, "spectra films"], readings: ReadSpectra
    ) -> Float[np.ndarray, "spectra films compared"]:
        """Readings of computed films with as much gloss as is in each reading, at the bands that
        are compared.
        """
        bands = self.bands
        gloss = readings[:, bands] - with_one_gloss(self.body(readings)[:, bands])
        return with_one_gloss(self.templates.readings[templates]) + gloss[:, None]

    def body(self, readings: ReadSpectra) -> ReadSpectra:
        """Readings without the surface's part."""
        return readings - surface_in(readings, self.surface)[:, None]

    def _possible(self, body: ReadSpectra) -> Possible:
        """True where a template may have the colour of a reading without the surface's part; all
        may where no visible range was read.
        """
        read = colours(self.grid, body[:, self.bands])
        if read is None or self.colours is None:
            return np.ones((len(body), len(self.templates)), dtype=bool)
        possible = squares_between(read, as_columns(self.colours)) <= ANOTHER_COLOUR**2
        # Whites, extenders and blacks have hardly a chroma of their own, and one that shows is not
        # theirs.
        chroma = np.hypot(read[:, 1:2], read[:, 2:])
        possible[:, self._made_of(COLOURLESS)] &= chroma <= MOST_CHROMA
        # A thin coat of black over white is grey, and a grey as light as that has other causes.
        possible[:, self._made_of(GROUPS["a black"])] &= read[:, :1] <= LIGHTEST_BLACK
        return np.asarray(possible)

    def _made_of(self, names: Collection[str]) -> Bool[np.ndarray, "templates"]:
        """True for templates that hold none but some families."""
        families = np.append([name in names for name in self.families], True)
        return np.asarray(families[self.members[self.set_of]].all(axis=1))

    def _sum_by_set(self, evidence: PerTemplate, possible: Possible, power: float) -> "_SetSums":
        """Evidence of templates, tempered by a power, averaged over each set's."""
        starts, counts = self._by_set
        tempered = power * evidence
        top = np.maximum.reduceat(tempered, starts, axis=1)
        safe = np.where(np.isfinite(top), top, 0.0)
        weights = np.exp(tempered - np.repeat(safe, counts, axis=1))
        sums = np.add.reduceat(weights, starts, axis=1)
        usable = np.add.reduceat(np.isfinite(tempered), starts, axis=1, dtype=float)
        with np.errstate(divide="ignore"):
            logs = np.log(sums) + safe - np.log(np.maximum(usable, 1.0))
        explains = np.logical_or.reduceat(possible, starts, axis=1)
        return _SetSums(
            logs=np.where(explains, logs, np.minimum(logs, _IMPOSSIBLE)),
            tempered=tempered,
            weights=weights,
            sums=sums,
        )

    def _films_of_sets(
        self, sums: "_SetSums", possible: Possible
    ) -> tuple[Int[np.ndarray, "spectra sets"], PerSet, PerSet]:
        """Best template of each set, of the reading's colour where one is; mean and standard
        deviation of the fraction of its first family.
        """
        starts, counts = self._by_set
        fraction = self.templates.fractions[:, 0]
        totals = np.maximum(sums.sums, 1e-30)
        mean = np.add.reduceat(sums.weights * fraction, starts, axis=1) / totals
        mean = np.clip(mean, 0.0, 1.0)  # Sums of single precision have errors in the last digit.
        square = np.add.reduceat(sums.weights * fraction**2, starts, axis=1) / totals
        ranking = np.where(possible, sums.tempered, sums.tempered + 10.0 * _IMPOSSIBLE)
        best = np.stack(
            [
                start + ranking[:, start : start + count].argmax(axis=1)
                for start, count in zip(starts, counts, strict=True)
            ],
            axis=1,
        )
        return best, mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    @cached_property
    def _by_set(self) -> tuple[Int[np.ndarray, "sets"], Int[np.ndarray, "sets"]]:
        """Where the templates of each set start, and how many there are."""
        _, starts, counts = np.unique(self.set_of, return_index=True, return_counts=True)
        return starts, counts
