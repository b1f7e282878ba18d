"""The built pages ask no other host for anything, and every picture has words for those who do not
see it.
"""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_ASKS = {
    "script": "src",
    "link": "href",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
}
# Links that a browser does not follow by itself.
_QUIET = {"canonical", "license", "next", "prev", "author"}


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.faults: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        address = given.get(_ASKS.get(tag, "")) or ""
        if re.match(r"(https?:)?//", address) and given.get("rel") not in _QUIET:
            self.faults.append(f"<{tag}> asks for {address}")
        if tag == "img" and not (given.get("alt") or "").strip():
            self.faults.append(f"the picture {address} has no words (alt)")


def faults_of(page: str) -> list[str]:
    """What a page asks of other hosts, and its pictures without alternative text."""
    parser = _Page()
    parser.feed(page)
    return parser.faults


def _look(app: "Sphinx", error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    folder = Path(app.outdir)
    faults = [
        f"{path.relative_to(folder)}: {fault}"
        for path in sorted(folder.rglob("*.html"))
        for fault in faults_of(path.read_text(encoding="utf-8"))
    ]
    # A style can ask, too.
    faults += [
        f"{path.relative_to(folder)}: asks for {address}"
        for path in sorted(folder.rglob("*.css"))
        for address in re.findall(
            r"(?:url\(|@import\s)\s*[\"']?((?:https?:)?//[^\"')\s]+)", path.read_text("utf-8")
        )
    ]
    if faults:
        from sphinx.errors import ExtensionError

        raise ExtensionError("\n".join(["the site is not complete in itself:", *faults]))


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("build-finished", _look)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
