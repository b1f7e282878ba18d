"""glazejax on the bench: `glazefit.identify` for names and amounts, `recover_jointly` and
`predict_mixture` for mixtures.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from benchmarks.kubelka_munk import KubelkaMunk
from glazefit import (
    Films,
    Identification,
    IdentificationOptions,
    identify,
    predict_mixture,
    recover_jointly,
)
from glazefit.film.films import Instrument
from glazefit.film.model.response import Response, film_response
from glazefit.film.readers import loose_films
from glazefit.identify.families.expected import EXPECTED
from glazefit.identify.families.naming import name_sets
from glazefit.identify.families.references import References, references_of
from glazefit.identify.families.search import FamilySearch
from glazefit.identify.families.set_up import search_families
from glazefit.identify.result.groups import FamilySet
from glazefit.recover.joint.joint import UNIT
from glazefit.recover.predict.crossvalidation import cross_validate
from glazefit.recover.predict.prediction import Prediction, predict_films
from glazejax import Pigment, catalogue
from glazejax.io import SpectraTable

from .library import Answer, Table
from .mixers import Mixtures, Predicted
from .sources import COLOURLESS, FOREIGN, WHITE_CARD, Source
from .spectra import GRID, bounded

# Grid of the two catalogues of films, and how many different sets are kept.
_FILM_GRID = np.arange(410.0, 701.0, 10.0)
_KEPT = 6
# Thickness that hides the ground, m, in the joint fit's own unit of 25 micrometres.
_THICK = 5e-3
_INSTRUMENT = "45:0"
# What is expected of a sample that is said to be of two paints.
_OF_TWO = replace(EXPECTED, sizes=(0.02, 0.95, 0.03))
# Catalogue -> the source that it was made from.
_MADE_FROM = {"oils": "revigo", "acrylics": "golden"}


class FamilyCatalogue:
    """Families among the exemplars that ship, without those of the sources that are hidden."""

    name = "glazejax"

    def __init__(
        self,
        instrument: str = _INSTRUMENT,
        elements: bool = False,
        references: str = "",
        own_paints: str = "",
    ):
        """For an instrument; with or without the elements that each sample's pigment holds, with or
        without the samples of a group as reference paints, or with the exemplars of a group instead
        of all others of their families.
        """
        self._instrument = instrument
        self._elements = elements
        self._references = references
        self._own_paints = own_paints
        if instrument != _INSTRUMENT:
            self.name = f"glazejax, {instrument}"
        if elements:
            self.name = "glazejax, elements"
        if references:
            self.name = "glazejax, references"
        if own_paints:
            self.name = "glazejax, own paints"

    def learn(self, library: Table) -> None:
        """Choose the exemplars whose source may be learnt from, and the bands that are there."""
        groups = set(library.groups.tolist())
        shelf = catalogue.load("pigments").values()
        self._pigments = [p for p in shelf if p.source in groups]
        own = [p for p in shelf if p.source == self._own_paints]
        families = {p.family for p in own}
        self._pigments = own + [p for p in self._pigments if p.family not in families]
        if self._references in groups:
            self._pigments += references_in(library, self._references, self._instrument).pigments
        self._searches: dict[tuple[bytes, bool], FamilySearch] = {}

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Sets of families of films that are said to hide their ground; groups of families where
        one is named.
        """
        seen = np.isfinite(unnamed.readings).all(axis=0)
        # Bands are no finer than exemplars are known.
        bands = np.flatnonzero(seen & (GRID % 10 == 0))
        try:
            search = self._search(bands, pairs)
        except ValueError:  # Too few exemplars are left: nothing can be named.
            return [Answer(ranked=(), doubt=np.inf, refused=True)] * len(unnamed)
        unknown = np.zeros((len(unnamed), len(search.families)), dtype=bool)
        for row, family in enumerate(hidden):
            if family in search.families:
                unknown[row, search.families.index(family)] = True
        if self._elements:
            return self._answers_with_elements(search, unnamed, bands, unknown)
        return self._answers(search, unnamed.readings[:, bands], bands, unknown)

    def _answers_with_elements(
        self,
        search: FamilySearch,
        unnamed: Table,
        bands: Int[np.ndarray, "bands"],
        unknown: Bool[np.ndarray, "samples families"],
    ) -> list[Answer]:
        """Answers to samples of which X-ray fluorescence found all heavy elements and no other."""
        about = catalogue.families()
        answers: list[Answer | None] = [None] * len(unnamed)
        for family in np.unique(unnamed.families):
            rows = np.flatnonzero(unnamed.families == family)
            found = about[family].elements if family in about else ()
            known = search.with_facts(IdentificationOptions(elements=found))
            readings = unnamed.readings[np.ix_(rows, bands)]
            for row, answer in zip(
                rows, self._answers(known, readings, bands, unknown[rows]), strict=True
            ):
                answers[row] = answer
        return [answer for answer in answers if answer is not None]

    def _answers(
        self,
        search: FamilySearch,
        readings: Float[np.ndarray, "samples bands"],
        bands: Int[np.ndarray, "bands"],
        unknown: Bool[np.ndarray, "samples families"],
    ) -> list[Answer]:
        odds = search.odds(readings, hidden=unknown)
        answers = []
        first = odds.sets.argmax(axis=1)[:, None]
        films = search.films(np.take_along_axis(odds.best, first, axis=1), readings)[:, 0]
        for chances, none, unlike, body in zip(
            odds.sets, odds.none, odds.unlike, films, strict=True
        ):
            answer = answer_of_sets(
                name_sets(search, chances), float(none), bool(unlike) or none >= 0.5
            )
            film = np.full(GRID.size, np.nan)
            film[bands[search.bands]] = body
            answers.append(replace(answer, film=film))
        return answers

    def _search(self, bands: Int[np.ndarray, "bands"], pairs: bool) -> FamilySearch:
        key = (bands.tobytes(), pairs)
        if key not in self._searches:
            self._searches[key] = search_families(
                GRID[bands],
                self._pigments,
                IdentificationOptions(
                    instrument=self._instrument, prior=_OF_TWO if pairs else EXPECTED
                ),
            )
        return self._searches[key]


def answer_of_sets(sets: Sequence[FamilySet], none: float, refused: bool) -> Answer:
    """What a search by families answers: its sets with the families of each group that it names,
    how probable it is that the reading is none of them, and whether it is refused.
    """
    return Answer(
        ranked=tuple(
            tuple(tuple(answer.shares(name)) for name in answer.families) for answer in sets
        ),
        chances=tuple(answer.probability for answer in sets),
        doubt=none,
        refused=refused,
    )


def references_in(library: Table, group: str, instrument: str) -> References:
    """The samples of a group as a user's reference paints."""
    own = library.take((library.groups == group) & (library.families != FOREIGN))
    bands = np.isfinite(own.readings).all(axis=0)
    names = tuple(sample.name for sample in own.samples)
    films = loose_films(SpectraTable(GRID[bands], names, own.readings[:, bands]))
    families = dict(zip(names, own.families.tolist(), strict=True))
    return references_of(films, families, instrument=instrument, source=group)


class FilmCatalogues:
    """Identification among the oils and acrylics that ship, each paint read as its family."""

    name = "glazejax, own films"

    def learn(self, library: Table) -> None:
        """Choose the catalogues whose own source may be learnt from."""
        groups = set(library.groups.tolist())
        self._pigments: dict[str, Pigment] = {}
        self._family: dict[str, str] = {}
        for shelf, source in _MADE_FROM.items():
            if source not in groups:
                continue
            for name, pigment in catalogue.load(shelf).items():
                family = catalogue.families_of(shelf)[name] or FOREIGN
                self._pigments[f"{shelf}:{name}"] = pigment.renamed(f"{shelf}:{name}")
                self._family[f"{shelf}:{name}"] = family

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Sets of families by `Identification.ranked`, of films that are said to hide their
        ground.
        """
        answers: list[Answer | None] = [None] * len(unnamed)
        for unknown in dict.fromkeys(hidden):
            rows = [row for row, family in enumerate(hidden) if family == unknown]
            pigments = {
                name: pigment
                for name, pigment in self._pigments.items()
                if self._family[name] != unknown
            }
            for row, answer in zip(rows, self._answers(unnamed.take(rows), pigments), strict=True):
                answers[row] = answer
        return [answer for answer in answers if answer is not None]

    def _answers(self, unnamed: Table, pigments: dict[str, Pigment]) -> list[Answer]:
        columns = np.searchsorted(GRID, _FILM_GRID)
        seen = np.isfinite(unnamed.readings[:, columns]).all(axis=0)
        readings = np.clip(bounded(unnamed.readings[:, columns[seen]]), 0.0, 1.0)
        found = identify(
            _FILM_GRID[seen],
            readings,
            pigments,
            opaque=True,
            instrument=_INSTRUMENT,
            max_paints=2,
        )
        out = []
        for row in range(len(unnamed)):
            chances: dict[frozenset[str], float] = {}
            for candidate in found.ranked(row):
                families = frozenset(self._family[paint] for paint in candidate.paints)
                chances[families] = chances.get(families, 0.0) + candidate.probability
            order = sorted(chances, key=lambda families: -chances[families])[:_KEPT]
            out.append(
                Answer(
                    ranked=tuple(
                        tuple((family,) for family in coloured_first(families))
                        for families in order
                    ),
                    chances=tuple(chances[families] for families in order),
                    doubt=float(found.none[row]),
                    refused=bool(not found.explained[row]),
                )
            )
        return out


def coloured_first(families: frozenset[str]) -> list[str]:
    """Families of a set, whites, extenders and blacks last."""
    return sorted(families, key=lambda family: (family in COLOURLESS, family == FOREIGN, family))


class JointFit:
    """k and s of a source's paints by `recover_jointly`, mixtures by `predict_mixture`, amounts by
    `identify` among the paints that are there: of films that hide what is below them.
    """

    name = "glazejax"

    def learn(self, films: Mixtures) -> None:
        """Fit all films at once."""
        self._films = films
        readings = np.clip(bounded(films.readings), 0.0, 1.0)
        count, bands = readings.shape
        recovery = recover_jointly(
            Films(
                names=films.names,
                wavelengths=films.wavelengths,
                bare_black=np.full((count, bands), 0.025),
                bare_white=np.full((count, bands), 0.9),
                over_black=readings,
                over_white=readings,
                seen=np.tile([True, False], (count, 1)),
                assumed=np.ones((count, 2), dtype=bool),
                opaque=np.ones(count, dtype=bool),
            ),
            recipes_of(films),
            instrument=_INSTRUMENT,
        )
        self._pigments: dict[str, Pigment] = recovery.pigments(UNIT)

    def predict(self, recipes: Float[np.ndarray, "films paints"]) -> Predicted:
        """Each mixture so thick that nothing shines through."""
        found: list[Prediction] = []
        for fractions in recipes:
            found += predict_mixture(
                self._pigments,
                recipe_of(self._films.paints, fractions),
                [_THICK],
                wavelengths=self._films.wavelengths,
                instrument=_INSTRUMENT,
            )
        bands = [prediction.interval() for prediction in found]
        drawn = [prediction.draws[:, 0] - prediction.over_black for prediction in found]
        return Predicted(
            readings=np.stack([prediction.over_black for prediction in found]),
            low=np.stack([low[0] for low, _ in bands]),
            high=np.stack([high[0] for _, high in bands]),
            expected=np.array([np.sqrt(np.mean(off**2)) for off in drawn]),
        )

    def amounts(
        self, readings: Float[np.ndarray, "films bands"], there: Bool[np.ndarray, "films paints"]
    ) -> Float[np.ndarray, "films paints"]:
        """Fractions of the best set that holds all paints that are there."""
        out = np.zeros(there.shape)
        seen = np.clip(bounded(readings), 0.0, 1.0)
        for members in {tuple(row) for row in there.tolist()}:
            rows = np.flatnonzero((there == np.array(members)).all(axis=1))
            codes = [p for p, is_there in zip(self._films.paints, members, strict=True) if is_there]
            found = identify(
                self._films.wavelengths,
                seen[rows],
                {code: self._pigments[code] for code in codes},
                opaque=True,
                instrument=_INSTRUMENT,
                max_paints=min(len(codes), 3),
            )
            for number, row in enumerate(rows):
                out[row] = _amounts_of(found, number, codes, self._films.paints)
        return out


def _amounts_of(
    found: Identification, row: int, codes: Sequence[str], paints: Sequence[str]
) -> Float[np.ndarray, "paints"]:
    """Fractions of the most probable set that holds all paints, or of the most probable one."""
    ranked = found.ranked(row)
    whole = [candidate for candidate in ranked if set(candidate.paints) == set(codes)]
    best = (whole or ranked)[0]
    out = np.zeros(len(paints))
    for paint, part in zip(best.paints, best.fractions, strict=True):
        out[list(paints).index(paint)] = part
    return out


def recipe_of(paints: Sequence[str], fractions: Float[np.ndarray, "paints"]) -> dict[str, float]:
    """Paint -> fraction, of the paints that are there."""
    return {p: float(part) for p, part in zip(paints, fractions, strict=True) if part > 0}


def recipes_of(films: Mixtures) -> dict[str, dict[str, float]]:
    """Film -> paint -> fraction."""
    return {
        name: recipe_of(films.paints, fractions)
        for name, fractions in zip(films.names, films.fractions, strict=True)
    }


class FilmsOverCards:
    """Films that were read over a white and a black card, whose cards were read bare: the same
    joint fit with this program's optics or with Kubelka-Munk's.

    A film's thickness is not in its recipe, so each is predicted with its thickness fitted to its
    own readings. The bands are those that films of the library which were left out in turn taught.
    """

    def __init__(self, name: str, response: Callable[[Instrument], Response]):
        self.name = name
        self._response = response

    def predict(
        self, taught: Films, tests: Films, recipes: Mapping[str, Mapping[str, float]]
    ) -> Predicted:
        """Readings over black and white of films that were not learnt from, film by film."""
        response = self._response(Instrument())
        recovery = recover_jointly(taught, recipes, response=response)
        left_out = cross_validate(recovery, taught, recipes, response=response)
        found = predict_films(
            recovery, tests, recipes, variation=left_out.variation, response=response
        )
        bands = [prediction.interval() for prediction in found]
        drawn = [prediction.draws - prediction.reflectance for prediction in found]
        return Predicted(
            readings=np.concatenate([prediction.reflectance for prediction in found]),
            low=np.concatenate([low for low, _ in bands]),
            high=np.concatenate([high for _, high in bands]),
            expected=np.concatenate([np.sqrt(np.mean(off**2, axis=(0, 2))) for off in drawn]),
        )


def over_cards() -> list[FilmsOverCards]:
    """This program's optics, and Kubelka-Munk's."""
    return [FilmsOverCards("glazejax", film_response), FilmsOverCards("Kubelka-Munk", KubelkaMunk)]


def films_over_cards(source: Source, rows: Sequence[int]) -> Films:
    """Films whose samples come in pairs, over white and then over black."""
    assert source.bare is not None
    camera = source.cameras[0]
    white = [row for row in rows if source.samples[row].support == WHITE_CARD]
    return Films(
        names=tuple(source.samples[row].name.removesuffix(" over white") for row in white),
        wavelengths=camera.wavelengths,
        bare_black=source.bare[[row + 1 for row in white]],
        bare_white=source.bare[white],
        over_black=camera.readings[[row + 1 for row in white]],
        over_white=camera.readings[white],
    )
