"""Pictures of the glaze studio for the documentation, from a Chromium without a window.

    python -m benchmarks.make.studio_pictures [--out FOLDER]

Writes studio.png (1440 pixels wide), studio-1024.png, studio-390.png, studio-canvas.png,
studio-recipe.png and studio-identify.png into docs by default. The film that is identified is 08A
of the package's samples.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.results import help_parser
from benchmarks.studio.studio import Server, open_page, start_browser

FOLDER = Path(__file__).parents[2] / "docs"
FILM = "08A"
STACK = {
    "glazejax": "stack",
    "coats": [
        {"paint": {"CobaltBlue": 1}, "um": 0.4},
        {"paint": {"Eosin": 1}, "um": 2.5},
        {"paint": {"ZincWhite": 5, "ChromeYellow": 1}, "um": 8},
    ],
    "ground": "card",
    "geometry": "45:0",
}
# Strokes of each coat, as (coat, x, y) from 0 to 1 along each; a wave, so that coats cross.
_STROKES = """
const canvas = document.querySelector("[data-at=easel]");
const [coat, across, offset] = arguments;
document.querySelectorAll(".coat")[coat].dispatchEvent(new PointerEvent("pointerdown", {bubbles: true}));
const box = canvas.getBoundingClientRect();
const at = (type, along) => {
  const wave = offset + 0.03 * Math.sin(9 * along + 20 * offset), far = 0.1 + 0.8 * along;
  const [x, y] = across ? [far, wave] : [wave, far];
  canvas.dispatchEvent(new PointerEvent(type, {bubbles: true, pointerId: 1, isPrimary: true,
    clientX: box.left + box.width * x, clientY: box.top + box.height * y}));
};
at("pointerdown", 0);
for (let i = 1; i <= 40; i++) at("pointermove", i / 40);
at("pointerup", 1);
"""


def until(true: Callable[[], Any], seconds: float = 400) -> Any:
    """What comes in the end."""
    end = time.monotonic() + seconds
    while not (found := true()):
        if time.monotonic() > end:
            raise TimeoutError("the page did not get there")
        time.sleep(0.2)
    return found


def click(browser: Any, at: str) -> None:
    browser.find_element("css selector", f"[data-at={at}]").click()


def size(browser: Any, width: int, height: int) -> None:
    """A screen of that size, and a moment to settle."""
    command = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", command)
    time.sleep(1)


def paint(browser: Any) -> None:
    """A canvas of blue and red strokes that cross over a yellow ground."""
    click(browser, "tab-canvas")
    done = "return document.querySelector('[data-at=easel]').dataset.done"
    until(lambda: browser.execute_script(done))
    browser.execute_script("document.querySelector('[data-at=brush]').value = 52")
    for coat, across in ((1, True), (0, False)):
        for offset in (0.2, 0.38, 0.56, 0.74):
            browser.execute_script(_STROKES, coat, across, offset)
            time.sleep(0.4)
    time.sleep(4)


def main() -> None:
    import glazejax

    out = help_parser(__doc__, FOLDER).parse_args().out
    browser = start_browser()
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder) / "cache")
        try:
            open_page(browser, server.link, STACK)
            time.sleep(1)
            for width, height, name in (
                (1024, 1000, "studio-1024"),
                (390, 844, "studio-390"),
                (1440, 960, "studio"),
            ):
                size(browser, width, height)
                browser.save_screenshot(str(out / f"{name}.png"))
            paint(browser)
            browser.save_screenshot(str(out / "studio-canvas.png"))
            click(browser, "tab-backwards")
            click(browser, "find")
            until(lambda: browser.find_elements("css selector", "[data-at=take]"))
            time.sleep(1)
            browser.save_screenshot(str(out / "studio-recipe.png"))
            lines = glazejax.samples.path().read_text().splitlines()
            film = Path(folder) / f"film-{FILM}.csv"
            film.write_text(
                "\n".join([lines[0], *(line for line in lines if line.startswith(FILM))]) + "\n"
            )
            browser.execute_script("document.querySelector('[data-at=file]').hidden = false")
            browser.find_element("css selector", "[data-at=file]").send_keys(str(film))
            browser.execute_script("document.querySelector('[data-at=file]').hidden = true")
            until(lambda: browser.find_element("css selector", "[data-at=identify]").is_enabled())
            click(browser, "identify")
            until(lambda: f"In {FILM}" in browser.find_element("css selector", ".found").text)
            time.sleep(1)
            browser.save_screenshot(str(out / "studio-identify.png"))
            print(f"written to {out}: six pictures of the studio")
        finally:
            server.stop()
            browser.quit()


if __name__ == "__main__":
    main()
