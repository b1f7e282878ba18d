"""Pages as they are read: where code may break, pictures that open, tables of results over the
whole page.

A name such as `split_reflectance_factor` breaks after an underscore, a dot or a slash and nowhere
else; an option stays in one piece. A picture is a link to itself, in all its pixels.
"""

import re
import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

_CODE = re.compile(r"<code\b.*?</code>", re.DOTALL)
_WORDS = re.compile(r'<span class="pre">([^<]+)</span>')
_OPTION = re.compile(r"-{1,2}[A-Za-z][\w-]*")
_JOINT = re.compile(r"([/_.=,:(\[]+)(?=[\w\"'(&])")
_MODULE = re.compile(r"(?<=>)(glaze\w+(?:\.\w+)+)(?=<)")
_PICTURE = re.compile(r"(<a\b[^>]*>\s*)?(<img\b[^>]*\bsrc=\"([^\"]+)\"[^>]*/?>)")


def folded(line: str) -> str:
    """A long sentence in several lines; a row of a table, which has columns two spaces apart, as it
    is.
    """
    words = line.strip()
    if len(line) <= 130 or "  " in words:
        return line
    indent = line[: len(line) - len(line.lstrip())]
    return textwrap.fill(
        words, 120, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
    )


def code_that_breaks(page: str) -> str:
    """Names in code with places where a line may end, and options that are never parted."""

    def mended(found: re.Match[str]) -> str:
        words = found[1]
        if _OPTION.fullmatch(words):
            return f'<span class="pre option">{words}</span>'
        if len(words) <= 12:
            return found[0]
        return f'<span class="pre">{_JOINT.sub(lambda joint: joint[1] + "<wbr/>", words)}</span>'

    # Not in signatures, where a line ends between parameters.
    return _CODE.sub(lambda code: _WORDS.sub(mended, code[0]), page)


def modules_that_break(page: str) -> str:
    """Names of modules in titles and links, which are no code, with places where a line may end."""
    return _MODULE.sub(lambda name: name[1].replace(".", ".<wbr/>"), page)


def pictures_that_open(page: str) -> str:
    """Each picture that is no link leads to its own file."""

    def mended(found: re.Match[str]) -> str:
        return found[0] if found[1] else f'<a class="picture" href="{found[3]}">{found[2]}</a>'

    return _PICTURE.sub(mended, page)


def _mend(
    app: "Sphinx", name: str, template: str, context: dict[str, Any], tree: "nodes.document | None"
) -> None:
    page = context.get("body")
    if not page:
        return
    page = modules_that_break(pictures_that_open(code_that_breaks(page)))
    for way in ("prev", "next"):
        if context.get(way):
            title = modules_that_break(f">{context[way]['title']}<")[1:-1]
            context[way] = {**context[way], "title": title}
    if name.startswith("results/"):
        # Tables of fixed width: the style gives them the width of the list of headings, of which
        #     there is none.
        page = f'<div class="of-result">{page}</div>'
        context["meta"] = {
            **(context.get("meta") or {}),
            "html_theme.sidebar_secondary.remove": "true",
        }
    context["body"] = page


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    # Before the theme, which reads the page's meta.
    app.connect("html-page-context", _mend, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
