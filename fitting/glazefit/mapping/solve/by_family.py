"""Families of pigments for the spectra of an image: those that were searched, and the pixels that
each of them stands for.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from glazejax import Pigment
from glazejax.spectra import Bands

from ...film.numerics.columns import Columns
from ...identify.families.identify_pigments import identify_families
from ...identify.families.naming import coloured_first
from ...identify.families.templates import most_films
from ...identify.result import Identification
from ...identify.result.groups import GROUPS, group_of
from ...identify.search.options import IdentificationOptions
from .survey import SpectraReadings
from .update import Answers

# Candidates among which the one that shows a spectrum's first answer is looked for.
_CANDIDATES = 16
# What a search holds for each film that it compares with, and for each band of that.
_BYTES_OF_A_FILM, _BYTES_OF_A_BAND = 500, 16


@dataclass(frozen=True)
class Answered(Columns):
    """Spectra that were searched, and the answer to each.

    Attributes:
        readings: (spectra, bands).
        answers: of each.
    """

    readings: SpectraReadings
    answers: Answers


@dataclass(frozen=True)
class FamilySearcher:
    """Search for families of pigments in the spectra of an image.

    Attributes:
        wavelengths: of the spectra, (bands,), nm.
        pigments: exemplars, each with a family and a source.
        options: of the search.
        opaque: the paint hides its ground.
    """

    wavelengths: Bands
    pigments: tuple[Pigment, ...]
    options: IdentificationOptions
    opaque: bool

    @cached_property
    def paints(self) -> tuple[str, ...]:
        """Names of families and of groups of them, coloured ones first."""
        families = {pigment.family for pigment in self.pigments}
        groups = [group for group, members in GROUPS.items() if families & set(members)]
        return coloured_first([*families, *groups])

    @property
    def memory(self) -> int:
        """Bytes that a search takes, set up or being set up, at most."""
        films = most_films(
            len(self.pigments),
            len({pigment.family for pigment in self.pigments}),
            opaque=self.opaque,
            mixed=self.options.max_paints > 1,
        )
        return films * (_BYTES_OF_A_FILM + _BYTES_OF_A_BAND * len(self.wavelengths))

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.paints)}

    def search(self, readings: SpectraReadings, ground: np.ndarray | None) -> Answered:
        """Search spectra.

        Args:
            readings: of the spectra.
            ground: internal reflectance, (bands,); None where films hide it.
        """
        chunks = identify_families(
            self.wavelengths,
            np.maximum(readings, 0.0),
            self.pigments,
            replace(self.options, keep=_CANDIDATES),
            ground=ground,
            opaque=self.opaque,
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
        return Answered(np.asarray(readings, np.float32), answers)

    def _fill(self, answers: Answers, identification: Identification, row: int) -> None:
        """Write the first answer of one spectrum, and how probable each family is."""
        sets = identification.family_sets[row]
        if not sets:
            return
        for answer in sets:
            for name in answer.families:
                shares = answer.shares(name)
                # The group of a family that was distinguished is as probable as the family.
                shares.setdefault(group_of(name), 1.0)
                for family, share in shares.items():
                    if family in self._numbers:
                        answers.paint_probability[row, self._numbers[family]] += (
                            answer.probability * share
                        )
        first = sets[0]
        answers.probability[row] = first.probability
        members = [self._numbers[name] for name in first.families]
        answers.members[row, : len(members)] = members
        # The film that is shown has the families of the answer, or some of the groups it names.
        for rank, candidate in enumerate(identification.ranked(row)):
            families = [identification.family_of[name] for name in candidate.paints]
            names = [name if name in first.families else group_of(name) for name in families]
            if sorted(names) == sorted(first.families):
                order = [names.index(name) for name in first.families]
                answers.amounts[row, : len(order)] = np.log(candidate.fractions[order])
                answers.covariance[row] = identification.log_covariance[row, rank]
                answers.fitted[row] = candidate.fitted[0]
                answers.misfit[row] = candidate.delta_e
                break
