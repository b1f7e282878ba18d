"""Texts of the repository as pages of the site, and links that work on the forge and here.

On the forge a page links to files wherever they lie: `../benchmarks/results/frontier.txt`,
`../ARCHITECTURE.md`. Here the first is a page of `results`, the second a copy of the text, made
when the site is built.
"""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx


ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RESULTS = ROOT / "benchmarks" / "results"

TEXTS = {
    "ARCHITECTURE.md": "project/architecture",
    "CONTRIBUTING.md": "project/contributing",
    "CHANGELOG.md": "project/changelog",
    "src/glazejax/catalogue/PROVENANCE.md": "project/oils",
    "src/glazejax/catalogue/ACRYLICS.md": "project/acrylics",
    "src/glazejax/samples/SOURCE.md": "project/samples",
    "src/glazejax/cie/SOURCE.md": "project/cie-tables",
    "benchmarks/paintbench/README.md": "project/paintbench",
}
"""Text of the repository -> name of its page."""

_LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\[\]]*\])*\]\()([^)\s#]+)(#[^)\s]*)?(\s+\"[^\"]*\")?\)")
_FENCE = re.compile(r"^( *)(`{3,}|~{3,}).*?^\1\2`*\s*$", re.MULTILINE | re.DOTALL)


def link_for_site(target: str, folder: Path) -> str:
    """Where a relative link of a text in `folder` leads on the site; what is no relative link
    stays.
    """
    if re.match(r"[a-z]+:|/|<", target):
        return target
    path = Path(os.path.normpath(folder / target))
    if not path.exists():
        return target  # Sphinx says that it is missing
    inside = path.relative_to(ROOT).as_posix()
    if inside in TEXTS:
        return f"/{TEXTS[inside]}.md"
    if inside == "README.md":
        return "/index.md"
    if path.parent == RESULTS and path.suffix == ".txt":
        return f"/results/{path.stem}.md"
    return "/" + Path(os.path.relpath(path, DOCS)).as_posix()


def links_for_site(text: str, folder: Path) -> str:
    """A Markdown text with all its relative links as they are on the site; blocks of code stay as
    they are.
    """

    def mended(prose: str) -> str:
        return _LINK.sub(
            lambda m: f"{m[1]}{link_for_site(m[2], folder)}{m[3] or ''}{m[4] or ''})", prose
        )

    parts, at = [], 0
    for fence in _FENCE.finditer(text):
        parts += [mended(text[at : fence.start()]), fence[0]]
        at = fence.end()
    return "".join([*parts, mended(text[at:])])


def write_if_new(path: Path, text: str) -> None:
    """Write a generated page only if it changes, so that Sphinx does not read it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def _copy(app: "Sphinx") -> None:
    for source, page in TEXTS.items():
        path = ROOT / source
        write_if_new(
            DOCS / f"{page}.md", links_for_site(path.read_text(encoding="utf-8"), path.parent)
        )


def _mend(app: "Sphinx", name: str, content: list[str]) -> None:
    path = Path(app.env.doc2path(name))
    if path.suffix == ".md" and not name.startswith("project/"):
        content[0] = links_for_site(content[0], path.parent)


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", _copy)
    app.connect("source-read", _mend)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
