"""What the page computes by itself, in node: spectra and colours are the library's, what is wrong is
one sentence.
"""

import json
import re
from functools import cache

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.testing import assert_allclose

import glazejax as gj
from glazejax import colour
from glazejax.paint.pigment_table import read_pigments, write_pigments
from glazejax.stacks import MOST_COATS, pigment_to_dict, stack_from_dict
from glazejax.studio.one_file import bundle, page_text
from glazejax.studio.page_data import page_data

from ..slow import slow
from .coats import coat
from .node import run

STACK = {
    "glazejax": "stack",
    "coats": [
        coat("CobaltBlue", 1),
        {"paint": {"ZincWhite": 3, "Vermillion": 1}, "um": 9},
    ],
    "ground": "card",
    "geometry": "45:0",
}
VIEW = {"lamps": ["D65", "FL11"], "light": 30, "view": 50, "pinned": [50, 0, 0], "repeated": 0}

_SEE = """
    const { Eye } = await load("seen"), { checkStack } = await load("check");
    const eye = new Eye(given.data), stack = checkStack(given.stack, given.data);
    return { ...eye.see(stack, given.view), ...eye.rest(stack, given.view) };
"""
_CHECK = """
    const { checkStack, checkLamp, parseStack } = await load("check"), { Eye } = await load("seen");
    return given.all.map((one) => {
        try {
            if (one.lamp) return checkLamp(one.lamp);
            const stack = one.text ? parseStack(one.text, given.data) : checkStack(one.stack, given.data);
            new Eye(given.data).see(stack, { lamps: ["D65"], light: 45, view: 60 });
            return stack;
        } catch (error) {
            return `${error.constructor.name}: ${error.message}`;
        }
    });
"""


@cache
def known():
    return page_data()


def ask(code, **given):
    """The page's answer, of all that it knows by itself and what is given."""
    return run(code, {"data": known(), **given})


def see(**changes):
    """What the page shows of the stack with other parts."""
    return ask(_SEE, stack={**STACK, **changes}, view=VIEW)


def check(*given):
    return ask(_CHECK, all=given)


@pytest.mark.parametrize(
    "coats",
    [STACK["coats"], [{"paint": {"acrylics/TitaniumWhite": 1, "Eosin": 1}, "um": 7}]],
    ids=["oils", "of two grids"],
)
def test_spectra_and_colours_are_those_of_the_library(coats):
    given = {**STACK, "coats": coats}
    found = see(coats=coats)
    stack = stack_from_dict(given)
    grid = stack.glaze().wavelengths
    assert_allclose(found["wavelengths"], grid)
    for row, (side, geometry) in enumerate(
        [
            ("white", stack.instrument),
            ("white", stack.instrument),
            ("black", stack.instrument),
            ("white", gj.Bidirectional(30, 50)),
        ]
    ):
        expected = np.asarray(gj.reflectance(stack.glaze(side), geometry))
        assert_allclose(found["spectra"][row], expected, atol=1e-4)
        rgb = 255 * np.asarray(colour.srgb(grid, expected, illuminant="FL11"))
        assert np.abs(found["colours"][1][row]["rgb"] - rgb).max() <= 1
    lab = np.asarray(colour.lab(grid, np.array(found["spectra"][0])))
    assert_allclose(found["colours"][0][0]["lab"], lab, atol=1e-6)
    assert found["delta"] == pytest.approx(colour.delta_e_2000([50.0, 0, 0], lab), abs=1e-6)
    # The ladder repeats the first coat.
    thick = stack_from_dict(
        {**given, "coats": [{**coats[0], "um": 3 * coats[0]["um"]}, *coats[1:]]}
    )
    lab = colour.lab(grid, gj.reflectance(thick.glaze(), stack.instrument))
    assert_allclose(found["ladder"][2]["lab"], lab, atol=0.05)


@pytest.mark.parametrize(
    "change",
    [
        {"geometry": "d:8"},
        {"geometry": "30:30:specular"},
        {"ground": 0.4},
        {"ground": {"paint": {"ChromeYellow": 1}}},
        {"ground": {"wavelengths": [400, 500, 700], "reflectance": [0.1, 0.9, 0.4]}},
    ],
    ids=["sphere", "mirror", "grey", "paint that hides", "measured"],
)
def test_geometries_and_grounds_are_those_of_the_library(change):
    stack = stack_from_dict({**STACK, **change})
    expected = gj.reflectance(stack.glaze(), stack.instrument)
    assert_allclose(see(**change)["spectra"][0], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("paint", "um", "ground"),
    [
        ({"CobaltBlue": 1}, 0.3, 0.93),
        ({"ZincWhite": 1}, 4, 0.025),
        ({"ZincWhite": 3, "Vermillion": 1}, 3, 0.025),
    ],
)
def test_the_band_is_that_of_the_paints_errors(paint, um, ground):
    """Against the spread of spectra of paints drawn as `Pigment.error_modes` says; one z for all of
    a provenance.
    """
    found = see(coats=[{"paint": paint, "um": um}], ground=ground)
    mixed = np.zeros((2, 400, 31))
    for name, part in paint.items():
        one = gj.catalogue.pigment(name)
        modes = np.asarray(one.error_modes)
        # So near that log k and log s are straight.
        z = 0.05 * np.random.default_rng(0).standard_normal((400, len(modes)))
        both = np.stack([np.asarray(one.absorption), np.asarray(one.scattering)])[:, None]
        mixed += part / sum(paint.values()) * both * np.exp(z @ modes.swapaxes(0, 1))
    grid = gj.catalogue.pigment("Eosin").wavelengths
    drawn = gj.Glaze([gj.Layer(gj.Pigment("drawn", grid, *mixed), np.full(400, um * 1e-6))], ground)
    spread = np.asarray(gj.reflectance(drawn, gj.Bidirectional(45, 0))).std(axis=0) / 0.05
    assert_allclose(found["sd"], spread, rtol=0.15, atol=2e-4)
    assert spread.max() > 0.002


def test_the_band_of_an_own_paint_is_that_of_its_standard_deviations():
    """Each band on its own, against two drawn a little larger."""
    one = gj.catalogue.pigment("Vermillion")
    sd = {"absorption_sd": 0.1 * np.asarray(one.absorption), "scattering_sd": np.zeros(31)}
    mine = gj.Pigment("Mine", one.wavelengths, one.absorption, one.scattering, **sd)
    found = see(coats=[coat("Mine", 3)], pigments={"Mine": pigment_to_dict(mine)})
    more = gj.Pigment("more", one.wavelengths, 1.001 * np.asarray(one.absorption), one.scattering)
    spectra = [
        gj.reflectance(gj.Glaze([gj.Layer(paint, 3e-6)], 0.93), "45:0") for paint in (one, more)
    ]
    assert_allclose(found["sd"], 100 * np.abs(spectra[1] - spectra[0]), rtol=0.05, atol=1e-5)


def test_a_paint_that_does_not_say_how_sure_it_is_has_no_band():
    found = see(coats=[coat("acrylics/TitaniumWhite", 9)])
    assert found["sd"] is None
    assert "TitaniumWhite" in found["rest"]


def test_paints_of_which_only_k_over_s_is_known_are_named():
    found = see(coats=[coat("LeadWhite", 9)])
    assert any("LeadWhite" in words and "only k/s is known" in words for words in found["doubts"])
    assert see()["doubts"] == []


def test_an_own_paint_of_which_only_k_over_s_is_known_is_named():
    """It comes onto the shelf after the page's data, as one recovered from a film does."""
    code = """
        globalThis.matchMedia = () => ({ matches: false });
        const { Store } = await load("store");
        const store = new Store(null);
        store.learn(given.data);
        store.own.Mine = store.eye.paints.get("Eosin");
        store.entries.set("Mine", { name: "Mine", group: "own", unknown: "400-420 nm" });
        store.add({ Mine: 1 }, 3);
        return store.eye.see(store.plain(), store.viewNow()).doubts;
    """
    [words] = [doubt for doubt in ask(code) if doubt.startswith("Mine")]
    assert "400-420 nm: only k/s is known" in words


def test_a_bare_card_is_seen_too():
    found = see(coats=[])
    assert found["spectra"][0] == found["spectra"][5]


def test_the_shelf_shows_paints_as_they_are():
    names = ["Eosin", "LeadWhite", "acrylics/CobaltBlue"]
    code = """
        const { Eye } = await load("seen"), eye = new Eye(given.data);
        return given.names.map((name) => eye.swatch(name).map((one) => one.rgb));
    """
    for name, rgb in zip(names, ask(code, names=names), strict=True):
        catalogue, _, own = name.rpartition("/")
        paint = gj.catalogue.load(catalogue or "oils")[own]
        for thickness, shown in zip((0.01, 5e-6), rgb, strict=True):
            spectrum = gj.reflectance(gj.Glaze([gj.Layer(paint, thickness)], 0.93), "45:0")
            expected = 255 * np.asarray(colour.srgb(paint.wavelengths, spectrum))
            assert np.abs(shown - expected).max() <= 1, name


TABLE = ["pigment,wavelength_nm,absorption,scattering"]
TABLE += [f"{name},{w},1000,50000" for name in ("Mine", "ZincWhite") for w in range(400, 701, 10)]
_PAINTS = """
    const { looksLikePigments, readPigments } = await load("pigments");
    return given.texts.map((text) => {
        try {
            return looksLikePigments(text.slice(0, 4000)) && readPigments(text, "mine.csv", given.data);
        } catch (error) {
            return `${error.constructor.name}: ${error.message}`;
        }
    });
"""


def read_paints(*texts):
    return ask(_PAINTS, texts=texts)


def test_a_table_of_own_paints_is_read_as_python_reads_it(tmp_path):
    """What `write_pigments` writes: names with commas, of formulas and numbered, errors that are
    missing.
    """
    eosin = gj.catalogue.pigment("Eosin")
    sd = 0.1 * np.asarray(eosin.absorption)
    known_at = np.arange(31) > 2
    mine = [
        gj.Pigment(
            "Red, old", eosin.wavelengths, eosin.absorption, eosin.scattering, absorption_sd=sd
        ),
        gj.catalogue.pigment("LeadWhite").renamed("=sum"),
        gj.catalogue.pigment("LeadWhite").renamed("#1 white"),
        gj.Pigment(
            "Eosin", eosin.wavelengths, eosin.absorption, eosin.scattering, identifiable=known_at
        ),
    ]
    write_pigments(tmp_path / "mine.csv", mine, ["read at home"])
    text = (tmp_path / "mine.csv").read_text()
    [found] = read_paints(text)
    assert list(found["pigments"]) == ["Red, old", "=sum", "#1 white", "Eosin (own)"]
    python = read_pigments(tmp_path / "mine.csv")
    for paint, one in zip(found["pigments"].values(), python.values(), strict=True):
        for key in ("wavelengths", "absorption", "scattering"):
            assert_allclose(paint[key], getattr(one, key), rtol=1e-6)
        assert ("scattering_sd" in paint) == (one.scattering_sd is not None)
        assert paint["provenance"] == "read at home"
    assert found["entries"][3]["unknown"] == "400-420 nm"
    # The same with a spreadsheet's mark and line ends.
    assert read_paints("\ufeff" + text.replace("\n", "\r\n")) == [found]


def spoilt(old, new):
    return "\n".join(TABLE).replace(old, new, 1)


BAD_TABLES = [
    (spoilt("400,1000", "400,many"), "line 2: absorption is 'many'; write a number"),
    (spoilt("410,1000", "410,-3"), "line 3: absorption is -3; it must be 0 or more"),
    (spoilt("410,1000", "410,1e31"), "line 3: absorption is '1e31'"),
    (spoilt("Mine,410", "Mine,390"), "go from 400 to 390 nm; they must rise"),
    (spoilt("410,1000", "410,1,000"), "line 3: 5 cells where the header has 4"),
    (spoilt("Mine,400", ",400"), "line 2: the pigment has no name"),
    (spoilt("scattering", "s"), "no column scattering"),
    (
        spoilt(TABLE[0], TABLE[0].replace(",", ";")),
        "divided by semicolons; save the table with commas",
    ),
    (TABLE[0], "no paint below it"),
    ("\n".join(TABLE[:12]), "known from 400 to 500 nm; a colour needs 420 to 680 nm"),
    (
        "\n".join([TABLE[0], *(f"P{i},{w},1,1" for i in range(101) for w in (400, 700))]),
        "more than 100",
    ),
]


def check_sentences(answers, table, start):
    for said, (given, words) in zip(answers, table, strict=True):
        assert isinstance(said, str), given
        assert said.startswith(start), said
        assert words in said, said
        assert "\n" not in said


def test_a_bad_table_of_paints_is_one_sentence():
    said = read_paints(*(one for one, _ in BAD_TABLES))
    check_sentences(said, BAD_TABLES, "Sentence: mine.csv")


def test_what_is_no_table_of_paints_is_left_to_others():
    assert read_paints("Name,400,500\na,0.1,0.2\n", '{"glazejax": "stack"}') == [False, False]


def question_with(**changes):
    """A question for a check of the stack with other parts."""
    return {"stack": {**STACK, **changes}}


BAD = [
    ({"stack": {}}, "this is no stack"),
    (question_with(version=9), "of version 9"),
    (question_with(coat=[]), "has no 'coat'"),
    ({"text": '{"glazejax": "sta'}, "cut short"),
    (question_with(coats=STACK["coats"] * 5), "8 at most"),
    (question_with(coats=STACK["coats"] * 51), f"{MOST_COATS} coats at most"),
    (question_with(coats=[coat("Eosin", 1e9)]), "between 0 and 10000"),
    (question_with(coats=[coat("Eosin", "5 um")]), "without a unit"),
    (question_with(coats=[{"paint": {"Eosin": 0}, "um": 5}]), "all parts are 0"),
    (
        question_with(coats=[coat("CobaltBleu", 5)]),
        "nearest is CobaltBlue",
    ),
    (question_with(ground=40), "the ground is 40"),
    (question_with(ground="red"), "white, black or card"),
    (question_with(geometry="45:95"), 'geometry is "45:95"'),
    (question_with(refractive_index=0.9), "between 1 and 2.5"),
    (question_with(pigments={"A": {"wavelengths": [1]}}), "absorption and scattering"),
    ({"lamp": {"name": "x", "wavelengths": [800, 900], "power": [1, 1]}}, "420 to 680 nm"),
    ({"lamp": {"name": "x", "wavelengths": [400, 700], "power": [0, 0]}}, "gives no light"),
    ({"lamp": {"name": "x", "wavelengths": [400, 700], "power": [1e308, 1e308]}}, "0 to 1e100"),
]


def test_what_is_wrong_is_one_sentence():
    check_sentences(check(*(one for one, _ in BAD)), BAD, "Sentence: ")


def test_a_whole_number_of_400_digits_is_one_sentence():
    """In a link's text: no float holds it."""
    huge = "9" * 400
    text = json.dumps(STACK).replace('"um": 9', f'"um": {huge}')
    [thickness] = check({"text": text})
    assert "must be a number of micrometres" in thickness
    with pytest.raises(ValueError, match="must be a number of micrometres"):
        stack_from_dict(json.loads(text))


JUNK = (None, True, -1, 1e30, "", "x", [], [1, "a"], {}, {"a": 1}, ["D65", 3], [[0, 1]])


def test_junk_in_any_place_is_refused_and_never_a_fault():
    places = ("coats", "ground", "geometry", "refractive_index", "pigments", "version")
    given = [question_with(**{place: junk}) for place in places for junk in JUNK]
    given += [question_with(coats=[junk]) for junk in JUNK]
    given += [{"lamp": {"name": "x", "wavelengths": a, "power": b}} for a in JUNK for b in JUNK]
    for one, said in zip(given, check(*given), strict=True):
        assert not isinstance(said, str) or said.startswith("Sentence: "), (one, said)


def test_a_paint_of_a_field_instrument_is_taken():
    grid = [350.0 + band for band in range(2151)]
    wide = {"wavelengths": grid, "absorption": [1e4] * 2151, "scattering": [1e5] * 2151}
    [stack] = check(question_with(coats=[{"paint": {"A": 1}, "um": 2}], pigments={"A": wide}))
    assert stack["pigments"]["A"] == wide


def test_a_check_gives_the_stack_as_it_is_understood():
    [found] = check(question_with(coats=[{"paint": {"cobalt blue": 5}, "um": 2}]))
    assert found["coats"] == [{"paint": {"CobaltBlue": 5}, "um": 2}]


def test_a_paint_in_two_spellings_is_one_of_their_weight():
    twice = {"ZincWhite": 7, "Eosin": 2, "zinc white": 1}
    [found] = check(question_with(coats=[{"paint": twice, "um": 2}], ground={"paint": twice}))
    assert found["coats"][0]["paint"] == {"ZincWhite": 8, "Eosin": 2}
    assert found["ground"] == {"paint": {"ZincWhite": 8, "Eosin": 2}}


def test_lines_of_python_run_and_give_the_same_spectrum():
    code = 'return (await load("lines")).pythonLines(given.stack, given.data);'
    whole = {**STACK, "refractive_index": 1.5}
    text = ask(code, stack=whole)
    assert len(text.splitlines()) <= 12
    names = {}
    exec(text.replace("print(", "found = ("), names)
    stack = stack_from_dict(STACK)
    expected = gj.reflectance(stack.glaze(), stack.instrument)
    assert_allclose(names["spectrum"], expected, atol=1e-9)
    own = {"Mine": pigment_to_dict(gj.catalogue.pigment("Eosin"))}
    assert "gj.load_glaze" in ask(code, stack={**whole, "pigments": own})
    # Oils and acrylics have other wavelengths: a `Glaze` of both would be refused.
    acrylic = {**whole, "coats": [coat("acrylics/TitaniumWhite", 5)]}
    assert "gj.load_glaze" not in ask(code, stack=acrylic)
    both = {**whole, "coats": [*STACK["coats"], *acrylic["coats"]]}
    assert "gj.load_glaze" in ask(code, stack=both)


EIGHT = [
    *STACK["coats"],
    coat("LeadWhite", 2),
    coat("Eosin", 3),
    coat("ViridianGreen", 1),
    coat("ChromeYellow", 4),
    {"paint": {"Minium": 1, "ZincWhite": 4}, "um": 6},
    coat("PrussianBlue", 0.5),
]
_BRUSH = """
    const { Eye } = await load("seen"), { checkStack } = await load("check"), { Combinations, fillLevels, makeTable, readTable } = await load("table");
    const eye = new Eye(given.data), stack = checkStack(given.stack, given.data), width = given.maps[0].length;
    const brushed = given.tops.map((top, i) => [i, top]), box = { x: 0, y: 0, w: width, h: 1 }, pixels = new Uint32Array(width);
    const levels = given.maps.map((map, i) => {
        const found = new Uint16Array(width);
        fillLevels(found, Float32Array.from(map), given.tops[i], width, box);
        return found;
    });
    if (brushed.length > 3) {
        const all = new Combinations(eye, stack, brushed, "D65");
        all.read(levels, pixels, width, box, given.quick);
        return { pixels: new Uint8Array(pixels.buffer), error: all.error() };
    }
    const table = makeTable(eye, stack, brushed, "D65", given.quick);
    readTable(table, levels, pixels, width, box);
    return { pixels: new Uint8Array(pixels.buffer), error: table.error };
"""


@pytest.mark.parametrize(
    ("coats", "quick", "within"),
    # 8 bits are up to 0.5 of a Delta E in the dark; steps of thickness add to that.
    [
        (1, False, 0.6),
        (2, False, 0.6),
        (3, False, 1.2),
        slow(8, False, 1.2),
        (1, True, 1.2),
        (2, True, 4),
    ],
)
def test_brushed_pixels_are_those_of_a_full_computation(coats, quick, within):
    rng = np.random.default_rng(1)
    given = {**STACK, "coats": EIGHT[: max(3, coats)]}
    tops = [4.0, 32.0, 8.0, 4.0, 2.0, 8.0, 8.0, 1.0][:coats]
    # A third of what was brushed with eight coats is bare of each.
    bare = 0.0 if coats < 4 else 0.33
    maps = [top * rng.random(300) * (rng.random(300) >= bare) for top in tops]
    lists = [one.tolist() for one in maps]
    found = ask(_BRUSH, stack=given, tops=tops, maps=lists, quick=quick)
    pixels = np.array(found["pixels"]).reshape(-1, 4)
    stack = stack_from_dict(given)
    thickness = [
        1e-6 * maps[i] if i < coats else np.full(300, 1e-6 * coat["um"])
        for i, coat in enumerate(given["coats"])
    ]
    layers = [gj.Layer(medium, t) for medium, t in zip(stack.media(), thickness, strict=True)]
    ground = np.where(np.arange(300) < 150, 0.93, 0.025)[:, None]
    spectra = gj.reflectance(gj.Glaze(layers, ground), stack.instrument)
    wanted = np.asarray(colour.srgb(stack.glaze().wavelengths, spectra))
    white = colour.srgb_to_xyz(np.ones(3))
    lab = [
        colour.xyz_to_lab(colour.srgb_to_xyz(rgb), white) for rgb in (pixels[:, :3] / 255, wanted)
    ]
    assert quick or found["error"] < 0.6
    assert np.percentile(colour.delta_e_2000(*lab), 95) < within
    assert np.all(pixels[:, 3] == 255)


def test_the_pages_modules_as_one_text_are_a_program():
    """Nothing to import or export is left, and it is read to its end."""
    text = bundle("main")
    assert re.search(r"^(import|export) ", text, re.MULTILINE) is None
    assert run("new Function(given); return true;", text)


def contrast(one, other):
    """Of two colours in 8 bits (WCAG 2.2, 1.4.3)."""
    light = [float(colour.srgb_to_xyz(np.asarray(rgb) / 255)[1]) for rgb in (one, other)]
    return (max(light) + 0.05) / (min(light) + 0.05)


def test_words_are_read_on_every_ground_of_the_page():
    """In light and dark, and on the colour of any paint."""
    schemes = re.findall(r"\.glaze-studio \{\n(.*?)\}", page_text("style.css"), re.DOTALL)[:2]
    for scheme in schemes:
        hexes = dict(re.findall(r"--(\w+): #(\w+);", scheme))
        rgb = {name: 255 * np.array(to_rgb(f"#{digits}")) for name, digits in hexes.items()}
        for ink in ("ink", "soft"):
            for ground in ("page", "panel", "field"):
                assert contrast(rgb[ink], rgb[ground]) >= 4.5, (ink, ground, scheme)
    colours = np.random.default_rng(0).integers(0, 256, (300, 3)).tolist()
    code = """
        globalThis.matchMedia = () => ({ matches: false });
        const { inkOn } = await load("dom");
        return given.map((rgb) => (inkOn(rgb) === "#000" ? 0 : 255));
    """
    for ink, ground in zip(run(code, colours), colours, strict=True):
        assert contrast(np.full(3, ink), np.array(ground)) >= 4.5


_SEARCH = """
    const { Eye } = await load("seen"), { Recipes, allowed, labOf } = await load("search");
    const eye = new Eye(given.data), entries = allowed([...given.data.paints], given.choice);
    const base = { glazejax: "stack", coats: [], ground: 0.9, geometry: "45:0", refractive_index: 1.5, pigments: given.data.own };
    const { recipes } = await new Recipes(eye, entries).find(labOf("#8a4b2d", eye), base);
    return recipes.map((one) => one.stack.coats);
"""


def test_a_search_gets_as_many_own_paints_as_a_stack_may_bring():
    """Those of the stack first, or its coats would name paints that are not there."""
    code = 'return Object.keys((await load("search")).tubesFor(given.used, given.own, given.data.most_coats));'
    own = {f"tube {i}": i for i in range(MOST_COATS + 20)}
    last = f"tube {MOST_COATS + 19}"
    names = ask(code, own=own, used={last: own[last]})
    assert names == [last, *list(own)[: MOST_COATS - 1]]
    assert ask(code, own={"Mine": 1}, used={}) == ["Mine"]


def test_a_recipe_promises_what_the_page_then_shows():
    """Its difference is that of the stack's own instrument."""
    code = """
        const { Eye } = await load("seen"), { Recipes, allowed, labOf } = await load("search");
        const eye = new Eye(given.data), wanted = labOf("#8a4b2d", eye);
        const entries = given.data.paints.filter(({ name }) => ["ZincWhite", "Vermillion", "BoneBlack"].includes(name));
        const base = { glazejax: "stack", coats: [], ground: 0.9, geometry: "d:8", refractive_index: 1.5, pigments: {} };
        const { recipes } = await new Recipes(eye, entries).find(wanted, base);
        const view = { lamps: ["D65"], light: 45, view: 60, pinned: wanted };
        return recipes.map((one) => [one.delta_e, eye.see(one.stack, view).delta]);
    """
    pairs = np.array(ask(code))
    assert len(pairs)
    assert_allclose(pairs[:, 0], pairs[:, 1], atol=1e-6)


def test_the_pages_recipes_are_within_the_commands_bounds_and_of_its_paints():
    """1 to 50 micrometres a coat, and no paint that the command marks, unless it is one's own."""
    shelf = gj.catalogue.load()
    own = {
        name: shelf[of].renamed(name, provenance="measured here")
        for name, of in (("Mine", "EmeraldGreen"), ("Other", "ZincWhite"))
    }
    data = page_data(own)
    poison = {one["name"] for one in data["paints"] if one["caution"]}
    assert "EmeraldGreen" in poison
    assert "Mine" not in poison
    for choice, wanted in (
        ({"modern": True, "own": False}, lambda names: not names & poison),
        ({"modern": True, "own": True}, lambda names: names <= set(own)),
    ):
        found = run(_SEARCH, {"data": data, "choice": choice})
        assert found
        for coats in found:
            assert all(1.0 <= coat["um"] <= 50.0 for coat in coats)
            assert wanted({name for coat in coats for name in coat["paint"]})
