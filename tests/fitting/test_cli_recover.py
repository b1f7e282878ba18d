import functools
import re
from dataclasses import replace
from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rich.console import Console

from glazefit import Noise, recover_films, simulate_films
from glazefit.recover.films.film_by_film import recover_chunks
from glazefit.recover.fits import Destination, _lengths, read_gauge, slug
from glazefit.recover.predict.crossvalidation import cross_validate
from glazejax import Pigment, catalogue, extras

from ..refusals import refusal
from .tables import read_rows, write_films
from .test_joint import RECIPES, painted

GRID = np.arange(400.0, 701.0, 10.0)
COARSE = GRID[::3]
COMMAND = "recover"
write = functools.partial(write_films, scale=100.0)


@pytest.fixture
def films():
    k = np.stack([np.geomspace(0.02, 2.0, GRID.size), np.geomspace(1.0, 0.05, GRID.size)])
    return simulate_films(GRID, k, np.ones_like(k) * [[1.0], [0.3]], names=["01A", "02B"])


@pytest.fixture
def file(tmp_path, films):
    return write(tmp_path / "f.tsv", films)


@pytest.fixture
def call(run):
    """The command with a line of words: what it says, and its errors."""

    def words_of(line, **status):
        return run(*line.split(), **status)

    return words_of


@pytest.fixture
def fit(call, tmp_path):
    """Recovers films into the folder `res`, without pictures."""

    def recover(films, words="", **status):
        write(tmp_path / "f.tsv", films)
        out, _ = call(f"f.tsv --out res --no-plots {words}", **status)
        return out

    return recover


@pytest.fixture
def mixtures(tmp_path):
    """Films of three paints, and beside their file the list of what they are made of."""
    lines = (
        f"{name}\t{'-'.join(recipe)}|{'-'.join(map(str, recipe.values()))}\n"
        for name, recipe in RECIPES.items()
    )
    (tmp_path / "mixtures.tsv").write_text("".join(lines))
    return painted()


def test_results_are_those_of_the_library(call, tmp_path, films, file):
    out, err = call(f"{file} --thickness 20um --instrument di:8 --out res")
    assert err == ""
    assert "20 µm is assumed" in out
    assert "percent" in out
    rows = read_rows(tmp_path / "res/pigments.csv")
    assert list(rows[0]) == [
        "pigment",
        "wavelength_nm",
        "absorption",
        "scattering",
        "absorption_sd",
        "scattering_sd",
        "identifiable",
    ]
    recovery = recover_films(films)
    assert [row["pigment"] for row in rows] == ["01A"] * 31 + ["02B"] * 31
    assert_allclose(
        [float(row["absorption"]) for row in rows], recovery.absorption.ravel() / 20e-6, rtol=1e-2
    )
    assert [row["identifiable"] == "True" for row in rows] == recovery.identifiable.ravel().tolist()
    for name in ("01A.png", "02B.png"):
        assert (tmp_path / "res" / name).read_bytes().startswith(b"\x89PNG")


def test_a_name_in_brackets_is_printed_as_it_is(fit, films):
    out = fit(replace(films, names=("Red [old]", "White :100:")))
    assert "Red [old]" in out
    assert "White :100:" in out


def test_names_and_masstones(call, run, tmp_path, file):
    (tmp_path / "mixtures.tsv").write_text("01A\tRed-White|100-0\n02B\tRed-White|10-90\n")
    out, _ = run(file, "--out", "res", "--masstones", "--no-plots")
    assert "Red" in out
    assert "02B" not in out
    assert not list((tmp_path / "res").glob("*.png"))
    out, _ = call(f"{file} --out more --samples 02B --no-plots")
    assert "02B Red 10% + White 90%" in out


def test_simulate_says_that_nothing_was_measured(call):
    out, _ = call("--simulate --samples ZincWhite,Minium --out res --no-plots")
    assert "Simulated" in out
    assert "Nothing here was measured" in out
    assert "true k lies" in out


def test_interrupt_keeps_what_is_finished(fit, tmp_path, films, monkeypatch):
    def interrupted(films, *, instrument, noise):
        yield next(recover_chunks(films.take([0]), instrument=instrument, noise=noise))
        raise KeyboardInterrupt

    monkeypatch.setattr("glazefit.recover.fits.recover_chunks", interrupted)
    assert "1 of 2 films" in fit(films, fails=130)
    assert "01A" in (tmp_path / "res/pigments.csv").read_text()


def test_bad_input_is_one_line_and_status_2(call, tmp_path, file):
    full = tmp_path / "full"
    full.mkdir()
    (full / "x").touch()
    (tmp_path / "others.tsv").write_text("99Z\tRed|100\n")
    (tmp_path / "lacks").write_text("\n".join(file.read_text().splitlines()[:3]) + "\n")
    cases = [
        ("nowhere.tsv --out o", "nowhere.tsv", "no such file"),
        ("lacks --out o", "'01A_ow'", "paint over black, over white", "card_b"),
        ("f.tsv --out o --samples 01a", "unknown sample '01a'", "the nearest is 01A"),
        ("f.tsv --out o --thickness 0", "--thickness is 0", "above 0"),
        ("f.tsv --out o --masstones", "--names"),
        ("f.tsv --out o --check", "--check leaves mixtures out of a joint fit", "add --joint"),
        ("nowhere.tsv --out o --joint --check", "nowhere.tsv", "no such file"),
        ("f.tsv --out o --joint --masstones", "leave out --masstones"),
        ("f.tsv --out o --joint", "--joint needs to know what the films are made of"),
        ("--simulate --out o --joint", "leave out --simulate, or leave out --joint"),
        ("f.tsv --out o --white TitaniumWhite", "the nearest is acrylics:TitaniumWhite"),
        ("f.tsv --out o --white acrylics:TitaniumWhite", "no film holds TitaniumWhite"),
        (
            "f.tsv --out o --catalogue acrylics",
            "--catalogue acrylics says where the white",
            "add --white NAME or --simulate",
        ),
        (
            "--simulate --out o --catalogue pigments",
            "--catalogue is 'pigments'",
            "oils or acrylics",
        ),
        ("f.tsv --out o --white ZincWhite", "no film holds ZincWhite", "01A, 02B"),
        ("f.tsv --out o --wet-film thick", "--wet-film is 'thick'"),
        ("f.tsv --out o --wet-film 03A=20um", "--wet-film: no film is called '03A'"),
        ("f.tsv --out o --wet-film 100um,50um", "'50um' is for all films and must stand first"),
        ("f.tsv --out o --wet-film 01A=100um,50um", "for one film write FILM=50um"),
        ("f.tsv --out o --wet-film 01A=100um,01A=50um", "--wet-film: '01A' is named twice"),
        (
            "f.tsv --out o --wet-film 100um±5%,01A=50um±60%",
            "one error counts for all lengths, and 5% and 60% are stated",
        ),
        ("--simulate --out o --into mine.csv", "--into is for measured films"),
        ("--simulate --out o --masstones", "--masstones is for measured films"),
        ("--simulate --out o --names f.tsv", "--names is for measured films"),
        ("--simulate --out o --unit percent", "--unit is for measured films"),
        ("f.tsv --out o --names others.tsv", "lists none of the films: they are 01A, 02B", "99Z"),
        ("f.tsv --out o --seed 3", "--seed 3 is for simulated films", "add --simulate"),
        ("f.tsv --out full", "full", "not empty", "--overwrite"),
        ("f.tsv --out f.tsv", "is a file"),
        ("f.tsv", "--out"),
        ("--out o", "--simulate"),
        ("f.tsv --simulate --out o", "--simulate needs no data"),
        ("--simulate --out o --samples Vermilion", "no pigment 'Vermilion'", "Vermillion"),
    ]
    for words, *parts in cases:
        _, err = call(words, fails=2)
        assert err.startswith("error: "), err
        for part in parts:
            assert part in err, (words, err)
        assert not (tmp_path / "o").exists(), words


@pytest.mark.slow
def test_interrupt_while_films_are_left_out_keeps_the_rest(fit, tmp_path, mixtures, monkeypatch):
    def interrupted(whole, *how, progress, **options):
        def stop(done, total, stage):
            progress(done, total, stage)
            if done:
                raise KeyboardInterrupt

        return cross_validate(whole, *how, progress=stop, **options)

    monkeypatch.setattr("glazefit.recover.fits.cross_validate", interrupted)
    out = fit(mixtures, "--joint --check", fails=130)
    assert "Interrupted: the mixtures that follow were not left out" in out
    assert len(read_rows(tmp_path / "res/left_out.csv")) == 1
    assert "CobaltBlue" in catalogue.read(tmp_path / "res/pigments.csv")


def test_pictures_need_matplotlib_only_where_some_are_drawn(check_refusal, tmp_path, monkeypatch):
    def without(name):
        raise PackageNotFoundError(name)

    (tmp_path / "lacks.csv").write_text("Name,400,410,420\nA_ow,.1,.2,.3\nA,.1,.2,.3\n")
    monkeypatch.setattr(extras, "distribution", without)
    check_refusal("'A' is there with an ending and without", "lacks.csv", "--into", "mine.csv")
    check_refusal("glazejax[plots]", "lacks.csv", "--into", "mine.csv", "--out", "res")


INFRARED = np.arange(1000.0, 1701.0, 50.0)


@pytest.mark.parametrize("words", ["", "--joint"])
def test_bands_that_give_no_colour_give_paints(call, fit, tmp_path, words):
    """k and s need none; how well films are met is then said of their spectra."""
    k = np.geomspace(0.05, 1.0, INFRARED.size)
    k = np.stack([k, k[::-1]])
    names = ["Red", "Red 1:1 White" if words else "White"]
    out = fit(simulate_films(INFRARED, k, np.ones_like(k), names=names), words)
    assert "nan" not in out
    assert {*catalogue.read(tmp_path / "res/pigments.csv")} == {"Red", "White"}
    if words:
        assert "Fitted films: RMSE 0.0" in out
        rows = read_rows(tmp_path / "res/films.csv")
        assert [row["delta_e_white"] for row in rows] == ["", ""]
        _, err = call("f.tsv --out more --joint --check", fails=2)
        assert "1000" in err
        assert not (tmp_path / "more").exists()


def test_an_unknown_light_is_refused_where_bands_give_no_colour():
    k = np.full((1, INFRARED.size), 0.5)
    recovery = recover_films(simulate_films(INFRARED, k, k, names=["Red"]))
    assert np.isnan(recovery.delta_e("A")).all()
    with refusal("D66"):
        recovery.delta_e("D66")


def test_slug():
    assert slug("03B Red 10% + White/90%") == "03B_Red_10_White_90"
    assert slug("../..") == "paint"


def test_pictures_of_names_that_differ_in_case_are_two_files(tmp_path):
    console = Console(width=200, record=True)
    results = Destination(tmp_path / "res", 25e-6, plots=True, overwrite=False, console=console)
    paint = Pigment("Red", GRID, np.ones(GRID.size), np.ones(GRID.size))
    tables = {"films.csv": (("film",), [("Red",)])}
    results.write([paint], tables, ["Red", "red"], lambda row, path: path.write_text(str(row)))
    assert "Wrote pigments.csv, films.csv and 2 pictures to" in console.export_text()
    assert (tmp_path / "res/Red.png").read_text() == "0"
    assert (tmp_path / "res/red_.png").read_text() == "1"
    assert [row["film"] for row in read_rows(tmp_path / "res/films.csv")] == ["Red"]


def test_joint_fit_on_the_command_line(fit, tmp_path, films):
    (tmp_path / "mixtures.tsv").write_text("01A\tRed-White|100-0\n02B\tRed-White|40-60\n")
    out = fit(films, "--joint")
    assert "2 paints from 2 films" in out
    assert "a typical film is taken as 25 µm" in out
    rows = read_rows(tmp_path / "res/films.csv")
    assert [row["film"] for row in rows] == ["01A", "02B"]
    assert rows[1]["recipe"] == "Red 40% + White 60%"
    assert {*catalogue.read(tmp_path / "res/pigments.csv")} == {"Red", "White"}


@pytest.mark.slow
def test_mixtures_are_left_out_when_asked(call, fit, tmp_path, mixtures):
    out = fit(mixtures, "--joint --wet-film 25um±50% --check")
    assert "4 mixtures: ΔE00" in out
    assert "Two mixings of one recipe differ by about ΔE00" in out
    rows = read_rows(tmp_path / "res/left_out.csv")
    assert [row["film"] for row in rows] == [*mixtures.names[2:]]
    assert rows[1]["recipe"] == "CobaltBlue 50% + ZincWhite 50%"
    assert all(float(row["delta_e_black"]) < 5 for row in rows)
    # Without a folder they are predicted all the same, and the paints kept.
    out, _ = call("f.tsv --into mine.csv --joint --no-plots --check")
    assert "4 mixtures: ΔE00" in out
    assert (tmp_path / "mine.csv").exists()


@pytest.fixture
def tubes(tmp_path):
    """A masstone and a tint of two paints with the catalogue's zinc white, on a coarse grid, over
    white only.
    """
    white = catalogue.pigment("ZincWhite")
    pale = np.stack([white.absorption, white.scattering])[:, ::3] * 25e-6

    def table(name, hue, **ends):
        blue = np.stack([0.05 + 3.0 * np.exp(-(((COARSE - hue) / 60) ** 2)), np.ones(11)])
        k, s = np.stack([blue, blue / 11 + pale * 10 / 11], axis=1)
        return write(
            tmp_path / f"{name}.tsv",
            simulate_films(COARSE, k, s, names=[name, f"{name} 1:10 ZincWhite"]),
            **ends,
        )

    return table


@pytest.mark.slow
def test_own_tubes_go_into_one_file(call, run, check_refusal, tmp_path, tubes):
    out, err = run(tubes("Blue", 590), "--white", "ZincWhite", "--into", "mine.csv")
    assert err == ""
    assert "Scale: that of ZincWhite" in out
    assert "Added Blue, ZincWhite to mine.csv" in out
    assert "Most useful next film" in out
    out, err = run(tubes("Red", 480, ends=["ow"]), "--into", "mine.csv", "--instrument", "di:8")
    assert err == ""
    assert "white card was not measured" in out
    assert "Added Red to mine.csv" in out
    mine = catalogue.read(tmp_path / "mine.csv")
    assert list(mine) == ["Blue", "ZincWhite", "Red"]
    for name, hue in (("Blue", 590), ("Red", 480)):
        assert COARSE[np.argmax(mine[name].absorption)] == pytest.approx(hue, abs=20)
    before = (tmp_path / "mine.csv").read_bytes()
    already = "in mine.csv already: Red, ZincWhite; --overwrite"
    check_refusal(already, "Red.tsv", "--into", "mine.csv")
    assert (tmp_path / "mine.csv").read_bytes() == before
    out, _ = call("Red.tsv --into mine.csv --white ZincWhite --overwrite")
    assert "(replaced: Red)" in out
    assert list(catalogue.read(tmp_path / "mine.csv")) == ["Blue", "ZincWhite", "Red"]


def test_results_do_not_replace_the_file_of_paints(check_refusal, tmp_path, tubes):
    mine = tmp_path / "res/pigments.csv"
    mine.parent.mkdir()
    mine.write_text("pigment,wavelength_nm,absorption,scattering\nRed,400,1,1\nRed,700,1,1\n")
    before = mine.read_bytes()
    file = tubes("Blue", 590, ends=["ow"])
    words = f"{file} --white ZincWhite --overwrite --out res --into {mine}".split()
    check_refusal("--out res holds pigments.csv, a file that is read", *words)
    assert mine.read_bytes() == before


def test_a_film_is_as_thick_as_it_is_said_to_be():
    """Or else as all are; one bar that drew all films says nothing of one film."""
    gauge = read_gauge("50um, Red=100um±20%", ["Red", "Blue"])
    assert gauge is not None
    assert gauge.thickness == pytest.approx({"Red": 100e-6, "Blue": 50e-6})
    assert gauge.error == 0.2
    assert read_gauge("same", ["Red", "Blue"]) is None
    with refusal("--film-thickness is 'same'"):
        read_gauge("same", ["Red"], "--film-thickness")


def test_thicknesses_in_words():
    """To two digits; a range only where there is one."""
    assert _lengths(np.array([20e-6, 20.01e-6])) == "20 µm"
    assert _lengths(np.array([18e-6, 31.2e-6, 25e-6])) == "18 µm to 31 µm"


@pytest.mark.slow
def test_gauged_films_have_a_scale_of_their_own(call, run, tmp_path, tubes):
    file = tubes("Blue", 590)
    out, _ = call(f"{file} --out res --wet-film 50um±20% --no-plots")
    assert "as measured, about 50 µm" in out
    run(file, "--out", "more", "--no-plots")
    gauged, usual = (
        catalogue.read(tmp_path / folder / "pigments.csv")["Blue"].absorption
        for folder in ("res", "more")
    )
    assert np.median(gauged / usual) == pytest.approx(0.5, rel=0.2)


@pytest.mark.slow
def test_rough_spectra_are_said_to_be_noisy(call, fit):
    k = np.geomspace(0.02, 2.0, GRID.size)[None]
    out = fit(simulate_films(GRID, k, np.ones_like(k), names=["01A"], noise=Noise(0.004, 0.0)))
    assert "Noise of a reading R, estimated from how rough the spectra are: 0.00" in out
    out, _ = call("f.tsv --out told --no-plots --noise 0.004")
    assert "how rough" not in out


def test_masstones_alone_promise_no_more_than_they_tell(run, command_line, tmp_path):
    """Opaque films show k/s: how strong one paint is beside another is not in them."""
    yellow = 0.05 + 0.75 / (1.0 + np.exp((505.0 - GRID) / 10.0))
    rows = [
        ["Name", *GRID],
        ["Cyan", *(0.05 + 0.5 / (1.0 + ((GRID - 480.0) / 45.0) ** 2))],
        ["Magenta", *(0.05 + 0.7 / (1.0 + np.exp((690.0 - GRID) / 12.0)))],
        ["Yellow", *yellow],
        ["Yell", *yellow],
    ]
    (tmp_path / "cmy.csv").write_text("\n".join(",".join(map(str, row)) for row in rows))
    out, _ = run("cmy.csv", "--into", "mine.csv")
    assert "Yell and Yellow are fitted as two paints" in out
    assert "tint of Magenta with ZincWhite" in out, "a yellow is no white"
    out, _ = command_line("recipe", on_one_line=True)(
        "--srgb", "#8a4b2d", "--pigments", "mine.csv", "--max-coats", "1", "--count", "1"
    )
    adds = re.search(
        r"The strength of [\w, ]+ is unknown, which adds ΔE00 ([\d.]+) by the level", out
    )
    assert adds is not None
    assert float(adds[1]) > 3.0
    assert "One tint of each with a white" in out


def test_a_fit_that_no_film_allows_is_not_relied_on(fit):
    """Two coloured paints whose mixtures read as white, black and grey."""
    ends = [(0.1, 3.0), (3.0, 0.1), *((level, level) for level in (0.005, 3.0, 0.3))]
    k = np.stack([np.geomspace(*values, GRID.size) for values in ends])
    names = ["Red", "Blue", "Red 1:1 Blue", "Red 3:1 Blue", "Red 1:3 Blue"]
    out = fit(simulate_films(GRID, k, np.ones_like(k), names=names))
    assert out.index("do not rely on predictions") < out.index("Wrote")
