"""Check of how well a set of films predicts its own mixtures: every mixture left out of a joint fit
in turn, and predicted.

What the films left out show of how far films are from their recipes (`film.model.variation`)
sets the bands: of each by what the others showed, and of films to come by what all did.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from glazejax.io.spectra_table import list_names
from glazejax.progress import Progress, no_progress

from ...film.films import Films
from ...film.model.variation import Variation, learn
from ..films.result import PerFilm, PerFilmAndCard, ReadingSpectra
from ..joint.joint import recover_jointly
from ..joint.result import JointRecovery
from .prediction import Prediction, predict_films


@dataclass(frozen=True)
class LeftOut:
    """Films left out one by one.

    Attributes:
        predictions: of each film by the fit of all others.
        fitted: CIEDE2000 (D65, 10 degrees) of the fit of all films, over black and white, (films,
            2).
        films: as measured, over both cards or one.
        variation: what all of them teach of how far films are from their recipes; for
            `predict_films`.
        complete: False where an interrupt came before the last film.
    """

    predictions: tuple[Prediction, ...]
    fitted: PerFilmAndCard
    films: Films
    variation: Variation
    complete: bool

    def __repr__(self) -> str:
        return f"LeftOut({len(self.predictions)} films: {list_names(self.names)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the films."""
        return tuple(prediction.name for prediction in self.predictions)

    @property
    def measured(self) -> ReadingSpectra:
        """Reflectance over black and white, (films, 2, bands); of a reading that there is not the
        other's values.
        """
        return self.films.over_cards

    @cached_property
    def predicted(self) -> PerFilmAndCard:
        """CIEDE2000 (D65, 10 degrees) of the predictions, over black and white; of a reading that
        there is not the other's value.
        """
        off = [
            p.delta_e(*spectra) for p, spectra in zip(self.predictions, self.measured, strict=True)
        ]
        return self.films.where_seen(np.array(off))

    @cached_property
    def expected(self) -> PerFilm:
        """CIEDE2000 that each prediction said it would be off."""
        return np.array([prediction.expected_error() for prediction in self.predictions])

    @cached_property
    def inside(self) -> PerFilm:
        """Share of each film's readings within the prediction's 90 % band."""
        low, high = np.stack([prediction.interval() for prediction in self.predictions], axis=1)
        within = (low <= self.measured) & (self.measured <= high)
        return np.mean(self.films.where_seen(within.astype(float)), axis=(1, 2))


def without(
    recovery: JointRecovery,
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    row: int | list[int],
    **fit_options: Any,
) -> JointRecovery:
    """The fit without one film or several; it starts where that of all ended, but knows nothing of
    them.

    Args:
        recovery: fit of all films.
        films, recipes: of `recovery`.
        row: of the film that is left out, or of several.
        fit_options: as `recovery` had them.
    """
    use = np.ones(len(films))
    use[row] = 0.0
    start = recovery.unknowns._replace(films=recovery.unknowns.films * use[:, None])
    # A fit that starts where that of all films ended is close.
    return recover_jointly(films, recipes, use=use, start=start, max_steps=15, **fit_options)


def cross_validate(
    whole: JointRecovery,
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    *,
    only: Callable[[str], bool] | None = None,
    progress: Progress = no_progress,
    **fit_options: Any,
) -> LeftOut:
    """Leave every mixture out of the fit in turn and predict it from its weights.

    Each prediction's bands are as wide as the other films left out say.

    Args:
        whole: fit of all films.
        films, recipes: of `whole`.
        only: whether a film, by name, is left out; by default those of more than one paint, all of
            whose paints are in other films too.
        progress: called before each film is fitted. An interrupt keeps the films that are done.
        fit_options: further arguments of `glazefit.recover.joint.joint.recover_jointly`, as `whole`
            had them.

    Raises:
        ValueError: there is no such film.
    """
    films_of = (whole.shares > 0).sum(axis=0)
    rows = [
        row
        for row, (name, share) in enumerate(zip(films.names, whole.shares, strict=True))
        if (only(name) if only else (share > 0).sum() > 1) and np.all(films_of[share > 0] > 1)
    ]
    if not rows:
        raise ValueError(
            "no film can be left out: none is of several paints that are all in other films too"
        )
    # Each film is predicted by a fit without it.
    predictions: list[Prediction] = []
    try:
        for row in rows:
            progress(len(predictions), len(rows), f"leaving out {films.names[row]}")
            refit = without(whole, films, recipes, row, **fit_options)
            predictions += predict_films(refit, films.take([row]), recipes)
    except KeyboardInterrupt:
        if not predictions:
            raise
    done = rows[: len(predictions)]
    # What each film shows of how far films are from their recipes.
    chosen = films.take(done)
    evidence = [
        prediction.size_evidence(spectra, cards)
        for prediction, spectra, cards in zip(
            predictions, chosen.over_cards, chosen.seen, strict=True
        )
    ]
    mixing = [film_evidence.paints for film_evidence in evidence]
    # Each prediction is as wide as the other films say, films to come as all say.
    judged = [
        replace(prediction, variation=learn(evidence[:i] + evidence[i + 1 :], mixing))
        for i, prediction in enumerate(predictions)
    ]
    return LeftOut(
        predictions=tuple(judged),
        fitted=whole.delta_e()[done],
        films=chosen,
        variation=learn(evidence),
        complete=len(done) == len(rows),
    )
