"""Methods that name families without a model of paint: nearest spectra, unmixing, a classifier."""

import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import softmax

from benchmarks.paintbench.library import (
    FALSE_ALARMS,
    Answer,
    Namer,
    Table,
    family_distances,
    known_families,
    rank_families,
)
from benchmarks.paintbench.sources import COLOURLESS
from benchmarks.paintbench.spectra import (
    absorbance,
    complete_rows,
    cosine_distance,
    finite_columns,
    log_ratio,
    slopes,
)
from benchmarks.rivals.baselines import shares_of, unmix

Feature = Callable[[Float[np.ndarray, "n bands"]], Float[np.ndarray, "n less"]]


class Neighbours:
    """Nearest families by one minus the cosine of some features of the spectra.

    A family's distance is the mean of its three nearest spectra. The limit of 'none' refuses a
    twentieth of what the library's sources would be named by each other.
    """

    def __init__(self, name: str, features: Sequence[Feature]):
        self.name = name
        self._features = features

    def learn(self, library: Table) -> None:
        """Take a library, and find the distance from which on a reading is refused."""
        self._library = library
        self._families = known_families(library)
        self._limit = np.inf
        distances = self._distances(library)
        distances = np.where(library.groups[:, None] == library.groups, np.inf, distances)
        known = np.isin(library.families, self._families)
        nearest = family_distances(distances, library.families, self._families).min(axis=1)
        named = nearest[known & np.isfinite(nearest)]
        if named.size:
            self._limit = float(np.quantile(named, 1.0 - FALSE_ALARMS))

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Nearest first; pure paints only, whatever is asked."""
        distances = family_distances(
            self._distances(unnamed), self._library.families, self._families
        )
        return rank_families(distances, self._families, hidden, self._limit)

    def _distances(self, unnamed: Table) -> Float[np.ndarray, "unnamed known"]:
        return np.sum(
            [
                cosine_distance(feature(unnamed.readings), feature(self._library.readings))
                for feature in self._features
            ],
            axis=0,
        )


def slope_of_log_ratio(readings: Float[np.ndarray, "n bands"]) -> Float[np.ndarray, "n less"]:
    """Slopes of log K/S."""
    return slopes(log_ratio(readings))


def slope_of_absorbance(readings: Float[np.ndarray, "n bands"]) -> Float[np.ndarray, "n less"]:
    """Slopes of -log R."""
    return slopes(absorbance(readings))


def _sources_apart(library: Table) -> Iterator[tuple[Table, Table]]:
    """For each source all others, and its own samples of families that the others have."""
    for group in sorted(set(library.groups)):
        others = library.take(library.groups != group)
        rest = library.take(
            (library.groups == group) & np.isin(library.families, known_families(others))
        )
        if len(rest) and len(others):
            yield others, rest


class Unmixing:
    """Non-negative least squares of -log R from one mean spectrum of each family and a constant."""

    name = "NNLS of -log R"

    # Below this share a component counts as not there.
    _present = 0.05

    def learn(self, library: Table) -> None:
        """Means of -log R of each family, and the misfit from which on a reading is refused."""
        self._library = library
        self._limit = np.inf
        misfits = [
            answer.doubt
            for others, rest in _sources_apart(library)
            for answer in self._answers(others, rest, [None] * len(rest), pairs=False)
        ]
        if misfits:
            self._limit = float(np.quantile(misfits, 1.0 - FALSE_ALARMS))

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Largest shares first: of pairs the two largest together."""
        return self._answers(self._library, unnamed, hidden, pairs)

    def _answers(
        self, library: Table, unnamed: Table, hidden: Sequence[str | None], pairs: bool
    ) -> list[Answer]:
        usable = np.isfinite(library.readings[:, finite_columns([unnamed.readings])]).mean(axis=1)
        library = library.take(usable > 0.5)
        families = known_families(library)
        values = absorbance(library.readings)
        answers = []
        for reading, unknown in zip(absorbance(unnamed.readings), hidden, strict=True):
            wanted = [family for family in families if family != unknown]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # bands that a family has not
                means = np.stack(
                    [np.nanmean(values[library.families == family], axis=0) for family in wanted]
                )
            bands = np.isfinite(reading) & np.isfinite(means).all(axis=0)
            # Where some families lack bands, what all have decides.
            if bands.sum() < 10:
                bands = np.isfinite(reading)
                there = complete_rows(means[:, bands])
                wanted = [family for family, has in zip(wanted, there, strict=True) if has]
                means = means[there]
            matrix = np.column_stack([means[:, bands].T, np.ones(int(bands.sum()))])
            amounts, misfit = unmix(matrix, reading[None, bands])
            shares = shares_of(amounts[0, :-1])
            answers.append(self._answer(wanted, shares, float(misfit[0]), pairs))
        return answers

    def _answer(
        self, wanted: Sequence[str], shares: np.ndarray, misfit: float, pairs: bool
    ) -> Answer:
        order = [wanted[int(i)] for i in np.argsort(-shares, kind="stable")]
        if pairs:
            coloured = [family for family in order if family not in COLOURLESS]
            singles = [((family,),) for family in coloured[:4]]
            pairs_of = [((a,), (b,)) for a, b in itertools.combinations(coloured[:4], 2)]
            second = sorted(shares)[-2] if len(shares) > 1 else 0.0
            ranked = [*pairs_of, *singles] if second > self._present else [*singles, *pairs_of]
        else:
            ranked = [((family,),) for family in order]
        return Answer(ranked=tuple(ranked), doubt=misfit, refused=not misfit <= self._limit)


class Classifier:
    """Logistic regression, or a support vector machine with radial kernel (both scikit-learn), on
    the first principal components of slopes of -log R and log K/S.

    A hidden family's probability is shared by the others. Of a support vector machine margins take
    the place of log probabilities.
    """

    def __init__(self, *, support_vectors: bool = False):
        self.name = "SVM on slopes" if support_vectors else "linear classifier"
        self._support_vectors = support_vectors

    # Principal components that are kept.
    _components = 25

    def learn(self, library: Table) -> None:
        """Take a library; it is fitted to the bands that are asked."""
        self._library = library
        self._fitted: dict[bytes, Any] = {}
        doubts = []
        for others, rest in _sources_apart(library):
            model, bands = self._fit(others, rest)
            chances = self._chances(model, rest.readings[:, bands])
            doubts += (1.0 - chances.max(axis=1)).tolist()
        self._limit = float(np.quantile(doubts, 1.0 - FALSE_ALARMS)) if doubts else np.inf

    def answer(self, unnamed: Table, hidden: Sequence[str | None], pairs: bool) -> list[Answer]:
        """Most probable first; pure paints only, whatever is asked."""
        key = finite_columns([unnamed.readings]).tobytes()
        if key not in self._fitted:
            self._fitted[key] = self._fit(self._library, unnamed)
        model, bands = self._fitted[key]
        families = [str(family) for family in model.classes_]
        answers = []
        probabilities = self._chances(model, unnamed.readings[:, bands])
        for chances, unknown in zip(probabilities, hidden, strict=True):
            chances = np.where([family == unknown for family in families], 0.0, chances)
            chances = chances / max(chances.sum(), 1e-300)
            order = [int(i) for i in np.argsort(-chances, kind="stable") if chances[i] > 0]
            doubt = 1.0 - float(chances.max())
            answers.append(
                Answer(
                    ranked=tuple(((families[i],),) for i in order),
                    chances=tuple(float(chances[i]) for i in order),
                    doubt=doubt,
                    refused=doubt > self._limit,
                )
            )
        return answers

    def _fit(self, library: Table, unnamed: Table) -> tuple[Any, Bool[np.ndarray, "bands"]]:
        """A model for the bands that the readings to be named have and enough of the library, too."""
        from sklearn.decomposition import PCA  # pyright: ignore[reportMissingImports]
        from sklearn.linear_model import LogisticRegression  # pyright: ignore[reportMissingImports]
        from sklearn.pipeline import make_pipeline  # pyright: ignore[reportMissingImports]
        from sklearn.preprocessing import StandardScaler  # pyright: ignore[reportMissingImports]
        from sklearn.svm import SVC  # pyright: ignore[reportMissingImports]

        learnt = library.take(np.isin(library.families, known_families(library)))
        bands = finite_columns([unnamed.readings])
        usable = complete_rows(learnt.readings[:, bands])
        if usable.mean() < 0.5:  # Bands that few sources have are left out.
            bands = bands & (np.isfinite(learnt.readings).mean(axis=0) > 0.5)
            usable = complete_rows(learnt.readings[:, bands])
        learnt = learnt.take(usable)
        x = self._features(learnt.readings[:, bands])
        model = make_pipeline(
            StandardScaler(),
            PCA(n_components=min(self._components, *x.shape)),
            SVC(C=10.0) if self._support_vectors else LogisticRegression(max_iter=100, tol=1e-3),
        )
        model.fit(x, learnt.families)
        return model, bands

    def _chances(
        self, model: Any, readings: Float[np.ndarray, "n bands"]
    ) -> Float[np.ndarray, "n families"]:
        features = self._features(readings)
        if self._support_vectors:
            return softmax(model.decision_function(features), axis=1)
        return model.predict_proba(features)

    @staticmethod
    def _features(readings: Float[np.ndarray, "n bands"]) -> Float[np.ndarray, "n features"]:
        return np.concatenate([slope_of_absorbance(readings), slope_of_log_ratio(readings)], axis=1)


def namers() -> list[Namer]:
    """All methods of this file; without scikit-learn none that needs it."""
    methods: list[Namer] = [
        Neighbours("spectral angle", [np.asarray]),
        Neighbours("slopes of -log R", [slope_of_absorbance]),
        Neighbours("slopes of log K/S", [slope_of_log_ratio]),
        Neighbours("slopes of both", [slope_of_absorbance, slope_of_log_ratio]),
        Unmixing(),
    ]
    if find_spec("sklearn"):
        methods.append(Classifier())
    return methods
