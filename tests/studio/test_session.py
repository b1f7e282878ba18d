"""What a page is answered, without a page: spectra are the solver's, files are read, what is wrong
is one sentence.
"""

import json

import numpy as np
import pytest

import glazejax as gj
from glazejax import colour
from glazejax.stacks import pigment_to_dict, stack_from_dict
from glazejax.studio import python_lines
from glazejax.studio.engine import SIZES, Engine
from glazejax.studio.jobs import Jobs
from glazejax.studio.messages import pack, unpack
from glazejax.studio.session import Session

STACK = {
    "glazejax": "stack",
    "coats": [
        {"paint": {"CobaltBlue": 1}, "um": 1},
        {"paint": {"ZincWhite": 3, "Vermillion": 1}, "um": 9},
    ],
    "ground": "card",
    "geometry": "45:0",
}


@pytest.fixture(scope="module")
def ask():
    """Asks a session; returns its answers but for those on its state."""
    answers = []
    session = Session(Engine(), Jobs({}), lambda message: answers.append(unpack(message)))

    def call(header, arrays=None, rest=b""):
        answers.clear()
        session.handle(pack(header, arrays) + rest)
        return [(head, found) for head, found, _ in answers if head["type"] != "status"]

    return call


def test_messages_come_back_as_they_were():
    arrays = {"one": np.arange(6, dtype=np.float32).reshape(2, 3), "none": np.zeros(0)}
    header, found, rest = unpack(pack({"type": "x", "words": "µ"}, arrays) + b"more")
    assert header == {"type": "x", "words": "µ"}
    assert rest == b"more"
    np.testing.assert_array_equal(found["one"], arrays["one"])
    assert found["none"].shape == (0,)


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"\xff\xff\xff\xff{}",
        "nonsense",
        "[1]",
        '{"a": 1}',
        pack({"type": "x"}, {"a": np.ones(9)})[:-8],
        pack({"type": "x"})[:-4] + b'":["',
    ],
)
def test_bytes_that_are_no_message_are_refused(ask, message):
    with pytest.raises(ValueError, match="message"):
        unpack(message)


def test_spectra_and_colours_are_those_of_the_library(ask):
    view = {"lamps": ["D65", "f11"], "light": 30, "view": 50, "pinned": [50, 0, 0]}
    [(header, found)] = ask({"type": "see", "number": 7, "stack": STACK, "view": view})
    assert header["number"] == 7
    stack = stack_from_dict(STACK)
    grid = stack.glaze().wavelengths
    for row, (side, geometry) in enumerate(
        [
            ("white", stack.seen_by),
            ("white", stack.seen_by),
            ("black", stack.seen_by),
            ("white", gj.Bidirectional(30, 50)),
        ]
    ):
        expected = np.asarray(gj.reflectance(stack.glaze(side), geometry))
        np.testing.assert_allclose(found["spectra"][row], expected, atol=3e-5)
        rgb = 255 * np.asarray(colour.srgb(grid, expected, illuminant="FL11"))
        assert np.abs(found["rgb"][1, row] - rgb).max() <= 1
    lab = np.asarray(colour.lab(grid, found["spectra"][0].astype(float)))
    np.testing.assert_allclose(found["lab"][0], lab, atol=1e-3)
    np.testing.assert_allclose(
        found["delta"], colour.delta_e_2000(np.array([50.0, 0, 0]), lab), atol=1e-3
    )
    # The ladder repeats the first coat.
    thick = stack_from_dict(
        {**STACK, "coats": [{"paint": {"CobaltBlue": 1}, "um": 3}, STACK["coats"][1]]}
    )
    np.testing.assert_allclose(
        found["ladder"][2], gj.reflectance(thick.glaze(), stack.seen_by), atol=3e-5
    )


@pytest.mark.parametrize("geometry", ["d:8", "30:30:specular"])
def test_the_surface_is_added_where_it_is_seen(ask, geometry):
    [(_, found)] = ask({"type": "see", "stack": {**STACK, "geometry": geometry}, "view": {}})
    stack = stack_from_dict({**STACK, "geometry": geometry})
    np.testing.assert_allclose(
        found["spectra"][0], gj.reflectance(stack.glaze(), stack.seen_by), atol=3e-5
    )


@pytest.mark.parametrize(
    ("paint", "um", "ground"),
    [
        ({"CobaltBlue": 1}, 0.3, 0.93),
        ({"ZincWhite": 1}, 4, 0.025),
        ({"ZincWhite": 3, "Vermillion": 1}, 3, 0.025),
    ],
)
def test_the_band_is_that_of_the_paints_errors(ask, paint, um, ground):
    """Against the spread of spectra of paints drawn as `Pigment.error_modes` says; one z for all of
    a provenance.
    """
    [(_, found)] = ask(
        {
            "type": "see",
            "stack": {**STACK, "coats": [{"paint": paint, "um": um}], "ground": ground},
            "view": {},
        }
    )
    z, mixed = None, np.zeros((2, 400, 31))
    for name, part in paint.items():
        one = gj.catalogue.pigment(name)
        modes = np.asarray(one.error_modes)
        # So near that log k and log s are straight.
        z = 0.05 * np.random.default_rng(0).standard_normal((400, len(modes))) if z is None else z
        both = np.stack([np.asarray(one.absorption), np.asarray(one.scattering)])[:, None]
        mixed += part / sum(paint.values()) * both * np.exp(z @ modes.swapaxes(0, 1))
    grid = gj.catalogue.pigment("Eosin").wavelengths
    drawn = gj.Glaze([gj.Layer(gj.Pigment("drawn", grid, *mixed), np.full(400, um * 1e-6))], ground)
    spread = np.asarray(gj.reflectance(drawn, gj.Bidirectional(45, 0))).std(axis=0) / 0.05
    np.testing.assert_allclose(found["sd"], spread, rtol=0.15, atol=2e-4)
    assert spread.max() > 0.002


def test_a_paint_that_does_not_say_how_sure_it_is_has_no_band(ask):
    coats = [{"paint": {"acrylics/TitaniumWhite": 1}, "um": 9}]
    [(header, found)] = ask({"type": "see", "stack": {**STACK, "coats": coats}, "view": {}})
    assert found["sd"].size == 0
    assert "TitaniumWhite" in header["rest"]


def test_a_bare_card_is_seen_too(ask):
    [(_, found)] = ask({"type": "see", "stack": {**STACK, "coats": []}, "view": {}})
    np.testing.assert_array_equal(found["spectra"][0], found["spectra"][5])


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"type": "nothing"}, "does not know the message 'nothing'"),
        ({"type": "see", "stack": {}, "view": {}}, "this is no stack"),
        (
            {"type": "see", "stack": STACK, "view": {"lamps": ["candle"]}},
            "unknown illuminant 'candle'",
        ),
        ({"type": "see", "stack": STACK, "view": {"light": 95}}, "between 0 and 85"),
        (
            {"type": "see", "stack": {**STACK, "coats": STACK["coats"] * 5}, "view": {}},
            f"{SIZES[-1]} at most",
        ),
        (
            {"type": "lamp", "lamp": {"name": "x", "wavelengths": [800, 900], "power": [1, 1]}},
            "420 to 680 nm",
        ),
        ({"type": "start", "task": "recipes", "stack": STACK}, "'recipes' is not installed"),
        ({"type": "canvas", "stack": STACK, "coats": [[9, 5]]}, "a brushed coat"),
        ({"type": "canvas", "stack": STACK, "coats": [[0, 5]] * 4}, "1 to 3 coats"),
        (
            {"type": "canvas", "stack": STACK, "coats": [[0, 5]]},
            "the map of brushed coat 0 is missing",
        ),
        ({"type": "file", "name": "empty.csv"}, "empty.csv is empty"),
    ],
)
def test_what_is_wrong_is_one_sentence(ask, message, words):
    [(header, _)] = ask(message)
    assert header["type"] == "error"
    assert header["about"] == message["type"]
    assert words in header["words"]
    assert "\n" not in header["words"]


def check_swatches(paints, swatches):
    for thickness, found in ((0.01, swatches["thick"]), (5e-6, swatches["thin"])):
        for paint, rgb in zip(paints, found, strict=True):
            spectrum = gj.reflectance(
                gj.Glaze([gj.Layer(paint, thickness)], 0.93), gj.Bidirectional(45, 0)
            )
            assert (
                np.abs(rgb - 255 * np.asarray(colour.srgb(paint.wavelengths, spectrum))).max() <= 1
            ), paint.name


def test_the_shelf_shows_paints_as_they_are(ask):
    hello, *shelves = ask({"type": "hello"})
    listed = {entry["name"]: entry for entry in hello[0]["paints"]}
    assert len(listed) == 39
    assert listed["LeadWhite"]["unknown"]
    assert listed["acrylics/TitaniumWhite"]["label"] == "Titanium White"
    assert [len(header["names"]) for header, _ in shelves] == [20, 19]
    for (header, swatches), catalogue in zip(shelves, gj.catalogue.names(), strict=True):
        paints = gj.catalogue.load(catalogue)
        names = [name.rpartition("/")[2] for name in header["names"]]
        chosen = [0, 1, 12, len(names) - 1]
        picked = {size: found[chosen] for size, found in swatches.items()}
        check_swatches([paints[names[i]] for i in chosen], picked)


def test_a_dropped_file_of_paints(ask):
    rows = [f"{name},{w},1000,50000" for name in ("Mine", "ZincWhite") for w in range(400, 701, 10)]
    content = "\n".join(["pigment,wavelength_nm,absorption,scattering", *rows]).encode()
    (header, _), (shelf, swatches) = ask({"type": "file", "name": "paints.csv"}, rest=content)
    assert list(header["pigments"]) == ["Mine", "ZincWhite (own)"]
    assert shelf["names"] == ["Mine", "ZincWhite (own)"]
    mine = gj.Pigment("Mine", np.arange(400.0, 701, 10), np.full(31, 1000.0), np.full(31, 50000.0))
    check_swatches([mine, mine], swatches)
    bad = content.replace(b"400,1000", b"400,many")
    [(header, _)] = ask({"type": "file", "name": "paints.csv"}, rest=bad)
    assert header["words"].startswith("paints.csv")
    assert "'many'" in header["words"]


JUNK = (
    None,
    True,
    -1,
    1e30,
    float("nan"),
    "",
    "x",
    [],
    [1, "a"],
    {},
    {"a": 1},
    ["D65", 3],
    [[0, 1]],
)


@pytest.mark.parametrize(
    "message", ["see", "canvas", "check", "lines", "lamp", "start", "stop", "file", "hello"]
)
def test_junk_in_any_place_is_told_and_never_a_fault(ask, message):
    """Whatever stands where something else should: an answer, and no exception that was
    not meant.
    """
    usual = {
        "stack": STACK,
        "view": {"lamps": ["D65"]},
        "coats": [[0, 5]],
        "lamp": {},
        "task": "none",
        "name": "a",
    }
    usual |= {"options": {}, "number": 1}
    places = [(key,) for key in usual] + [
        ("view", key) for key in ("lamps", "light", "view", "pinned", "repeated")
    ]
    places += [
        ("stack", key)
        for key in ("coats", "ground", "geometry", "refractive_index", "pigments", "version")
    ]
    for place in places if message != "hello" else places[:1]:
        for junk in JUNK if message != "hello" else JUNK[:1]:
            given = json.loads(json.dumps({"type": message, **usual}))
            holder = given if len(place) == 1 else given[place[0]]
            holder[place[-1]] = junk
            for header, _ in ask(given):
                assert "failed at this" not in header.get("words", ""), (
                    place,
                    junk,
                    header["words"],
                )


def test_a_dropped_file_of_spectra(ask):
    content = (
        b"Name,"
        + b",".join(b"%d" % w for w in range(400, 701, 10))
        + b"\ngrey"
        + b",0.2" * 31
        + b"\n"
    )
    [(header, found)] = ask({"type": "file", "name": "one.csv"}, rest=content)
    assert (header["kind"], header["names"]) == ("spectra", ["grey"])
    np.testing.assert_allclose(
        found["rgb"][0],
        255 * np.asarray(colour.srgb(found["wavelengths"].astype(float), np.full(31, 0.2))),
        atol=0.5,
    )
    [(header, _)] = ask(
        {"type": "file", "name": "poem.csv"}, rest=b"roses are red\nviolets are blue\n"
    )
    assert header["type"] == "error"
    assert header["words"].startswith("poem.csv")
    films = gj.samples.path().read_bytes()
    [(header, _)] = ask({"type": "file", "name": "films.csv"}, rest=films)
    assert header["kind"] == "films"


def test_brushed_pixels_are_those_of_a_full_computation(ask):
    rng = np.random.default_rng(1)
    maps = {
        "0": 4 * rng.random(300, np.float32),
        "1": 20 * rng.random(300, np.float32),
        "side": np.arange(300) % 2,
    }
    message = {"type": "canvas", "stack": STACK, "coats": [[0, 4], [1, 32]], "box": {}}
    [(header, found)] = ask(message, maps)
    pixels = np.frombuffer(found["rgba"].astype("<f4").tobytes(), np.uint8).reshape(-1, 4)
    stack = stack_from_dict(STACK)
    layers = [gj.Layer(m, 1e-6 * maps[str(i)].astype(float)) for i, m in enumerate(stack.media())]
    ground = np.where(maps["side"] == 0, 0.93, 0.025)[:, None]
    spectra = gj.reflectance(gj.Glaze(layers, ground), stack.seen_by)
    lab = [
        colour.xyz_to_lab(colour.srgb_to_xyz(rgb), colour.srgb_to_xyz(np.ones(3)))
        for rgb in (
            pixels[:, :3] / 255,
            np.asarray(colour.srgb(stack.glaze().wavelengths, spectra)),
        )
    ]
    assert header["error"] < 0.21
    # 8 bits are up to 0.5 of a Delta E in the dark.
    assert np.percentile(colour.delta_e_2000(*lab), 95) < 0.6
    assert np.all(pixels[:, 3] == 255)


def test_lines_of_python_run_and_give_the_same_spectrum():
    stack = stack_from_dict(STACK)
    text = python_lines.of(stack)
    assert len(text.splitlines()) <= 12
    names = {}
    exec(text.replace("print(", "found = ("), names)
    np.testing.assert_allclose(
        names["spectrum"], gj.reflectance(stack.glaze(), stack.seen_by), atol=1e-9
    )
    own = {"Mine": pigment_to_dict(gj.catalogue.pigment("Eosin"))}
    assert "Glaze.load" in python_lines.of(stack_from_dict({**STACK, "pigments": own}))


def test_a_check_gives_the_stack_as_it_is_understood(ask):
    [(header, _)] = ask(
        {"type": "check", "stack": {**STACK, "coats": [{"paint": {"cobalt blue": 1}, "um": 2}]}}
    )
    assert header["stack"]["coats"] == [{"paint": {"CobaltBlue": 1.0}, "um": 2.0}]
    assert json.dumps(header["stack"])
