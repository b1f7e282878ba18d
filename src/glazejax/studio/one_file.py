"""The page as one text: its modules joined, for notebooks, and with all that it knows, as a file
that needs no server and asks none.
"""

import json
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from ..paint.media import Pigment
from .page_data import page_data

# In the order in which they need one another.
_MODULES = (
    "solver",
    "dom",
    "wire",
    "seen",
    "check",
    "pigments",
    "lines",
    "layers",
    "table",
    "search",
    "store",
    "link",
    "shelf",
    "coats",
    "plot",
    "look",
    "painter",
    "easel",
    "backwards",
    "away",
    "studio",
)
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function\*?|const|let|class) (\w+))", re.MULTILINE)
_DEFAULT = re.compile(r"^export default ", re.MULTILINE)
# Nothing is loaded from anywhere: all is in the file.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'"
)


def page_text(name: str) -> str:
    """A file of the page."""
    return files("glazejax.studio").joinpath("page", name).read_text(encoding="utf-8")


@cache
def bundle(last: str) -> str:
    """The page's modules as one, `last` after all others; its default export stays one."""
    scripts = ["const modules = {};"]
    # Each module becomes a function that returns its exports, of which later ones take theirs.
    for name in (*_MODULES, last):
        text = page_text(f"{name}.js")
        names = _EXPORT.findall(text)
        text = _IMPORT.sub(_inner_import, text)
        text = _EXPORT.sub("", text)
        if _DEFAULT.search(text):
            text = _DEFAULT.sub("const standard = ", text)
            names.append("default: standard")
        scripts.append(
            f"modules.{name} = (() => {{\n{text}\nreturn {{ {', '.join(names)} }};\n}})();"
        )
    if "standard" in scripts[-1]:
        scripts.append(f"export default modules.{last}.default;")
    return "\n".join(scripts)


def _inner_import(line: re.Match[str]) -> str:
    """An import as a line of one text."""
    return f"const {{ {line[1].strip().replace(' as ', ': ')} }} = modules.{line[2]};"


def one_file(
    own_paints: Mapping[str, Pigment] | None = None, begin: dict[str, Any] | None = None
) -> str:
    """The whole studio as one HTML file: it opens from a disk and asks no host for anything.

    Args:
        own_paints: paints in addition to the catalogues', by names that no catalogue has.
        begin: a stack to begin with, as `glazejax.stacks.stack_to_dict` gives it.
    """
    # Nothing in JSON may end the element that holds it.
    data = json.dumps(
        page_data(own_paints) | {"begin": begin}, separators=(",", ":"), ensure_ascii=False
    )
    data = data.replace("<", "\\u003c")
    text = page_text("index.html")
    for original, new in (
        (
            '<link rel="stylesheet" href="style.css">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
            f"<style>\n{page_text('style.css')}</style>",
        ),
        ('<script type="module" src="main.js"></script>\n', ""),
        (
            "</body>",
            f'<script type="application/json" id="data">{data}</script>\n'
            f'<script type="module">\n{bundle("main")}\n</script>\n</body>',
        ),
    ):
        assert original in text, original
        text = text.replace(original, new)
    return text
