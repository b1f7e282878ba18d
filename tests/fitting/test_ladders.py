"""Ladders of coats: k and s of one coat, and the next coat."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit import Films, Noise
from glazefit.film.films import card_reflectance
from glazefit.film.model.response import film_response
from glazefit.film.readers import read_loose_films
from glazefit.recover.coats.coats import CoatScattering, coat_of, predict_next_coat, recover_coats
from glazejax import catalogue
from glazejax.colour import delta_e_of_spectra
from glazejax.geometry import resolve_instrument

from ..refusals import refusal
from .palette import GRID
from .tables import read_rows, write_films
from .test_variation import inside

COMMAND = "recover"
INSTRUMENT = resolve_instrument("45:0")
GROUND = 0.85 - 0.1 * np.exp(-(GRID - 400) / 60)
NOISE = Noise(0.001, 0.002)
RED = 0.02 + 0.8 / (1 + np.exp((GRID - 580) / 15))
BLUE = 0.02 + 0.8 / (1 + np.exp((500 - GRID) / 15))


def read_coat(k, s, thickness, rng, ground=GROUND):
    """Reading of a film of k d and s d for one coat."""
    inside = card_reflectance(ground, INSTRUMENT)[0]
    kd, sd = (np.broadcast_to(x, GRID.shape) * thickness for x in (k, s))
    exact = np.asarray(film_response(INSTRUMENT).body(kd, sd, inside))
    return exact + NOISE.sd(exact) * rng.standard_normal(GRID.size)


def table(rows) -> Films:
    """Films from (name, reading, ground)."""
    names, readings, grounds = zip(*rows, strict=True)
    count = len(names)
    return Films(
        names=names,
        wavelengths=GRID,
        bare_black=np.full((count, GRID.size), 0.05),
        bare_white=np.array(grounds),
        over_black=np.array(readings),
        over_white=np.array(readings),
        seen=np.tile([False, True], (count, 1)),
        assumed=np.tile([True, False], (count, 1)),
    )


def ladder(paint, k, s, coats, seed=0, spread=0.0):
    rng = np.random.default_rng(seed)
    return [
        (
            f"{paint} {n} coat{'s' * (n > 1)}",
            read_coat(k, s, n * np.exp(spread * rng.standard_normal()), rng),
            GROUND,
        )
        for n in range(1, coats + 1)
    ]


def recovered(rows, **given):
    return recover_coats(table(rows), instrument=INSTRUMENT, noise=NOISE, **given)


@pytest.fixture
def fit(run, tmp_path):
    """Recovers films from a file into the folder `res`."""

    def recover(films, *words):
        file = write_films(tmp_path / "ladder.csv", films, ("ow", "w"))
        return run(file, "--out", "res", "--instrument", "45:0", *words)

    return recover


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Smalt 1 coat", ("Smalt", 1.0)),
        ("Red ochre 3 coats", ("Red ochre", 3.0)),
        ("Red 42 2 coats left", ("Red 42", 2.0)),
        ("Smalt 1.5 Coats", ("Smalt", 1.5)),
        ("Smalt", None),
        ("Red 1:10 White", None),
        ("2 coats", None),
    ],
)
def test_names_say_paint_and_coats(name, said):
    assert coat_of(name) == said


def test_three_coats_tell_k_from_s():
    scattering = np.linspace(0.9, 0.5, GRID.size)
    rows = ladder("Red", RED, scattering, 3)
    # A wide expectation, near the truth of -0.4. It counts at the red end: where red paint is clear
    # over white, films do not tell s, and k/s lies as far off as what is expected of s.
    found = recovered(rows, expected=CoatScattering(0.0, 1.5))
    red = found.paints["Red"]
    # Thickness is known to some 17 % from three films that may each be off by 30 %.
    assert np.log(red.scattering[0] / scattering).mean() == pytest.approx(0.0, abs=0.3)
    ratio = np.log(red.absorption[0] / red.scattering[0] * scattering / RED)
    assert np.abs(ratio).max() < 0.3
    assert np.all(np.abs(np.log(red.absorption[0] / RED)) < 2.5 * red.log_sd[0, 0])
    assert red.identifiable.mean() > 0.5
    assert red.log_sd[1, 0, -1] > 1.5
    # By default a coat is expected to scatter e times as much (k/s at the red end is then off by
    # .38). That hardly matters where the films tell k from s.
    usual = recovered(rows).paints["Red"]
    ratio = np.log(usual.absorption[0] / usual.scattering[0] * scattering / RED)
    assert np.abs(ratio[usual.identifiable[0]]).max() < 0.1


def test_what_is_expected_of_a_coat_tells_what_one_coat_does_not():
    # Brushed thick: a coat hides far more than films usually do.
    asked = ladder("Red", RED, 3.5, 2, seed=9)
    right, wrong = (
        predict_next_coat(recovered(asked[:1], expected=expected), "Red", 2, GROUND)
        for expected in (CoatScattering(np.log(3.5), 0.3), CoatScattering(-2.0, 0.3))
    )
    assert right.delta_e(asked[1][1]) < wrong.delta_e(asked[1][1])


def test_paints_are_recovered_each_by_itself():
    blue = ladder("Blue", BLUE, 0.5, 2)
    together = recovered([*ladder("Red", RED, 3.5, 3, seed=1), *blue]).paints["Blue"]
    alone = recovered(blue).paints["Blue"]
    assert_allclose(together.absorption, alone.absorption, rtol=1e-6)
    assert_allclose(together.scattering, alone.scattering, rtol=1e-6)


@pytest.mark.slow
def test_two_coats_foretell_the_third_better_than_the_second_does():
    rows = ladder("Blue", BLUE, 0.1, 3)
    found = recovered(rows[:2])
    third = predict_next_coat(found, "Blue", 3, GROUND)
    same = delta_e_of_spectra(GRID, rows[1][1], rows[2][1], observer=10)
    assert third.delta_e(rows[2][1]) < 0.7 * same
    assert third.expected_error() > 0
    # Over another ground too.
    dark = np.full(GRID.size, 0.2)
    other = predict_next_coat(found, "Blue", 3, dark)
    truth = read_coat(BLUE, 0.1, 3, np.random.default_rng(1), dark)
    assert inside(other, truth, 0.99) > 0.9


def test_a_further_film_is_as_thick_as_chance_has_it():
    # Clear paint: the log of what it absorbs is the log of its thickness. That of the film that
    # was read and that of the one foretold vary independently.
    found = recovered(ladder("Clear", 0.15, 0.002, 1), expected=CoatScattering(-6.0, 0.5))
    again = predict_next_coat(found, "Clear", 1, GROUND)
    rng = np.random.default_rng(3)
    thickness = np.exp(0.3 * np.sqrt(2) * rng.standard_normal(200))
    truth = np.array([read_coat(0.15, 0.002, d, rng) for d in thickness])
    spreads = [np.log(x / GROUND).mean(axis=1).std() for x in (again.draws, truth)]
    assert spreads[0] == pytest.approx(spreads[1], rel=0.25)


@pytest.mark.slow
def test_bands_hold_ninety_per_cent_of_truths():
    rng = np.random.default_rng(5)
    expected = CoatScattering(-0.3, 0.6)
    rows, truths = [], {}
    for number in range(40):
        k = np.exp(rng.normal(-1.5, 1.0)) * (RED if number % 2 else BLUE)
        s = np.exp(expected.mean + expected.sd * rng.standard_normal())
        first, second = ladder(f"P{number}", k, s, 2, seed=100 + number, spread=0.3)
        rows.append(first)
        truths[f"P{number}"] = second[1]
    found = recovered(rows, expected=expected)
    shares = [
        inside(predict_next_coat(found, paint, 2, GROUND), truth) for paint, truth in truths.items()
    ]
    assert 0.8 < np.mean(shares) < 0.98


def test_wrong_films_are_refused():
    red = ladder("Red", RED, 0.5, 1)
    good = table(red)
    with refusal("'Umber' does not say its paint and number of coats"):
        recover_coats(table([("Umber", *red[0][1:])]))
    with refusal(r"99 coats; they must be 0\.1 to 20"):
        recover_coats(table([("Red 99 coats", *red[0][1:])]))
    with refusal("spread is 0; it must be above 0"):
        recover_coats(good, spread=0.0)
    with refusal("'Red 1 coat' was not read: add a row 'Red 1 coat_w'"):
        recover_coats(replace(good, assumed=np.ones((1, 2), bool)))
    with refusal("name its rows 'Red 1 coat_ow' and 'Red 1 coat_w'"):
        recover_coats(replace(good, opaque=np.ones(1, bool)))


def test_wrong_wishes_are_refused():
    found = recovered(ladder("Red", RED, 0.5, 1))
    with refusal("no coats of 'Rde' were recovered; there are Red"):
        predict_next_coat(found, "Rde", 2, GROUND)
    with refusal("0 coats of Red; give a number"):
        predict_next_coat(found, "Red", 0, GROUND)
    with refusal(r"shape \(3,\); the films have 16 bands"):
        predict_next_coat(found, "Red", 2, GROUND[:3])
    with refusal("as fractions"):
        predict_next_coat(found, "Red", 2, 100 * GROUND)
    with refusal("the level is 90"):
        predict_next_coat(found, "Red", 2, GROUND).interval(90)


def test_the_command_foretells_the_next_coats(fit, tmp_path):
    rows = [*ladder("Red", RED, 0.5, 3), *ladder("Blue", BLUE, 0.5, 1)]
    out, err = fit(table(rows))
    assert err == ""
    assert "no length was measured" in out
    coming = read_rows(tmp_path / "res/next_coats.csv")
    assert {(row["paint"], row["coats"]) for row in coming} == {
        ("Red", "4"),
        ("Red", "5"),
        ("Blue", "2"),
        ("Blue", "3"),
    }
    assert all(float(r["low_90"]) <= float(r["reflectance"]) <= float(r["high_90"]) for r in coming)
    # The same as the library's.
    found = recover_coats(read_loose_films(tmp_path / "ladder.csv"), instrument="45:0")
    mine = predict_next_coat(found, "Blue", 2, rows[-1][2]).reflectance
    theirs = [float(r["reflectance"]) for r in coming if (r["paint"], r["coats"]) == ("Blue", "2")]
    assert_allclose(mine, theirs, atol=1e-4)
    assert (tmp_path / "res/Red.png").is_file()


def test_no_more_coats_are_foretold_than_there_may_be(fit, tmp_path):
    rows = [
        *ladder("Red", 0.1 * RED, 0.05, 19)[-1:],
        *ladder("Blue", 0.1 * BLUE, 0.05, 20)[-1:],
    ]
    fit(table(rows), "--no-plots")
    coming = read_rows(tmp_path / "res/next_coats.csv")
    assert {(row["paint"], row["coats"]) for row in coming} == {("Red", "20")}
    assert {*catalogue.read(tmp_path / "res/pigments.csv")} == {"Red", "Blue"}


def test_coats_of_bands_that_give_no_colour(fit, tmp_path):
    films = replace(table(ladder("Red", RED, 0.5, 2)), wavelengths=GRID + 700.0)
    out, _ = fit(films, "--no-plots")
    assert "nan" not in out
    assert [row["delta_e"] for row in read_rows(tmp_path / "res/films.csv")] == ["", ""]
    assert len(read_rows(tmp_path / "res/next_coats.csv")) == 2 * GRID.size


@pytest.mark.parametrize(
    ("more", "ends", "words", "said"),
    [
        (["Umber"], ("ow", "w"), "", "'Red 1 coat' is a film of coats and 'Umber' is not"),
        ([], ("ow", "w"), "--white ZincWhite", "--white is not for coats"),
        ([], ("ow", "w"), "--joint", "--joint is not for coats"),
        ([], ("ow",), "", "the bare ground of 'Red 1 coat' was not read"),
    ],
)
def test_what_is_not_for_coats_is_refused(check_refusal, tmp_path, more, ends, words, said):
    rows = [*ladder("Red", RED, 0.5, 1), *((name, GROUND, GROUND) for name in more)]
    file = write_films(tmp_path / "ladder.csv", table(rows), ends)
    check_refusal(said, file, "--out", "res", *words.split())
    assert not (tmp_path / "res").exists()
