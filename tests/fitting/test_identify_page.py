"""The report of an identification: page, table and JSON say what the result says, and nothing comes
from elsewhere.
"""

import base64
import importlib
import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from benchmarks.studio.studio import go_to
from numpy.testing import assert_allclose, assert_array_equal, assert_equal

from glazefit import Noise
from glazefit.identify.result import STRENGTH
from glazefit.identify.result.odds import CoatsOdds
from glazefit.identify.search.searcher import check_spectra
from glazefit.identify.show.page import DRAWN, LISTED, page, plot_axes, write_page
from glazefit.identify.show.record import make_record, table_of_record
from glazefit.identify.show.ruled_out import ruled_out
from glazefit.page.inputs import input_files
from glazefit.page.plot import PlotAxes
from glazefit.page.subject import check_subject
from glazejax.commands.command_line import ground_file
from glazejax.io.source import with_its_pair

from ..refusals import refusal
from ..studio.browser import start_browser
from .answers import made_up
from .palette import GRID
from .tables import read_rows

# `glazefit.identify` is the function too, so that the name alone does not lead there.
MODULE = importlib.import_module("glazefit.identify.show.page")
PAINTS = ("Red", "White", "Blue", "Chalk", "Black")
EVIL = '<script>alert("1")</script> & co'
ABOUT = {
    "title": "films.csv",
    "subject": {},
    "created": "2026-03-04T05:06:07+00:00",
    "command": "glazejax identify films.csv --report report.html",
    "options": {"--top": 3, "--ground": None},
    "inputs": [{"role": "FILE", "name": "films.csv", "bytes": 12, "sha256": "ab" * 32}],
    "catalogue": {"name": "own.csv", "provenance": EVIL, "scale": None},
    "measurement": {
        "geometry": "an integrating sphere",
        "refractive_index": 1.5,
        "grounds": ["black card", "white card"],
        "notes": [],
    },
    "method": {"max_paints": 2, "layers": 2, "settings": {"noise": {"floor": 0.0005}}},
}
NAMES = ("one", EVIL)


def identification(names=NAMES, grid=GRID, opaque=False):
    """Two candidates for each spectrum, one of them of two coats; spectra differ in one amount."""
    count, rng = len(names), np.random.default_rng(3)
    readings = np.array([[[0.8], [1.0]]] * count) * (0.3 + 0.4 * (grid > 560))
    root = 0.2 * rng.standard_normal((count, 2, 3, 5))
    covariance = root @ np.swapaxes(root, -1, -2)
    covariance[..., 2, :] = covariance[..., :, 2] = 0.0
    found = made_up(
        check_spectra(grid, readings, 0.5, names, Noise()),
        PAINTS,
        [({"Red": 2e-6, "White": 6e-6}, 0.6), ({"Red": 3e-6, "Blue": 3e-6}, 0.3)],
        readings[:, None] + np.array([0.002, -0.004])[:, None, None],
        coats=np.broadcast_to([[0, 0, 0], [0, 1, 0]], (count, 2, 3)),
        log_covariance=covariance,
        paint_probability=np.broadcast_to([0.9, 0.6, 0.3, 0.004, 0.002], (count, 5)),
        opaque=opaque,
    )
    found.amounts[:, 0, 0] += 1e-7 * np.arange(count)
    return found


def record(found, about=ABOUT, names=NAMES):
    return make_record(found, about, names, 2, bands=np.full(found.fitted.shape, 0.01))


class Parsed:
    """Elements, tables and texts of a page, and of its articles by their ids; it is well formed."""

    def __init__(self, text: str):
        root = ElementTree.fromstring(re.sub(r"<((?:meta|img|br)\b[^>]*)>", r"<\1/>", text))
        articles = {article.attrib["id"]: article for article in root.iter("article")}
        self.tags = [(each.tag, each.attrib) for each in root.iter()]
        self.rows = _rows(root)
        self.spots = {spot: _rows(article) for spot, article in articles.items()}
        self.words = {spot: "".join(article.itertext()) for spot, article in articles.items()}
        for article in articles.values():
            article.clear()
        self.words[""] = "".join(root.itertext())


def _rows(element: ElementTree.Element) -> list[list[str]]:
    return [["".join(cell.itertext()) for cell in row] for row in element.iter("tr")]


def html(filed):
    return "".join(page(filed, "report.csv", "report.json"))


def parsed(filed):
    return Parsed(html(filed))


def having(seen, name, value):
    """Attributes of the elements of a page of which one has this value."""
    return [attributes for _, attributes in seen.tags if attributes.get(name) == value]


def plots(seen):
    return having(seen, "class", "plot")


def numbers(text):
    return [float(n) for n in re.findall(r"\d+(?:\.\d+)?", text)]


def test_every_spot_has_its_place_and_the_numbers_of_the_result():
    found = identification()
    seen = parsed(record(found))
    assert list(seen.spots) == ["spot-1", "spot-2"]
    ids = [given["id"] for _, given in seen.tags if "id" in given]
    assert len(ids) == len(set(ids))
    assert [row[0] for row in seen.rows if row[0] in NAMES] == [*NAMES]

    for row, spot in enumerate(seen.spots.values()):
        for n, candidate in enumerate(found.ranked(row, 2)):
            lead = next(cells for cells in spot if cells[0].startswith(f"{n + 1}: probability"))
            shown = numbers(lead[0].replace("ΔE00", ""))[1:]
            sizes = 1e6 * np.array([candidate.thickness, *candidate.thickness_90])
            stated = [100 * candidate.probability, *sizes, candidate.delta_e, candidate.rmse]
            assert shown == pytest.approx(stated, rel=0.06, abs=0.01)
            following = spot[spot.index(lead) + 1 :][: len(candidate.paints)]
            shares = 100 * np.column_stack([candidate.fractions, candidate.fractions_90])
            amounts = 1e6 * np.column_stack([candidate.amounts, candidate.amounts_90])
            for i, (cells, paint) in enumerate(zip(following, candidate.paints, strict=True)):
                coat = f" ({('upper', 'lower')[candidate.coats[i]]} coat)" if n == 1 else ""
                assert cells[0] == paint + coat
                assert numbers(cells[1]) == pytest.approx(shares[i], rel=0.06)
                assert numbers(cells[2]) == pytest.approx(amounts[i], rel=0.06)


def test_the_table_and_the_json_hold_the_numbers_exactly(tmp_path):
    odds = CoatsOdds(
        paints=("Red", "White"),
        chances={"Red + White": 0.4, "Red over White": 0.6},
        layered=0.6,
        share=0.5,
        reason="",
    )
    found = replace(identification(), coats_odds=((odds,), ()))
    table, data = write_page(record(found), tmp_path / "report.html")
    assert (table.name, data.name) == ("report.csv", "report.json")
    filed = json.loads(data.read_text())
    assert filed == record(found)
    lines = read_rows(table)
    assert len(lines) == 2 * 2 * 2
    _, rows = table_of_record(filed)
    assert [["" if cell is None else str(cell) for cell in row] for row in rows] == [
        list(line.values()) for line in lines
    ]
    # Of the second spot, the most probable film's first paint.
    line = lines[4]
    assert (line["spot"], line["rank"], line["paint"]) == (EVIL, "1", "White")
    shown = [
        float(line[name]) for name in ("fraction", "fraction_low", "fraction_high", "amount_low_um")
    ]
    best = found.ranked(1, 1)[0]
    exact = [best.fractions[0], *best.fractions_90[0], 1e6 * best.amounts_90[0, 0]]
    assert shown == pytest.approx(exact, rel=1e-12)
    spot = filed["spots"][0]
    assert_allclose(spot["explanations"][1]["fitted"], found.fitted[0, 1], atol=1e-6)
    assert spot["coats_probability"] == 0.3


def test_names_are_text_and_nothing_comes_from_elsewhere():
    filed = record(replace(identification(), paints=(EVIL, *PAINTS[1:])))
    text = html(filed)
    assert not re.search(r"<script|://|@import|url\((?!#)", text)
    seen = Parsed(text)
    assert {"svg", "figure", "table"} <= {tag for tag, _ in seen.tags}
    (policy,) = having(seen, "http-equiv", "Content-Security-Policy")
    assert "default-src 'none'" in policy["content"]
    assert len(plots(seen)) == 2 * (1 + 2)
    assert all(plot["aria-label"] for plot in plots(seen))
    assert "reflectance over black card and over white card" in seen.words["spot-1"]
    assert EVIL in seen.words["spot-2"]
    assert EVIL in [cells[0] for cells in seen.spots["spot-1"]]
    assert EVIL in plots(seen)[0]["aria-label"]


def test_of_very_many_spots_the_first_are_drawn():
    names = [f"spot {n}" for n in range(DRAWN + 2)]
    seen = parsed(record(identification(names), names=names))
    assert len(seen.spots) == DRAWN + 2
    # Spectra of each, and what the fits leave.
    assert [tag for tag, _ in seen.tags].count("figure") == 2 * DRAWN
    assert f"Spectra are drawn for the first {DRAWN} spots" in seen.words[""]


def test_an_interrupted_run_says_what_is_missing():
    filed = record(identification(["one"]))
    assert not filed["complete"]
    assert filed["not_done"] == [EVIL]
    words = parsed(filed).words[""]
    assert "1 of 2 spots were finished" in words
    assert EVIL in words
    assert record(identification())["complete"]


def test_what_has_no_number_has_none():
    """No colour outside the visible, no lengths where the ground is hidden."""
    found = identification(grid=np.linspace(500.0, 560.0, 16), opaque=True)
    assert np.isnan(found.delta_e).all()
    filed = record(found)
    spot = filed["spots"][0]
    best = spot["explanations"][0]
    paint = best["paints"][0]
    assert best["delta_e_2000"] is best["thickness_um"] is best["thickness_90_um"] is None
    assert paint["amount_um"] is paint["amount_90_um"] is spot["colours"] is None
    assert json.loads(json.dumps(filed, allow_nan=False)) == filed
    words = parsed(filed).words
    assert "µm" not in words["spot-1"]
    assert "hiding their ground" in words[""]


def test_what_nothing_explains_is_said_first():
    none, probability = np.array([0.95, 0.45]), np.array([[0.03, 0.02], [0.4, 0.1]])
    seen = parsed(record(replace(identification(), none=none, probability=probability)))
    assert "Nothing in the catalogue explains this" in seen.words["spot-1"]
    assert "Most probable" not in seen.words["spot-1"].partition("Amounts")[0]
    assert "Uncertain" in seen.words["spot-2"]
    (row,) = (row for row in seen.rows if row[0] == "one")
    assert row[2] == "Nothing in the catalogue explains it"


def test_who_measured_what_is_said_at_the_head():
    """As text, and only what was said."""
    report = Path("report.html")
    subject = check_subject(report, object=f" {EVIL} ", inventory="", spot="sky", operator="")
    filed = record(identification(), ABOUT | {"subject": subject})
    assert filed["subject"] == {"object": EVIL, "spot": "sky"}
    head = html(filed).partition("</header>")[0]
    assert "<dt>Object</dt><dd>&lt;script&gt;" in head
    assert "<dt>Spot</dt><dd>sky</dd>" in head
    assert "Inventory" not in head
    assert "Operator" not in head
    with refusal(r"^--operator holds the character U\+000A, which is not"):
        check_subject(report, operator="N.\nN.")
    with refusal(r"^--object has 201 characters; .* room for 200$"):
        check_subject(report, object="a" * 201)
    with refusal(r"^--object stands at the head .* give --report too$"):
        check_subject(None, object="a")
    assert check_subject(None, object="") == {}


def test_existing_files_are_kept_and_other_endings_refused(tmp_path):
    path, filed = tmp_path / "report.html", record(identification())
    data = path.with_suffix(".json")
    data.write_text("mine")
    with refusal(r"report\.json exists", FileExistsError):
        write_page(filed, path)
    assert [*tmp_path.iterdir()] == [data]
    write_page(filed, path, overwrite=True)
    endings = (".csv", ".html", ".json")
    assert {*tmp_path.iterdir()} == {path.with_suffix(ending) for ending in endings}
    with refusal(r"report\.htm: a report ends in \.html, such as .*report\.html$"):
        write_page(filed, tmp_path / "report.htm")


def test_a_failure_while_a_page_is_made_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    write_page(record(identification()), path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}

    def fails(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(MODULE, "plot_axes", fails)
    with refusal("no ink", RuntimeError):
        write_page(record(identification(["other"])), path, overwrite=True)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_why_a_paint_is_ruled_out():
    """Chalk is in the second candidate, which misses the reading as told; Black is in none."""

    def judged(off, chances=(0.9, 0.6, 0.3, 0.004, 0.002), grid=GRID, share=0.5):
        one = identification(grid=grid)
        second = {"Red": (1.0 - share) * 6e-6, "Chalk": share * 6e-6}
        film = made_up(
            one.measured,
            PAINTS,
            [({"Red": 2e-6, "White": 6e-6}, 0.6), (second, 0.3)],
            np.stack([one.fitted[:, 0], one.measured.readings + off], axis=1),
            paint_probability=np.broadcast_to(chances, (2, 5)),
        )
        found = {paint.paint: paint for paint in ruled_out(film, 0)}
        if "Chalk" in found and share >= 0.01:
            assert_equal(found["Chalk"].delta_e, film.delta_e[0, 1])
            assert found["Chalk"].rmse == film.rmse[0, 1]
        return found

    usual = judged(0.002)
    assert list(usual) == ["Chalk", "Black"]
    chalk, black = usual.values()
    assert chalk.kind == "unneeded"
    assert chalk.film == "50 % Red + 50 % Chalk"
    assert chalk.paints == {"Chalk": 0.5, "Red": 0.5}
    assert black.kind == "absent"
    assert black.reason == (
        "Black: no film with 1% of it or more came near enough to be compared closely."
    )
    assert (black.film, black.paints) == ("", {})
    # A trace of it can hide in any film.
    assert judged(0.002, share=0.005)["Chalk"].kind == "absent"
    off = judged(0.15)["Chalk"]
    assert off.kind == "misfit"
    assert (
        off.reason
        == f"Chalk: the nearest film with it has an error of Delta E00 {off.delta_e:.1f}."
    )
    # Off to and fro between bands, which no eye sees.
    rough = judged(0.02 * (-1.0) ** np.arange(GRID.size))["Chalk"]
    assert rough.kind == "worse"
    assert "spectrum less so: RMSE 0.0200 against 0.0020" in rough.reason
    # What does not fit is ruled out but for a trace; what is there more likely than not is never
    # ruled out.
    assert judged(0.15, chances=(0.9, 0.6, 0.3, 0.2, 0.002))["Chalk"].kind == "trace"
    assert "Chalk" not in judged(0.15, chances=(0.9, 0.6, 0.3, 0.6, 0.002))
    no_colour = judged(0.08, grid=np.arange(800.0, 1101.0, 20.0))["Chalk"]
    assert "0.080 in reflectance" in no_colour.reason


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("unknown", [np.nan, 0.0])
def test_fractions_of_unknown_amounts_are_nan(unknown):
    found, emptied = identification(), identification()
    emptied.amounts[0, 1] = unknown
    for name in ("fractions", "fractions_90"):
        # The others stay as they were.
        expected = getattr(found, name).copy()
        expected[0, 1] = np.nan
        assert_array_equal(getattr(emptied, name), expected)


def test_intervals_are_those_of_the_log_normal_amounts():
    found = identification()
    rng = np.random.default_rng(0)
    for n in range(2):
        covariance = found.log_covariance[0, n, :2, :2]
        errors = rng.multivariate_normal([0, 0], covariance + STRENGTH**2 * np.eye(2), 400_000)
        amounts = found.amounts[0, n, :2] * np.exp(errors)
        ends = np.quantile(amounts, [0.05, 0.95], axis=0)
        assert_allclose(found.amounts_90[0, n, :2].T, ends, rtol=0.01)
        # What is left of a thickness, expected to .7, by a reading of its product with strength.
        shares = found.fractions[0, n, :2]
        shown = shares @ covariance @ shares
        data = 1.0 / (1.0 / shown - 1.0 / 0.7**2)
        thickness = 0.7 * rng.standard_normal(400_000)
        product = thickness + STRENGTH * rng.standard_normal((400_000, 2)) @ shares
        product += np.sqrt(data) * rng.standard_normal(400_000)
        slope = np.cov(thickness, product)[0, 1] / product.var()
        low, high = np.log(found.thickness_90[0, n])
        assert_allclose((high - low) / 2, 1.6449 * (thickness - slope * product).std(), rtol=0.01)
        parts = np.quantile(amounts / amounts.sum(axis=1, keepdims=True), [0.05, 0.95], axis=0)
        assert_allclose(found.fractions_90[0, n, :2].T, parts, rtol=0.02)
    assert (found.fractions_90[:, :, 2] == 0).all()
    ranked = found.ranked(0, 1)[0]
    assert ranked.paints == ("White", "Red")
    assert_array_equal(ranked.amounts_90, found.amounts_90[0, 0, [1, 0]])


def test_every_line_and_number_lies_within_its_plot():
    """Of a fit that is brighter than the reading, too, and of a dark spectrum."""
    filed = record(identification(["one"]))
    spot = filed["spots"][0]
    spot["explanations"][1]["fitted"] = (2.0 * np.array(spot["measured"])).tolist()
    measured = (0.1 * np.array(spot["measured"])).tolist()
    fit = {**spot["explanations"][0], "fitted": measured}
    dark = {**spot, "measured": measured, "explanations": [fit]}
    for each in (spot, dark):
        axes = plot_axes(filed, each)["spectra"]
        lines = [
            *each["measured"],
            *(line for fit in each["explanations"] for line in fit["fitted"]),
        ]
        assert axes.high > np.max(lines) > 0.9 * axes.high
        # A value's place is as far up as it is of the height: nothing is moved to fit in.
        for line in lines:
            y = [float(pair.split(",")[1]) for pair in axes.line(line).split()]
            assert_allclose(y, 100 - 100 * np.array(line) / axes.high, atol=0.01)
        for places in (axes.across, axes.up):
            assert all(0 <= place <= 100 for place, _ in places)
            assert 3 <= len(places) <= 7
        assert [words for _, words in axes.across] == [f"{nm}" for nm in range(400, 701, 50)]
    assert [word for _, word in plot_axes(filed, dark)["spectra"].up][:2] == ["0", "0.02"]


def test_bands_without_a_number_are_left_out():
    axes = PlotAxes(grid=np.array([400.0, 500.0, 600.0]), low=-1.0, high=1.0)
    assert len(axes.line([None, 0.0, np.nan]).split()) == 1
    assert axes.dots([None, 0.0, 0.0]).count("M") == 2
    low, high = (
        pair.split(",") for pair in axes.around([0.0, None, None], [0.5, 0.5, None]).split()
    )
    assert (float(low[1]), float(high[1])) == (75.0, 25.0)
    assert "\u22120.5" in [word for _, word in axes.up]


def test_files_that_were_read_are_hashed_with_the_other_half_of_a_pair(tmp_path):
    for name in ("a.csv", "spectra.hdr", "spectra.sli", "book.xlsx"):
        (tmp_path / name).write_bytes(b"abc")
    seen = input_files(
        {"FILE": tmp_path / "spectra.hdr", "--ground": None, "--pigments": tmp_path / "a.csv"}
    )
    assert [(each["role"], Path(each["name"]).name) for each in seen] == [
        ("FILE", "spectra.hdr"),
        ("FILE", "spectra.sli"),
        ("--pigments", "a.csv"),
    ]
    # FIPS 180-4, the example of one block.
    checksum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert {each["sha256"] for each in seen} == {checksum}
    assert input_files({"FILE": tmp_path / "gone"})[0]["sha256"] is None
    # A sheet is hashed as its file.
    (sheet,) = input_files({"FILE": tmp_path / "book.xlsx:data"})
    assert sheet["name"].endswith("book.xlsx:data")
    assert sheet["sha256"] == checksum
    assert ground_file(f"{tmp_path / 'book.xlsx'}:data:white") == tmp_path / "book.xlsx"


def test_a_folder_is_no_half_of_an_envi_pair(tmp_path):
    for name in ("bands.hdr", "panel", "panel.hdr"):
        (tmp_path / name).touch()
    (tmp_path / "bands").mkdir()
    assert with_its_pair(tmp_path / "bands") == [tmp_path / "bands"]
    assert with_its_pair(tmp_path / "panel") == [tmp_path / "panel", tmp_path / "panel.hdr"]


def test_what_a_page_of_paper_has_no_room_for_is_named_there():
    filed = crowded(record(identification()))
    seen = parsed(filed)
    rows = [given.get("class", "") for tag, given in seen.tags if tag == "tr"]
    assert sum("more" in names for names in rows) == 2 * (2 * 4 + 16 + 2)
    for name in ("spot-1", "spot-2"):
        words = seen.words[name]
        assert all(f"Paint{n}:" in words for n in range(24))
        said = words.partition("Also, in the files next to this page: ")[2]
        assert "2 less probable" in said
        assert "Paint23" in said.rpartition("next to this page: ")[2]


def crowded(filed):
    """The same with five sets of three paints for each spot, many paints that are ruled out, and
    much that is open.
    """
    for spot in filed["spots"]:
        first = spot["explanations"][0]
        three = [*first["paints"], first["paints"][0]]
        spot["explanations"] = [{**first, "rank": n, "paints": three} for n in range(1, 6)]
        one = spot["ruled_out"][0]
        spot["ruled_out"] = [
            {
                **one,
                "paint": f"Paint{n}",
                "kind": ("misfit", "trace", "worse", "unneeded")[n // 6],
                "reason": f"Paint{n}: the best film with it is off by Delta E00 7.1, and more.",
            }
            for n in range(24)
        ]
        spot["doubts"] = ["It may also hold up to 97.8 % ChromeYellowPoppyseed or as much. " * 8]
    return filed


@pytest.mark.browser
@pytest.mark.parametrize("paper", [(8.27, 11.69), (8.5, 11.0)], ids=["A4", "Letter"])
def test_a_spot_is_printed_on_a_page(tmp_path, paper):
    """A page for the summary, one for each spot, and what there is to say of the method."""
    filed = crowded(record(identification(names=("one", "two", "three"))))
    path = tmp_path / "report.html"
    write_page(filed, path)
    with start_browser(tmp_path) as browser:
        go_to(browser, path.as_uri())
        found = browser.execute_cdp_cmd(
            "Page.printToPDF", {"paperWidth": paper[0], "paperHeight": paper[1]}
        )
    pages = re.findall(rb"/Type\s*/Page\b", base64.b64decode(found["data"]))
    assert len(pages) == 1 + 3 + 1


def test_a_large_catalogue_is_listed_in_the_json_alone():
    filed = record(identification())
    filed["catalogue"] |= {"paints": [f"Paint{n}" for n in range(LISTED + 1)], "provenance": "many"}
    words = parsed(filed).words[""]
    assert f"{LISTED + 1} paints, which report.json lists" in words
    assert "Paint7" not in words
    assert "that of each paint, in report.json" in words
    filed["catalogue"]["paints"].pop()
    assert "Paint7, Paint8" in parsed(filed).words[""]


@pytest.mark.browser
def test_numbers_of_a_plot_are_whole_and_of_the_page_s_size(tmp_path):
    """On a desk and on a telephone."""
    write_page(record(identification(["one"])), tmp_path / "report.html")
    ask = """return [...document.querySelectorAll('.plot span')].filter(e => e.offsetParent).map(e => {
        const r = e.getBoundingClientRect();
        return [r.left, document.documentElement.clientWidth - r.right,
                parseFloat(getComputedStyle(e).fontSize)];
    })"""
    with start_browser(tmp_path) as browser:
        for width in (1200, 390):
            size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            go_to(browser, (tmp_path / "report.html").as_uri())
            left, right, letters = np.array(browser.execute_script(ask)).T
            assert min(left.min(), right.min()) >= 0
            assert left.size > 20
            # A table's are .84 to .9 of the page's 16 px.
            assert letters == pytest.approx(np.full(letters.size, 12.8))
