"""The page as one file, opened from a disk in a Chromium: all of it without a server."""

import base64
import io
import json

import numpy as np
import pytest
from PIL import Image
from selenium.webdriver import ActionChains

from glazejax.studio.one_file import one_file

from .browser import Page, start_browser
from .test_browser import TWO, check_swatch, expected, with_top

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def link(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "studio.html"
    path.write_text(one_file(), encoding="utf-8")
    return path.as_uri()


@pytest.fixture
def page(browser, link):
    found = Page(browser, link)
    found.open_stack({**TWO, "coats": []})
    yield found
    assert found.errors() == []
    browser.execute_script("document.querySelector('#studio').replaceChildren()")


@pytest.mark.slow
def test_a_graphics_card_and_typed_arrays_draw_the_same(link, tmp_path):
    """Two brushed coats on a card, and eight; the card is played by the processor."""
    paints = ["CobaltBlue", "ChromeYellow", "ZincWhite", "Eosin", "Minium", "LeadWhite"]
    more = [{"paint": {name: 1}, "um": 0.5 + i} for i, name in enumerate(paints)]
    for stack, brushed in ((TWO, 2), ({**TWO, "coats": [*TWO["coats"], *more]}, 8)):
        drawn = {}
        for kind in ("webgl2", "arrays"):
            with start_browser(tmp_path, card=True) as browser:
                page = Page(browser, f"{link}?canvas={kind}")
                page.open_stack(stack)
                page.press("tab-canvas")
                assert page.at("easel").get_attribute("data-by") == kind
                brush_each(page, brushed)
                page.until(lambda page=page: "within" in page.at("easel-state").text, "the colours")
                drawn[kind] = pixels_of(page)
                if kind == "webgl2":
                    lose_card(page)
                    assert np.array_equal(pixels_of(page), drawn[kind])
                assert page.errors() == []
        assert np.unique(drawn["arrays"].reshape(-1, 3), axis=0).shape[0] > 300
        assert np.abs(drawn["webgl2"] - drawn["arrays"]).max() <= 1


def pixels_of(page):
    """All pixels of the canvas."""
    code = "return arguments[0].toDataURL('image/png')"
    picture = base64.b64decode(page.js(code, page.at("easel")).partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), int)


def lose_card(page):
    """The graphics card goes, as after a sleep, and comes back."""
    before = int(page.at("easel").get_attribute("data-done"))
    page.js(
        """
        const card = arguments[0].getContext("webgl2").getExtension("WEBGL_lose_context");
        card.loseContext();
        setTimeout(() => card.restoreContext(), 200);""",
        page.at("easel"),
    )
    page.until(
        lambda: (
            int(page.at("easel").get_attribute("data-done")) > before
            and page.at("easel").get_attribute("data-state") == "exact"
        ),
        "the card",
    )


def brush_each(page, brushed):
    """A stroke of each coat, its own way across the canvas."""
    code = """
        const [coat] = arguments, canvas = document.querySelector("[data-at=easel]"), box = canvas.getBoundingClientRect();
        document.querySelectorAll(".coat")[coat].dispatchEvent(new PointerEvent("pointerdown", {bubbles: true}));
        const at = (type, along) => canvas.dispatchEvent(new PointerEvent(type, {bubbles: true, pointerId: 1, isPrimary: true,
            clientX: box.left + box.width * (0.1 + 0.8 * along), clientY: box.top + box.height * (0.2 + 0.07 * coat + 0.3 * along * Math.sin(coat))}));
        at("pointerdown", 0);
        for (let i = 1; i <= 20; i++) at("pointermove", i / 20);
        at("pointerup", 1);"""
    for coat in range(brushed):
        page.js(code, coat)


def test_it_asks_no_host_for_anything(page):
    page.open_stack(TWO)
    asked = page.js("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert [name for name in asked if not name.startswith(("data:", "blob:"))] == []


def test_what_needs_python_is_said(page, tmp_path):
    path = tmp_path / "film.csv"
    path.write_text("Name,400,500\na,0.1,0.2\n")
    page.drop(path)
    page.hear("glazejax studio")
    path = tmp_path / "stack.json"
    path.write_text(json.dumps(TWO))
    page.drop(path)
    page.until(lambda: len(page.all(".coat")) == 2, "the stack")


def test_own_paints_are_dropped_used_and_linked(page, browser, tmp_path):
    """A table of paints without Python: on the shelf, in a coat, in the link; a bad one is a sentence."""
    rows = [f"Mine,{w},{200 * (w - 390)},40000" for w in range(400, 701, 10)]
    text = "\n".join(["pigment,wavelength_nm,absorption,scattering", *rows])
    path = tmp_path / "mine.csv"
    path.write_text(text.replace("Mine,410,4000", "Mine,410,a lot"))
    page.drop(path)
    page.hear("line 3: absorption is 'a lot'")
    path.write_text(text)
    page.drop(path)
    page.click(".tile[data-paint='Mine'] .paint")
    stack = page.stack()
    assert stack["pigments"]["Mine"]["scattering"] == [40000] * 31
    check_swatch(page, stack)
    address = browser.current_url
    page.open("#" + address.partition("#")[2])
    assert page.stack()["pigments"] == stack["pigments"]
    assert page.all(".tile[data-paint='Mine']")
    check_swatch(page, stack)


def test_it_finds_recipes_by_itself(page):
    """Within half a second of colour, of the page's own table, and one is taken."""
    page.press("tab-backwards")
    page.press("nearest")
    page.until(lambda: page.all("[data-at=take]"), "recipes")
    assert "the page's own search" in page.js("return document.querySelector('.found').textContent")
    assert not page.at("find").is_displayed()
    stack = page.stack_after("take", "tab-look")
    wanted = np.array([0x8A, 0x4B, 0x2D])
    assert np.abs(expected(stack, "white") - wanted).max() <= 6
    check_swatch(page, stack)


def test_all_that_is_on_the_page_is_in_its_link(page, browser):
    """Lamps, angles, the pinned colour and what was brushed come back with the link."""
    page.open_stack(TWO)
    page.press("pin")
    page.choose("lamp-1", "FL2")
    page.slide("angle-light", 20)
    page.press("tab-canvas")
    canvas = page.at("easel")
    ActionChains(page.browser).move_to_element_with_offset(canvas, -100, 0).click().perform()
    page.until(lambda: "maps" in browser.current_url, "the link")
    address = browser.current_url
    page.js("document.querySelector('#studio').replaceChildren()")
    page.open("#" + address.partition("#")[2])
    assert page.at("easel").is_displayed()
    page.press("tab-look")
    assert page.at("lamp-1").get_attribute("value") == "FL2"
    assert page.at("angle-light").get_attribute("value") == "20"
    assert page.at("pin").text == "Unpin"
    page.press("tab-canvas")
    found = expected(with_top(0), "white")
    page.until(lambda: np.abs(page.pixel("easel", 0.1, 0.1) - found).max() <= 2, "the bare canvas")
    far = page.js(
        "const c = arguments[0], b = c.getBoundingClientRect(); return 0.5 - 100 / b.width",
        page.at("easel"),
    )
    thick = expected(TWO, "white")
    assert np.abs(page.pixel("easel", far, 0.5) - thick).max() < np.abs(found - thick).max() / 2
