"""Maps of other people's paint: which families they name, by area, and what is said where the
catalogue lacks the paint; compared with what people use, with the same exemplars.

    python -m benchmarks.maps.mosaic [--pixels 800] [--noise 0.005] [--sources 7]

Each source of measured paint is left out in turn and lies on two panels
(`benchmarks.maps.panel`): twelve flat fields, and fields under brush strokes. Two paints of a panel
are unknown to the catalogue. `no camera` names each paint from its spectrum as it was measured: what
it misses, the map cannot find. Where scikit-learn is not installed, its row is left out.
"""

import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.maps.panel import NOISE, SOURCES, Panel, lay_panel
from benchmarks.paintbench.library import FALSE_ALARMS, Answer, Namer, Table
from benchmarks.paintbench.program import answer_of_sets
from benchmarks.paintbench.spectra import GRID, on_grid
from benchmarks.paintbench.tasks import is_right
from benchmarks.results import Quantity, Results, command_line, percent, progress, quantity
from benchmarks.rivals.namers import Classifier, Neighbours, Unmixing, namers
from glazefit import IdentificationOptions, map_cube
from glazefit.identify.families.naming import name_sets
from glazefit.identify.families.set_up import search_families
from glazefit.identify.result.groups import GROUPS
from glazejax.commands.main import start_jax

NEEDS = ("zarr", "data/hyperdoc")
PARTS_NEED = ("sklearn",)

LEAST = 0.01
"""Share of an image from which a set counts by itself."""
# Brush strokes of a panel that has them, and its size compared with that of one of flat fields.
_STROKES, _LARGER = 24, 1.5
# Share of a group's probability from which a family of it is counted as named.
_WITHIN = 0.05


@dataclass(frozen=True, kw_only=True)
class Score:
    """How answers compare with a panel's truth; each a share of pixels off the edges where nothing
    else is said.

    Attributes:
        right: of known paints: the first set has the right colours and is not refused.
        pure: the same of pure paints alone.
        whole: the same as `right`, edges too.
        sets: sets of at least `LEAST` of the image, over the paints that lie there.
        small: of all pixels: in smaller sets.
        false: of known paints: called none.
        none: of unknown paints: called none.
        doubted: of unknown paints: called none where the twentieth of the known that is doubted
            most is called none.
        seconds: that the answers took.
    """

    right: float
    pure: float
    whole: float
    sets: float
    small: float
    false: float
    none: float
    doubted: float
    seconds: float


def main() -> None:
    """Run the benchmark."""
    parser = command_line(
        __doc__,
        sources=(len(SOURCES), 1, "sources that are left out in turn"),
        height=(60, 24, "lines of a panel of flat fields; it has four columns for three lines"),
        pixels=(800, 200, "pixels of a panel that each method is asked for"),
        noise=(NOISE, NOISE, "standard deviation of a reading"),
    )
    options = parser.parse_args()
    start_jax()
    learner = ("scikit-learn",) if find_spec("sklearn") else ()
    results = Results("mosaic", options.out, "zarr", *learner)
    shape = options.height, options.height * 4 // 3
    scores: dict[str, list[Score]] = {}
    for source in SOURCES[: options.sources]:
        for strokes in (0, _STROKES):
            grown = _LARGER if strokes else 1
            panel = lay_panel(
                source,
                (int(grown * shape[0]), int(grown * shape[1])),
                noise=options.noise,
                strokes=strokes,
                # Of other paints than the fields alone.
                seed=strokes,
            )
            one = score_panel(panel, options.pixels)
            results(f"\n{source}, {_words(panel, strokes)}")
            _show(results, one)
            for name, score in one.items():
                scores.setdefault(name, []).append(score)
    count = 2 * min(options.sources, len(SOURCES))
    means = {name: _mean(each) for name, each in scores.items()}
    results(f"\nMean of {count} panels")
    _show(results, means)
    if not learner:
        results("left out, scikit-learn is not installed: SVM on slopes")
    results.record(panels=quantity(count, digits=0), **_recorded(means))
    results.save()


def score_panel(panel: Panel, pixels: int) -> dict[str, Score]:
    """Scores of the map and of each rival, by name, over some pixels of a panel.

    The map sees the whole panel, the rivals one pixel at a time.
    """
    height, width = panel.labels.shape
    drawn = np.random.default_rng(0).permutation(height * width)[:pixels]
    progress(f"{panel.group}: map")
    start = time.perf_counter()
    answers = _answers_of_map(panel, drawn)
    scores = {"the map": score_answers(panel, drawn, answers, time.perf_counter() - start)}
    start = time.perf_counter()
    answers = _answers_to_spectra(panel, drawn)
    scores["no camera"] = score_answers(panel, drawn, answers, time.perf_counter() - start)
    readings = panel.readings.reshape(height * width, -1)[drawn]
    asked = on_grid(panel.wavelengths, readings, GRID)
    unnamed = Table(
        readings=asked,
        families=np.full(len(drawn), ""),
        groups=np.full(len(drawn), panel.group),
        samples=(),
    )
    bands = np.isfinite(asked).all(axis=0)
    library = panel.library()
    library = replace(library, readings=np.where(bands, library.readings, np.nan))
    for rival in _rivals():
        progress(f"{panel.group}: {rival.name}")
        start = time.perf_counter()
        rival.learn(library)
        answers = rival.answer(unnamed, [None] * len(drawn), pairs=False)
        scores[rival.name] = score_answers(panel, drawn, answers, time.perf_counter() - start)
    progress()
    return scores


def _rivals() -> list[Namer]:
    """Nearest spectra, unmixing, and a support vector machine where scikit-learn is there."""
    chosen: list[Namer] = [one for one in namers() if isinstance(one, Neighbours | Unmixing)]
    return [*chosen, Classifier(support_vectors=True)] if find_spec("sklearn") else chosen


def _answers_of_map(panel: Panel, drawn: np.ndarray) -> list[Answer]:
    """What a map of the whole panel says of some pixels."""
    with tempfile.TemporaryDirectory() as folder:
        mapped = map_cube(
            panel.image(),
            panel.pigments(),
            opaque=True,
            instrument="45:0",
            out=Path(folder) / "map.zarr",
        ).load()
    paints = [str(name) for name in mapped["paint"].values]
    numbers = {name: number for number, name in enumerate(paints)}
    members = mapped["members"].values.reshape(panel.labels.size, -1)[drawn]
    chances = mapped["paint_probability"].values.reshape(panel.labels.size, -1)[drawn]
    none = np.nan_to_num(mapped["none"].values.ravel()[drawn], nan=1.0)
    explained = mapped["explained"].values.ravel()[drawn] > 0

    def families(row: int, name: str) -> tuple[str, ...]:
        """What a name may be: a family, or those of its group that are probable."""
        if name not in GROUPS:
            return (name,)
        shares = {
            family: chances[row, numbers[family]] for family in GROUPS[name] if family in numbers
        }
        least = _WITHIN * sum(shares.values())
        return tuple(family for family, share in shares.items() if share >= least)

    return [
        Answer(
            ranked=(tuple(families(row, paints[member]) for member in own if member >= 0),),
            doubt=float(none[row]),
            refused=not explained[row],
        )
        for row, own in enumerate(members.tolist())
    ]


def _answers_to_spectra(panel: Panel, drawn: np.ndarray) -> list[Answer]:
    """What is said of the paint of some pixels from its spectrum as it was measured."""
    options = IdentificationOptions(instrument="45:0")
    search = search_families(panel.wavelengths, panel.pigments(), options)
    odds = search.odds(panel.spectra)
    of_paint = [
        answer_of_sets(name_sets(search, chances), float(none), bool(unlike) or none >= 0.5)
        for chances, none, unlike in zip(odds.sets, odds.none, odds.unlike, strict=True)
    ]
    return [of_paint[label] for label in panel.labels.ravel()[drawn]]


def score_answers(
    panel: Panel, drawn: np.ndarray, answers: Sequence[Answer], seconds: float
) -> Score:
    """Compare answers for some pixels with the truth."""
    labels = panel.labels.ravel()[drawn]
    paints = [panel.paints[label] for label in labels]
    unknown = np.array([paint.unknown for paint in paints])
    pure = np.array([len(paint.families) == 1 for paint in paints])
    inside = panel.inside.ravel()[drawn]
    refused = np.array([answer.refused for answer in answers])
    doubt = np.array([answer.doubt for answer in answers])
    right = np.array(
        [
            not answer.refused
            and bool(answer.ranked)
            and is_right(answer.ranked[0], paint.families)
            for answer, paint in zip(answers, paints, strict=True)
        ]
    )
    sets = Counter(answer.ranked[0] for answer in answers if answer.ranked and not answer.refused)
    large = {name for name, count in sets.items() if count >= LEAST * len(drawn)}
    known = inside & ~unknown
    foreign = inside & unknown
    limit = np.quantile(doubt[known], 1.0 - FALSE_ALARMS)
    return Score(
        right=right[known].mean(),
        pure=right[known & pure].mean(),
        whole=right[~unknown].mean(),
        sets=len(large) / len(set(labels.tolist())),
        small=sum(count for name, count in sets.items() if name not in large) / len(drawn),
        false=refused[known].mean(),
        none=refused[foreign].mean(),
        doubted=(doubt[foreign] > limit).mean(),
        seconds=seconds,
    )


def _mean(scores: Sequence[Score]) -> Score:
    """Means over panels."""
    return Score(
        **{name: float(np.mean([getattr(one, name) for one in scores])) for name in vars(scores[0])}
    )


def _words(panel: Panel, strokes: int) -> str:
    height, width = panel.labels.shape
    unknown = [" + ".join(paint.families) for paint in panel.paints if paint.unknown]
    mixed = sum(len(paint.families) > 1 for paint in panel.paints)
    return (
        f"{height} x {width} pixels, {panel.wavelengths.size} bands from "
        f"{panel.wavelengths[0]:.0f} to {panel.wavelengths[-1]:.0f} nm, {strokes} strokes; "
        f"{len(panel.paints)} paints, {mixed} of them mixtures; unknown: {', '.join(unknown)}"
    )


_HEADS = (
    ("right", ""),
    ("right,", "pure"),
    ("right,", "edges too"),
    ("sets", "a paint"),
    ("in small", "sets"),
    ("false", "none"),
    ("unknown", "none"),
    ("the same", "at 5 %"),
    ("seconds", ""),
)


def _show(results: Results, scores: dict[str, Score]) -> None:
    """Print a line for each method."""
    for line in zip(*_HEADS, strict=True):
        results(f"{'':<20}{''.join(f'{word:>11}' for word in line)}".rstrip())
    for name, one in scores.items():
        cells = [f"{value:.0%}" for value in vars(one).values()]
        cells[3], cells[-1] = f"{one.sets:.2f}", f"{one.seconds:.1f}"
        results(f"{name:<20}{''.join(f'{cell:>11}' for cell in cells)}")


_KEYS = {
    "the map": "map",
    "no camera": "spectra",
    "spectral angle": "angle",
    "slopes of both": "slopes",
    "NNLS of -log R": "nnls",
    "SVM on slopes": "svm",
}
"""Methods whose scores are recorded, and what texts call them."""


def _recorded(means: dict[str, Score]) -> dict[str, Quantity]:
    """Scores as texts quote them."""
    recorded = {}
    for name, key in _KEYS.items():
        if name not in means:
            continue
        one = means[name]
        recorded[f"{key}_sets"] = quantity(one.sets, digits=1)
        for score in ("right", "pure", "false", "none", "doubted"):
            recorded[f"{key}_{score}"] = percent(getattr(one, score))
    return recorded


if __name__ == "__main__":
    main()
