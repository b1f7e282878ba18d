"""A bench of real paint: methods that name pigments, predict mixtures and estimate amounts, on other
people's measurements.

    python -m benchmarks.paintbench [--data DIR] [--extra DIR] [--json FILE] [--out FOLDER]

Prints one table and every answer of glazejax that is not right, and writes the scores as JSON.
The README next to this file says what the tasks are and how to enter a source or a method.
"""

import argparse
import itertools
import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from benchmarks.measured import data_folder
from benchmarks.results import Quantity, Results, command_line, percent, progress
from benchmarks.rivals.namers import namers
from glazefit.identify.result.in_tests import FILE
from glazejax.commands.main import start_jax
from glazejax.io import write_table

from .coats import NEIGHBOUR, OTHER_BINDER, OWN_BINDER, VISIBLE, run_coats
from .mixers import AbsorbanceUnmixing, KubelkaMunk
from .program import FamilyCatalogue, FilmCatalogues, JointFit
from .sources import Source, read_sources
from .splits import check_hashes
from .tasks import (
    SURE,
    Failure,
    Record,
    Scores,
    interval,
    run_mixing,
    run_names,
    run_own,
    run_references,
    run_with_own_paints,
    stated_and_right,
)

NEEDS = ("data/hyperdoc", "data/bath", "data/grillini", "sklearn")

# Samples of a chart of hundreds; of a quick run one in so many.
EVERY = 1
_SHARES = ("first", "three", "refused", "sure", "nonsense", "found", "false", "right", "decided")
_OURS = FamilyCatalogue.name
# Between these, stated probabilities are counted together.
STATED = (0.0, 0.4, 0.6, 0.8, 0.9, 1.01)
# Shares that are recorded: name -> task, source, method, score.
_RECORDED = {
    **{
        f"{key}_{what}": (task, source, method, score)
        for key, task, source in (
            ("hyperdoc", "pigment", "hyperdoc"),
            ("chart", "pigment", "hyppigments"),
            ("acrylics", "pigment", "kimera"),
            ("visible", "pigment_visible", "hyperdoc"),
        )
        for what, method, score in (
            ("first", _OURS, "first"),
            ("three", _OURS, "three"),
            ("neighbour", "slopes of both", "first"),
            ("classifier", "linear classifier", "first"),
        )
    },
    **{
        f"makers_{what}": (task, "makers", method, score)
        for what, task, method, score in (
            ("first", "pigment_400", _OURS, "first"),
            ("three", "pigment_400", _OURS, "three"),
            ("neighbour", "pigment_400", "slopes of both", "first"),
            ("references_first", "references_400", "glazejax, references", "first"),
            ("references_three", "references_400", "glazejax, references", "three"),
            ("references_neighbour", "references_400", "slopes of both", "first"),
        )
    },
    "none_found": ("none", "hyperdoc", _OURS, "found"),
    "none_false": ("none", "hyperdoc", _OURS, "false"),
    "none_angle": ("none", "hyperdoc", "spectral angle", "found"),
    "none_makers": ("none", "makers", _OURS, "found"),
    "none_makers_angle": ("none", "makers", "spectral angle", "found"),
    "none_makers_pairs": ("none", "makers", _OURS, "auc"),
    "mixed_bath": ("mixture", "bath", _OURS, "first"),
    "mixed_grillini": ("mixture", "grillini", _OURS, "first"),
    "mixed_bath_own": ("mixture", "bath", "glazejax, own paints", "first"),
    "mixed_grillini_own": ("mixture", "grillini", "glazejax, own paints", "first"),
    "mixed_grillini_unmixing": ("mixture", "grillini", "NNLS of -log R", "first"),
    "own_pure": ("pigment_own", "revigo", _OURS, "first"),
    "own_mixed": ("mixture_own", "revigo", _OURS, "first"),
}
# The same of the task coats alone.
_RECORDED_OF_COATS = {
    **{
        f"{key}_{score}": ("coats", source, method, score)
        for key, source, method in (
            ("own", "hyperdoc", OWN_BINDER),
            ("visible", "hyperdoc", VISIBLE),
            ("other", "hyperdoc", OTHER_BINDER),
            ("probe", "bath", OWN_BINDER),
        )
        for score in ("right", "decided", "right_decided")
    },
    "neighbour": ("coats", "hyperdoc", NEIGHBOUR, "right"),
    "probe_neighbour": ("coats", "bath", NEIGHBOUR, "right"),
}


def main() -> None:
    """Run the bench."""
    parser = command_line(__doc__, {"every": 23, "pairs": 2})
    parser.add_argument(
        "--data", type=Path, help="folder of measured data (default: GLAZEJAX_DATA or ../shared)"
    )
    parser.add_argument(
        "--extra", type=Path, help="folder of further sources, all of whose samples are tests"
    )
    parser.add_argument("--json", type=Path, help="file for the scores")
    parser.add_argument(
        "--own-films",
        action="store_true",
        help="identify among the oils and acrylics alone, too: some minutes for each source",
    )
    parser.add_argument(
        "--coats", action="store_true", help="only the task coats, with a result of its own"
    )
    parser.add_argument(
        "--stated",
        action="store_true",
        help="only how often what is stated is right; written to the table that identify quotes",
    )
    parser.add_argument("--every", type=int, default=EVERY, help=argparse.SUPPRESS)
    # Mixtures, and superpositions, that the task coats asks for in each source.
    parser.add_argument("--pairs", type=int, default=None, help=argparse.SUPPRESS)
    options = parser.parse_args()
    check_hashes()
    start_jax()
    sources = [
        thinned(source, options.every)
        for source in read_sources(options.data or data_folder(), options.extra)
    ]
    if options.stated:
        write_in_tests(sources)
        return
    if options.coats:
        coats = Record()
        run_coats(sources, coats, options.pairs)
        results = Results("paintbench_coats", options.out, "numpy", "scipy")
        for line in lines_of(coats):
            results(line)
        results.record(**quantities(coats, _RECORDED_OF_COATS))
        results.save()
        return
    record = run(sources, options.own_films, options.pairs, options.every)
    # Scores of sources from outside are no result of the repository's.
    if find_spec("sklearn") is None:
        print("left out, scikit-learn is not installed: the linear classifier")
    if options.extra is None and options.data is None:
        learner = ("scikit-learn",) if find_spec("sklearn") else ()
        results = Results("paintbench", options.out, "numpy", "scipy", *learner)
        for line in lines_of(record):
            results(line)
        for line in failures_of(record.failures):
            results(line)
        results.record(**quantities(record, _RECORDED))
        results.save()
    else:
        print("\n".join(lines_of(record)))
    if options.json:
        options.json.write_text(json.dumps(record.results, indent=1, sort_keys=True) + "\n")
        print(f"scores written to {options.json}")


def write_in_tests(sources: list[Source]) -> None:
    """Count answers and right ones by what was stated, and write the table that ships."""
    stated = stated_and_right(sources, FamilyCatalogue())
    for name in dict.fromkeys(source for source, *_ in stated):
        for infrared in (True, False):
            own = [each[2:] for each in stated if each[:2] == (name, infrared)]
            if own:
                sure = [right for chance, right in own if chance >= SURE]
                print(f"{name}, infrared {infrared}: {len(own)}, sure {len(sure)}: {sum(sure)}")
    rows = []
    for infrared in (True, False):
        own = [(chance, right) for _, seen, chance, right in stated if seen == infrared]
        for low, high in itertools.pairwise(STATED):
            inside = [right for chance, right in own if low <= chance < high]
            rows.append([int(infrared), low, min(high, 1.0), len(inside), sum(inside)])
    write_table(FILE, ["infrared", "from", "to", "answers", "right"], rows, overwrite=True)
    print(FILE.read_text())


def thinned(source: Source, every: int) -> Source:
    """A large chart with one sample in so many; other sources as they are."""
    if every == 1 or len(source.samples) < 500:
        return source
    return source.take(range(0, len(source.samples), every))


def run(
    sources: list[Source], own_films: bool = False, pairs: int | None = None, every: int = EVERY
) -> Record:
    """All tasks; with identification among the oils and acrylics alone, if asked.

    Args:
        sources: of samples.
        own_films: whether paints are searched among the oils and acrylics, too.
        pairs: mixtures, and superpositions, that the task coats takes of each source; None for all.
        every: one maker in so many is searched among the others' paints.
    """
    record = Record()
    progress("names of pigments")
    ours = [FamilyCatalogue(), *([FilmCatalogues()] if own_films else [])]
    run_names(sources, [*ours, *namers()], record)
    # What a wrong word on the instrument costs: readings are mostly of 45:0.
    others = [FamilyCatalogue(instrument) for instrument in ("de:8", "d:8")]
    run_names(sources, others, record, tasks=("pigment", "pigment_400"))
    run_names(sources, [FamilyCatalogue(elements=True)], record, tasks=("pigment",))
    record.score_calibration()
    nearest = [namer for namer in namers() if namer.name == "slopes of both"]
    run_references(sources, [FamilyCatalogue(references="makers"), *nearest], record, every=every)
    run_own(sources, FamilyCatalogue(), record)
    run_with_own_paints(sources, lambda group: FamilyCatalogue(own_paints=group), record)
    progress("mixtures")
    run_mixing(
        sources,
        [JointFit, KubelkaMunk, lambda: KubelkaMunk(pairs=True), AbsorbanceUnmixing],
        record,
    )
    progress("coats")
    run_coats(sources, record, pairs)
    progress()
    return record


def lines_of(record: Record) -> list[str]:
    """One table a task: a line for each source and method, shares with their 95 % intervals."""
    lines = []
    for task, by_source in record.results.items():
        scores = list(next(iter(next(iter(by_source.values())).values())))
        lines.append(
            f"{task.upper():<14}{'':<30}{'n':>6}" + "".join(f"{s:>20}" for s in scores[1:])
        )
        for source, by_method in by_source.items():
            for method, values in by_method.items():
                cells = "".join(f"{cell(name, values):>20}" for name in scores[1:])
                lines.append(f"{source:<14}{method:<30}{values['n']:>6}{cells}")
        lines.append("")
    return lines


def quantities(
    record: Record, wanted: Mapping[str, tuple[str, str, str, str]]
) -> dict[str, Quantity]:
    """Some of the shares, to be recorded; those that were not asked for are left out."""
    recorded = {}
    for name, (task, source, method, score) in wanted.items():
        values = record.results.get(task, {}).get(source, {}).get(method, {})
        if (share := values.get(score)) is not None:
            recorded[name] = percent(share, n=int(values["n"] or 0))
    return recorded


def cell(name: str, values: Scores) -> str:
    """A score; of a share, with its 95 % interval."""
    value = values.get(name)
    if value is None:
        return "-"
    if name.split("_")[0] in _SHARES:
        count = float(values["n"] or 0)
        if name == "sure_right":
            count *= float(values["sure"] or 0.0)
        low, high = interval(float(value), round(count))
        return f"{value:.1%} ({low:.0%}-{high:.0%})"
    if name == "inside":
        return f"{value:.1%}"
    return f"{value:.2f}" if name == "delta_e" else f"{value:.4f}"


def failures_of(failures: list[Failure]) -> list[str]:
    """Every answer of glazejax that is not right, a line each."""
    own = [failure for failure in failures if failure.method == _OURS]
    lines = [f"ANSWERS OF GLAZEJAX THAT ARE NOT RIGHT: {len(own)}", ""]
    for task in dict.fromkeys(failure.task for failure in own):
        for source in dict.fromkeys(f.source for f in own if f.task == task):
            here = [f for f in own if (f.task, f.source) == (task, source)]
            lines.append(f"{task}, {source}: {len(here)}")
            lines += [f"  {f.sample}: {f.truth}; said {f.answer}" for f in here]
            lines.append("")
    return lines


if __name__ == "__main__":
    main()
