"""Result of an identification: a ranked list for each spectrum, and how sure it is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax.catalogue import family

from ...film.model.errors import Prior
from ...film.model.variation import STRENGTH, thickness_variance
from ...film.tables import WAVELENGTH, Tabulated, Variables, as_frame
from ..search.pool import NOBODY, Pool
from ..search.task import Measured
from ..search.unstated_conditions import CONDITIONS
from ..search.weigh import UNSEEN, Odds
from .groups import FamilySet, answer_of
from .in_tests import came_true, has_infrared, were_tested
from .odds import CoatsOdds
from .table import table_of

PerPlace: TypeAlias = Float[np.ndarray, "*n places"]
"""A number for each paint of a candidate, with room for three."""
# Spectra that are named where a result is printed.
_SHOWN = 3

NINETY = np.array([-1.6448536269514722, 1.6448536269514722])
"""Standard deviations from the middle of a Gaussian to the ends of its central 90 %."""


@dataclass(frozen=True)
class Candidate:
    """One explanation of a spectrum.

    Attributes:
        paints: names, largest fraction first; of two coats, the upper one's first.
        fractions: by mass, of all paint in the film, most probable with errors of the paints' k and
            s allowed; sum 1.
        fractions_sd: standard deviations.
        coats: coat of each paint, 0 the uppermost.
        fractions_90: their 90 % intervals, (paints, 2).
        amounts, amounts_90: thickness times fraction of each paint, m, and their 90 % intervals,
            (paints, 2); NaN for films that hide their ground.
        thickness, thickness_sd: m, of all coats; NaN for films that hide their ground.
        thickness_90: its 90 % interval, (2,).
        probability: posterior.
        condition: how the film lies if not bare over its stated ground, such as "under a yellowed
            varnish"; empty if so.
        gloss: share of the surface's reflection in the readings.
        fitted, residual: readings of the mixture of these paints that comes nearest, and measured
            minus these, (grounds, bands).
        rmse: of the residual.
        angle: spectral angle between measured and fitted, degrees; the largest over the grounds.
        delta_e: CIEDE2000 (D65, 10 degrees), the largest over the grounds; NaN where the bands give
            no colour.
    """

    paints: tuple[str, ...]
    fractions: Float[np.ndarray, "paints"]
    fractions_sd: Float[np.ndarray, "paints"]
    fractions_90: Float[np.ndarray, "paints 2"]
    amounts: Float[np.ndarray, "paints"]
    amounts_90: Float[np.ndarray, "paints 2"]
    coats: tuple[int, ...]
    thickness: float
    thickness_sd: float
    thickness_90: Float[np.ndarray, "2"]
    probability: float
    condition: str
    gloss: float
    fitted: Float[np.ndarray, "grounds bands"]
    residual: Float[np.ndarray, "grounds bands"]
    rmse: float
    angle: float
    delta_e: float

    def __repr__(self) -> str:
        return (
            f"Candidate({self.words!r}, probability {self.probability:.2f}, Delta E "
            f"{self.delta_e:.1f})"
        )

    @property
    def words(self) -> str:
        """Such as ``90 % ZincWhite + 10 % Eosin``, or ``30 % Eosin over 70 % ZincWhite``."""
        return self.mixture + (f", {self.condition}" if self.condition else "")

    @property
    def mixture(self) -> str:
        """The words without the condition."""
        upper = [i for i, coat in enumerate(self.coats) if coat == 0]
        lower = [i for i, coat in enumerate(self.coats) if coat == 1]
        if not lower:
            return self._shares(upper)
        sides = [self._shares(coat, always=True) for coat in (upper, lower)]
        return " over ".join(f"({side})" if " + " in side else side for side in sides)

    def _shares(self, coat: Sequence[int], *, always: bool = False) -> str:
        """Shares of the paints of a coat, in words; of a single paint only where it is asked
        for.
        """
        indices = [i for i in coat if self.fractions[i] >= TRACE]
        alone = len(indices) == 1 and not always
        names = [
            self.paints[i] if alone else f"{percent(self.fractions[i])} {self.paints[i]}"
            for i in indices
        ]
        names += [f"a trace of {self.paints[i]}" for i in coat if i not in indices]
        return " + ".join(names)


TRACE = 0.001
"""Share below which a reading does not show how much of a paint there is."""


def percent(fraction: float) -> str:
    """A fraction with one digit where a part of it is small: a reading shows no more."""
    value = 100 * float(fraction)
    smaller = min(value, 100 - value)  # what the digits must show
    if smaller <= 0.0:
        return "100 %" if value > 50 else "0 %"
    if smaller < 100 * TRACE:
        return "> 99.9 %" if value > 50 else "< 0.1 %"
    return f"{value:.{0 if smaller >= 9.5 else 1}f} %"


@dataclass(frozen=True)
class Identification(Tabulated):
    """Ranked explanations of spectra.

    Attributes:
        measured: what was given.
        paints: names of the catalogue's paints.
        members: paints of each candidate by number, most probable first, `NOBODY` where there is
            none, (spectra, candidates, 3).
        coats: coat of each, 0 the uppermost.
        amounts: thickness times fraction of each, m, most probable with errors of the paints' k and
            s allowed; 0 where there is no paint.
        log_covariance: of the log amounts, (spectra, candidates, 3, 3).
        probability: posterior, (spectra, candidates).
        none: posterior probability that the catalogue does not explain the spectrum, (spectra,).
        misfit: what that is judged by, (spectra,): the candidates' mean Delta E00, where each is
            the geometric mean of that of the fit and that with errors of its paints' coefficients
            allowed, or the latter's residual if that has a shape that no colour shows. Of a search
            by family, minus the log of the evidence.
        rejected: whether a person would reject the fit by eye, (spectra, candidates): Delta E00
            above 4, noise aside.
        paint_probability: of each paint to be in the film, over all candidates looked at, (spectra,
            paints).
        gloss: share of the surface's reflection, (spectra, candidates).
        fitted: readings of the mixture of these paints that comes nearest, (spectra, candidates,
            grounds, bands).
        condition: under which each was searched, a number of
            `search.unstated_conditions.CONDITIONS`; 0 is as stated.
        opaque: whether the films were said to hide their ground.
        family_sets: of each spectrum, sets of pigment families, best first and at least one, where
            families were searched; empty where paints were.
        paint_families: of each paint, its family; empty where paints were searched.
        coats_odds: of each spectrum, how the paints of the best sets may lie, most probable set
            first; empty where one coat alone was tried.
        spread: standard deviation of the log thickness before the readings.
    """

    measured: Measured
    paints: tuple[str, ...]
    members: Int[np.ndarray, "spectra candidates 3"]
    coats: Int[np.ndarray, "spectra candidates 3"]
    amounts: Float[np.ndarray, "spectra candidates 3"]
    log_covariance: Float[np.ndarray, "spectra candidates 3 3"]
    probability: Float[np.ndarray, "spectra candidates"]
    none: Float[np.ndarray, "spectra"]
    misfit: Float[np.ndarray, "spectra"]
    rejected: Bool[np.ndarray, "spectra candidates"]
    paint_probability: Float[np.ndarray, "spectra paints"]
    gloss: Float[np.ndarray, "spectra candidates"]
    fitted: Float[np.ndarray, "spectra candidates grounds bands"]
    condition: Int[np.ndarray, "spectra candidates"]
    opaque: bool
    family_sets: tuple[tuple[FamilySet, ...], ...] = ()
    paint_families: tuple[str, ...] = ()
    coats_odds: tuple[tuple[CoatsOdds, ...], ...] = ()
    spread: float = Prior.spread

    def __len__(self) -> int:
        return len(self.measured)

    def __repr__(self) -> str:
        best = [
            " + ".join(self.paints[i] for i in row[0] if i != NOBODY)
            for row in self.members[:_SHOWN]
        ]
        first = [
            f"{name!r}: {paints}"
            for name, paints in zip(self.measured.names[:_SHOWN], best, strict=True)
        ]
        suffix = f", and {len(self) - _SHOWN} more" if len(self) > _SHOWN else ""
        return (
            f"Identification({len(self)} spectra among {len(self.paints)} paints; "
            f"{', '.join(first)}{suffix})"
        )

    @property
    def explained(self) -> np.ndarray:
        """True where the catalogue explains a spectrum, (spectra,).

        Its films are together more probable than none, and a person does not reject the first by
        eye.
        """
        return (self.none < 0.5) & ~self.rejected[:, 0]

    @property
    def coats_probability(self) -> Float[np.ndarray, "spectra"]:
        """Probability that a film has more than one coat, if paints of the catalogue explain it; 0
        where one coat alone was tried: then `coats_odds` is empty.
        """
        odds = self.coats_odds or ((),) * len(self)
        return np.array(
            [sum(coats.share * coats.layered for coats in row_odds) for row_odds in odds], float
        )

    def coats_words(self, row: int) -> str:
        """One sentence on how the paints of the most probable set lie, mixed or one over another;
        empty where that was not weighed.
        """
        row_odds = self.coats_odds[row] if self.coats_odds else ()
        if not row_odds:
            return ""
        return f"if it is of {' and '.join(row_odds[0].paints)}: {row_odds[0].words()}"

    @cached_property
    def fractions(self) -> Float[np.ndarray, "spectra candidates 3"]:
        """By mass, of all paint in the film; NaN where there is none, or no amount is known."""
        return fractions_of(self.amounts)

    @cached_property
    def log_sd(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Standard deviations of the logs of amounts, of fractions and of the thickness of all
        candidates (`log_sds`).
        """
        return log_sds(self.members, self.fractions, self.log_covariance, self.spread)

    @cached_property
    def amounts_90(self) -> Float[np.ndarray, "spectra candidates 3 2"]:
        """90 % intervals of the amounts if the film is of these paints, m: log-normal."""
        return self.amounts[..., None] * np.exp(self.log_sd[0][..., None] * NINETY)

    @cached_property
    def thickness_90(self) -> Float[np.ndarray, "spectra candidates 2"]:
        """90 % intervals of the thickness if the film is of these paints, m: log-normal."""
        return self.amounts.sum(axis=-1)[..., None] * np.exp(self.log_sd[2][..., None] * NINETY)

    @cached_property
    def fractions_90(self) -> Float[np.ndarray, "spectra candidates 3 2"]:
        """90 % intervals of the fractions if the film is of these paints: Gaussian in the log odds,
        inside [0, 1]; NaN where these are.
        """
        share = self.fractions
        interior = (share > 0) & (share < 1)
        safe = np.where(interior, share, 0.5)
        # d log odds = d log f / (1 - f).
        spread = np.where(interior, self.log_sd[1], 0.0)
        half_width = (spread / (1.0 - safe))[..., None] * NINETY
        log_odds = np.log(safe / (1.0 - safe))[..., None] + half_width
        ends = np.exp(-np.logaddexp(0.0, -log_odds))
        return np.where(interior[..., None], ends, share[..., None])

    @cached_property
    def residual(self) -> Float[np.ndarray, "spectra candidates grounds bands"]:
        """Measured minus computed."""
        return self.measured.readings[:, None] - self.fitted

    @cached_property
    def rmse(self) -> Float[np.ndarray, "spectra candidates"]:
        """Root mean square of the residual, over the bands at which a candidate is known."""
        return np.sqrt(np.nanmean(self.residual**2, axis=(-1, -2)))

    @cached_property
    def angle(self) -> Float[np.ndarray, "spectra candidates"]:
        """Largest spectral angle over the grounds, degrees."""
        finite = np.isfinite(self.fitted)
        measured = np.where(finite, self.measured.readings[:, None], 0.0)
        return spectral_angle(measured, np.where(finite, self.fitted, 0.0)).max(axis=-1)

    @cached_property
    def delta_e(self) -> Float[np.ndarray, "spectra candidates"]:
        """Largest CIEDE2000 over the grounds, D65 and 10 degrees; NaN where the bands give no
        colour.
        """
        return self.measured.delta_e(self.fitted)

    def to_dataframe(self, top: int | None = None) -> Any:
        """A pandas.DataFrame with a row for each explanation of each spectrum, most probable first;
        thicknesses in micrometres, and how a film lies if not bare over its stated ground in
        ``condition``.

        Args:
            top: explanations of a spectrum, at most; by default all.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        return as_frame(*table_of(self, top))

    def arrays_and_axes(self) -> Variables:
        """Readings, what was fitted, and how probable it is."""
        candidate_axes = ("spectrum", "candidate")
        bands = ("ground", WAVELENGTH)
        axes = {
            "spectrum": list(self.measured.names),
            "ground": np.arange(self.fitted.shape[2]) + 1,
            WAVELENGTH: self.measured.wavelengths,
        }
        return {
            "measured": (("spectrum", *bands), self.measured.readings),
            "fitted": ((*candidate_axes, *bands), self.fitted),
            "probability": (candidate_axes, self.probability),
        }, axes

    def ranked(self, row: int, count: int | None = None) -> list[Candidate]:
        """Explanations of one spectrum, most probable first."""
        out = []
        for n in range(self.probability.shape[1])[:count]:
            at = row, n
            condition = CONDITIONS[self.condition[at]]
            hidden = self.opaque if condition.opaque is None else condition.opaque
            present = np.flatnonzero(self.members[at] != NOBODY)
            if not present.size:  # A place that other spectra needed.
                continue
            share = self.fractions[at]
            order = present[np.lexsort((-share[present], self.coats[at][present]))]
            total = float(self.amounts[at].sum())
            spread = self.log_sd[1][at] * share
            # The ground of a film that hides it says nothing on lengths.
            length = np.nan if hidden else 1.0
            out.append(
                Candidate(
                    paints=tuple(self.paints[i] for i in self.members[at][order]),
                    fractions=share[order],
                    fractions_sd=np.minimum(spread[order], 0.3),
                    fractions_90=self.fractions_90[at][order],
                    amounts=self.amounts[at][order] * length,
                    amounts_90=self.amounts_90[at][order] * length,
                    coats=tuple(self.coats[at][order].tolist()),
                    thickness=total * length,
                    thickness_sd=total * float(self.log_sd[2][at]) * length,
                    thickness_90=self.thickness_90[at] * length,
                    probability=float(self.probability[at]),
                    condition=condition.words,
                    gloss=float(self.gloss[at]),
                    fitted=self.fitted[at],
                    residual=self.residual[at],
                    rmse=float(self.rmse[at]),
                    angle=float(self.angle[at]),
                    delta_e=float(self.delta_e[at]),
                )
            )
        return out

    def families(self, row: int) -> list[tuple[tuple[str, ...], float]]:
        """Sets of pigments, medium and maker aside, and their probabilities; largest first.

        Where families were searched, names are those of `glazejax.catalogue.families`, coloured
        ones first, or of a group such as "a white" where the spectrum does not show which it is
        (``family_sets[row]`` says which it may be).
        """
        if self.family_sets:
            return [(answer.families, answer.probability) for answer in self.family_sets[row]]
        chances: dict[tuple[str, ...], float] = {}
        ordered_names: dict[frozenset[str], tuple[str, ...]] = {}
        for candidate in self.ranked(row):
            names = tuple(dict.fromkeys(family(paint) for paint in candidate.paints))
            names = ordered_names.setdefault(frozenset(names), names)
            chances[names] = chances.get(names, 0.0) + candidate.probability
        return sorted(chances.items(), key=lambda answer: -answer[1])

    @cached_property
    def family_of(self) -> dict[str, str]:
        """Family of each paint by name, where families were searched."""
        return dict(zip(self.paints, self.paint_families, strict=True))

    def films_of_answers(self, row: int) -> dict[frozenset[str], Candidate]:
        """The most probable film of each answer by family, under what `groups.answer_of` makes of
        it; of an improbable answer none may have been kept.
        """
        films: dict[frozenset[str], Candidate] = {}
        for candidate in self.ranked(row):
            answer = answer_of(self.family_of[paint] for paint in candidate.paints)
            films.setdefault(answer, candidate)
        return films

    def nearest_exemplars(self, row: int) -> str:
        """Paints of the film that stands for the first answer by family."""
        film = self.films_of_answers(row).get(answer_of(self.family_sets[row][0].families))
        return "none that was kept" if film is None else " + ".join(film.paints)

    def not_told(self, row: int, least: float = 0.2) -> dict[str, list[str]]:
        """Paints of the first candidate -> others that may stand in their place, most probable
        first.

        Args:
            row: of the spectrum.
            least: share of the first one's probability that a film with another paint has.
        """
        first, *others = self.ranked(row)
        first_paints = set(first.paints)
        out: dict[str, list[str]] = {}
        for candidate in others:
            gone = first_paints - set(candidate.paints)
            new = set(candidate.paints) - first_paints
            if len(gone) == len(new) == 1 and candidate.probability >= least * first.probability:
                alternatives = out.setdefault(gone.pop(), [])
                alternatives.extend(new - set(alternatives))
        return out

    def words(self, row: int) -> str:
        """One sentence on a spectrum, after its name."""
        return f"{self.measured.names[row]}: {self.verdict(row)}"

    def verdict(self, row: int) -> str:
        """One sentence on a spectrum."""
        if not self.explained[row]:
            return self.unexplained(row)
        if self.family_sets:
            first = self.family_sets[row][0]
            return (
                f"{first.words} ({self.stated_words(row)}; none of these families "
                f"{self.none[row]:.0%}); nearest exemplar {self.nearest_exemplars(row)}"
            )
        best, (_, chance) = self.ranked(row, 1)[0], self.families(row)[0]
        likely = self.likely_paint(row)
        if likely is not None:
            paint, share = likely
            return (
                f"most probably with {paint} ({share:.0%}), but its companion is open: the "
                f"most probable single set, {best.words} ({best.probability:.0%}), is without it"
            )
        suffix = f"; these pigments {chance:.0%}" if chance > best.probability + 0.05 else ""
        # The sentence names 'none of these' from a chance of a tenth on.
        suffix += f"; none of these paints {self.none[row]:.0%}" if self.none[row] >= 0.1 else ""
        return f"{best.words} (probability {best.probability:.0%}{suffix})"

    def came_true(self, row: int) -> tuple[int, int] | None:
        """Of answers by family that stated as much of paint by others: how many were right, and
        how many there were. None where paints were searched, nothing explains the spectrum, or no
        test read so few bands.
        """
        bands = self.measured.wavelengths
        if not (self.family_sets and self.explained[row] and were_tested(bands)):
            return None
        return came_true(self.family_sets[row][0].probability, has_infrared(bands))

    def stated_words(self, row: int) -> str:
        """Say how probable the first answer by family is said to be, and how often such answers
        came true.
        """
        counts = self.came_true(row)
        tested = "" if counts is None else f", in tests {counts[0] / counts[1]:.0%} right"
        return f"probability {self.family_sets[row][0].probability:.0%}{tested}"

    def unexplained(self, row: int) -> str:
        """Say why nothing explains a spectrum."""
        start = "nothing in the catalogue explains this"
        if self.family_sets:
            if self.none[row] < 0.5:
                start = "this looks unlike nearly all paints of the families that are known"
            return (
                f"{start} (probability that it is none of them {self.none[row]:.0%}); the nearest "
                f"pigment is {self.family_sets[row][0].words}"
            )
        # The nearest in colour of the five that a table shows as a rule; without colours by RMSE.
        shown = self.ranked(row, 5)
        if np.isfinite(shown[0].delta_e):
            nearest = min(shown, key=lambda candidate: candidate.delta_e)
            off = (
                f"has the colour (Delta E00 {nearest.delta_e:.1f}) but not the shape of the "
                "spectrum"
                if nearest.delta_e < UNSEEN
                else f"has an error of Delta E00 {nearest.delta_e:.1f}"
            )
        else:
            nearest = min(shown, key=lambda candidate: candidate.rmse)
            off = f"has an error of {nearest.rmse:.3f} in reflectance (RMSE)"
        if self.none[row] < 0.5:
            # Improbable as it is that nothing does, its films have visible
            # errors.
            return f"no film of the catalogue comes near this; the nearest, {nearest.words}, {off}"
        return (
            f"{start} (probability {self.none[row]:.0%}); the nearest of its films, "
            f"{nearest.words}, {off}"
        )

    def likely_paint(self, row: int) -> tuple[str, float] | None:
        """A paint that is probably in a film although the most probable set is without it, and its
        probability: many sets share it. None where the most probable set says it all.
        """
        number = int(np.argmax(self.paint_probability[row]))
        share = float(self.paint_probability[row, number])
        if share < 0.5 or self.paints[number] in self.ranked(row, 1)[0].paints:
            return None
        return self.paints[number], share

    @classmethod
    def of(
        cls,
        measured: Measured,
        pool: Pool,
        odds: Odds,
        *,
        paints: tuple[str, ...],
        opaque: bool,
        keep: int,
        spread: float,
    ) -> "Identification":
        """Probabilities of all candidates and of none, and the best candidates in full."""
        total = odds.total
        probability = odds.candidates / total[:, None]
        present = pool.members[..., None] == np.arange(len(paints))
        best = np.argsort(-probability, axis=1, kind="stable")[:, :keep]
        top = pool.choose(best)
        return cls(
            measured=measured,
            paints=paints,
            members=top.members,
            coats=top.coats,
            amounts=np.exp(top.weighed),
            log_covariance=top.covariance,
            probability=np.take_along_axis(probability, best, axis=1),
            none=odds.none / total,
            misfit=odds.misfit,
            rejected=np.take_along_axis(odds.rejected, best, axis=1),
            paint_probability=np.einsum("sc,scmp->sp", probability, present),
            gloss=top.gloss,
            fitted=top.readings,
            condition=top.condition,
            opaque=opaque,
            spread=spread,
        )

    def take(self, rows: Int[np.ndarray, "rows"]) -> "Identification":
        """Some of the spectra, by number."""
        arrays = {name: getattr(self, name)[rows] for name in (*_OF_SPECTRA, *_OF_CANDIDATES)}
        answers = {
            name: tuple(getattr(self, name)[row] for row in rows)
            for name in ("family_sets", "coats_odds")
            if getattr(self, name)
        }
        return replace(self, measured=self.measured.take(rows), **arrays, **answers)

    @classmethod
    def join(cls, parts: Sequence["Identification"]) -> "Identification":
        """Identifications of several batches with the same catalogue as one.

        Batches in which more conditions were tried hold more candidates; the others' further places
        are empty.
        """
        most = max(batch.probability.shape[1] for batch in parts)
        wide = [batch._with_places(most) for batch in parts]
        joined = {
            name: np.concatenate([getattr(batch, name) for batch in wide])
            for name in (*_OF_SPECTRA, *_OF_CANDIDATES)
        }
        return replace(
            wide[0],
            measured=Measured.join([batch.measured for batch in wide]),
            family_sets=tuple(answers for batch in wide for answers in batch.family_sets),
            coats_odds=tuple(odds for batch in wide for odds in batch.coats_odds),
            **joined,
        )

    def _with_places(self, count: int) -> "Identification":
        """The same with empty places up to a count of candidates."""
        filled = self.probability.shape[1]
        if filled == count:
            return self
        # The others repeat the last.
        places = np.minimum(np.arange(count), filled - 1)
        padded = {name: np.take(getattr(self, name), places, axis=1) for name in _OF_CANDIDATES}
        padded["members"][:, filled:] = NOBODY
        padded["probability"][:, filled:] = 0.0
        return replace(self, **padded)


_OF_SPECTRA = ("none", "misfit", "paint_probability")
_OF_CANDIDATES = (
    "members",
    "coats",
    "amounts",
    "log_covariance",
    "probability",
    "rejected",
    "gloss",
    "fitted",
    "condition",
)
"""Arrays with a row for each spectrum, and with a place for each of its candidates."""


def fractions_of(amounts: PerPlace) -> PerPlace:
    """Share of each paint in all; NaN where there is none."""
    total = amounts.sum(axis=-1, keepdims=True)
    return amounts / np.where(total == 0, np.nan, total)


def log_sds(
    members: Int[np.ndarray, "*n places"],
    fractions: PerPlace,
    log_covariance: Float[np.ndarray, "*n places places"],
    prior: float,
) -> tuple[PerPlace, PerPlace, Float[np.ndarray, "*n"]]:
    """Standard deviations of the logs of amounts, of fractions and of the thickness.

    What the readings leave open, and that a paint is stronger or weaker in one film than in others.

    Args:
        members: paints by number, `NOBODY` where there is none.
        fractions: of these.
        log_covariance: of the log amounts that the readings show.
        prior: standard deviation of the log thickness before the readings.
    """
    varied = np.where(members != NOBODY, STRENGTH, 0.0) ** 2
    identity = np.eye(members.shape[-1])
    covariance = log_covariance + varied[..., None] * identity
    # d log f = d u - sum f d u, and d log thickness = sum f d u.
    slope = identity - fractions[..., None, :]
    spread = np.einsum("...ij,...jk,...ik->...i", slope, covariance, slope, optimize=True)
    shown = np.einsum("...i,...ij,...j->...", fractions, log_covariance, fractions, optimize=True)
    thickness = thickness_variance(shown, prior**2, np.sum(fractions**2, axis=-1))
    variances = np.diagonal(covariance, axis1=-2, axis2=-1), spread, thickness
    # Standard deviations of a logarithm beyond 50 say that nothing is known.
    amounts, fraction_sds, thickness_sd = (
        np.minimum(np.sqrt(np.maximum(variance, 0.0)), 50.0) for variance in variances
    )
    return amounts, fraction_sds, thickness_sd


def spectral_angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angle between spectra, degrees, over the last axis; 0 if both are black, 90 if one is."""
    length = np.linalg.norm(first, axis=-1)
    other = np.linalg.norm(second, axis=-1)
    product = length * other
    cosine = np.sum(first * second, axis=-1) / np.where(product > 0, product, 1.0)
    cosine = np.where(length + other == 0, 1.0, cosine)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
