"""A Chromium for the tests of the studio's page, and a studio for it to look at."""

import contextlib
import json
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from benchmarks.studio.studio import browser_options, go_to

from glazejax.studio.server import Studio

TASKS = {
    "recipes": "glazefit.studio.tasks:recipes",
    "identify": "glazefit.studio.tasks:identification",
    "recover": "glazefit.studio.tasks:recovery",
}
_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
WAIT = 60.0
"""Seconds for what takes longest."""


class Served:
    """A studio that runs in a thread of this process."""

    def __init__(self, port: int = 0, token: str = "", tasks: dict[str, str] = TASKS):
        self.studio = Studio(port, tasks)
        self.studio.token = token or self.studio.token
        self._thread = threading.Thread(target=self.studio.run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self.studio.stop()
        self._thread.join(30)


def start_browser(downloads: Path, *, card: bool = False) -> Any:
    """A Chromium without a window, or a skip that says what is missing; `card` with a graphics card
    that the processor plays.
    """
    from selenium import webdriver

    chromium = next(filter(None, map(shutil.which, _NAMES)), None)
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip(
            "no Chromium with chromedriver here (Debian: apt-get install chromium chromium-driver)"
        )
    options = browser_options(chromium, card=card)
    options.add_argument("--force-color-profile=srgb")
    options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


class Page:
    """The studio's page, as a person uses it."""

    def __init__(self, browser: Any, link: str):
        self.browser, self.link = browser, link

    def open(self, fragment: str) -> None:
        # From elsewhere, so that another fragment is another page.
        go_to(self.browser, "about:blank")
        go_to(self.browser, self.link + fragment)
        self.until(
            lambda: self.js("return document.querySelector('#studio')?.dataset.seen"),
            "the first colours",
        )
        self.settle()

    def open_stack(self, stack: dict[str, Any]) -> None:
        """Open the link of a stack."""
        self.open("#" + quote(json.dumps(stack)))

    def js(self, code: str, *given: Any) -> Any:
        return self.browser.execute_script(code, *given)

    def at(self, name: str) -> Any:
        return self.browser.find_element("css selector", f"[data-at='{name}']")

    def all(self, selector: str) -> list[Any]:
        return self.browser.find_elements("css selector", selector)

    def until(self, true: Callable[[], Any], what: str, seconds: float = WAIT) -> Any:
        from selenium.common.exceptions import StaleElementReferenceException

        end = time.monotonic() + seconds
        while time.monotonic() < end:
            # What is looked at may be built anew meanwhile.
            with contextlib.suppress(StaleElementReferenceException):
                if found := true():
                    return found
            time.sleep(0.05)
        raise AssertionError(
            f"{what} did not come in {seconds:.0f} s; the page says {self.said()!r}"
        )

    def click(self, selector: str) -> None:
        """Click the first element that matches, also if it is drawn anew in that moment."""
        self.until(lambda: [one.click() or one for one in self.all(selector)[:1]], selector)

    def press(self, name: str) -> None:
        """Click the button of this name, as `click` does."""
        self.click(f"[data-at='{name}']")

    def stack_after(self, *names: str) -> dict[str, Any]:
        """The stack once these buttons were clicked."""
        for name in names:
            self.press(name)
        return self.stack()

    def settle(self) -> None:
        """Wait until every change has been answered."""
        time.sleep(0.05)
        self.until(
            lambda: self.js("return document.querySelector('#studio').dataset.busy") != "yes",
            "the answer",
        )

    def said(self) -> str:
        return self.at("line").text

    def hear(self, words: str) -> None:
        """Wait until the page says this."""
        self.until(lambda: words in self.said(), words)

    def stack(self) -> dict[str, Any]:
        """The stack that the link holds, once every change has been answered."""
        self.settle()
        time.sleep(0.4)
        code = "return decodeURIComponent(location.hash.slice(1).split('&')[0])"
        return json.loads(self.js(code))

    def pixel(self, name: str, x: float, y: float) -> np.ndarray:
        """Colour of a canvas at a share of its width and height."""
        code = """
            const c = document.querySelector(`[data-at="${arguments[0]}"]`);
            const at = [Math.floor(arguments[1] * c.width), Math.floor(arguments[2] * c.height)];
            let pen = c.getContext("2d");
            if (!pen) {
                // A graphics card drew it.
                pen = Object.assign(document.createElement("canvas"), {width: c.width, height: c.height}).getContext("2d");
                pen.drawImage(c, 0, 0);
            }
            return [...pen.getImageData(...at, 1, 1).data].slice(0, 3)"""
        return np.array(self.js(code, name, x, y))

    def canvas(self) -> Any:
        """The canvas, once it is drawn."""
        self.press("tab-canvas")
        found = self.at("easel")
        self.until(lambda: self.js("return arguments[0].dataset.done", found), "the canvas")
        return found

    def slide(self, name: str, value: float) -> None:
        """Move a slider as its keys and mouse do: events of its own."""
        code = (
            "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input', "
            "{bubbles: true}));"
            "arguments[0].dispatchEvent(new Event('change', {bubbles: true}))"
        )
        self.js(code, self.at(name), value)
        self.settle()

    def choose(self, name: str, value: Any) -> None:
        """Set a field, as a person does who leaves it."""
        code = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('change'))"
        self.js(code, self.at(name), value)
        self.settle()

    def drop(self, path: Path, name: str = "file") -> None:
        """Drop a file on the page, or on a field of it."""
        field = self.at(name)
        self.js("arguments[0].hidden = false", field)
        field.send_keys(str(path))

    def errors(self) -> list[str]:
        """What the browser complained of."""
        return [
            entry["message"]
            for entry in self.browser.get_log("browser")
            if entry["level"] == "SEVERE"
        ]
