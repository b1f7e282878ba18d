"""How quickly the glaze studio answers, in a Chromium: from a slider's event to new pixels.

    python -m benchmarks.studio.studio [--out FOLDER]

The page is opened twice: from `glazejax studio`, a process of its own, and as the one file that
`glazejax studio --page` writes, from the disk. It runs in a Chromium without a window (Debian:
chromium, chromium-driver), driven by Selenium, without a graphics card. A slider moves a hundred
times for one, three and eight coats of oils, 31 bands, four lamps; a time ends when the swatch is
drawn, and again with the screen's next frame; ladder and 90 % band follow when the hand rests. The
canvas is 1024 x 1024 pixels of typed arrays, two coats brushed on a card, and then eight; and again
by WebGL2, where the processor plays the graphics card. A time of the canvas ends when its pixels
can be read.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from benchmarks.results import Results, command_line, quantity
from glazejax.studio.one_file import one_file

NEEDS = ("selenium", "program/chromium", "program/chromedriver")

COATS = (
    "CobaltBlue",
    "ZincWhite",
    "Vermillion",
    "ChromeYellow",
    "Eosin",
    "ViridianGreen",
    "LeadWhite",
    "Minium",
)
EVENTS = 100
_READY = 900
# The command itself, also where its entry point is not installed.
_START = (
    "import typer; from glazejax.studio.command import studio; a = typer.Typer(); "
    "a.command()(studio); a(['--no-open'])"
)

# Moves the first slider up and down; each time ends when the swatch has been drawn, and with the
# next frame.
_SLIDE = """
const [events, done] = arguments;
const root = document.querySelector("#studio"), slider = document.querySelector("[data-at=slider]");
const times = [];
let n = 0, start = 0;
const next = () => {
  // A change that was answered twice must not go on afterwards.
  if (n >= events) { watch.disconnect(); done(times); return; }
  n++;
  start = performance.now();
  slider.value = -0.5 + 1.5 * ((n * 0.381966) % 1);
  slider.dispatchEvent(new Event("input", {bubbles: true}));
};
const watch = new MutationObserver(() => {
  const drawn = performance.now() - start, solver = Number(root.dataset.ms);
  requestAnimationFrame(() => { times.push([drawn, performance.now() - start, solver]); setTimeout(next, 100); });
});
watch.observe(root, {attributes: true, attributeFilter: ["data-seen"]});
next();
"""
# Moves the lowest coat's slider, until the whole canvas is drawn again.
_SLIDE_CANVAS = """
const [events, done] = arguments;
const canvas = document.querySelector("[data-at=easel]");
const sliders = document.querySelectorAll("[data-at=slider]"), times = [];
const slider = sliders[sliders.length - 1];
let n = 0;
const next = () => {
  if (n >= events) { done(times); return; }
  n++;
  const start = performance.now();
  slider.value = -0.5 + 1.5 * ((n * 0.381966) % 1);
  slider.dispatchEvent(new Event("input", {bubbles: true}));
  finish();
  times.push(performance.now() - start);
  setTimeout(next, 30);
};
next();
"""
# Waits for the graphics card.
_FINISH = """
const finish = () => {
  const card = document.querySelector("[data-at=easel]").getContext("webgl2");
  if (card) card.readPixels(0, 0, 1, 1, card.RGBA, card.UNSIGNED_BYTE, new Uint8Array(4));
};
"""
# Undo or redo, which draw all pixels.
_STEP = (
    _FINISH
    + """
const start = performance.now();
document.querySelector(`[data-at=${arguments[0]}]`).click();
finish();
return performance.now() - start;
"""
)
# A touch of the brush at another place each time, until the colours of its box are there.
_BRUSH = """
const [events, done] = arguments;
const canvas = document.querySelector("[data-at=easel]"), box = canvas.getBoundingClientRect();
const times = [];
let n = 0, start = 0;
const at = (type, i) => canvas.dispatchEvent(new PointerEvent(type, {bubbles: true, pointerId: 1, isPrimary: true,
  clientX: box.left + box.width * (0.2 + 0.6 * ((i * 0.618) % 1)),
  clientY: box.top + box.height * (0.2 + 0.6 * ((i * 0.414) % 1))}));
const next = () => {
  // A change that was answered twice must not go on afterwards.
  if (n >= events) { watch.disconnect(); done(times); return; }
  n++;
  start = performance.now();
  at("pointerdown", n);
  at("pointerup", n);
};
const watch = new MutationObserver(() => {
  finish();
  times.push(performance.now() - start);
  setTimeout(next, 30);
});
watch.observe(canvas, {attributes: true, attributeFilter: ["data-done"]});
next();
"""


def stack(count: int) -> dict[str, Any]:
    """Thin coats of oils, all of which light passes."""
    coats = [{"paint": {name: 1}, "um": 0.3 + 0.2 * i} for i, name in enumerate(COATS[:count])]
    return {"glazejax": "stack", "coats": coats, "ground": "card", "geometry": "45:0"}


class Server:
    """`glazejax studio --no-open` with a cache of its own."""

    def __init__(self, cache: Path):
        began = time.perf_counter()
        environment = os.environ | {"GLAZEJAX_CACHE": str(cache)}
        command = [sys.executable, "-c", _START]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert self.process.stdout is not None
        self.link = self.process.stdout.readline().split(" at ")[1].strip()
        self.seconds = time.perf_counter() - began

    def stop(self) -> None:
        """End it as Ctrl-C does."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(60)


def browser_options(chromium: str, *, card: bool = False) -> Any:
    """Of a Chromium without a window; `card` plays a graphics card by the processor."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for word in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--window-size=1440,900",
        *(
            ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
            if card
            else ("--disable-gpu",)
        ),
    ):
        options.add_argument(word)
    # `go_to` waits for a page: a driver that waits as well was seen to wait for ever.
    options.page_load_strategy = "none"
    return options


def start_browser(*, card: bool = False) -> Any:
    """A Chromium without a window, see `browser_options`."""
    from selenium import webdriver

    options = browser_options(shutil.which("chromium") or "", card=card)
    found = webdriver.Chrome(
        options=options, service=webdriver.ChromeService(shutil.which("chromedriver") or "")
    )
    found.set_script_timeout(_READY)
    return found


def go_to(browser: Any, address: str) -> None:
    """Open another page, of which the address differs not only by its fragment, and wait until it
    has loaded.
    """
    # The page before would answer for the next one.
    before = browser.execute_script("return performance.timeOrigin")
    browser.get(address)
    code = "return document.readyState === 'complete' && performance.timeOrigin"
    while browser.execute_script(code) in (False, before):
        time.sleep(0.02)


def open_page(browser: Any, link: str, given: dict[str, Any]) -> float:
    """Seconds until the stack of a link is seen and every change is answered."""
    # From elsewhere, so that another fragment is another page.
    go_to(browser, "about:blank")
    began = time.perf_counter()
    browser.get(f"{link}#{quote(json.dumps(given))}")
    code = "const s = document.querySelector('#studio')?.dataset; return s?.seen && s.busy === ''"
    while not browser.execute_script(code):
        if time.perf_counter() - began > _READY:
            raise TimeoutError("the page saw nothing")
        time.sleep(0.02)
    return time.perf_counter() - began


def row(out: Results, name: str, values: np.ndarray) -> np.ndarray:
    """Print a line of the table of milliseconds; the values."""
    median, high = np.percentile(values, (50, 95))
    out(f"{name:<34} {median:8.0f} {high:8.0f} {values.min():8.0f}")
    return values


def main() -> None:
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(EVENTS=10)
    out = Results("studio", options.out)
    browser = start_browser()
    try:
        with tempfile.TemporaryDirectory() as folder:
            server = Server(Path(folder))
            try:
                page = open_page(browser, server.link, stack(2))
            finally:
                server.stop()
            out(f"served: link after {server.seconds:.1f} s, page usable {page:.1f} s later")
            out.record(served_start=quantity(page, "s", digits=1))
            path = Path(folder) / "studio.html"
            path.write_text(one_file(), encoding="utf-8")
            page = open_page(browser, path.as_uri(), stack(2))
            size = path.stat().st_size / 1e6
            out(f"one file: {size:.2f} MB, page usable after {page:.1f} s")
            out.record(
                one_file_start=quantity(page, "s", digits=1),
                one_file_megabytes=quantity(size, "MB"),
            )
            times = measure(browser, path.as_uri(), out)
            times |= measure_canvas(browser, path.as_uri() + "?canvas=arrays", out)
            browser.quit()
            browser = start_browser(card=True)
            card = measure_canvas(browser, path.as_uri() + "?canvas=webgl2", out, "WebGL2: ")
            times["card_canvas"] = card["canvas"]
    finally:
        browser.quit()
    for key, values in times.items():
        for name, percentile in (("median", 50), ("95", 95)):
            value = np.percentile(values, percentile)
            out.record(**{f"{key}_{name}": quantity(value, "ms", digits=0, n=values.size)})
    out.save()


def measure(browser: Any, link: str, out: Results) -> dict[str, np.ndarray]:
    """Sliders and the swatch: milliseconds until it is drawn, by the number of coats."""
    out(f"\n{'milliseconds':<34} {'median':>8} {'95 %':>8} {'least':>8}")
    drawn = {}
    for count, key in ((1, "one_coat"), (3, "three_coats"), (8, "eight_coats")):
        open_page(browser, link, stack(count))
        browser.execute_async_script(_SLIDE, 10)
        times = np.array(browser.execute_async_script(_SLIDE, EVENTS))
        coats = f"{count} {'coat' if count == 1 else 'coats'}"
        drawn[key] = row(out, f"slider to swatch drawn, {coats}", times[:, 0])
        row(out, "  of it the solver", times[:, 2])
        row(out, "  to the screen's next frame", times[:, 1])
    return drawn


def measure_canvas(browser: Any, link: str, out: Results, mark: str = "") -> dict[str, np.ndarray]:
    """Brushes, undo and sliders, where two of three coats are brushed, and eight of eight;
    milliseconds by name.
    """
    found = {}
    brush, slide = _FINISH + _BRUSH, _FINISH + _SLIDE_CANVAS
    for coats, brushed in ((3, 2), (8, 8)):
        open_page(browser, link, stack(coats))
        browser.find_element("css selector", "[data-at=tab-canvas]").click()
        for coat in range(brushed):
            code = (
                "document.querySelectorAll('.coat')[arguments[0]].dispatchEvent("
                "new PointerEvent('pointerdown', {bubbles: true}))"
            )
            browser.execute_script(code, coat)
            browser.execute_async_script(brush, 6)
        wait_for_canvas(browser)
        words = f"{mark}{{}}, {brushed} brushed"
        times = browser.execute_async_script(brush, EVENTS // 2)
        few = brushed < coats
        touched = row(out, words.format("brush to pixels"), np.array(times))
        found["brush" if few else "eight_brush"] = touched
        whole, sharp = [], []
        for _ in range(max(2, EVENTS // 10)):
            for at in ("undo", "redo"):
                wait_for_canvas(browser)
                whole.append(browser.execute_script(_STEP, at))
                began = time.perf_counter()
                wait_for_canvas(browser)
                sharp.append(whole[-1] + 1000 * (time.perf_counter() - began))
        drawn = row(out, words.format("whole canvas"), np.array(whole))
        found["canvas" if few else "eight_canvas"] = drawn
        if not few:
            found["eight_sharp"] = row(out, words.format("whole canvas, sharp"), np.array(sharp))
            # The slider's coat lies evenly.
            browser.find_element("css selector", "[data-at=even]").click()
            wait_for_canvas(browser)
        times = browser.execute_async_script(slide, EVENTS // 5)
        still = f"{mark}slider to canvas, {min(brushed, coats - 1)} brushed"
        slid = row(out, still, np.array(times))
        found["canvas_slider" if few else "eight_slider"] = slid
        wait_for_canvas(browser)
        state = browser.find_element("css selector", "[data-at=easel-state]").text
        out(f"{words.format('canvas')}: {state.partition(';')[0]}")
    return found


def wait_for_canvas(browser: Any) -> None:
    """Until the canvas says how far its colours are from the full computation."""
    settled = "const now = document.querySelector('[data-at=easel]').dataset; return now.state === 'exact'"
    while not browser.execute_script(settled):
        time.sleep(0.01)


if __name__ == "__main__":
    main()
