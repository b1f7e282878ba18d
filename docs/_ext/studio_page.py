"""The studio itself on the site: `studio.html`, the page that `glazejax studio --page` writes, its
solver as a module of its own, `solver.js`, and paints and lamps for that, `paints.json`.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def write_studio(folder: Path) -> None:
    """The three files in a folder."""
    from glazejax.studio.one_file import one_file, page_text
    from glazejax.studio.page_data import page_data

    (folder / "studio.html").write_text(one_file(), encoding="utf-8")
    (folder / "solver.js").write_text(page_text("solver.js"), encoding="utf-8")
    known = json.dumps(page_data(), separators=(",", ":"), ensure_ascii=False)
    (folder / "paints.json").write_text(known, encoding="utf-8")


def _write(app: "Sphinx", error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        write_studio(Path(app.outdir))


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("build-finished", _write, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
