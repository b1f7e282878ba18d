"""Pages of the benchmarks' results, and the role `{result}`: a figure taken from them when the site is built.

``{result}`scaling.million_seconds` `` becomes the figure of that name (`python -m benchmarks.figures` prints all), with
a link to the page of the file that it stands in. A name that is not there, or a result in which it is not found, ends
the build.
"""

import ast
import re
from pathlib import Path
from typing import Any

from benchmarks.figures import figure
from benchmarks.results import declared, head, module_of, modules
from docutils import nodes
from pages_of_repository import DOCS, RESULTS, write_if_new
from reading import folded
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxRole


class Result(SphinxRole):
    """A figure by its name, as a link to its result's page."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The link."""
        try:
            said = figure(self.text)
        except ValueError as error:
            message = self.inliner.reporter.error(f"no result {self.text!r}: {error}", line=self.lineno)
            return [], [message]
        result = self.text.partition(".")[0]
        self.env.note_dependency(str(RESULTS / f"{result}.txt"))
        link = addnodes.pending_xref(
            "",
            nodes.inline("", said),
            refdomain="std",
            reftype="doc",
            reftarget=f"/results/{result}",
            refexplicit=True,
            refwarn=True,
        )
        link["refdoc"] = self.env.docname
        link["classes"].append("result")
        return [link], []


def _about(path: Path) -> str:
    """What a benchmark asks: the first paragraph of its module."""
    told = ast.get_docstring(ast.parse(module_of(path.stem).read_text("utf-8"))) or ""
    return told.partition("\n\n")[0].replace("\n", " ")


def _page(path: Path) -> str:
    lines = [f"# {path.stem.replace('_', ' ')}", "", _about(path), ""]
    lines += [f"`{head(path.stem).command}` wrote this:", ""]
    lines += ["```text", *map(folded, path.read_text(encoding="utf-8").rstrip().splitlines()), "```", ""]
    if path.with_suffix(".png").is_file():
        words = re.sub(r"[\[\]`]", "", _about(path))
        lines += [f"![Drawn from the numbers above. {words}](/../benchmarks/results/{path.stem}.png)", ""]
    return "\n".join(lines)


def _without(files: list[Path]) -> list[str]:
    """Which benchmarks have no result, and why, as they say."""
    having = {module_of(path.stem) for path in files}
    lines = [f"- `{one.stem}`: {declared(one, 'NO_RESULT')}." for one in modules() if one not in having]
    return ["## Not run yet", "", *lines, ""] if lines else []


def _write(app: Sphinx) -> None:
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
            f"| [{path.stem.replace('_', ' ')}]({path.stem}.md) | {_about(path).replace('|', chr(92) + '|')} |"
            for path in files
        ),
        "",
        "```{toctree}",
        ":hidden:",
        "",
        *(path.stem for path in files),
        "```",
        "",
        *_without(files),
    ]
    write_if_new(folder / "index.md", "\n".join(lines))
    for path in folder.iterdir():
        if path.name not in wanted:
            path.unlink()


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", _write)
    app.add_role("result", Result())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
