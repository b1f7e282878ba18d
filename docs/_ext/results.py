"""Pages of the benchmarks' results, and the role `{result}`: a figure taken from them when the site is built.

``{result}`gradient_over_value` `` becomes the figure of that name in `benchmarks/figures.py`, with a link to the page
of the file that it stands in. A name that is not there, or a result in which it is not found, ends the build.
"""

import ast
from pathlib import Path
from typing import Any

from benchmarks.figures import FIGURES
from docutils import nodes
from pages_of_repository import DOCS, RESULTS, ROOT, write_if_new
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxRole


class Result(SphinxRole):
    """A figure by its name, as a link to its result's page."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The link."""
        try:
            figure = FIGURES[self.text]
            said = figure.text()
        except (KeyError, ValueError) as error:
            message = self.inliner.reporter.error(f"no result {self.text!r}: {error}", line=self.lineno)
            return [], [message]
        page = f"/results/{figure.file}"
        self.env.note_dependency(str(RESULTS / f"{figure.file}.txt"))
        link = addnodes.pending_xref(
            "", nodes.inline("", said), refdomain="std", reftype="doc", reftarget=page, refexplicit=True, refwarn=True
        )
        link["refdoc"] = self.env.docname
        link["classes"].append("result")
        return [link], []


def _maker(stem: str) -> str:
    """Module of the benchmark whose result this is: the longest name that the result's begins with."""
    names = [path.stem for path in (ROOT / "benchmarks").glob("*.py") if stem.startswith(path.stem)]
    return max(names, key=len, default="")


def _page(path: Path) -> str:
    lines = [f"# {path.stem.replace('_', ' ')}", ""]
    if maker := _maker(path.stem):
        told = ast.get_docstring(ast.parse((ROOT / "benchmarks" / f"{maker}.py").read_text("utf-8"))) or ""
        lines += [told.partition("\n\n")[0].replace("\n", " "), "", f"`python -m benchmarks.{maker}` wrote this:", ""]
    lines += ["```text", path.read_text(encoding="utf-8").rstrip(), "```", ""]
    if path.with_suffix(".png").is_file():
        lines += [f"![The same as a picture](/../benchmarks/results/{path.stem}.png)", ""]
    return "\n".join(lines)


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
        "```{toctree}",
        ":maxdepth: 1",
        "",
        *(path.stem for path in files),
        "```",
        "",
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
