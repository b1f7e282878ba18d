"""Paints from what a kitchen table gives: films that lack readings, tints by name, known whites,
gauges, own files.
"""

from contextlib import nullcontext
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import Instrument, Noise, read_films, recover_films, simulate_films
from glazefit.film.films import SPECTRA, USUAL_CARD_SD, bare_surface, card_readings, usual_cards
from glazefit.film.model.response import film_response
from glazefit.film.noise import estimate_noise
from glazefit.film.readers import read_loose_films, recipes_from_names, tint
from glazefit.film.shared_bands import average, crop
from glazefit.recover.joint.entries import add_paints
from glazefit.recover.joint.joint import UNIT, recover_jointly
from glazefit.recover.joint.pose import Gauge, error_modes
from glazefit.recover.joint.problem import Expectations, optical_thickness
from glazefit.recover.predict.next_reading import rank_next_films
from glazefit.recover.show import plots
from glazefit.recover.show.report import film_table
from glazejax import Pigment, catalogue
from glazejax.paint.pigment_table import write_pigments

from ..refusals import refusal
from .palette import GRID
from .tables import write_films
from .test_joint import posed

BLUE = np.stack([0.05 + 3.0 * np.exp(-(((GRID - 590) / 60) ** 2)), np.full(GRID.size, 1.0)])
PALE = np.stack([0.01 + 0.05 * np.exp(-(GRID - 400) / 40), 10.0 - (GRID - 400) / 100])
FINE = np.arange(400.0, 701.0, 10.0)
NAMES = ("Blue", "Blue 1:10 White")
RECIPES = recipes_from_names(NAMES, {})


def modes_of(pigment):
    """Error modes of a pigment that has them."""
    assert pigment.error_modes is not None
    return np.asarray(pigment.error_modes)


def white(size=0.05, strength=1.0):
    """The white of the films in 1/m, with one error mode: its strength."""
    k, s = strength * PALE / UNIT
    modes = np.full((1, 2, GRID.size), size)
    return Pigment("White", GRID, k, s, error_modes=modes, provenance="mine")


KNOWN = {"White": white()}
INSTRUMENT = Instrument()


def painted(thickness=(1.3, 0.8), instrument=INSTRUMENT, seed=1):
    shares = np.array([1.0, 1 / 11])[:, None, None]
    paints = shares * BLUE + (1 - shares) * PALE
    k, s = np.einsum("f,fcb->cfb", thickness, paints)
    return simulate_films(GRID, k, s, names=NAMES, instrument=instrument, seed=seed)


def test_a_whole_table_reads_as_before(tmp_path):
    path = write_films(tmp_path / "films.csv", painted(), scale=100.0)
    loose, strict = read_loose_films(path), read_films(path)
    assert loose.complete
    for what in SPECTRA:
        assert_array_equal(getattr(loose, what), getattr(strict, what))
    assert (loose.names, loose.notes) == (strict.names, strict.notes)


def test_rows_that_are_not_there(tmp_path):
    films = painted()

    def read(*ends):
        return read_loose_films(write_films(tmp_path / "films.csv", films, ends))

    one = read("w", "ow")
    assert one.seen.tolist() == [[False, True]] * 2
    assert not one.assumed[:, 1].any()
    assert "not measured" not in str(one.notes)
    assert_array_equal(one.over_black, one.over_white)

    bare = read("ob", "ow")
    assert bare.assumed.all()
    assert "the black and the white card was not measured" in str(bare.notes)
    measured = card_readings(bare, INSTRUMENT, Noise())
    assert_array_equal(measured.ground[0, :, 0], usual_cards(GRID)[0])
    assert_array_equal(measured.ground_sd[..., 1], USUAL_CARD_SD[1])

    opaque = read("")
    assert opaque.opaque.all()
    assert "taken to hide whatever is below" in str(opaque.notes)

    path = write_films(tmp_path / "shared.csv", films, ends=("ob", "ow"))
    card = replace(films.take([0]), names=("card",))
    _, _, rows = write_films(tmp_path / "card.csv", card, ("b", "w")).read_text().partition("\n")
    path.write_text(path.read_text() + rows)
    shared = read_loose_films(path)
    assert shared.complete
    assert_allclose(shared.bare_white[1], films.bare_white[0], atol=1e-6)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["A_b", "A_w"], "film 'A' has no row 'A_ob' or 'A_ow'"),
        (["A_ow", "A_x"], "the name 'A_x' must end in _b"),
        (["A_ow", "A"], "'A' is there with an ending and without"),
        (["card_b", "card_w"], "cards but no paint"),
    ],
)
def test_rows_that_cannot_be_meant_are_refused(tmp_path, rows, message):
    path = tmp_path / "films.csv"
    path.write_text("\n".join(["Name,400,410,420", *(f"{name},.1,.2,.3" for name in rows)]))
    with refusal(message):
        read_loose_films(path)


def test_films_are_called_by_what_is_in_them():
    assert tint("Red 1:10 Zinc white") == {"Red": 1.0, "Zinc white": 10.0}
    assert tint("Red 2.5 : 97.5 White") == {"Red": 2.5, "White": 97.5}
    assert tint("Red") is tint("Red 1:10") is tint("1:10 White") is tint("Red 1:2 Red") is None
    listed = {"07B": {"Red": 10.0, "White": 90.0}}
    assert recipes_from_names(("07B", "Red 1:3 White", "Red"), listed) == listed | {
        "Red 1:3 White": {"Red": 1.0, "White": 3.0},
        "Red": {"Red": 100.0},
    }


def test_fine_grids_are_averaged_and_cropped_with_a_word():
    films = painted()
    fine = np.arange(350.0, 2501.0)
    spectra = {
        what: np.stack([np.interp(fine, GRID, row) for row in getattr(films, what)])
        for what in SPECTRA
    }
    wide = replace(films, wavelengths=fine, **spectra)
    less = average(wide)
    assert less.wavelengths.size == 431
    assert_allclose(np.diff(less.wavelengths)[1:-1], 5.0)
    assert_allclose(less.over_white[0, 10], wide.over_white[0, 48:53].mean())
    assert less.notes == ("2151 bands averaged to steps of 5 nm",)
    near = crop(less, 400.0, 700.0, "the white is known there only")
    assert (near.wavelengths[0], near.wavelengths[-1]) == (400.0, 700.0)
    assert (
        near.notes[-1] == "cropped to 400-700 nm step 5 (61 bands): the white is known there only"
    )
    assert crop(near, 380.0, 780.0, "") is near
    assert average(films) is films
    with refusal("no three bands in common"):
        crop(films, 705.0, 780.0, "")


@pytest.mark.parametrize(("floor", "share"), [(0.002, 0.0), (0.0005, 0.004), (0.006, 0.0)])
def test_noise_is_told_from_roughness(floor, share):
    height, centre = np.array([[3, 1, 5, 0.3], [590, 450, 520, 640]])[..., None]

    def estimate(noise, step=1):
        grid = FINE[::step]
        k = 0.05 + height * np.exp(-(((grid - centre) / 30) ** 2))
        films = simulate_films(grid, k, np.ones_like(k), names="abcd", noise=noise, seed=2)
        return estimate_noise(films)

    ends = np.array([0.05, 0.9])
    assert estimate(Noise(floor, share)).sd(ends) == pytest.approx(floor + share * ends, rel=0.35)
    # A quiet instrument is taken for a usual one, and coarse spectra say nothing of noise.
    quiet = estimate(Noise(1e-5, 0.0))
    assert quiet.sd(ends[1:]) == pytest.approx(Noise().sd(ends[1:]), rel=0.1)
    assert estimate(Noise(floor, share), 3) == Noise()


def test_films_that_are_rough_themselves_do_not_pass_for_noisy_ones():
    k, s = np.exp(np.random.default_rng(0).uniform(-3.0, 1.0, (2, 4, FINE.size)))
    found = estimate_noise(simulate_films(FINE, k, s, names="abcd", noise=Noise(0.002, 0.0)))
    assert found.sd(np.asarray(0.5)) == pytest.approx(0.002, rel=0.35)


@pytest.mark.parametrize("geometry", ["d:8", "de:8", "45:0"])
def test_bare_cards_read_as_the_films_model_says(geometry):
    """The closed form of a bare card and the table of films agree where the film is nothing."""
    _, *film = film_response(geometry).numbers(np.zeros(1), np.zeros(1))
    bare = bare_surface(Instrument.parse(geometry))
    assert_allclose(np.ravel(film), bare, rtol=0, atol=3e-5)


@pytest.mark.slow
def test_film_by_film_at_45_0():
    quiet = Noise(1e-4, 0.0)
    films = simulate_films(GRID, BLUE[:1], BLUE[1:], names=["a"], instrument="45:0", noise=quiet)
    found = recover_films(films, instrument="45:0", noise=quiet)
    known = found.identifiable[0]
    assert known.mean() > 0.7
    assert_allclose(found.absorption[0, known], BLUE[0, known], rtol=0.03)
    with refusal("fit jointly"):
        recover_films(replace(films, seen=np.array([[True, False]])), instrument="45:0")


def fitted(films, instrument=INSTRUMENT, pigments=KNOWN, **how):
    tight = Expectations(model_floor=0.001, model_share=0.001)
    return recover_jointly(
        films,
        RECIPES,
        instrument=instrument,
        noise=Noise(),
        expectations=tight,
        pigments=pigments,
        **how,
    )


@cache
def one_step():
    """A fit that has hardly begun."""
    return fitted(painted(), max_steps=1)


@pytest.mark.parametrize("instrument", ["d:8", "45:0"])
def test_a_masstone_and_a_tint_with_a_known_white(instrument):
    films = painted(instrument=instrument)
    found = fitted(films, instrument)
    assert found.known == ("White",)
    row = found.row("Blue")
    assert_allclose(found.absorption[row], BLUE[0], rtol=0.25)
    assert_allclose(found.scattering[row], BLUE[1], rtol=0.25)
    # The scale is the white's: thicknesses come out as they are, not as typical ones.
    assert_allclose(found.thickness, [1.3, 0.8], rtol=0.12)
    # A white twice as strong makes the films half as thick and the paint as strong.
    other = fitted(films, instrument, pigments={"White": white(strength=2.0)})
    assert_allclose(other.absorption[row] / found.absorption[row], 2.0, rtol=0.1)
    # Neither need be the usual one.
    thin = fitted(painted((0.3, 0.2), instrument), instrument)
    assert_allclose(thin.thickness, [0.3, 0.2], rtol=0.15)


def test_readings_that_are_not_there_do_not_matter():
    films = painted()
    seen = np.array([[True, True], [False, True]])
    first, second = (
        fitted(replace(films, seen=seen, over_black=np.where(seen[:, :1], films.over_white, lost)))
        for lost in (films.over_white, 0.9)
    )
    assert_allclose(first.absorption, second.absorption, rtol=1e-3)
    assert_array_equal(first.residual[1, 0], first.residual[1, 1])


def test_opaque_films_tell_k_over_s():
    films = painted((60.0, 60.0))
    hidden = replace(films, opaque=np.ones(2, bool), bare_white=films.bare_white * 0.5)
    found = fitted(hidden)
    ratio = found.absorption[0] / found.scattering[0]
    assert_allclose(ratio, BLUE[0] / BLUE[1], rtol=0.15)
    # As thick as films go, whatever thickness is expected.
    kd, sd = optical_thickness(found.unknowns, found.problem)
    assert np.all(kd + sd > 250)
    assert_allclose(found.absorption[0], BLUE[0], rtol=0.3)


def test_a_known_paint_is_called_as_in_the_recipes(tmp_path):
    found = fitted(painted(), pigments={"White": white().renamed("Titan 2")}, max_steps=1)
    assert found.known == ("White",)
    assert list(found.known_modes) == ["White"]
    assert add_paints(found, tmp_path / "mine.csv") == ("Blue", "White")


def test_a_gauge_sets_the_scale():
    films = painted()
    gauge = Gauge({"Blue": 130e-6, "Blue 1:10 White": 80e-6})
    found = fitted(films, pigments=None, gauge=gauge, unit=100e-6)
    assert found.pigment("Blue", 100e-6).absorption == pytest.approx(BLUE[0] / 100e-6, rel=0.25)
    # k and s share the gauge's error.
    rough = Gauge(gauge.thickness, common=0.5)
    wrong = fitted(films, pigments=None, gauge=rough, unit=100e-6)
    assert np.median(wrong.log_sd[:, 0]) > max(0.45, 2 * np.median(found.log_sd[:, 0]))

    by_gauge = posed(films, RECIPES, gauge=gauge, unit=100e-6)
    assert_allclose(by_gauge.film_mean, np.log([1.3, 0.8]))
    assert_allclose(by_gauge.scale.films[:, 0], 0.1)
    # On the scale of a known paint thicknesses are open by a common factor; on their own they have
    # none.
    assert_array_equal(posed(films, RECIPES, references=KNOWN).thickness_modes[-1], 1.0)
    assert len(posed(films, RECIPES).thickness_modes) == 0
    with refusal("no film is called 'Red'"):
        posed(films, RECIPES, gauge=Gauge({"Red": 1e-4}))
    with refusal("the thickness of 'Red' is 1 m"):
        Gauge({"Red": 1.0})
    with refusal("does not cover the films'"):
        posed(films, RECIPES, references={"White": white().resample(GRID[2:])})


def test_a_card_that_was_not_measured_is_fitted():
    """A usual card is assumed; the one below the films was darker, and the fit finds how much."""
    films = painted()
    black, pale = usual_cards(GRID)
    brighter = pale * 1.5 / (1 - pale + pale * 1.5)
    assumed = replace(
        films,
        bare_black=np.tile(black, (2, 1)),
        bare_white=np.tile(brighter, (2, 1)),
        assumed=np.ones((2, 2), bool),
    )
    found = fitted(assumed, pigments={"White": white(size=0.01)})
    level = found.unknowns.others[-2] * 0.5
    assert level == pytest.approx(-np.log(1.5), abs=0.25)
    assert found.rmse.max() < 0.004


def test_error_modes_of_a_pigment_without_them_have_its_size():
    sd = np.linspace(0.05, 0.2, GRID.size)
    paint = Pigment(
        "a", GRID, BLUE[0], BLUE[1], absorption_sd=sd * BLUE[0], scattering_sd=2 * sd * BLUE[1]
    )
    size = np.sqrt(np.sum(error_modes(paint) ** 2, axis=0))
    assert_allclose(size, [sd, 2 * sd], rtol=0.05)


def test_entries_keep_what_is_there_and_share_the_errors_of_the_white(tmp_path):
    path = tmp_path / "mine.csv"
    found = fitted(painted())
    assert repr(found) == "JointRecovery(Blue from 2 films, known: White)"
    assert add_paints(found, path) == ("Blue", "White")
    mine = catalogue.read(path)
    assert list(mine) == ["Blue", "White"]
    blue, pale = mine.values()
    first = "Blue, White: glazejax recover, 2 films, scale of White."
    assert pale.provenance == blue.provenance == f"{first} White: mine"
    assert_allclose(modes_of(pale)[0], 0.05, rtol=1e-2)
    assert_allclose(modes_of(pale)[1:], 0.0)
    # A stronger white would make the blue stronger.
    modes = modes_of(blue)
    assert np.median(modes[0]) > 0.02
    assert blue.absorption_sd is not None
    total = np.sqrt(np.sum(modes[:, 0] ** 2, axis=0))
    assert_allclose(total, blue.absorption_sd / blue.absorption, rtol=0.1)

    # Another paint goes beside them; their lines stay, with nought in the columns that are new.
    before = path.read_text().splitlines()
    films = replace(painted(seed=5), names=("Sky", "Sky 1:10 White"))
    sky = recover_jointly(
        films, recipes_from_names(films.names, {}), noise=Noise(), pigments={"White": pale}
    )
    assert add_paints(sky, path) == ("Sky",)
    after = path.read_text().splitlines()
    assert after[:3] == [*before[:2], "# Sky: glazejax recover, 2 films, scale of White."]
    for old, new in zip(before[3:], after[4:], strict=False):
        assert new.startswith(old)
        assert set(new[len(old) :]) <= set(",0")
    again = catalogue.read(path)
    assert_array_equal(again["Blue"].absorption, blue.absorption)
    longer = modes_of(again["Blue"])
    assert len(longer) > len(modes)
    assert_array_equal(longer[: len(modes)], modes)
    assert_array_equal(longer[len(modes) :], 0.0)
    assert_allclose(again["Sky"].absorption / again["Blue"].absorption, 1.0, rtol=0.4)
    # Both inherit the white's error.
    assert np.median(modes_of(again["Sky"])[0]) > 0.02

    whole = path.read_text()
    with refusal("has an entry 'Sky'; give another name, or replace it with overwrite=True"):
        add_paints(sky, path)
    # Errors of mixtures would be wrong with two whites of one name.
    twice = Pigment("White", GRID, *(2 * PALE / UNIT), error_modes=pale.error_modes)
    other = Pigment("White", GRID, *(PALE / UNIT), error_modes=2 * modes_of(pale))
    for paint in (twice, other, pale.resample(GRID[2:])):
        with refusal("has another 'White' than the fit used: give the fit the file's own"):
            add_paints(replace(sky, known_paints={"White": paint}), path, overwrite=True)
    assert path.read_text() == whole
    # A copy of the same paint is the same.
    copy = replace(sky, known_paints={"White": again["White"]})
    assert add_paints(copy, path, overwrite=True) == ("Sky",)
    assert list(catalogue.read(path)) == ["Blue", "White", "Sky"]
    # A name that begins as a comment does stays a paint's.
    write_pigments(path, [again["Blue"].renamed("#1"), again["White"]], overwrite=True)
    assert add_paints(copy, path) == ("Sky",)
    assert list(catalogue.read(path)) == ["#1", "White", "Sky"]
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_a_file_of_paints_as_a_spreadsheet_saves_it_is_added_to(tmp_path, encoding):
    path = tmp_path / "mine.csv"
    rows = [f"Crème,{nm:g},1000,20000" for nm in GRID]
    lines = ["# prêt-à-porter", "pigment,wavelength_nm,absorption,scattering", *rows]
    path.write_bytes("\r\n".join(lines).encode(encoding))
    assert add_paints(one_step(), path) == ("Blue", "White")
    text = path.read_bytes().decode("utf-8")
    assert text.startswith("# prêt-à-porter\n# Blue, White: ")
    assert list(catalogue.read(path)) == ["Crème", "Blue", "White"]


def test_a_card_without_a_reading_is_neither_listed_nor_drawn(tmp_path, monkeypatch):
    found = one_step()
    found = replace(found, films=replace(found.films, seen=np.array([[True, True], [False, True]])))
    header, rows = film_table(found)
    whole, over_white = (dict(zip(header, row, strict=True)) for row in rows)
    assert "" not in whole.values()
    assert over_white["delta_e_black"] == ""
    assert over_white["delta_e_white"] != ""

    figure = Figure()
    monkeypatch.setattr(plots, "picture", lambda *_: nullcontext(figure))
    plots.plot_joint_paint(found, 0, tmp_path / "Blue.png")
    drawn = [np.isfinite(np.asarray(line.get_ydata())).all() for line in figure.axes[0].lines]
    # Of each film circles, squares and the two lines that were fitted.
    assert drawn == [True] * 4 + [True, False, True, False]


@pytest.mark.slow
def test_a_tint_teaches_most_where_there_is_none():
    films = painted((20.0, 1.0)).take([0])
    alone = recover_jointly(films, RECIPES, noise=Noise())
    found = rank_next_films(alone, "Blue", white=white())
    assert "tint of Blue with White" in found.films[0].film
    assert found.films[0].expected < 0.6 * found.now
    expected = [further.expected for further in found.films]
    assert expected == sorted(expected)
    after = rank_next_films(fitted(painted()), "Blue")
    assert after.now < found.now
    assert not any("1:10" in further.film for further in after.films)
