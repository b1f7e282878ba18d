"""The report of a map: whole, from nowhere else, and true to the map."""

import html
import re
from unittest import mock

import numpy as np
import pytest
from jinja2 import UndefinedError

from glazefit.mapping.show.classes import CLASSES
from glazefit.mapping.show.overview import shown_sets
from glazefit.mapping.show.page import _WAYS, write_report
from glazefit.mapping.show.page_rows import small_spectrum
from glazefit.mapping.store.chunk import SetSum
from glazefit.mapping.store.layout import Status, Way
from glazefit.page.templates import fill_template
from tests.mapping import small

from ..fitting.test_identify_page import Parsed
from .truth_map import GRID, painting, truth_map

EVIL = '<b>&"'
ABOUT = {
    "title": "a <b>painting</b>",
    "created": "2026-01-02, 03:04",
    "command": "glazejax map cube.hdr --out 'a & b'",
    "facts": {"Ground": "grey < white"},
    "options": {"Noise": "0.003"},
    "versions": {"glazejax": "1.2.3"},
    "platform": "",
    "inputs": [{"role": "cube", "name": "cube.hdr", "sha256": "0123abcd"}],
    "shortcuts": {"Alike": "solved once"},
    "agreement": {"Same first set": "97.5 % of 2,000 pixels"},
    "notes": ["A band was dead."],
}


@pytest.fixture(scope="module")
def made():
    return truth_map(painting((64, 96), seed=2))


@pytest.fixture(scope="module")
def report(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    dataset, sets = made
    cube = small.image(painting((64, 96), seed=2).rows(0, 64), GRID)
    return write_report(dataset, sets, ABOUT, folder, cube=cube)


@pytest.fixture(scope="module")
def page(report):
    return report.read_text(encoding="utf-8")


GREY = small.image(np.full((64, 96, GRID.size), 0.5), GRID)


def report_of(*map_and_about, **facts):
    """A report without the pictures beside it."""
    with mock.patch("glazefit.mapping.show.page.write_pictures", return_value=[]):
        return write_report(*map_and_about, cube=GREY, **facts)


@pytest.fixture(scope="module")
def part(made, tmp_path_factory):
    """A map of its upper part, whose columns were answered in two ways, and the page of its report
    without the pictures beside it.
    """
    dataset, sets = made
    part = dataset.copy(deep=True)
    part["status"][20:] = Status.DARK
    part["way"][:, ::2] = Way.NEIGHBOUR
    left = float(np.sum(part["status"].values == Status.MAPPED))
    dark = 44.0 * 96
    part.attrs["tallies"] = {
        "mapped": left,
        "left out by the mask": 3.0 * 96,
        "too dark": dark,
        "way neighbour": left / 2,
    }
    names = [EVIL if name == "LeadWhite" else name for name in part["paint"].values]
    part = part.assign_coords(paint=names)
    about = ABOUT | {"notes": []}
    report = report_of(part, sets, about, tmp_path_factory.mktemp("part"))
    return part, report.read_text(encoding="utf-8")


def words(page):
    """Text of a page."""
    page = re.sub(r"<(style|svg).*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page)))


def test_the_page_is_whole_and_loads_nothing_from_elsewhere(page):
    parsed = Parsed(page)
    loaded = [tag[name] for _, tag in parsed.tags for name in ("src", "href") if name in tag]
    assert loaded
    assert all(each.startswith(("data:image/png;base64,", "#")) for each in loaded)
    assert "<script" not in page
    assert not re.search(r"url\(|@import|https?:", page)
    assert "<b>painting" not in page


def test_what_was_said_about_the_map_stands_on_the_page(page):
    said = words(page)
    for each in (
        "Map of paints: a <b>painting</b>",
        "2026-01-02, 03:04",
        "glazejax map cube.hdr --out 'a & b'",
        "grey < white",
        "0.003",
        "glazejax 1.2.3",
        "0123abcd",
        "solved once",
        "97.5 % of 2,000 pixels",
        "A band was dead.",
        "96 × 64 pixels, 0.0625 mm² each",
        "Left out by the mask 288",
    ):
        assert each in said, each


def test_sets_stand_with_their_shares_of_the_area(made, page):
    dataset, sets = made
    table = page[page.index('<table id="sets">') :]
    rows = re.findall(r"<tr>(.*?)</tr>", table[: table.index("</table>")], flags=re.DOTALL)[1:]
    names = [str(name) for name in dataset["paint"].values]
    mapped = int(np.sum(dataset["status"].values == Status.MAPPED))
    ranked = shown_sets(sets)
    others = len(sets) - 1 > len(ranked)
    assert len(rows) == len(ranked) + others + 1
    for number, (row, members) in enumerate(zip(rows, ranked, strict=False), start=1):
        text = words(row)
        assert text.split()[0] == str(number)
        assert all(names[member] in text for member in members)
        share = float(re.findall(r"([\d.]+) % [\d.]+ 9", text)[0])
        assert share == pytest.approx(100 * sets[members].pixels / mapped, abs=0.05)
        one = sets[members]
        assert f" {one.thickness / one.pixels_with_thickness * 1e6:.1f} " in text
        assert "<svg" in row
    assert "None of these paints" in rows[-1]
    assert 'class="key none"' in rows[-1]


@pytest.fixture(scope="module")
def by_family(made, tmp_path_factory):
    """The map with what is to be said of it as of a map by family, and its report."""
    dataset, sets = made
    pigment = {
        "family": "azurite",
        "share": 1.0,
        "formula": "2CuCO3·Cu(OH)2",
        "in_use": "antiquity-",
        "colour_index": "PB30",
        "anachronism": "not of 1990: azurite",
    }
    bands = len(dataset.attrs["working_wavelengths"])
    film = {
        "paints": [{"name": "azurite/of a hand", "binder": "egg"}],
        "fitted": [[None, *([0.25] * (bands - 1))]],
    }
    facts = {members: {"pigments": [pigment], "film": film} for members in sets if members}
    folder = tmp_path_factory.mktemp("by_family")
    return report_of(dataset, sets, ABOUT, folder, facts=facts)


def test_families_stand_with_formula_years_and_nearest_exemplars(made, by_family):
    _, sets = made
    said = words(by_family.read_text(encoding="utf-8"))
    for each in (
        "azurite: 2CuCO3·Cu(OH)2, antiquity- (not of 1990: azurite)",
        "azurite/of a hand, egg",
        "Nothing is said of amounts",
    ):
        assert each in said, each
    assert "median share by mass" not in said
    # One map beside the object for each name of a set that is shown.
    names = {n for members in shown_sets(sets) for n in members}
    assert said.count("Where it is.") == len(names)


def test_sets_of_less_than_a_hundredth_are_summed():
    def sums(pixels):
        none = np.zeros(1)
        return {members: SetSum(count, none, none, none) for members, count in pixels.items()}

    assert shown_sets(sums({(0,): 500, (1,): 10, (2,): 9, (): 481})) == [(0,), (1,)]
    assert shown_sets(sums({(n,): 1 for n in range(200)})) == [(0,)]


def test_other_programs_open_the_sets_as_classes(made, by_family):
    envi = pytest.importorskip("spectral.io.envi")
    dataset, sets = made
    image = envi.open(by_family.with_name("classes.hdr"))
    classes = np.asarray(image.load())[..., 0].astype(int)
    names = image.metadata["class names"]
    assert len(image.metadata["class lookup"]) == 3 * len(names)
    mapped = dataset["status"].values == Status.MAPPED
    assert ((classes == 0) == ~mapped).all()
    none = mapped & (dataset["explained"].values == 0)
    assert ((classes == names.index("none of these paints")) == none).all()
    first = shown_sets(sets)[0]
    assert (classes == 1).sum() == sets[first].pixels
    assert names[1] == " + ".join(str(dataset["paint"].values[n]) for n in first)


def test_each_way_of_an_answer_has_its_words(part):
    dataset, page = part
    count = int(np.sum(dataset["status"].values[:, ::2] == Status.MAPPED))
    assert f"From a pixel nearby that was searched, in closed form {count:,} pixels" in words(page)
    assert set(_WAYS) == set(Way) - {Way.NONE}


def test_a_paint_of_any_name_is_text(part):
    page = part[1]
    assert "<b>" not in page
    # In the legend, among paints, and above the picture of its amount.
    assert words(page).count(EVIL) > 3
    with pytest.raises(UndefinedError, match="spots"):
        "".join(fill_template("mapping/show/spots.html"))


def test_pictures_lie_beside_the_page(report):
    pictures = list((report.parent / "pictures").iterdir())
    names = {path.stem for path in pictures}
    assert names >= {
        "true_colour",
        "sets",
        "probability",
        "none",
        "thickness",
        "thickness_sd",
        "misfit",
        "rmse",
        "LeadWhite_probability",
        "LeadWhite_amount",
    }
    assert "CalciumCarbonate_probability" not in names
    for path in pictures:
        assert path.read_bytes().startswith(b"\x89PNG")


def test_a_file_that_is_there_is_replaced_only_if_asked_for(made, report, tmp_path):
    (tmp_path / CLASSES).write_text("mine")
    for file, words in ((report, "--overwrite replaces it"), (tmp_path / CLASSES, CLASSES)):
        before = file.read_bytes()
        with pytest.raises(FileExistsError, match=words):
            report_of(*made, ABOUT, file.parent)
        assert file.read_bytes() == before


def test_what_was_not_mapped_is_said(part, tmp_path):
    dataset, page = part
    assert "Too dark 4,224 68.8 %" in words(page)
    dark = dataset.copy(deep=True)
    dark["status"][:] = Status.DARK
    dark.attrs["tallies"] = {"too dark": float(dark["status"].size)}
    about = ABOUT | {"title": "dark"}
    empty = write_report(dark, {}, about, tmp_path / "dark", cube=GREY).read_text(encoding="utf-8")
    assert "No pixel was mapped" in empty
    assert "Too dark" in empty


def test_a_small_spectrum_has_the_mean_at_its_height():
    grid = np.array([400.0, 500.0, 600.0, 700.0])
    mean = np.array([0.0, 0.5, 1.0, 0.25])
    drawn = small_spectrum(SetSum(4, 4 * mean, 4 * mean, 4 * mean**2), grid)
    assert drawn is not None
    y = [float(pair.split(",")[1]) for pair in drawn["axes"].line(drawn["mean"]).split()]
    # In hundredths from above; the upper edge is 1.
    assert 1 - np.array(y) / 100 == pytest.approx(mean)
    assert drawn["mean"] == pytest.approx(drawn["fitted"])
    assert small_spectrum(None, grid) is None


def test_pictures_fill_their_row(page):
    """True colour, sets and false colour stand side by side."""
    row = page.partition('<div class="maps three">')[2].partition("<h2>")[0]
    assert row.count("<figure>") == 3
