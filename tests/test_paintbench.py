"""The bench of real paint: sources are read as they say, answers are judged as its README says."""

import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from benchmarks.paintbench import sources, splits, tasks
from benchmarks.paintbench.library import Answer, pure_table
from benchmarks.paintbench.mixers import AbsorbanceUnmixing, KubelkaMunk, Mixtures
from benchmarks.paintbench.spectra import GRID, absorbance, cosine_distance, on_grid, slopes
from benchmarks.rivals import namers

from glazejax import catalogue


@pytest.fixture(scope="module")
def measured(shared_data):
    return {source.name: source for source in sources.read_sources(shared_data)}


def write_source(folder, *, kinds=("pure", "pure", "mixture"), fractions="0.25 + 0.75"):
    folder.mkdir()
    bands = np.arange(400.0, 701.0, 10.0)
    red = 0.1 + 0.6 / (1.0 + np.exp(-(bands - 590.0) / 12.0))
    rows = np.column_stack([bands, red, np.full(bands.size, 0.9), 0.5 * (red + 0.9)])
    head = "wavelength_nm\tR\tW\tRW"
    np.savetxt(
        folder / "reflectance.tsv", rows, fmt="%.5f", delimiter="\t", header=head, comments=""
    )
    lines = [
        f"R\t{kinds[0]}\tVR\t\t\t",
        f"W\t{kinds[1]}\tLW\t\t\t",
        f"RW\t{kinds[2]}\tVR + LW\t{fractions}\t\t",
    ]
    head = "sample\tkind\tpaints\tfractions\tbinder\tsupport"
    (folder / "samples.tsv").write_text("\n".join([head, *lines]) + "\n")
    (folder / "paints.tsv").write_text(
        "code\tfamily\tname\nVR\tvermilion\tred\nLW\tlead white\twhite\n"
    )
    return folder


def test_the_frozen_splits_are_those_of_the_rule(measured):
    splits.check_hashes()
    for name in ("bath", "grillini", "hyperdoc", "revigo"):
        for sample in measured[name].samples:
            assert sample.test == splits.is_test(name, sample), (name, sample.name)


def test_all_sources_come_to_one_form(measured):
    families = catalogue.families()
    for source in measured.values():
        for paint in source.paints.values():
            known = (*families, sources.FOREIGN, *sources.UNCLEAR)
            assert paint.family in known, (source.name, paint)
        for camera in source.cameras:
            assert camera.readings.shape == (len(source.samples), camera.wavelengths.size)
    assert len(measured["hyppigments"].samples) == 1592
    assert "74A" not in {sample.name for sample in measured["hyperdoc"].samples}
    assert measured["revigo"].bare is not None


def test_films_that_are_said_to_hide_their_ground_lie_over_no_black_card(measured):
    source = measured["revigo"]
    rows = [row for kind in ("pure", "mixture") for row in source.chosen(kind)]
    assert len(rows) == len(source.samples) / 2
    assert {source.samples[row].support for row in rows} == {sources.WHITE_CARD}
    table = pure_table([source])
    chalk = table.readings[table.families == "chalk"]
    assert np.nanmin(chalk[:, GRID >= 420.0]) > 0.4


def test_readings_on_the_grid_are_those_of_the_instrument(measured):
    bath = measured["bath"].cameras[0]
    found = on_grid(bath.wavelengths, bath.readings[:2], GRID)
    at = np.searchsorted(bath.wavelengths, GRID)
    assert np.abs(found - bath.readings[:2, at]).max() < 0.01
    golden = measured["golden"].cameras[0]
    found = on_grid(golden.wavelengths, golden.readings[:1], GRID)
    assert np.isnan(found[0, GRID > 750.0]).all()
    assert found[0, GRID == 500.0] == pytest.approx(golden.readings[0, 12])


@pytest.mark.parametrize(
    ("answer", "truth", "right"),
    [
        ([("azurite",)], ["azurite"], True),
        ([("azurite",), ("chalk",)], ["azurite"], True),
        ([("azurite",), ("vermilion",)], ["azurite"], False),
        ([("lead white", "chalk")], ["chalk"], True),
        ([("azurite",), ("chalk",)], ["chalk"], False),
        ([("red ochre", "yellow ochre", "raw umber", "burnt umber")], ["raw umber"], True),
        ([("a", "b", "c", "d", "azurite")], ["azurite"], False),
        ([("vermilion",), ("minium", "azurite")], ["azurite", "vermilion"], True),
        ([("vermilion",)], ["azurite", "vermilion"], False),
        ([("vermilion",)], ["lead white", "vermilion"], True),
        ([], ["azurite"], False),
    ],
)
def test_an_answer_is_right_as_the_readme_says(answer, truth, right):
    assert tasks.is_right(answer, truth) == right


def test_scores_against_their_closed_forms():
    chances = np.array([0.95, 0.95, 0.55, 0.55])
    assert tasks.calibration_error(chances, np.array([1.0, 1.0, 1.0, 0.0])) == pytest.approx(0.05)
    assert tasks.area_under_curve(np.array([2.0, 3.0]), np.array([0.0, 2.0])) == 0.875
    low, high = tasks.interval(0.5, 100)
    assert (low, high) == (pytest.approx(0.4038, abs=1e-4), pytest.approx(0.5962, abs=1e-4))


def test_what_is_stated_sums_over_whites_that_do_not_count():
    answer = Answer(
        ranked=(
            (("azurite",), ("lead white", "chalk")),
            (("malachite",),),
            (("azurite",),),
        ),
        chances=(0.5, 0.3, 0.1),
        doubt=0.1,
        refused=False,
    )
    assert tasks.stated_chance(answer) == pytest.approx(0.6)
    white = replace(answer, ranked=((("chalk",),), (("lead white",),), (("chalk",), ("gypsum",))))
    assert tasks.stated_chance(white) == pytest.approx(0.6)


def test_sure_answers_are_counted_and_how_many_are_right():
    azurite = Answer(ranked=((("azurite",),),), chances=(0.9,), doubt=0.1, refused=False)
    answers = [azurite, azurite, replace(azurite, chances=(0.7,)), replace(azurite, refused=True)]
    truths = [("azurite",), ("smalt",), ("azurite",), ("azurite",)]
    grey = np.full((4, GRID.size), 0.3)
    scores = tasks.score_headlines(answers, truths, grey)
    assert scores == {"sure": 0.5, "sure_right": 0.5, "nonsense": 0.0}
    silent = [replace(azurite, chances=())]
    assert tasks.score_headlines(silent, truths[:1], grey[:1])["sure"] is None


@pytest.mark.parametrize(
    ("named", "level", "slope", "film", "nonsense"),
    [
        ("lead white", 0.9, 0.0, None, False),
        ("lead white", 0.05, 0.0, None, True),  # L* 27
        ("carbon black", 0.5, 0.9, None, True),  # an orange
        ("vermilion", 0.5, 0.9, None, False),
        ("vermilion", 0.5, 0.9, 0.05, True),
        ("vermilion", 0.5, 0.0, 0.45, False),
    ],
)
def test_an_answer_that_contradicts_the_colour_is_nonsense(named, level, slope, film, nonsense):
    reading = level * (1.0 + slope * np.tanh((GRID - 560.0) / 60.0))
    answer = Answer(
        ranked=(((named,),),),
        doubt=0.1,
        refused=False,
        film=None if film is None else np.full(GRID.size, film),
    )
    assert tasks.contradicts(answer, reading) == nonsense
    assert not tasks.contradicts(replace(answer, refused=True), reading)


def test_a_source_of_unclear_licence_is_asked_and_teaches_nothing(measured):
    assert not measured["makers"].learnable
    assert measured["usgs"].learnable

    class Recording:
        name = "recording"
        groups: frozenset[str] = frozenset()

        def learn(self, library):
            self.groups |= set(library.groups.tolist())

        def answer(self, sought, hidden, pairs):
            return [Answer(ranked=(), doubt=1.0, refused=True)] * len(sought)

    method = Recording()
    record = tasks.Record()
    some = [measured[name] for name in ("makers", "usgs", "kimera")]
    tasks.run_names(some, [method], record)
    assert "makers" in record.results["pigment_380"]
    # A source that starts at 400 nm has nothing below it to be asked.
    assert "kimera" not in record.results["pigment_380"]
    assert method.groups == {"usgs", "kimera"}


def test_what_is_stated_is_counted_with_and_without_near_infrared(measured):
    """A namer that says vermilion of everything, at .9, and refuses half of what it is asked."""

    class Vermilion:
        name = "glazejax"

        def learn(self, library):
            self.taught = set(library.groups.tolist())

        def answer(self, sought, hidden, pairs):
            assert not pairs
            assert not self.taught & set(sought.groups.tolist())
            return [
                Answer(ranked=((("vermilion",),),), chances=(0.9,), doubt=0.1, refused=row % 2 == 1)
                for row in range(len(sought))
            ]

    used = [measured[name] for name in ("hyperdoc", "kimera", "rrt")]
    stated = tasks.stated_and_right(used, Vermilion())
    told = {(source, infrared) for source, infrared, *_ in stated}
    seen_twice = {(name, infrared) for name in ("hyperdoc", "rrt") for infrared in (True, False)}
    assert told == {*seen_twice, ("kimera", False)}
    assert {chance for *_, chance, _ in stated} == {0.9}
    # Each reading that holds the near infrared is asked twice, and half is refused.
    counts = [sum(each[:2] == ("hyperdoc", seen) for each in stated) for seen in (True, False)]
    assert counts[0] == counts[1] > 10
    reds = [right for source, infrared, _, right in stated if source == "hyperdoc" and infrared]
    assert 0 < sum(reds) < len(reds)


def test_slopes_do_not_see_a_level_and_bands_that_lack_are_left_out():
    rng = np.random.default_rng(0)
    reading = rng.uniform(0.2, 0.5, (1, GRID.size))
    assert slopes(absorbance(reading)) == pytest.approx(slopes(absorbance(0.8 * reading)))
    other = reading.copy()
    other[:, GRID > 700] = np.nan
    assert cosine_distance(reading, other)[0, 0] == pytest.approx(0.0, abs=1e-12)
    other[:, GRID > 450] = np.nan
    assert np.isinf(cosine_distance(reading, other))[0, 0]


def test_neighbours_name_their_own_readings_and_obey_what_is_hidden(measured):
    table = pure_table([measured["rrt"], measured["bath"], measured["grillini"]])
    for method in namers.namers()[:4]:
        method.learn(table)
        answers = method.answer(table, [None] * len(table), pairs=False)
        own = [a.ranked[0] == ((f,),) for a, f in zip(answers, table.families, strict=True)]
        assert np.mean(own) > 0.8, method.name
        hidden = method.answer(table, [str(f) for f in table.families], pairs=False)
        for answer, family in zip(hidden, table.families, strict=True):
            assert ((str(family),),) not in [tuple(sets) for sets in answer.ranked]


def mixtures_by_kubelka_munk():
    rng = np.random.default_rng(1)
    k = np.array([[0.02, 0.02], [2.0, 0.1], [0.05, 1.0]])  # (paints, bands)
    s = np.array([[1.0, 1.0], [0.4, 0.6], [0.3, 0.2]])
    fractions = np.concatenate([np.eye(3), rng.dirichlet(np.ones(3), 20)])
    ratio = (fractions @ k) / (fractions @ s)
    return Mixtures(
        wavelengths=np.array([500.0, 600.0]),
        readings=1.0 + ratio - np.sqrt(ratio**2 + 2.0 * ratio),
        fractions=fractions,
        paints=("W", "R", "B"),
        names=tuple(str(n) for n in range(len(fractions))),
    )


@pytest.mark.parametrize("pairs", [False, True])
def test_two_constants_are_found_again_in_their_own_mixtures(pairs):
    films = mixtures_by_kubelka_munk()
    method = KubelkaMunk(pairs=pairs)
    method.learn(films.take(np.arange(15)))
    rest = films.take(np.arange(15, len(films)))
    foretold = method.foretell(rest.fractions)
    # Half of the error that the method counts with: its priors pull by some of that.
    assert np.abs(foretold.readings - rest.readings).max() < 5e-3
    assert ((foretold.low <= rest.readings) & (rest.readings <= foretold.high)).all()
    found = method.amounts(rest.readings[:3], np.ones((3, 3), bool))
    assert np.abs(found - rest.fractions[:3]).max() < 0.05


def test_unmixing_is_exact_where_absorbances_add():
    values = np.array([[0.9, 0.5, 0.3], [0.4, 0.8, 0.9]])
    mixed = np.exp(0.25 * np.log(values[0]) + 0.75 * np.log(values[1]))
    films = Mixtures(
        wavelengths=np.array([450.0, 550.0, 650.0]),
        readings=values,
        fractions=np.eye(2),
        paints=("A", "B"),
        names=("A", "B"),
    )
    method = AbsorbanceUnmixing()
    method.learn(films)
    found = method.amounts(mixed[None], np.ones((1, 2), bool))
    assert found == pytest.approx(np.array([[0.25, 0.75]]), abs=1e-9)
    assert method.foretell(np.eye(2)) is None


class Listener:
    """A method that keeps which makers it was taught and asked, and answers nothing."""

    name = "listener"

    def __init__(self):
        self.heard = []

    def learn(self, library):
        self.heard.append({sample.name.split("-")[0] for sample in library.samples})

    def answer(self, sought, hidden, pairs):
        asked = {sample.name.split("-")[0] for sample in sought.samples}
        self.heard[-1] = (self.heard[-1], asked)
        return [Answer(ranked=(), doubt=0.0, refused=True)] * len(sought)


def test_a_maker_is_asked_with_the_paints_of_all_others(measured):
    method = Listener()
    record = tasks.Record()
    tasks.run_references([measured["makers"], measured["kimera"]], [method], record)
    every = {sample.name.split("-")[0] for sample in measured["makers"].samples}
    assert len(method.heard) == 2 * len(every)
    for taught, (asked,) in method.heard:
        assert every - taught == {asked}
        assert taught - every, "the library is not there"
    scores = record.results["references_380"]["makers"]["listener"]
    assert (scores["n"] or 0) > 300
    assert scores["refused"] == 1.0


@pytest.mark.slow
def test_the_bench_runs_on_some_sources_and_takes_one_from_outside(
    tmp_path, shared_data, monkeypatch, capsys
):
    from benchmarks.paintbench import __main__ as bench

    some = tmp_path / "data"
    some.mkdir()
    for name in ("bath", "rrt", "kimera", "hyperdoc"):
        (some / name).symlink_to(shared_data / name)
    extra = write_source(tmp_path / "new-one")
    words = ["paintbench", "--quick", "--data", str(some), "--extra", str(extra)]
    monkeypatch.setattr("sys.argv", [*words, "--json", str(tmp_path / "scores.json")])
    bench.main()
    scores = json.loads((tmp_path / "scores.json").read_text())
    assert scores["pigment"]["new-one"]["glazejax"]["n"] == 2
    assert set(scores["predict"]["bath"]) >= {"glazejax", "Kubelka-Munk"}
    methods = {"glazejax", "spectral angle"}
    if find_spec("sklearn"):
        methods.add("linear classifier")
    assert set(scores["pigment"]["rrt"]) >= methods
    tasks_there = {"pigment", "mixture", "none", "amounts", "predict", "coats", "calibration"}
    assert set(scores) >= tasks_there
    for by_source in scores.values():
        for by_method in by_source.values():
            for values in by_method.values():
                assert values["n"] > 0
                assert all(value is None or np.isfinite(value) for value in values.values())
    assert "PIGMENT" in capsys.readouterr().out
