"""The bench's tasks: what is to be named, what may be learnt, and how an answer is scored.

Each task gives, for every source and method, a number of samples and scores; and a list of what
went wrong.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import spearmanr

from glazefit.identify.result.groups import GROUPS
from glazefit.identify.result.in_tests import has_infrared
from glazejax import colour

from .library import Answer, Namer, Table, grid_readings, known_families, pure_table
from .mixers import Mixer, Mixtures, Predicted
from .program import films_over_cards, over_cards
from .sources import COLOURLESS, FOREIGN, Sample, Source
from .spectra import GRID, RANGES, REACHED, VISIBLE, WHOLE, bounded, finite_columns, within

Scores = dict[str, float | int | None]
Results = dict[str, dict[str, dict[str, Scores]]]
"""task -> source -> method -> scores."""

LARGEST_GROUP = 4
"""Families that an answer may name together, where spectra do not separate them, to be right."""
BINS = 10
"""Of stated probabilities."""
# Draws of answers of which all that is stated is true.
_DRAWS = 500
LEAST_BANDS = 10
"""A source that has fewer in a task's range takes no part in it."""

# Grid on which mixtures are predicted, nm; grids finer than it are averaged.
_MIX_GRID = np.arange(420.0, 981.0, 20.0)
# The source that the catalogue of oils was made from.
_OILS = "revigo"
# Its coefficients are no readings, and are never to be named.
_GOLDEN = "golden"
# Sources whose readings have an unknown level: a probe held by hand.
_FREE_LEVEL = ("bath",)


@dataclass(frozen=True, kw_only=True)
class Failure:
    """One answer that is not right."""

    task: str
    source: str
    method: str
    sample: str
    truth: str
    answer: str


class Record:
    """Scores and failures of a run, and where each method's stated probabilities came true."""

    def __init__(self) -> None:
        self.results: Results = {}
        self.failures: list[Failure] = []
        self._stated: dict[tuple[str, str], list[tuple[float, bool]]] = {}

    def add(self, task: str, source: str, method: str, scores: Scores) -> None:
        """Scores of one method on one source."""
        self.results.setdefault(task, {}).setdefault(source, {})[method] = scores

    def fail(
        self,
        task: str,
        source: Source,
        namer: Namer,
        sample: Sample,
        truth: Sequence[str],
        answer: Answer,
    ) -> None:
        """One answer that is not right."""
        self.failures.append(
            Failure(
                task=task,
                source=source.name,
                method=namer.name,
                sample=sample.name,
                truth=" + ".join(truth),
                answer=words_of(answer),
            )
        )

    def state(self, source: str, method: str, chance: float, right: bool) -> None:
        """A probability that a method stated for its first answer."""
        self._stated.setdefault((source, method), []).append((chance, right))

    def score_calibration(self) -> None:
        """The task `calibration`: expected calibration error over ten bins of equal width, and what
        so many answers have of it where all that is stated is true.
        """
        rng = np.random.default_rng(0)
        for (source, method), pairs in self._stated.items():
            chances, right = (np.array(column, dtype=float) for column in zip(*pairs, strict=True))
            draws = rng.uniform(size=(_DRAWS, len(pairs))) < chances
            scores: Scores = {
                "n": len(pairs),
                "ece": calibration_error(chances, right),
                "ece_if_true": float(np.mean([calibration_error(chances, d) for d in draws])),
            }
            self.add("calibration", source, method, scores)


def calibration_error(
    chances: Float[np.ndarray, "answers"], right: Float[np.ndarray, "answers"]
) -> float:
    """Mean over answers of the difference, in each of ten bins, between the stated probability and
    the share of right answers.
    """
    bins = np.minimum((chances * BINS).astype(int), BINS - 1)
    error = 0.0
    for number in range(BINS):
        there = bins == number
        if there.any():
            error += there.mean() * abs(chances[there].mean() - right[there].mean())
    return float(error)


# ---- names ---------------------------------------------------------------------------------------


def is_right(answer: Sequence[Sequence[str]], truth: Iterable[str]) -> bool:
    """Whether a set of families is the true one.

    Of a truth with colours the coloured families must be right, whatever whites, extenders and
    blacks are with them; of one without, all that is named must be colourless and the first be it.
    A family that is named as one of several counts where these are at most four.
    """
    wanted = set(truth)
    coloured = wanted - COLOURLESS
    named = [tuple(names) for names in answer]
    if any(len(names) > LARGEST_GROUP for names in named):
        return False
    with_colour = [names for names in named if not set(names) <= COLOURLESS]
    if not coloured:
        return not with_colour and bool(named) and bool(wanted & set(named[0]))
    return len(with_colour) == len(coloured) and _matched(with_colour, coloured)


def _matched(named: Sequence[Sequence[str]], wanted: set[str]) -> bool:
    """Whether each wanted family can be given a place of its own that names it."""
    if not named:
        return not wanted
    return any(_matched(named[1:], wanted - {family}) for family in named[0] if family in wanted)


def score_names(answers: Sequence[Answer], truths: Sequence[tuple[str, ...]]) -> Scores:
    """`first` and `three` (a refused reading counts as wrong), `refused`, and the same two as if
    nothing had been refused.
    """

    def among(count: int) -> np.ndarray:
        pairs = zip(answers, truths, strict=True)
        return np.array([any(is_right(sets, t) for sets in a.ranked[:count]) for a, t in pairs])

    first, three = among(1), among(3)
    refused = np.array([answer.refused for answer in answers])
    return {
        "n": len(answers),
        "first": float(np.mean(first & ~refused)),
        "three": float(np.mean(three & ~refused)),
        "refused": float(refused.mean()),
        "first_if_pressed": float(first.mean()),
        "three_if_pressed": float(three.mean()),
    }


SURE = 0.8
"""Stated probability from which an answer counts as sure."""


def score_headlines(
    answers: Sequence[Answer],
    truths: Sequence[tuple[str, ...]],
    readings: Float[np.ndarray, "samples bands"],
) -> Scores:
    """`sure`: share of answers that state .8 and more; `sure_right`: share of these that are right;
    `nonsense`: share of first answers that contradict the reading's own colour.

    A method that states no probability has no first two.
    """
    contradicted = [
        contradicts(answer, reading) for answer, reading in zip(answers, readings, strict=True)
    ]
    scores: Scores = {"sure": None, "sure_right": None, "nonsense": float(np.mean(contradicted))}
    if not any(answer.chances for answer in answers):
        return scores
    sure = [not a.refused and bool(a.chances) and stated_chance(a) >= SURE for a in answers]
    right = [
        is_right(answer.ranked[0], truth)
        for answer, truth, is_sure in zip(answers, truths, sure, strict=True)
        if is_sure
    ]
    return {
        **scores,
        "sure": float(np.mean(sure)),
        "sure_right": float(np.mean(right)) if right else None,
    }


def contradicts(answer: Answer, reading: Float[np.ndarray, "bands"]) -> bool:
    """Whether an answer's first set cannot have the colour that was read (under D65): it names no
    colour where chroma is above 20, or a white first where lightness is below 35, or its
    film differs by more than 15 CIEDE2000.
    """
    if answer.refused or not answer.ranked:
        return False
    wavelengths = np.arange(400.0, 701.0, 10.0)
    lab = np.asarray(colour.lab(wavelengths, _visible(reading, wavelengths)))
    first = answer.ranked[0]
    colourless = all(set(names) <= COLOURLESS for names in first)
    if colourless and np.hypot(lab[1], lab[2]) > 20.0:
        return True
    if lab[0] < 35.0 and set(first[0]) <= set(GROUPS["a white"]):
        return True
    if answer.film is None:
        return False
    pair = [_visible(spectrum, wavelengths)[None] for spectrum in (reading, answer.film)]
    return bool(colour.delta_e_of_spectra(wavelengths, *pair)[0] > 15.0)


def _visible(
    spectrum: Float[np.ndarray, "bands"], wavelengths: Float[np.ndarray, "visible"]
) -> Float[np.ndarray, "visible"]:
    """A spectrum on the grid at visible wavelengths; beyond its ends as at them."""
    there = np.isfinite(spectrum)
    return np.clip(np.interp(wavelengths, GRID[there], spectrum[there]), 0.0, 1.0)


NAMING = (*RANGES, "none", "mixture")
"""Tasks that name pigments."""


def run_names(
    sources: Sequence[Source],
    namers: Sequence[Namer],
    record: Record,
    tasks: Sequence[str] = NAMING,
) -> None:
    """Tasks that name pigments, and what `calibration` needs.

    Of each source that is to be named, all sources of its group are hidden.
    """
    learnable = [source for source in sources if source.learnable]
    table = pure_table(learnable)
    for source in sources:
        if source.group == _GOLDEN:
            continue
        library = table.take(table.groups != source.group)
        pure = pure_table([source])
        # A source of mixtures alone has no pure samples whose bands could be counted.
        readings = pure.readings if len(pure) else grid_readings(source, range(len(source.samples)))
        for namer in namers:
            # None and mixtures are asked in the bands of the first range.
            for task in (task for task in RANGES if task in tasks):
                limits = RANGES[task]
                bands = within(limits)
                unnamed = pure.within(bands)
                there = finite_columns([readings])
                if (there & bands).sum() < LEAST_BANDS:
                    continue
                if task in REACHED and not there[REACHED[task] == GRID].all():
                    continue
                learner = _whole_grid(namer, library, bands)
                _pigment(task, source, learner, library, _blank(unnamed, bands), record)
                if task == "pigment" and "none" in tasks:
                    _none(source, learner, library, _blank(unnamed, bands), record)
                if task == "pigment" and "mixture" in tasks:
                    _mixture("mixture", source, learner, library, bands, record)


def stated_and_right(
    sources: Sequence[Source], namer: Namer
) -> list[tuple[str, bool, float, bool]]:
    """What is said of pure samples of known families, with all sources of their group hidden, with
    the near infrared and without: the source, whether the near infrared was read, the stated
    probability, and whether the answer is right. What is refused is left out.
    """
    table = pure_table([source for source in sources if source.learnable])
    out = []
    for source in sources:
        library = table.take(table.groups != source.group)
        pure = pure_table([source])
        known = set(known_families(library))
        pure = pure.take([row for row in range(len(pure)) if pure.families[row] in known])
        if source.group == _GOLDEN or not len(pure):
            continue
        for limits in (WHOLE, VISIBLE):
            bands = within(limits)
            infrared = has_infrared(GRID[bands & finite_columns([pure.readings])])
            if (limits is WHOLE) != infrared:
                continue
            learner = _whole_grid(namer, library, bands)
            unnamed = _blank(pure.within(bands), bands)
            answers = learner.answer(unnamed, [None] * len(unnamed), pairs=False)
            for answer, family in zip(answers, unnamed.families, strict=True):
                if not answer.refused:
                    right = is_right(answer.ranked[0], (str(family),))
                    out.append((source.name, infrared, answer.chances[0], right))
    return out


def run_references(
    sources: Sequence[Source],
    namers: Sequence[Namer],
    record: Record,
    group: str = "makers",
    every: int = 1,
) -> None:
    """Tasks `references_400` and `references_380`: each maker of a group's paints is to be named with
    those of its other makers in addition to the library, as a user's own references are; and
    `references_none`, `none` with these references, from 400 nm.

    Args:
        sources: of samples.
        namers: methods.
        record: that the scores go to.
        group: whose samples' names begin with a maker, up to a hyphen.
        every: one maker in so many is to be named.
    """
    table = pure_table([s for s in sources if s.learnable or s.group == group])
    own = table.groups == group
    maker = np.array([sample.name.split("-")[0] for sample in table.samples])
    makers = sorted(set(maker[own].tolist()))[::every]
    for task in ("pigment_400", "pigment_380") if makers else ():
        bands = within(RANGES[task])
        for namer in namers:
            answers: list[Answer] = []
            without: list[Answer] = []
            asked: list[Table] = []
            for one in makers:
                is_chosen = own & (maker == one)
                library = table.take(~is_chosen)
                has_family = np.isin(table.families, known_families(library))
                unnamed = _blank(table.take(is_chosen & has_family).within(bands), bands)
                learner = _whole_grid(namer, library, bands)
                answers += learner.answer(unnamed, [None] * len(unnamed), pairs=False)
                asked.append(unnamed)
                if task == "pigment_400":
                    foreign = table.families == FOREIGN
                    rows = is_chosen & (has_family | foreign)
                    unknown = _blank(table.take(rows).within(bands), bands)
                    hidden = [str(family) for family in unknown.families]
                    without += learner.answer(unknown, hidden, pairs=False)
            truths = [(str(family),) for unnamed in asked for family in unnamed.families]
            readings = np.concatenate([unnamed.readings for unnamed in asked])
            scores = score_names(answers, truths) | score_headlines(answers, truths, readings)
            record.add(task.replace("pigment", "references"), group, namer.name, scores)
            if without:
                record.add("references_none", group, namer.name, score_none(without, answers))


def run_own(sources: Sequence[Source], namer: Namer, record: Record) -> None:
    """Tasks `pigment_own` and `mixture_own`: the source that the oils are from, with nothing
    hidden: whether what was made for anybody's paint also serves for the catalogue's own films.
    """
    table = pure_table([source for source in sources if source.learnable])
    bands = within(WHOLE)
    for source in sources:
        if source.name != _OILS:
            continue
        learner = _whole_grid(namer, table, bands)
        unnamed = pure_table([source]).within(bands)
        _pigment("pigment_own", source, learner, table, _blank(unnamed, bands), record)
        _mixture("mixture_own", source, learner, table, bands, record)


def run_with_own_paints(
    sources: Sequence[Source], namer_with: Callable[[str], Namer], record: Record
) -> None:
    """Task `mixture` of a method that has the exemplars of the source that is asked for: what it
    then names wrongly, it lacks no data for.

    Args:
        sources: of samples.
        namer_with: a method with the exemplars of a group.
        record: that the scores go to.
    """
    table = pure_table([source for source in sources if source.learnable])
    bands = within(WHOLE)
    for source in sources:
        if source.group in table.groups:
            library = table.take(table.groups != source.group)
            learner = _whole_grid(namer_with(source.group), library, bands)
            _mixture("mixture", source, learner, library, bands, record)


def _whole_grid(namer: Namer, library: Table, bands: Bool[np.ndarray, "bands"]) -> Namer:
    """A method that has learnt from a library of which only some bands are there."""
    blank = np.where(bands, library.readings, np.nan)
    namer.learn(replace(library, readings=blank))
    return namer


def _blank(unnamed: Table, bands: Bool[np.ndarray, "bands"]) -> Table:
    """Samples of some bands on the whole grid again, NaN elsewhere."""
    readings = np.full((len(unnamed), bands.size), np.nan)
    readings[:, bands] = unnamed.readings
    return replace(unnamed, readings=readings)


def _pigment(
    task: str, source: Source, namer: Namer, library: Table, unnamed: Table, record: Record
) -> None:
    known = set(known_families(library))
    unnamed = unnamed.take([row for row in range(len(unnamed)) if unnamed.families[row] in known])
    if not len(unnamed):
        return
    answers = namer.answer(unnamed, [None] * len(unnamed), pairs=False)
    truths = [(str(family),) for family in unnamed.families]
    scores = score_names(answers, truths)
    scores |= score_headlines(answers, truths, unnamed.readings)
    record.add(task, source.name, namer.name, scores)
    for answer, truth, sample in zip(answers, truths, unnamed.samples, strict=True):
        right = bool(answer.ranked) and is_right(answer.ranked[0], truth)
        if answer.chances and task == "pigment":
            record.state(source.name, namer.name, stated_chance(answer), right)
        if not right or answer.refused:
            record.fail(task, source, namer, sample, truth, answer)


def stated_chance(answer: Answer) -> float:
    """Probability that a method states for what the first set is right or wrong by: its coloured
    families, whatever whites, extenders and blacks are with them; of a set without any, its first.
    """
    wanted = _what_counts(answer.ranked[0])
    return float(
        sum(
            chance
            for sets, chance in zip(answer.ranked, answer.chances, strict=True)
            if _what_counts(sets) == wanted
        )
    )


def _what_counts(sets: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], ...]:
    with_colour = [tuple(names) for names in sets if not set(names) <= COLOURLESS]
    return tuple(sorted(with_colour)) if with_colour else tuple(map(tuple, sets[:1]))


def words_of(answer: Answer) -> str:
    """The first set of an answer, in words."""
    if not answer.ranked:
        return "nothing"
    named = " + ".join(" or ".join(names) for names in answer.ranked[0])
    chance = f" ({answer.chances[0]:.0%})" if answer.chances else ""
    return f"none; nearest {named}{chance}" if answer.refused else f"{named}{chance}"


def _none(source: Source, namer: Namer, library: Table, unnamed: Table, record: Record) -> None:
    """Each pure sample with its family taken out of all sources, and with it."""
    known = set(known_families(library))
    has = np.array([family in known for family in unnamed.families.tolist()], dtype=bool)
    foreign = unnamed.families == FOREIGN
    out = unnamed.take(has | foreign)
    kept = unnamed.take(has)
    if not len(out) or not len(kept):
        return
    without = namer.answer(out, [str(family) for family in out.families], pairs=False)
    with_all = namer.answer(kept, [None] * len(kept), pairs=False)
    record.add("none", source.name, namer.name, score_none(without, with_all))


def score_none(without: Sequence[Answer], with_all: Sequence[Answer]) -> Scores:
    """`found`, `false` and `auc` of answers to readings whose family no source has, and to readings
    whose family is there.
    """
    return {
        "n": len(without),
        "found": float(np.mean([answer.refused for answer in without])),
        "false": float(np.mean([answer.refused for answer in with_all])),
        "auc": area_under_curve(
            np.array([answer.doubt for answer in without]),
            np.array([answer.doubt for answer in with_all]),
        ),
    }


def area_under_curve(foreign: np.ndarray, known: np.ndarray) -> float:
    """Share of pairs in which the foreign reading is in more doubt than the known one; ties count
    half.
    """
    more = (foreign[:, None] > known).mean()
    same = (foreign[:, None] == known).mean()
    return float(more + 0.5 * same)


def _mixture(
    task: str,
    source: Source,
    namer: Namer,
    library: Table,
    bands: Bool[np.ndarray, "bands"],
    record: Record,
) -> None:
    """Two paints whose families are known, at least one of them coloured."""
    known = set(known_families(library))
    rows = []
    for row in source.chosen("mixture"):
        families = source.families(source.samples[row])
        if len(families) == 2 and set(families) <= known and set(families) - COLOURLESS:
            rows.append(row)
    if not rows:
        return
    readings = np.where(bands, grid_readings(source, rows), np.nan)
    unnamed = Table(
        readings=readings,
        families=np.array([""] * len(rows)),
        groups=np.array([source.group] * len(rows)),
        samples=tuple(source.samples[row] for row in rows),
    )
    answers = namer.answer(unnamed, [None] * len(rows), pairs=True)
    truths = [source.families(sample) for sample in unnamed.samples]
    record.add(task, source.name, namer.name, score_names(answers, truths))
    for answer, truth, sample in zip(answers, truths, unnamed.samples, strict=True):
        if answer.refused or not (answer.ranked and is_right(answer.ranked[0], truth)):
            record.fail(task, source, namer, sample, truth, answer)


# ---- mixtures from recipes -----------------------------------------------------------------------


def run_mixing(
    sources: Sequence[Source], mixers: Sequence[Callable[[], Mixer]], record: Record
) -> None:
    """Tasks `predict` and `amounts`: each source's mixtures by what its own group teaches."""
    for source in sources:
        if source.bare is not None:
            _predict_over_cards(source, record)
            continue
        taught = [s for s in sources if s.group == source.group and s.learnable and s.bare is None]
        films, tests = mixing_films(source, taught)
        if films is None or tests is None:
            continue
        for make in mixers:
            mixer = make()
            mixer.learn(films)
            _predict(source, mixer, tests, record)
            _amounts(source, mixer, tests, record)


def mixing_films(
    source: Source, taught: Sequence[Source]
) -> tuple[Mixtures | None, Mixtures | None]:
    """Films to learn from, pure paints and mixtures of a source's group, and its mixtures that are
    tests; None where there are none.

    Of an added source all mixtures are tests, and all films of its group may be learnt from.
    Mixtures with a paint that no film to learn from holds are left out.
    """
    pieces = [
        (other, [row for row, s in enumerate(other.samples) if _may_teach(s, source.extra)])
        for other in taught
    ]
    tests = [
        row
        for row in source.chosen("mixture")
        if source.samples[row].fractions and (source.extra or source.samples[row].test)
    ]
    pieces = [(other, rows) for other, rows in pieces if rows]
    if not pieces or not tests:
        return None, None
    paints = tuple(
        dict.fromkeys(
            code for other, rows in pieces for row in rows for code in other.samples[row].paints
        )
    )
    tests = [row for row in tests if set(source.samples[row].paints) <= set(paints)]
    if not tests:
        return None, None
    grid = _MIX_GRID
    films = _films(pieces, paints, grid)
    unnamed = _films([(source, tests)], paints, grid)
    both = finite_columns([films.readings, unnamed.readings])
    return _in_bands(films, both), _in_bands(unnamed, both)


def _may_teach(sample: Sample, extra: bool) -> bool:
    if sample.kind == "pure":
        return True
    return sample.kind == "mixture" and bool(sample.fractions) and (extra or not sample.test)


def _films(
    pieces: Sequence[tuple[Source, Sequence[int]]],
    paints: tuple[str, ...],
    grid: Float[np.ndarray, "bands"],
) -> Mixtures:
    readings = []
    fractions = []
    names = []
    for source, rows in pieces:
        readings.append(grid_readings(source, rows, grid))
        for row in rows:
            sample = source.samples[row]
            shares = sample.fractions or (1.0,) * len(sample.paints)
            parts = dict(zip(sample.paints, shares, strict=True))
            fractions.append([parts.get(code, 0.0) / sum(shares) for code in paints])
            names.append(sample.name if len(pieces) == 1 else f"{source.name}: {sample.name}")
    return Mixtures(
        wavelengths=grid,
        readings=np.concatenate(readings),
        fractions=np.array(fractions),
        paints=paints,
        names=tuple(names),
    )


def _in_bands(films: Mixtures, bands: Bool[np.ndarray, "bands"]) -> Mixtures:
    return replace(films, wavelengths=films.wavelengths[bands], readings=films.readings[:, bands])


def _predict_over_cards(source: Source, record: Record) -> None:
    """Films over a white and a black card: of each, two readings are predicted."""
    rows = [row for row, sample in enumerate(source.samples) if sample.kind in ("pure", "mixture")]
    learnt = [row for row in rows if not source.samples[row].test]
    known = {code for row in learnt for code in source.samples[row].paints}
    tests = [row for row in rows if source.samples[row].test]
    tests = [row for row in tests if set(source.samples[row].paints) <= known]
    taught = films_over_cards(source, learnt)
    unnamed = films_over_cards(source, tests)
    recipes = {
        sample.name.removesuffix(" over white"): dict(
            zip(sample.paints, sample.fractions, strict=True)
        )
        for sample in source.samples
    }
    seen = unnamed.over_cards.reshape(-1, unnamed.wavelengths.size)
    for method in over_cards():
        predicted = method.predict(taught, unnamed, recipes)
        gain = np.ones((len(seen), 1))
        scores = score_predicted(unnamed.wavelengths, predicted, seen, gain)
        record.add("predict", source.name, method.name, {"n": len(unnamed), **scores})


def _predict(source: Source, mixer: Mixer, tests: Mixtures, record: Record) -> None:
    predicted = mixer.predict(tests.fractions)
    if predicted is None:
        return
    seen = bounded(tests.readings)
    gain = np.ones((len(tests), 1))
    if source.group in _FREE_LEVEL:  # The level that meets best: only the shape can be predicted.
        gain = np.sum(seen * predicted.readings, axis=1, keepdims=True)
        gain = gain / np.sum(predicted.readings**2, axis=1, keepdims=True)
    scores = score_predicted(tests.wavelengths, predicted, seen, gain)
    record.add("predict", source.name, mixer.name, {"n": len(tests), **scores})


def score_predicted(
    wavelengths: Float[np.ndarray, "bands"],
    predicted: Predicted,
    seen: Float[np.ndarray, "films bands"],
    gain: Float[np.ndarray, "films 1"],
) -> Scores:
    """`rmse`, `delta_e`, `inside` of 90 % bands, and `rank`: Spearman's correlation of stated and
    true errors, None where a method states none.
    """
    off = gain * predicted.readings - seen
    each = np.sqrt(np.mean(off**2, axis=1))
    inside = (gain * predicted.low <= seen) & (seen <= gain * predicted.high)
    stated = np.isfinite(predicted.expected).all() and np.ptp(predicted.expected) > 0
    return {
        "rmse": float(np.sqrt(np.mean(off**2))),
        "delta_e": delta_e(wavelengths, gain * predicted.readings, seen),
        "inside": float(inside.mean()),
        "rank": float(np.asarray(spearmanr(predicted.expected, each))[0]) if stated else None,
    }


def delta_e(
    wavelengths: Float[np.ndarray, "bands"],
    one: Float[np.ndarray, "films bands"],
    other: Float[np.ndarray, "films bands"],
) -> float:
    """Mean CIEDE2000 under D65, 10 degrees, from the bands of 420 to 700 nm."""
    grid = np.arange(400.0, 701.0, 10.0)
    pairs = [
        np.stack([np.interp(grid, wavelengths, np.clip(row, 0.0, 1.0)) for row in rows])
        for rows in (one, other)
    ]
    return float(np.mean(colour.delta_e_of_spectra(grid, *pairs)))


def _amounts(source: Source, mixer: Mixer, tests: Mixtures, record: Record) -> None:
    there = tests.fractions > 0
    found = mixer.amounts(tests.readings, there)
    if found is None:
        return
    off = np.abs(found - tests.fractions)[there]
    record.add(
        "amounts",
        source.name,
        mixer.name,
        {"n": len(tests), "mean": float(off.mean()), "median": float(np.median(off))},
    )


def interval(score: float, count: int) -> tuple[float, float]:
    """95 % interval of a share, by Wilson's score."""
    if not count:
        return 0.0, 1.0
    z = 1.96
    middle = (score + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(score * (1 - score) / count + z**2 / (4 * count**2))
    return max(0.0, middle - half), min(1.0, middle + half)
