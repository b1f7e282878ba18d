"""The studio's page in a Chromium: what a person does, and that pixels are what
`glazejax.reflectance` says.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from selenium.webdriver import ActionChains, Keys

import glazejax as gj
from glazejax import colour
from glazejax.stacks import read_stack, stack_from_dict

from .browser import Page, Served
from .coats import coat

pytestmark = pytest.mark.browser

TWO = {
    "glazejax": "stack",
    "version": 1,
    "coats": [coat("CobaltBlue", 1), coat("ChromeYellow", 6)],
    "ground": "card",
    "geometry": "45:0",
}


def with_top(um):
    """The same with another thickness of the upper coat."""
    top, below = TWO["coats"]
    return {**TWO, "coats": [{**top, "um": um}, below]}


def pure(paint):
    """A paint that hides the ground."""
    return {**TWO, "coats": [coat(paint, 200)]}


@pytest.fixture(scope="module")
def served():
    found = Served()
    yield found
    found.stop()


@pytest.fixture
def page(served, browser):
    found = Page(browser, served.studio.link)
    found.open_stack(TWO)
    yield found
    assert found.errors() == []
    # Nothing brushed may ask whether to leave.
    browser.execute_script("document.querySelector('#studio').replaceChildren()")


def spectrum_of(stack, side="white"):
    """Wavelengths and reflectance of the whole computation."""
    read = stack_from_dict(stack)
    glaze = read.glaze(side)
    return glaze.wavelengths, gj.reflectance(glaze, read.instrument)


def expected(stack, side, lamp="D65"):
    """8-bit sRGB of the whole computation."""
    return 255 * np.asarray(colour.srgb(*spectrum_of(stack, side), illuminant=lamp))


def off(page, name, x, y, stack, side, lamp="D65"):
    """Largest difference of a canvas's pixel from the whole computation."""
    return np.abs(page.pixel(name, x, y) - expected(stack, side, lamp)).max()


def check_swatch(page, stack):
    for side, x in (("white", 0.25), ("black", 0.75)):
        assert off(page, "swatch", x, 0.5, stack, side) <= 1, side


def test_a_slider_changes_the_swatch_to_what_the_library_says(page):
    check_swatch(page, TWO)
    before = page.pixel("swatch", 0.25, 0.5)
    page.slide("slider", np.log10(8))
    stack = page.stack()
    assert stack["coats"][0]["um"] == pytest.approx(8, rel=0.01)
    check_swatch(page, stack)
    assert np.abs(page.pixel("swatch", 0.25, 0.5) - before).max() > 20
    # The bare card above the paint stays.
    assert page.pixel("swatch", 0.25, 0.02).min() > 225


def test_coats_are_reordered_by_hand_and_by_keys(page):
    handles = page.all("[data-at=handle]")
    ActionChains(page.browser).click_and_hold(handles[1]).move_by_offset(0, -60).move_by_offset(
        0, -60
    ).release().perform()
    turned = page.stack()
    assert [list(coat["paint"]) for coat in turned["coats"]] == [["ChromeYellow"], ["CobaltBlue"]]
    check_swatch(page, turned)
    page.all("[data-at=handle]")[0].send_keys(Keys.ARROW_DOWN)
    assert [list(coat["paint"]) for coat in page.stack()["coats"]] == [
        ["CobaltBlue"],
        ["ChromeYellow"],
    ]
    check_swatch(page, TWO)


def test_undo_and_redo(page):
    page.slide("slider", 1.0)
    assert len(page.stack_after("remove")["coats"]) == 1
    assert page.stack_after("undo")["coats"][0]["um"] == 10
    assert page.stack_after("undo")["coats"][0]["um"] == 1
    check_swatch(page, TWO)
    assert page.stack_after("redo")["coats"][0]["um"] == 10


def test_lamps_are_switched(page):
    for i, lamp in enumerate(("D65", "A", "FL11", "LED-B3")):
        assert off(page, f"under-{i}", 0.25, 0.5, TWO, "white", lamp) <= 1
    page.choose("lamp-0", "FL2")
    assert off(page, "swatch", 0.25, 0.5, TWO, "white", "FL2") <= 1


def test_hidden_duplicated_and_mixed_coats(page):
    stack = page.stack_after("hide")
    assert stack["coats"][0]["hidden"] is True
    check_swatch(page, stack)
    stack = page.stack_after("hide", "copy")
    assert len(stack["coats"]) == 3
    check_swatch(page, stack)
    page.click(".tile[data-paint='ZincWhite'] .mix")
    mixed = page.stack()
    assert any(set(coat["paint"]) == {"CobaltBlue", "ZincWhite"} for coat in mixed["coats"])
    check_swatch(page, mixed)


def test_a_paint_from_the_shelf_lies_on_top(page):
    page.at("search").send_keys("viri")
    assert page.js("return [...document.querySelectorAll('.tile')].map(t => t.dataset.paint)") == [
        "ViridianGreen"
    ]
    page.click(".tile .paint")
    stack = page.stack()
    assert list(stack["coats"][0]["paint"]) == ["ViridianGreen"]
    check_swatch(page, stack)


@pytest.mark.slow
def test_a_pinned_colour_gets_its_difference(page):
    page.press("pin")
    page.slide("slider", 1.0)
    stack = page.stack()
    labs = [colour.lab(*spectrum_of(one)) for one in (TWO, stack)]
    assert f"{colour.delta_e_2000(*labs):.2f}" in page.at("numbers").text


def test_a_studio_that_answers_late_finds_the_links_stack(page, browser):
    """What the page shows before it knows any paint is not written over its link."""
    late = """
        const send = WebSocket.prototype.send;
        WebSocket.prototype.send = function (...given) { setTimeout(() => send.apply(this, given), 700); };"""
    command = "Page.addScriptToEvaluateOnNewDocument"
    added = browser.execute_cdp_cmd(command, {"source": late})
    try:
        page.open_stack(TWO)
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)
    assert page.stack()["coats"] == TWO["coats"]


def test_a_bad_link_is_one_sentence_and_the_page_works(page):
    page.open("#%7Bcut")
    assert "the link's stack cannot be read" in page.said().lower()
    assert len(page.all(".coat")) == 3
    page.slide("slider", 1.0)
    check_swatch(page, page.stack())


def test_a_thickness_of_nothing_and_of_a_kilometre(page):
    number = page.at("um")
    number.clear()
    number.send_keys("1e9\t")
    assert "between 0 and 10000 µm" in page.said()
    assert page.stack()["coats"][0]["um"] == 1
    page.choose("um", 0)
    check_swatch(page, with_top(0))


def test_a_file_of_two_gigabytes_is_not_even_read(page, tmp_path):
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    page.drop(path)
    page.hear("huge.csv has 2048 MB; the studio takes files of 16 MB at most")


@pytest.mark.slow
def test_a_lamp_of_ones_own(page, tmp_path):
    dark = tmp_path / "heater.csv"
    dark.write_text("nm,power\n800,1\n900,2\n")
    page.drop(dark, "lamp-file")
    page.hear("420 to 680 nm")
    even = tmp_path / "even.csv"
    even.write_text("\n".join(f"{w},1" for w in range(360, 800, 10)))
    page.drop(even, "lamp-file")
    page.until(lambda: page.at("lamp-3").get_attribute("value") == "even", "the lamp")
    page.settle()
    assert off(page, "under-3", 0.25, 0.5, TWO, "white", "E") <= 1


def test_a_stroke_is_painted_undone_and_painted_again(page):
    canvas = page.canvas()
    drag = ActionChains(page.browser).move_to_element_with_offset(canvas, -140, 0).click_and_hold()
    for _ in range(8):
        drag = drag.move_by_offset(35, 0)
    drag.release().perform()
    page.until(lambda: "within" in page.at("easel-state").text, "the colours")
    no_blue = with_top(0)

    def near(x, y, stack, side):
        return off(page, "easel", x, y, stack, side) <= 2

    page.until(lambda: near(0.35, 0.1, no_blue, "white"), "the bare canvas")
    page.until(lambda: near(0.35, 0.5, TWO, "white"), "the stroke")
    page.until(lambda: near(0.65, 0.5, TWO, "black"), "the stroke over black")
    page.press("undo")
    page.until(lambda: near(0.35, 0.1, TWO, "white"), "the even coat")
    page.press("redo")
    page.until(lambda: near(0.35, 0.1, no_blue, "white"), "the stroke again")
    assert near(0.35, 0.5, TWO, "white")


@pytest.mark.slow
def test_the_canvas_is_brushed_by_keys(page):
    canvas = page.canvas()
    # How near the colours are is said in the same line, when they have been compared.
    page.until(lambda: canvas.get_attribute("data-state") == "exact", "the comparison")
    canvas.send_keys(Keys.ARROW_LEFT * 8)
    assert page.at("easel-state").text == "brush at 384, 512; space lays paint"
    assert page.all(".ring")[0].is_displayed()
    canvas.send_keys("   ")
    for x, y, stack in ((0.1, 0.1, with_top(0)), (384.5 / 1024, 0.5, TWO)):
        page.until(
            lambda x=x, y=y, stack=stack: off(page, "easel", x, y, stack, "white") <= 4,
            "the touch",
            20,
        )


@pytest.mark.slow
def test_maps_are_saved_and_loaded(page, downloads):
    canvas = page.canvas()
    canvas.send_keys(" ")
    page.press("map-npy")
    path = downloads / "thickness Cobalt Blue.npy"
    page.until(lambda: path.exists() and path.stat().st_size > 1 << 20, "the file")
    map_ = np.load(path)
    assert map_.shape == (1024, 1024)
    assert map_.max() == pytest.approx(1e-6, rel=0.2)
    assert map_[10, 10] == 0
    np.save(downloads / "ramp.npy", np.tile(np.linspace(0, 4e-6, 64), (64, 1)))
    page.drop(downloads / "ramp.npy", "map-file")

    def shows(um):
        return off(page, "easel", 0.995, 0.5, with_top(um), "black") <= 2

    page.until(lambda: shows(4), "the ramp")
    # The same as a picture: white is the thickness in its name.
    page.press("map-png")
    picture = page.until(
        lambda: next(downloads.glob("thickness*white=4um.png"), None), "the picture"
    )
    page.press("clear")
    page.until(lambda: shows(0), "the bare canvas")
    page.drop(picture, "map-file")
    page.until(lambda: shows(4), "the ramp again")


@pytest.mark.slow
def test_paint_of_millimetres_is_brushed_linked_and_loaded(page, downloads):
    thick = with_top(2000)
    page.open_stack(thick)
    page.canvas().send_keys(Keys.ARROW_LEFT * 8 + "   ")

    def shows(x, y, side):
        return off(page, "easel", x, y, thick, side) <= 4

    page.until(lambda: shows(384.5 / 1024, 0.5, "white"), "the touch")
    page.until(lambda: "maps" in page.browser.current_url, "the link")
    page.open("#" + page.browser.current_url.partition("#")[2])
    page.canvas()
    page.until(lambda: shows(384.5 / 1024, 0.5, "white"), "the touch of the link")
    for metres in (0.011, 2e-3):
        np.save(downloads / "thick.npy", np.full((8, 8), metres))
        page.drop(downloads / "thick.npy", "map-file")
        if metres > 0.01:
            page.hear("thickness is in metres there, between 0 and 0.01")
    page.until(lambda: shows(0.995, 0.5, "black"), "the file")


@pytest.mark.slow
def test_a_wash_takes_nothing_off(page):
    page.open_stack(with_top(8))
    canvas = page.canvas()
    canvas.send_keys(Keys.ARROW_RIGHT * 8 + "   ")

    def shows():
        return off(page, "easel", 640.5 / 1024, 0.5, with_top(8), "black") <= 4

    page.until(shows, "the touch")
    page.choose("um", 0.5)
    page.choose("tool", "wash")
    done = int(canvas.get_attribute("data-done"))
    canvas.send_keys(" ")
    page.until(lambda: int(canvas.get_attribute("data-done")) > done, "the wash")
    assert shows()


def test_what_is_taken_away_is_what_is_seen(page, downloads):
    page.press("tab-away")
    page.press("csv")
    page.until((downloads / "spectra.csv").exists, "the table")
    table = gj.io.read_spectra(downloads / "spectra.csv")
    assert_allclose(table["over_white"], spectrum_of(TWO)[1], atol=3e-5)
    page.press("json")
    page.until((downloads / "stack.json").exists, "the stack")
    assert read_stack(downloads / "stack.json").shown == stack_from_dict(TWO).shown
    text = page.until(lambda: page.at("python").get_attribute("value"), "the lines")
    assert 'gj.Layer(oils["CobaltBlue"], 1e-6)' in text
    page.press("png")
    page.until((downloads / "glaze.png").exists, "the picture")


@pytest.mark.slow
def test_a_lost_connection_loses_nothing(page):
    """The server goes and comes back at the same address, as after a crash."""
    again = Served(token="again")
    port = again.studio.port
    page.link = again.studio.link
    page.open_stack(TWO)
    again.stop()
    page.until(lambda: page.at("state").text == "not connected", "the loss")
    assert "colours go on" in page.said()
    page.settle()
    page.js(
        "arguments[0].value = 1; arguments[0].dispatchEvent(new Event('input'))", page.at("slider")
    )
    back = Served(port, "again")
    try:
        page.until(lambda: page.at("state").text == "ready", "the return")
        stack = page.stack()
        assert stack["coats"][0]["um"] == 10
        check_swatch(page, stack)
    finally:
        back.stop()
        page.errors()  # of the connection that was refused


@pytest.mark.slow
def test_a_recipe_is_stopped_and_one_is_taken(page):
    page.press("tab-backwards")
    page.press("find")
    page.until(lambda: page.all("[data-at=stop]"), "the search")
    page.press("stop")
    page.until(lambda: page.said() == "Stopped.", "the end")
    page.js("document.querySelector('[data-at=max-coats]').value = '1'")
    # Of paints that are sold and no poison one coat does not reach this red.
    page.js("document.querySelector('[data-at=modern]').checked = false")
    page.press("find")
    page.until(lambda: page.all("[data-at=take]"), "recipes", 400)
    stack = page.stack_after("take")
    assert len(stack["coats"]) == 1
    page.press("tab-look")
    page.settle()
    wanted = np.array([0x8A, 0x4B, 0x2D])
    assert np.abs(page.pixel("swatch", 0.25, 0.5) - wanted).max() <= 6
    assert page.stack_after("undo")["coats"] == TWO["coats"]


def write_film(folder, rows=""):
    """A file of some rows of 06A of the samples: vermilion over cards."""
    path = folder / "film.csv"
    first, *lines = gj.samples.path().read_text().splitlines()
    path.write_text(
        "\n".join([first, *(line for line in lines if line.startswith(f"06A_{rows}"))]) + "\n"
    )
    return path


@pytest.mark.slow
def test_a_film_is_identified_and_recovered(page, tmp_path):
    """'None of these' is in the list, and one click takes the film."""
    page.drop(write_film(tmp_path))
    page.until(
        lambda: page.at("identify").is_displayed() and page.at("identify").is_enabled(), "the film"
    )
    page.press("identify")
    page.until(
        lambda: "In 06A" in page.js("return document.querySelector('.found').textContent"),
        "the answer",
        400,
    )
    text = page.js("return document.querySelector('.found').textContent")
    assert "none of these paints" in text
    stack = page.stack_after("take")
    assert list(stack["coats"][0]["paint"]) == ["Vermillion"]
    page.press("recover")
    page.until(lambda: page.all(".tile[data-paint='06A']"), "the paint", 400)
    page.click(".tile[data-paint='06A'] button")
    stack = page.stack()
    assert list(stack["pigments"]) == ["06A"]
    page.press("tab-look")
    page.settle()
    check_swatch(page, stack)


def test_a_spectrum_becomes_the_ground(page, tmp_path):
    page.drop(write_film(tmp_path, "ow"))
    page.until(lambda: "06A_ow" in page.at("aim").text, "the spectrum")
    page.choose("ground", "spectrum")
    stack = page.stack_after("tab-look")
    assert len(stack["ground"]["wavelengths"]) == 31
    assert off(page, "swatch", 0.5, 0.4, stack, "white") <= 1


def test_a_colour_is_picked_in_a_photograph(page, tmp_path):
    from PIL import Image

    picture = np.zeros((20, 30, 3), np.uint8)
    picture[:, :15], picture[:, 15:] = (200, 120, 40), (10, 200, 90)
    Image.fromarray(picture).save(tmp_path / "photo.png")
    page.drop(tmp_path / "photo.png")
    photo = page.at("photo")
    page.until(photo.is_displayed, "the photograph")
    photo.click()  # in its middle, at the edge of the right half
    assert page.at("wanted").get_attribute("value") in {"#0ac85a", "#49ad49"}


@pytest.mark.slow
def test_a_colour_beyond_srgb_is_marked(page):
    yellow = pure("ChromeYellow")
    page.open_stack(yellow)
    assert np.min(colour.srgb(*spectrum_of(yellow), clip=False)) < -0.002
    assert "outside sRGB" in page.js("return document.querySelector('.beyond')?.textContent ?? ''")
    page.open_stack(pure("ZincWhite"))
    assert page.all(".beyond") == []


def test_a_wide_screen_gets_the_colour_itself(page):
    """On a screen that shows Display P3, a colour between the two gamuts is not clipped."""
    wide = {"features": [{"name": "color-gamut", "value": "p3"}]}
    page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", wide)
    try:
        yellow = pure("ChromeYellow")
        page.open_stack(yellow)
        code = """
            const c = document.querySelector("[data-at=swatch]");
            const at = [Math.floor(c.width / 4), Math.floor(c.height / 2), 1, 1];
            return [...c.getContext("2d").getImageData(...at, {colorSpace: "display-p3"}).data].slice(0, 3)"""
        shown = np.array(page.js(code))
    finally:
        page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    encoded = np.asarray(colour.srgb(*spectrum_of(yellow), clip=False))
    # SMPTE EG 432-1: chromaticities of the primaries, and the white of sRGB.
    primaries = np.array([[0.68, 0.32, 0.0], [0.265, 0.69, 0.045], [0.15, 0.06, 0.79]]).T
    matrix = primaries * np.linalg.solve(primaries, colour.srgb_to_xyz(np.ones(3)))
    light = np.linalg.solve(matrix, colour.srgb_to_xyz(encoded))
    straight = light <= 0.0031308
    wanted = np.where(
        straight, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055
    )
    assert np.abs(shown - 255 * np.clip(wanted, 0, 1)).max() <= 2
    assert shown[2] > 0  # sRGB has none of its blue


def test_by_keyboard_alone(page):
    """Every control is reached by Tab, and has a name."""
    page.js("document.activeElement.blur()")
    reached = set()
    for _ in range(40):
        ActionChains(page.browser).send_keys(Keys.TAB).perform()
        code = """
            const e = document.activeElement, name = e.getAttribute("aria-label") || e.textContent;
            return [e.tagName, e.dataset.at, name, getComputedStyle(e).outlineStyle]"""
        tag, at, name, outline = page.js(code)
        assert name or tag == "BODY", (tag, at)
        assert outline != "none" or tag == "BODY", (tag, at)
        reached.add(at)
    assert {"tab-look", "pin", "lamp-0", "slider", "um", "handle", "hide"} <= reached


@pytest.mark.slow
@pytest.mark.parametrize("width", [2560, 1440, 1024, 390])
def test_nothing_is_wider_than_the_page(page, width):
    command = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    page.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", command)
    try:
        for tab in ("look", "canvas", "backwards", "away"):
            page.press(f"tab-{tab}")
            assert page.js("return document.documentElement.scrollWidth") <= width
    finally:
        page.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
