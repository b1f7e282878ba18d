"""Stacks as files: what is written is read again, and what is wrong is one sentence."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import (
    Glaze,
    Hemispherical,
    Layer,
    Mixture,
    Pigment,
    catalogue,
    load_glaze,
    reflectance,
    save_glaze,
)
from glazejax.paint.describe import Coat, parse_coats
from glazejax.stacks import (
    BLACK,
    WHITE,
    Hiding,
    Spectrum,
    Stack,
    parse_stack,
    read_stack,
    stack_from_dict,
    stack_of,
    stack_to_dict,
    write_stack,
)

from .glazes import coated
from .refusals import refusal
from .tables import rows

COATS = [
    {"paint": {"CobaltBlue": 1}, "um": 2},
    {"paint": {"ZincWhite": 9, "Eosin": 1}, "um": 20, "hidden": True},
]
GIVEN = {
    "glazejax": "stack",
    "version": 1,
    "coats": COATS,
    "ground": 0.6,
    "geometry": "d:8",
    "refractive_index": 1.4,
}
GRID = [400.0, 500.0, 600.0, 700.0]
MINE = {"wavelengths": GRID, "absorption": [1e4, 2e4, 3e4, 4e4], "scattering": [1e3, 1e3, 1e3, 1e3]}


def test_a_file_that_was_written_is_read_again(tmp_path):
    stack = stack_from_dict({**GIVEN, "pigments": {"Mine": MINE}})
    path = write_stack(tmp_path / "stack.json", stack)
    again = read_stack(path)
    assert stack_to_dict(again) == stack_to_dict(stack)
    assert again.coats[1] == Coat(((0.9, "ZincWhite"), (0.1, "Eosin")), 20e-6, 1)
    assert again.hidden == (False, True)
    assert_allclose(again.pigments["Mine"].absorption, MINE["absorption"])
    with refusal("overwrite=True", FileExistsError):
        write_stack(path, stack)


def test_a_file_is_replaced_as_a_whole(tmp_path):
    path = write_stack(tmp_path / "stack.json", stack_from_dict(GIVEN))
    before = path.read_text(encoding="utf-8")
    # Another name of the old file keeps it: the new one is a file of its own.
    (tmp_path / "old.json").hardlink_to(path)
    write_stack(path, stack_from_dict({**GIVEN, "ground": 0.2}), overwrite=True)
    assert (tmp_path / "old.json").read_text(encoding="utf-8") == before
    assert read_stack(path).ground == 0.2
    assert sorted(file.name for file in tmp_path.iterdir()) == ["old.json", "stack.json"]


def test_the_glaze_is_that_of_the_shown_coats():
    stack = stack_from_dict(GIVEN)
    expected = reflectance(coated(0.6, 1.4, CobaltBlue=2e-6), Hemispherical(8.0))
    assert_allclose(reflectance(stack.glaze(), stack.instrument), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("ground", "level"),
    [
        ("white", WHITE),
        ("black", BLACK),
        ("card", WHITE),
        (0.25, 0.25),
        ({"paint": {"Eosin": 1}}, 0.5),
    ],
)
def test_grounds(ground, level):
    stack = stack_from_dict({**GIVEN, "ground": ground})
    assert stack.level() == level
    assert len(stack.shown) == (2 if isinstance(stack.ground, Hiding) else 1)
    assert stack_to_dict(stack)["ground"] == ground


def test_a_measured_ground_cuts_the_wavelengths_to_its_own():
    spectrum = {"wavelengths": [430.0, 500.0, 600.0], "reflectance": [0.2, 0.3, 0.4]}
    stack = stack_from_dict({**GIVEN, "ground": spectrum})
    assert isinstance(stack.ground, Spectrum)
    glaze = stack.glaze()
    assert (glaze.wavelengths[0], glaze.wavelengths[-1]) == (430.0, 600.0)
    assert_allclose(np.asarray(glaze.ground)[[0, -1]], [0.2, 0.4])


def test_paints_of_two_catalogues_share_their_wavelengths():
    coats = [{"paint": {"acrylics/TitaniumWhite": 1}, "um": 9}, {"paint": {"Eosin": 1}, "um": 3}]
    glaze = stack_from_dict({**GIVEN, "coats": coats}).glaze()
    assert (glaze.wavelengths[0], glaze.wavelengths[-1]) == (400.0, 700.0)


def test_what_a_file_need_not_say():
    least = {"glazejax": "stack", "coats": COATS[:1]}
    stack = stack_from_dict(least)
    for same in (stack, Stack(stack.coats)):
        assert same.refractive_index == 1.5
        assert same.instrument == "45:0"
        assert same.ground == "card"
        assert same.hidden == (False,)
    assert stack_from_dict({**least, "version": 1}) == stack


WRONG = r"""
{"glazejax": "scene"} | "glazejax": "stack"
{"version": 2} | version 2
{"coat": []} | a stack has no 'coat'
{"coats": [{"paint": {"CobaltBleu": 1}, "um": 1}]} | coat 1: there is no pigment 'CobaltBleu'.*CobaltBlue
{"coats": [{"paint": {"Eosin": 1}, "um": 1e9}]} | coat 1 is .* micrometres thick; .* between 0 and 10000
{"coats": [{"paint": {"Eosin": 1}, "um": -1}]} | between 0 and 10000
{"coats": [{"paint": {"Eosin": 1}, "um": null}]} | coat 1: "um" is None; it must be a number of micro
{"coats": [{"paint": {"Eosin": 1}, "um": "4um"}]} | "um" is '4um'; .* without a unit
{"coats": [{"paint": {"Eosin": 1}, "um": HUGE}]} | "um" is 1000.*; it must be
{"coats": [{"paint": "Eosin", "um": 1}]} | parts by weight, such as "paint": {"Eosin": 1}
{"coats": [{"paint": {"Eosin": 0}, "um": 1}]} | all parts are 0
{"coats": [{"paint": {"Eosin": -1}, "um": 1}]} | the part of Eosin is -1
{"coats": [{"paint": {"Eosin": HUGE}, "um": 1}]} | the part of Eosin is 1000
{"coats": [{"paint": {"a": 1, "b": 1, "c": 1, "d": 1, "e": 1}, "um": 1}]} | 1 to 4 paints
{"coats": [{"um": 1}]} | coat 1 must have "paint" and "um"
{"ground": 85} | the ground is 85; .* between 0 and 1: 85 percent are 0.85
{"ground": 1.2} | the ground is 1.2; .* between 0 and 1
{"ground": HUGE} | the ground is 1000.*; it must be a number
{"ground": "pink"} | white, black or card
{"ground": {"wavelengths": [400, 500, 600], "reflectance": [0.1, 0.2]}} | one reflectance
{"geometry": "sideways"} | geometry is 'sideways'
{"refractive_index": 3} | refractive_index is 3
{"refractive_index": HUGE} | refractive_index is 1000.*; it must be a number
{"pigments": {"Mine": {"wavelengths": [400, 500]}}} | paint 'Mine' must have
{"pigments": {"Mine": {"wavelengths": [400, 500], "absorption": [1, -4], "scattering": [1, 1]}}} | absorption of 'Mine'
"""


@pytest.mark.parametrize(("change", "words"), rows(WRONG))
def test_what_is_wrong_is_one_sentence(change, words):
    changes = json.loads(change.replace("HUGE", str(10**400)))
    with refusal(words) as raised:
        parse_stack(json.dumps(GIVEN | changes))
    assert len(str(raised.value)) < 300


def test_text_that_is_no_stack(tmp_path):
    path = tmp_path / "stack.json"
    for text in ("{", "[1]", "NaN"):
        path.write_text(text)
        with refusal("stack"):
            read_stack(path)


def test_a_glaze_is_saved_and_loaded(tmp_path):
    paints = catalogue.load()
    grid = paints["CobaltBlue"].wavelengths
    mine = Pigment("Mine", grid, np.linspace(1e4, 7e4, grid.size) / 3, np.full(grid.size, 1e4 / 7))
    other = Pigment("Mine", grid, mine.scattering, mine.absorption)
    mixture = Mixture([paints["ZincWhite"], mine], [0.7, 0.3])
    coats = [Layer(paints["CobaltBlue"], 2.3e-6), Layer(mixture, 1e-5), Layer(other, 1e-6)]
    glaze = Glaze(coats, np.linspace(0.2, 0.9, grid.size), 1.45)
    path = save_glaze(glaze, tmp_path / "glaze.json", instrument="d:8")
    again = load_glaze(path)
    assert [coat.medium.name for coat in again.coats] == [
        "CobaltBlue",
        "0.7 ZincWhite + 0.3 Mine",
        "Mine'",
    ]
    assert_allclose(reflectance(again, "d:8"), reflectance(glaze, "d:8"), atol=1e-9)
    assert_array_equal(again.coats[2].medium.absorption, other.absorption)
    assert (again.refractive_index, read_stack(path).instrument) == (1.45, "d:8")
    assert set(json.loads(path.read_text())["pigments"]) == {"Mine", "Mine'"}
    with refusal("overwrite=True", FileExistsError):
        save_glaze(glaze, path)
    assert save_glaze(glaze, path, overwrite=True) == path


def test_a_glaze_over_both_sides_of_a_card(tmp_path):
    (tmp_path / "s.json").write_text(json.dumps({**GIVEN, "ground": "card"}))
    grounds = [load_glaze(tmp_path / "s.json", side=side).ground for side in ("white", "black")]
    assert_allclose(grounds, [WHITE, BLACK])


def test_a_card_has_two_sides(unchecked, tmp_path):
    (tmp_path / "s.json").write_text(json.dumps(GIVEN))
    with refusal("side is 'grey'"):
        load_glaze(tmp_path / "s.json", side="grey")  # pyright: ignore[reportArgumentType]


COBALT = catalogue.pigment("CobaltBlue")
FORWARD = Pigment("F", GRID, [1e4] * 4, [1e4] * 4, phase=[1.0, 0.5])


@pytest.mark.parametrize(
    ("coats", "index", "words"),
    [
        ([], 1.5, "a glaze without coats"),
        ([Layer(COBALT, [1e-6, 2e-6])], 1.5, "without batch axes"),
        ([Layer(FORWARD, 1e-6)], 1.5, "a phase function"),
        ([Layer(COBALT, 1e-6)], np.linspace(1.4, 1.5, 31), "one refractive index"),
        (
            [Layer(Mixture([COBALT] * 5, [0.2] * 5), 1e-6)],
            1.5,
            "is of 5 paints; a coat has 4 at most",
        ),
    ],
)
def test_what_no_file_holds_is_said(tmp_path, coats, index, words):
    with refusal(words):
        save_glaze(Glaze(coats, 0.5, index), tmp_path / "glaze.json")


LONG = "9x" * 150_000


def flat(name: str = "Flat", bands: int = 4) -> Pigment:
    """A paint of one's own on a grid of so many bands."""
    grid = np.linspace(350.0, 2500.0, bands)
    return Pigment(name, grid, np.full(bands, 1e5 / 7), np.full(bands, 1e5 / 3))


def test_a_paint_of_a_field_instrument_is_saved_and_loaded(tmp_path):
    glaze = Glaze([Layer(flat(bands=2151), 1e-6)], 0.5)
    again = load_glaze(save_glaze(glaze, tmp_path / "glaze.json"))
    assert_array_equal(again.coats[0].medium.absorption, glaze.coats[0].medium.absorption)


def test_a_name_with_a_stroke_is_marked_once(tmp_path):
    glaze = Glaze([Layer(flat("Blue 1/2"), 1e-6)], 0.5)
    for _ in range(2):
        glaze = load_glaze(save_glaze(glaze, tmp_path / "glaze.json", overwrite=True))
        assert glaze.coats[0].medium.name == "Blue 1/2 (own)"


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        (stack_of(Glaze([Layer(flat(bands=5001), 1e-6)], 0.5)), "1 to 5000 numbers"),
        (stack_of(Glaze([Layer(COBALT, 1e-7)] * 101, 0.5)), "a list of 100 coats"),
        (stack_of(Glaze([Layer(flat("n" * 201), 1e-6)], 0.5)), "more than 200 characters"),
        (stack_of(Glaze([Layer(COBALT, 1e-6)], 0.5), Hemispherical(89.9999999)), "d:90"),
        (Stack((Coat(tuple((0.2, name) for name in "abcde"), 1e-6, 1),)), "1 to 4 paints"),
    ],
    ids=["bands", "coats", "name", "angle", "paints"],
)
def test_what_could_not_be_read_again_is_not_written(tmp_path, stack, words):
    path = write_stack(tmp_path / "stack.json", stack_from_dict(GIVEN))
    before = path.read_bytes()
    with refusal(f"stack.json: .*{words}"):
        write_stack(path, stack, digits=17, overwrite=True)
    assert path.read_bytes() == before


def test_a_stack_that_is_too_large_to_be_read_is_not_written(tmp_path):
    glaze = Glaze([Layer(flat(f"x{i}", 5000), 1e-6) for i in range(25)], 0.5)
    with refusal("the stack takes .* MB, and 8 MB are read .*: resample"):
        save_glaze(glaze, tmp_path / "glaze.json")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    "place", ["version", "ground", "geometry", "refractive_index", "coats", "pigments", LONG]
)
@pytest.mark.parametrize("kind", [str, list, dict])
def test_a_long_value_is_not_echoed_whole(place, kind):
    value = {str: LONG, list: [LONG], dict: {LONG: LONG}}[kind]
    with refusal(r"^.{1,700}$"):
        stack_from_dict({"glazejax": "stack", "coats": COATS, place: value})


@pytest.mark.parametrize("key", ["paint", "um"])
@pytest.mark.parametrize("value", [LONG, {LONG: 1}, {LONG: ""}, {"CobaltBlue": LONG}])
def test_a_long_word_of_a_coat_is_not_echoed_whole(key, value):
    with refusal(r"^.{1,700}$"):
        stack_from_dict({"glazejax": "stack", "coats": [COATS[0] | {key: value}]})


def test_a_paint_that_a_mixture_holds_twice_keeps_its_weight(tmp_path):
    blue, white = (catalogue.pigment(name) for name in ("CobaltBlue", "ZincWhite"))
    mixed = Mixture([blue, white, blue], [0.2, 0.5, 0.3])
    path = save_glaze(Glaze([Layer(mixed, 2e-6)], 0.6), tmp_path / "glaze.json")
    again = load_glaze(path).coats[0].medium
    assert isinstance(again, Mixture)
    assert_allclose(again.weights, [0.5, 0.5])


def test_a_paint_in_two_spellings_is_one_of_their_weight():
    twice = {"paint": {"ZincWhite": 7, "zinc white": 1, "Eosin": 2}, "um": 5}
    [coat] = stack_from_dict({**GIVEN, "coats": [twice]}).coats
    assert coat.parts == ((0.8, "ZincWhite"), (0.2, "Eosin"))
    ground = stack_from_dict({**GIVEN, "ground": {"paint": twice["paint"]}}).ground
    assert ground == Hiding(coat.parts)
    typed = Stack(parse_coats("0.5*Eosin+0.25*ZincWhite+0.25*Eosin:5um"))
    assert stack_to_dict(typed)["coats"][0]["paint"] == {"Eosin": 0.75, "ZincWhite": 0.25}
