"""The page as one file, opened from a disk in a Chromium: all of it without a server."""

import json
from urllib.parse import quote

import numpy as np
import pytest
from selenium.webdriver import ActionChains

from glazejax.studio.one_file import one_file

from .browser import Page, start_browser
from .test_browser import TWO, check_swatch, expected, fragment

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    found = start_browser(tmp_path_factory.mktemp("downloads"))
    yield found
    found.quit()


@pytest.fixture(scope="module")
def link(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "studio.html"
    path.write_text(one_file(), encoding="utf-8")
    return path.as_uri()


@pytest.fixture
def page(browser, link):
    found = Page(browser, link)
    found.open(fragment({**TWO, "coats": []}))
    yield found
    assert found.errors() == []
    browser.execute_script("document.querySelector('#studio').replaceChildren()")


def test_a_stack_is_made_dragged_lit_linked_and_undone(page, browser):
    for name in ("ZincWhite", "ChromeYellow", "CobaltBlue"):
        page.click(f".tile[data-paint='{name}'] .paint")
    page.settle()
    page.slide(page.at("slider"), 0.0)
    stack = page.stack()
    assert [next(iter(coat["paint"])) for coat in stack["coats"]] == [
        "CobaltBlue",
        "ChromeYellow",
        "ZincWhite",
    ]
    assert stack["coats"][0]["um"] == 1
    check_swatch(page, stack)
    page.js(
        "const s = document.querySelector('[data-at=lamp-0]'); s.value = 'A'; "
        "s.dispatchEvent(new Event('change'))"
    )
    page.settle()
    assert np.abs(page.pixel("swatch", 0.25, 0.5) - expected(stack, "white", "A")).max() <= 1
    address = browser.current_url
    page.press("undo")
    page.settle()
    assert page.stack()["coats"][0]["um"] == 10
    browser.get("about:blank")
    browser.get(address)
    page.until(lambda: page.js("return document.querySelector('#studio')?.dataset.seen"), "colours")
    page.settle()
    assert page.stack()["coats"] == stack["coats"]


def test_it_is_brushed(page):
    page.open(fragment(TWO))
    page.press("tab-canvas")
    canvas = page.at("easel")
    page.until(lambda: page.js("return arguments[0].dataset.done", canvas), "the canvas")
    drag = ActionChains(page.browser).move_to_element_with_offset(canvas, -140, 0).click_and_hold()
    for _ in range(8):
        drag = drag.move_by_offset(35, 0)
    drag.release().perform()
    page.until(lambda: "within" in page.at("easel-state").text, "the colours")
    no_blue = {**TWO, "coats": [{**TWO["coats"][0], "um": 0}, TWO["coats"][1]]}
    for y, stack in ((0.1, no_blue), (0.5, TWO)):
        assert np.abs(page.pixel("easel", 0.35, y) - expected(stack, "white")).max() <= 2


def test_it_asks_no_host_for_anything(page):
    page.open(fragment(TWO))
    asked = page.js("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert [name for name in asked if not name.startswith(("data:", "blob:"))] == []


def test_what_needs_python_is_said(page, tmp_path):
    path = tmp_path / "film.csv"
    path.write_text("Name,400,500\na,0.1,0.2\n")
    page.drop(path)
    page.until(lambda: "glazejax studio" in page.said(), "the sentence")
    path = tmp_path / "stack.json"
    path.write_text(json.dumps(TWO))
    page.drop(path)
    page.until(lambda: len(page.all(".coat")) == 2, "the stack")


def test_a_bad_link_is_one_sentence(page):
    page.open(
        "#" + quote('{"glazejax": "stack", "coats": [{"paint": {"CobaltBleu": 1}, "um": 1}]}')
    )
    assert "There is no pigment 'CobaltBleu'" in page.said()
    assert len(page.all(".coat")) == 3


def test_it_finds_recipes_by_itself(page):
    """Within half a second of colour, of the page's own table, and one is taken."""
    page.press("tab-backwards")
    page.press("nearest")
    page.until(lambda: page.all("[data-at=take]"), "recipes")
    assert "the page's own search" in page.js("return document.querySelector('.found').textContent")
    assert not page.at("find").is_displayed()
    page.press("take")
    page.press("tab-look")
    page.settle()
    stack = page.stack()
    wanted = np.array([0x8A, 0x4B, 0x2D])
    assert np.abs(expected(stack, "white") - wanted).max() <= 6
    check_swatch(page, stack)


def test_all_that_is_on_the_page_is_in_its_link(page, browser):
    """Lamps, angles, the pinned colour and what was brushed come back with the link."""
    page.open(fragment(TWO))
    page.press("pin")
    page.js(
        "const s = document.querySelector('[data-at=lamp-1]'); s.value = 'FL2'; "
        "s.dispatchEvent(new Event('change'))"
    )
    page.slide(page.at("angle-light"), 20)
    page.press("tab-canvas")
    canvas = page.at("easel")
    ActionChains(page.browser).move_to_element_with_offset(canvas, -100, 0).click().perform()
    page.until(lambda: "maps" in browser.current_url, "the link")
    address = browser.current_url
    page.js("document.querySelector('#studio').replaceChildren()")
    page.open("#" + address.partition("#")[2])
    assert page.at("lamp-1").get_attribute("value") == "FL2"
    assert page.at("angle-light").get_attribute("value") == "20"
    assert page.at("pin").text == "Unpin"
    page.press("tab-canvas")
    no_blue = {**TWO, "coats": [{**TWO["coats"][0], "um": 0}, TWO["coats"][1]]}
    found = expected(no_blue, "white")
    page.until(lambda: np.abs(page.pixel("easel", 0.1, 0.1) - found).max() <= 2, "the bare canvas")
    far = page.js(
        "const c = arguments[0], b = c.getBoundingClientRect(); return 0.5 - 100 / b.width",
        page.at("easel"),
    )
    thick = expected(TWO, "white")
    assert np.abs(page.pixel("easel", far, 0.5) - thick).max() < np.abs(found - thick).max() / 2
