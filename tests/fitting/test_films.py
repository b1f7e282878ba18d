from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad

from glazefit import Films, Instrument, Noise, read_films, read_loose_films, simulate_films
from glazefit.film.films import (
    bare_surface,
    card_readings,
    card_reflectance,
    ground_from_air,
    reading_over,
    readings,
)
from glazefit.film.readers import (
    films_of,
    is_masstone,
    loose_films,
    read_recipes,
    readable_names,
)
from glazejax import Hemispherical
from glazejax.io import SpectraTable, write_table

from ..commands import invoke
from ..refusals import refusal

GRID = np.array([400.0, 500.0, 600.0])
ROWS = {
    "b": [5.0, 5.0, 5.0],
    "w": [80.0, 84.0, 85.0],
    "ob": [10.0, 12.0, 14.0],
    "ow": [30.0, 35.0, 40.0],
}


def table(rows=ROWS, scale=1.0, separator=","):
    lines = [separator.join(["Name", "400", "410", "420"])]
    lines += [
        separator.join([f"A1_{end}", *(f"{v * scale:g}" for v in row)]) for end, row in rows.items()
    ]
    return "\n".join(lines) + "\n"


def cards(films):
    """Inside, as the usual instrument reads them."""
    return card_readings(films, Instrument(), Noise()).ground


def over_cards(films):
    return readings(films, Instrument(), Noise())


@pytest.fixture
def read(tmp_path):
    def read_text(text):
        path = tmp_path / "films.csv"
        path.write_text(text)
        return read_films(path)

    return read_text


@pytest.mark.parametrize("separator", [",", "\t", ";"])
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_percent_and_fraction_in_any_table_read_the_same(read, separator, scale):
    films = read(table(scale=scale, separator=separator))
    assert films.names == ("A1",)
    assert_allclose(films.over_white, [[0.30, 0.35, 0.40]])
    assert_allclose(films.bare_black, 0.05)
    assert ("values are in percent; divided by 100" in films.notes) == (scale == 1.0)


def test_an_ending_may_be_in_capitals(read):
    capitals = read(table().replace("A1_ob", "A1_OB").replace("A1_w", "A1_W"))
    assert capitals.names == ("A1",)
    assert_array_equal(capitals.over_cards, read(table()).over_cards)


BAD = {
    "missing row": (table({e: r for e, r in ROWS.items() if e != "ow"}), "'A1' has no row 'A1_ow'"),
    "twice": (table() + "A1_OW,1,2,3\n", "film 'A1' has two rows 'A1_ow'"),
    "conditions": (
        table().replace("A1_ob", "A1_ob (M0)"),
        "'A1_ob' was read under several conditions, such as M0: export one of them",
    ),
    "odd name": (table() + "A1_x,1,2,3\n", "'A1_x' must end in _b"),
    "negative": (
        table(ROWS | {"ob": [10.0, -2.0, 14.0]}),
        r"'A1_ob' is negative at band 2 \(410 nm\)",
    ),
    "nan": (table().replace("14", "nan"), "'nan' is not a finite number"),
    "mixed units": (
        table(ROWS | {"ow": [0.30, 0.35, 0.40]}),
        "percent and fraction are mixed.*A1_ow",
    ),
    "wavelengths": (table() + "B1_b,1,2\n", "line 6: 3 cells where the header has 4"),
    "swapped readings": (
        table(ROWS | {"ob": ROWS["ow"], "ow": ROWS["ob"]}),
        "darker over white than over black",
    ),
    "swapped cards": (table(ROWS | {"b": ROWS["w"], "w": ROWS["b"]}), "are the rows swapped"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_tables_are_refused_in_one_line(read, what):
    text, message = BAD[what]
    with refusal(message):
        read(text)


def test_recipes(tmp_path):
    path = tmp_path / "mixtures.tsv"
    path.write_text(
        "01A\tRed-White|100-0\n02A\tRed-White|100-0\n03\tRed-White|9.7-90.3\n04\tBlue|100\n"
    )
    recipes = read_recipes(path)
    assert recipes["01A"] == {"Red": 100.0}
    assert [is_masstone(recipes[s]) for s in recipes] == [True, True, False, True]
    names = readable_names(("01A", "02A", "03", "04", "05"), recipes)
    assert names == ("01A Red", "02A Red", "03 Red 9.7% + White 90.3%", "Blue", "05")
    # Weights are in any unit.
    path.write_text("04\tBlue|1\n06\tRed-White|1-9\n")
    recipes = read_recipes(path)
    assert is_masstone(recipes["04"])
    assert readable_names(("04", "06"), recipes) == ("Blue", "06 Red 10% + White 90%")


def test_a_film_that_was_read_twice_is_refused():
    notes = ["names that repeat were numbered: Red"]
    readings = SpectraTable(GRID, ("Red", "Red (2)"), np.full((2, GRID.size), 0.2), notes=notes)
    for films in (films_of, loose_films):
        with refusal("numbered: Red; a film has one reading of each kind: average them first"):
            films(readings)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("01A Red|100", "expected"),
        ("01A\tRed-White|100", "expected"),
        ("01A\tRed|much", "expected"),
        ("01A\tRed", "expected"),
        ("01A\tRed-Red-White|30-30-40", "paint 'Red' is listed twice in '01A'; add its weights"),
        ("01A\tRed-White|0-0", "all weights of '01A' are 0"),
    ],
)
def test_lists_of_recipes_that_cannot_be_meant_are_refused(tmp_path, line, message):
    path = tmp_path / "mixtures.tsv"
    path.write_text(f"00\tBlue|100\n{line}\n")
    with refusal(f"line 2: {message}"):
        read_recipes(path)


def fresnel(cos_air, n):
    cos_in = np.sqrt(1 - (1 - cos_air**2) / n**2)
    s = (cos_air - n * cos_in) / (cos_air + n * cos_in)
    p = (n * cos_air - cos_in) / (n * cos_air + cos_in)
    return (s**2 + p**2) / 2


@pytest.mark.parametrize("n", [1.3, 1.5, 1.7])
@pytest.mark.parametrize("specular", [True, False])
def test_cards_obey_saunderson(specular, n):
    """What a Lambertian ground under a smooth surface reads (Saunderson 1942)."""
    instrument = Instrument(Hemispherical(8.0, specular), n)
    ground = np.array([[0.0, 0.025, 0.5, 0.93, 1.0]])
    outer = fresnel(np.cos(np.deg2rad(8)), n)
    # 1 - r_i = (1 - r_e)/n^2, by the conservation of radiance / n^2 (Duntley 1942).
    outside = quad(lambda c: 2 * c * fresnel(c, n), 0, 1)[0]
    inner = 1 - (1 - outside) / n**2
    assert bare_surface(instrument).back == pytest.approx(inner, abs=1e-5)
    bare = specular * outer + (1 - outer) * ground * (1 - inner) / (1 - inner * ground)
    inside, slope = card_reflectance(bare, instrument)
    assert_allclose(inside, ground, atol=3e-5)
    assert_allclose(ground_from_air(bare, instrument), ground, atol=3e-5)
    step = 1e-6
    above, below = (card_reflectance(bare + move, instrument)[0] for move in (step, -step))
    assert_allclose(slope, (above - below) / (2 * step), rtol=1e-5)


def test_card_without_specular_part_is_explained(read):
    films = read(table(ROWS | {"b": [1.0, 1.0, 1.0]}, scale=0.01))
    with refusal(r"bare black card of 'A1' reads 0.0100 at 400 nm.*specular"):
        cards(films)
    without = Instrument(Hemispherical(8.0, specular=False))
    assert card_readings(films, without, Noise()).ground[..., 0].max() < 0.05


def test_a_card_that_no_reading_needs_is_converted_and_not_judged(read):
    films = read(table())
    for changes in ({"seen": np.array([[False, True]])}, {"opaque": np.array([True])}):
        fewer = replace(films, **changes)
        assert_array_equal(cards(fewer), cards(films))
        too_dark = replace(fewer, bare_black=0.2 * films.bare_black)
        assert_array_equal(cards(too_dark)[..., 0], 0.0)


def test_too_bright_a_card_is_refused(read):
    films = read(table(ROWS | {"w": [80.0, 84.0, 120.0]}))
    with refusal(r"white card of 'A1' reads 1.2000 at 420 nm, brighter"):
        cards(films)


@pytest.mark.usefixtures("unchecked")
def test_films_check_what_they_are_given(read):
    films = read(table())
    with refusal("over_black of 'A1' at 410 nm is nan"):
        replace(films, over_black=np.array([[0.1, np.nan, 0.2]]))
    with refusal("over_white has shape"):
        replace(films, over_white=np.ones((1, 2)))
    # A white card that is as bright as the black one tells no more than one that is darker.
    for white in (films.bare_black, 0.5 * films.bare_black):
        with refusal("'A1' is not brighter than its bare black card"):
            replace(films, bare_white=white)
    replace(films, bare_white=1.001 * films.bare_black)
    with refusal("over_white of 'A1' at 400 nm is 30, which looks like percent: divide by 100"):
        replace(films, over_white=100.0 * films.over_white)
    twice = np.repeat(films.over_white, 2, axis=0)
    with refusal("two films are called 'A1'"):
        Films(("A1", "A1"), films.wavelengths, twice, twice, twice, twice)


@pytest.mark.parametrize(("floor", "share"), [(-1e-3, 0.002), (0.0, 0.002), (1e-3, np.nan)])
def test_noise_must_be_positive(floor, share):
    with refusal("noise"):
        Noise(floor, share)


@pytest.fixture
def both_kinds(tmp_path):
    """A file of readings with the specular component and without, .04 lower; over white of .5."""
    grid = np.arange(400.0, 701.0, 50.0)
    bands = [f"{word}_{nm:g}nm" for word in ("SCI", "SCE") for nm in grid]
    rows = [
        [f"PB28_{end}", *np.repeat([level, level - 0.04], grid.size)]
        for end, level in zip(ROWS, (0.2, 0.3, 0.4, 0.5), strict=True)
    ]
    path = tmp_path / "films.csv"
    write_table(path, ["Name", *bands], rows)
    return path


def test_of_both_kinds_of_readings_those_with_the_specular_component_are_films(both_kinds):
    films = read_films(both_kinds)
    assert films.names == ("PB28",)
    assert_allclose(films.over_white, 0.5)
    assert "readings with the specular component included (SCI) are used" in films.notes[-1]
    for read in (read_films, read_loose_films):
        assert_allclose(read(both_kinds, specular=False).over_white, 0.46)


@pytest.mark.parametrize(("geometry", "level"), [("", 0.5), ("d:8", 0.5), ("de:8", 0.46)])
@pytest.mark.parametrize(
    ("words", "engine"),
    [
        ("recover FILE --out new", "glazefit.recover.fits.recover_each"),
        ("predict CobaltBlue --reading FILE", "glazefit.recover.predict.mixture.calibrate_mixture"),
        (
            "posterior FILE --paints CobaltBlue --out new",
            "glazefit.posterior.posterior.posterior_of_film",
        ),
        ("identify FILE", "glazefit.identify.command._identify"),
        (
            "identify FILE --ground .9 --references FILE",
            "glazefit.identify.families.references.references_of",
        ),
    ],
)
@pytest.mark.usefixtures("here")
def test_of_both_kinds_the_instruments_is_taken(
    both_kinds, monkeypatch, words, engine, geometry, level
):
    reached = []

    def stop(*arguments, **_):
        reached.extend(each for each in arguments if isinstance(each, Films))
        raise ValueError("nothing is computed")

    # glazefit.identify is a function to those who go by attributes.
    module, _, name = engine.rpartition(".")
    monkeypatch.setattr(import_module(module), name, stop)
    instrument = ["--instrument", geometry] if geometry else []
    result = invoke(*words.replace("FILE", str(both_kinds)).split(), *instrument)
    assert "nothing is computed" in str(result.exception)
    (films,) = reached
    assert_allclose(films.over_white, level)


@pytest.mark.parametrize("card", [0, 1])
def test_a_film_over_one_card_is_one_reading(read, card):
    """The other column, which holds the same values, was not measured."""
    whole = read(table())
    (both,) = over_cards(whole)
    (one,) = over_cards(replace(whole, seen=np.arange(2)[None] == card))
    assert both.grounds == ("black", "white")
    assert one.grounds == both.grounds[card : card + 1]
    for what in ("reflectance", "ground", "sd", "ground_sd"):
        assert_array_equal(getattr(one, what), getattr(both, what)[:, [card]])


def test_a_film_that_hides_its_ground_is_no_reading_over_cards(read):
    with refusal("'A1' is taken to hide its ground.*reading_over"):
        over_cards(replace(read(table()), opaque=np.array([True])))


def test_a_reading_in_percent_is_refused():
    with refusal(r"at 400 nm is 35; it must be in \[0, 3\] \(divide percent by 100\)"):
        reading_over(GRID, np.full(3, 35.0), 0.9)


def test_films_are_simulated_on_a_grid_of_whole_numbers():
    """Cards, too: a black one of whole numbers would reflect nothing."""
    k, s = np.full((2, 1, 3), 0.3)
    films, whole = (simulate_films(grid, k, s, names="a") for grid in (GRID, GRID.astype(int)))
    assert_array_equal(whole.bare_cards, films.bare_cards)
    assert_array_equal(whole.over_cards, films.over_cards)


def test_one_film_is_simulated_from_one_spectrum():
    k, s = np.array([[0.1, 0.3, 0.5], [2.0, 2.0, 2.0]])
    films = simulate_films(GRID, k[None], s[None], names="a")
    assert_array_equal(simulate_films(GRID, k, s, names="a").over_cards, films.over_cards)


def test_spectra_to_simulate_are_not_reordered():
    right = np.full((2, 3), 0.3)
    with refusal(r"absorption has shape \(3, 2\).*2 films and 3 bands"):
        simulate_films(GRID, right.T, right, names="ab")
    with refusal("scattering has shape"):
        simulate_films(GRID, right, right.T, names="ab")
