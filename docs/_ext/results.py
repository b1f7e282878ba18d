"""Pages of the benchmarks' results, and links to them from numbers.

On the forge a mark behind a number, `0.6<!--scaling.million_seconds-->`, is not seen
(`benchmarks/fill.py`). Here the number is a link to the page of its result.
"""

import ast
import importlib.util
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.fill import with_marks
from benchmarks.results import read
from pages_of_repository import DOCS, RESULTS, write_if_new
from reading import folded

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def with_links(text: str) -> str:
    """A Markdown text in which each marked number is a link to the page of its result."""

    def link(match: re.Match[str]) -> str:
        return f"[{match['number']}](/results/{match['name'].partition('.')[0]}.md){{.result}}"

    return with_marks(text, link)


def _link(app: "Sphinx", name: str, content: list[str]) -> None:
    content[0] = with_links(content[0])


def _about(path: Path) -> str:
    """First paragraph of the module that wrote a result."""
    module = importlib.util.find_spec(read(path.stem)["made"]["command"].split()[2])
    if module is None or module.origin is None:
        return ""
    about = ast.get_docstring(ast.parse(Path(module.origin).read_text("utf-8"))) or ""
    return about.partition("\n\n")[0].replace("\n", " ")


def _page(path: Path) -> str:
    lines = [f"# {path.stem.replace('_', ' ')}", "", _about(path), ""]
    lines += [f"`{read(path.stem)['made']['command']}` wrote this:", ""]
    lines += [
        "```text",
        *map(folded, path.read_text(encoding="utf-8").rstrip().splitlines()),
        "```",
        "",
    ]
    if path.with_suffix(".png").is_file():
        words = re.sub(r"[\[\]`]", "", _about(path))
        lines += [
            f"![Drawn from the numbers above. {words}](/../benchmarks/results/{path.stem}.png)",
            "",
        ]
    return "\n".join(lines)


def _write(app: "Sphinx") -> None:
    folder = DOCS / "results"
    files = sorted(RESULTS.glob("*.txt"))
    for path in files:
        write_if_new(folder / f"{path.stem}.md", _page(path))
    wanted = {f"{path.stem}.md" for path in files} | {"index.md"}
    lines = [
        "# Results",
        "",
        "What the benchmarks wrote, as they wrote it. Figures in the text are taken from here.",
        "",
        "| result | what it asks |",
        "|---|---|",
        *(
            f"| [{path.stem.replace('_', ' ')}]({path.stem}.md) | "
            f"{_about(path).replace('|', chr(92) + '|')} |"
            for path in files
        ),
        "",
        "```{toctree}",
        ":hidden:",
        "",
        *(path.stem for path in files),
        "```",
        "",
    ]
    write_if_new(folder / "index.md", "\n".join(lines))
    for path in folder.iterdir():
        if path.name not in wanted:
            path.unlink()


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", _write)
    app.connect("source-read", _link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
