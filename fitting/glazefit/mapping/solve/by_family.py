"""Search for families of pigments in the spectra of an image: each stands for those near it."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from glazejax import Pigment
from glazejax.progress import Progress
from glazejax.spectra import Bands

from ...film.model.errors import Prior
from ...identify.families.expected import EXPECTED
from ...identify.families.features import at_brightness_of
from ...identify.families.identify_pigments import identify_families
from ...identify.families.naming import coloured_first
from ...identify.families.set_up import prepare_search
from ...identify.families.templates import most_films
from ...identify.result import Identification
from ...identify.result.groups import GROUPS, group_of
from ...identify.search.options import IdentificationOptions
from ..store.process import give_back
from ..store.windows import BASE
from .answers import Answers
from .features import SpectraReadings, usual_number

# Candidates among which the one that shows a spectrum's first answer is looked for.
_CANDIDATES = 16
# Representatives at most: families differ by more than the distance of two of them.
_REPRESENTATIVES = 1500
# What a search holds for each film that it compares with, and for each band of that.
_BYTES_OF_A_FILM, _BYTES_OF_A_BAND = 500, 16


@dataclass(frozen=True)
class FamilySearcher:
    """Search for families of pigments in the spectra of an image.

    Attributes:
        wavelengths: of the spectra, (bands,), nm.
        pigments: exemplars, each with a family and a source.
        options: of the search.
        ground: internal reflectance, (bands,); None where films hide it.
        kind, piece, brightness: as of `PaintSearcher`.
    """

    wavelengths: Bands
    pigments: tuple[Pigment, ...]
    options: IdentificationOptions
    ground: Bands | None
    kind: ClassVar[type[Answers]] = Answers
    piece: ClassVar[int] = 32
    brightness: ClassVar[bool] = False

    @cached_property
    def paints(self) -> tuple[str, ...]:
        """Names of families and of groups of them, coloured ones first."""
        families = {pigment.family for pigment in self.pigments}
        groups = [group for group, members in GROUPS.items() if families & set(members)]
        return coloured_first([*families, *groups])

    @property
    def prior(self) -> Prior:
        """What was expected."""
        return self.options.prior or EXPECTED

    @property
    def bare(self) -> Bands:
        """Readings of the ground without paint: 1, as where films hide it."""
        return np.ones(len(self.wavelengths))

    def representatives(self, pixels: int, memory: int) -> tuple[int, int]:
        """Representatives of an image at most, and what the process takes before the first window
        at most, bytes; whatever the bound of the memory.
        """
        films = most_films(
            len(self.pigments),
            len({pigment.family for pigment in self.pigments}),
            opaque=self.ground is None,
            mixed=self.options.max_paints > 1,
        )
        search = films * (_BYTES_OF_A_FILM + _BYTES_OF_A_BAND * len(self.wavelengths))
        return min(usual_number(pixels), _REPRESENTATIVES), BASE + search

    def prepare(self, progress: Progress) -> None:
        """Set the search up, which the first spectrum would wait for otherwise.

        Args:
            progress: called as it is set up.
        """

        def note(done: int, total: int | None, stage: str, /) -> None:
            give_back()
            progress(done, total, stage)

        prepare_search(self.wavelengths, self.pigments, self.options, self.ground, note)

    def answers(
        self, readings: SpectraReadings, noise_sd: SpectraReadings
    ) -> dict[str, np.ndarray]:
        """Answers of the search, by the names of a map's arrays; see `search`."""
        return self.search(readings, noise_sd).columns(self.prior)

    def search(self, readings: SpectraReadings, noise_sd: SpectraReadings) -> Answers:
        """Search spectra.

        Args:
            readings: of the spectra.
            noise_sd: of their readings, of which families make nothing.
        """
        chunks = identify_families(
            self.wavelengths,
            np.maximum(readings, 0.0),
            self.pigments,
            replace(self.options, keep=_CANDIDATES),
            ground=self.ground,
            opaque=self.ground is None,
            names=None,
        )
        identification = Identification.join(list(chunks))
        answers = Answers.empty(len(identification), len(self.paints), readings.shape[1])
        # A search by family gives no thickness.
        answers.opaque[:] = True
        answers.none[:] = identification.none
        answers.explained[:] = identification.explained
        answers.paint_probability[:] = 0.0
        for row in range(len(identification)):
            self._fill(answers, identification, row)
        return answers

    def _fill(self, answers: Answers, identification: Identification, row: int) -> None:
        """Write the first answer of one spectrum, and how probable each family is."""
        sets = identification.family_sets[row]
        for answer in sets:
            for name in answer.families:
                shares = answer.shares(name)
                # The group of a family that was distinguished is as probable as the family.
                shares.setdefault(group_of(name), 1.0)
                for family, share in shares.items():
                    if family in self.paints:
                        number = self.paints.index(family)
                        answers.paint_probability[row, number] += answer.probability * share
        first = sets[0]
        answers.probability[row] = first.probability
        members = [self.paints.index(name) for name in first.families]
        answers.members[row, : len(members)] = members
        # The film that is shown has the families of the answer, or some of the groups it names.
        for rank, candidate in enumerate(identification.ranked(row)):
            families = [identification.family_of[name] for name in candidate.paints]
            names = [name if name in first.families else group_of(name) for name in families]
            if sorted(names) == sorted(first.families):
                order = [names.index(name) for name in first.families]
                answers.amounts[row, : len(order)] = np.log(candidate.fractions[order])
                answers.covariance[row] = identification.log_covariance[row, rank]
                reading = identification.measured.readings[row, 0]
                answers.fitted[row] = at_brightness_of(reading, candidate.fitted[0])[0]
                answers.misfit[row] = candidate.delta_e
                break
