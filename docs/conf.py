"""The site: `python -m sphinx -W -b html -D nb_execution_mode=off docs docs/_build/html`, with the
extra `docs` installed. Without `-D ...` its notebooks run too.

Everything comes from this repository: no font, script or style of another host is asked for
(`_ext/offline.py` looks). Pages under reference/, results/ and project/ are made from the code, the
result files and the texts of the repository when the site is built; they are not in git.
"""

import functools
import inspect
import os
import re
import sys
from importlib import import_module
from importlib.metadata import version as installed
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sphinx.util.logging import getLogger

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE), str(ROOT)]

from stale_notebooks import NOTEBOOKS, digest, files_of, home_of  # noqa: E402

from glazejax.plots import STYLE  # noqa: E402

project = "glazejax"
author = "the authors of glazejax"
copyright = f"{author}, Apache-2.0"
release = version = installed("glazejax")

extensions = [
    "myst_nb",
    "autoapi.extension",
    "sphinx.ext.doctest",
    "sphinx.ext.napoleon",
    "sphinxcontrib.typer",
    "sphinx_copybutton",
    "sphinx_design",
    # What is in _ext.
    "mathml",
    "pages_of_repository",
    "results",
    "reading",
    "studio_page",
    "offline",
]
exclude_patterns = ["_build", "_ext", "_templates"]

# Markdown, as the forge reads it too: links to headings are made as there.
myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
math_numfig = True
math_number_all = False

# Notebooks run while the site is built, unless `-D nb_execution_mode=off` or GLAZEJAX_NOTEBOOKS
# ("all", "none", or names) says otherwise; an error in one ends the build. What has run is kept,
# and runs again if its cells or the code whose names it uses changed (`stale_notebooks.py`).
nb_execution_mode = "cache"
chosen = os.environ.get("GLAZEJAX_NOTEBOOKS", "all").split()
if unknown := set(chosen) - {"all", "none", *NOTEBOOKS}:
    raise ValueError(f"GLAZEJAX_NOTEBOOKS: no notebooks are called {sorted(unknown)}")
nb_execution_excludepatterns = [
    f"docs/notebooks/{name}.md" for name in NOTEBOOKS if not {"all", name} & set(chosen)
]
nb_execution_cache_path = os.environ.get("GLAZEJAX_DOCS_CACHE", str(HERE / "_build" / "notebooks"))
nb_execution_raise_on_error = True
nb_execution_timeout = -1  # a cell takes as long as it takes: a slow machine ends no build
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js = {}
# As the commands do it: compiled programs are kept from one build to the next.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(HERE / "_build" / "xla"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
os.environ.setdefault("JAX_LOGGING_LEVEL", "CRITICAL")
# The look of the program's own pictures, without a line in each notebook.
look = HERE / "_build" / "matplotlibrc"
look.parent.mkdir(exist_ok=True)
ours = {
    **STYLE,
    "figure.figsize": "7.0, 3.6",
    "figure.constrained_layout.use": True,
    "figure.dpi": 110,
}
look.write_text("".join(f"{name}: {str(value).lstrip('#')}\n" for name, value in ours.items()))
os.environ["MATPLOTLIBRC"] = str(look)
# Commands in notebooks print without colours; TERM, which a kernel sets again, is theirs to say.
os.environ |= {"NO_COLOR": "1", "COLUMNS": "92"}
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
# One notebook maps the painting of the benchmarks.
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

# The reference: what the rooms in PUBLIC offer, read from the source, so with the types as they are
# written there. What two rooms offer is described in the one with the shorter name.
PUBLIC = {
    "Forward: from paint to colour": [
        "glazejax",
        "glazejax.catalogue",
        "glazejax.colour",
        "glazejax.samples",
        "glazejax.io",
        "glazejax.plots",
        "glazejax.spectra",
        "glazejax.studio",
    ],
    "Backward: from measurements to paint": ["glazefit"],
    "The solvers on arrays": [
        "glazejax.radiative",
        "glazejax.radiative.auxiliary",
        "glazejax.radiative.manyflux",
        "glazejax.radiative.rough",
        "glazejax.radiative.twoflux",
        "glazejax.radiative.plan",
        "glazejax.radiative.common.phase",
        "glazejax.radiative.common.fresnel",
    ],
    "Appearance": [
        "glazejax.appearance",
        "glazejax.appearance.display",
        "glazejax.appearance.exports",
        "glazejax.appearance.mitsuba",
        "glazejax.appearance.interreflection",
        "glazejax.appearance.metals",
        "glazejax.appearance.shading",
        "glazejax.appearance.scene",
    ],
}
ROOMS = [room for rooms in PUBLIC.values() for room in rooms]
# Parsing takes a tenth of a second a file: only folders are read that define a public name.
homes = {home_of(room) for room in ROOMS} | {
    home_of(f"{room}.{name}")
    for room in ROOMS
    for name in getattr(import_module(room), "__all__", [])
}
folders = {home.parent if home.is_file() else home for home in homes if home}
autoapi_ignore = [
    str(path)
    for packages in ("src", "fitting")
    for path in (ROOT / packages).rglob("*.py*")
    if path.parent not in folders
]
# Names that a module has from another one for its users: `_homes` looks that none is missing.
suppress_warnings = ["autoapi.python_import_resolution"]
autoapi_dirs = ["../src/glazejax", "../fitting/glazefit"]
autoapi_root = "reference"
autoapi_template_dir = "_templates/autoapi"
autoapi_file_patterns = ["*.pyi", "*.py"]
autoapi_options = ["members", "imported-members"]
autoapi_keep_files = True
autoapi_add_toctree_entry = True


def _shown(room: str) -> str:
    """The name by which users import a room."""
    return room.replace(".common.", ".")


def _about(room: str) -> str:
    """A room's docstring: its list of names (`__init__.pyi`), which is what is read, has none."""
    return inspect.getdoc(import_module(room)) or ""


@functools.cache
def _homes(app: Any) -> dict[str, str]:
    """Where a thing is defined -> the public name under which it is described."""
    names = sorted(app.env.autoapi_all_objects.items(), key=lambda pair: len(pair[0]))
    homes: dict[str, str] = {}
    for name, thing in names:
        if thing.display and name.rpartition(".")[0] in ROOMS:
            homes.setdefault(thing.obj.get("original_path", name), _shown(name))
    for room in map(import_module, ROOMS):
        for name in getattr(room, "__all__", []):
            thing = getattr(room, name)
            defined = f"{getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', '')}"
            described = defined in homes or f"{_shown(room.__name__)}.{name}" in homes.values()
            if not described and not inspect.ismodule(thing):
                getLogger(__name__).warning("%s.%s has no docstring", room.__name__, name)
    return homes


def _home(thing: Any) -> str:
    return _homes(thing.app)[thing.obj.get("original_path", thing.id)]


def _as_written(types: str, thing: Any) -> str:
    """Types as the source has them.

    autoapi writes all names from their roots, and the shapes of jaxtyping without their quotes.
    """
    types = re.sub(r"\bjaxtyping\.(\w+\[[^,\[\]]+, )([^\[\]]*)\]", r'\1"\2"]', types)
    types = types.replace("numpy.", "np.")
    return re.sub(
        r"\b(?!j?np\.)[a-z_]\w*(?:\.\w+)*\.(\w+)",
        lambda name: _homes(thing.app).get(name[0], name[1]),
        types,
    )


def _prepare(templates: Any) -> None:
    """What the templates in `_templates` use."""
    templates.globals["public"] = PUBLIC
    templates.filters |= {
        "shown": _shown,
        "about": _about,
        "home": _home,
        "as_written": _as_written,
    }


autoapi_prepare_jinja_env = _prepare
# `-b doctest` runs the examples of docstrings; `-b linkcheck` tries links to other hosts.
doctest_global_setup = """
import jax
jax.config.update("jax_enable_x64", True)
import numpy as np
from glazejax import *
from glazejax.catalogue import *
from glazejax.colour import *
from glazejax.samples import *
from glazefit import *
"""
doctest_test_doctest_blocks = "default"
toc_object_entries_show_parents = "hide"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
napoleon_numpy_docstring = False
# What stands before a colon in `Returns:` is words and no type.
napoleon_use_rtype = False
# A name in single backquotes is a link where it is one of ours, and code elsewhere.
default_role = "py:obj"

NOT_RUN = "Outputs and pictures appear here when the site is built with its notebooks."

html_theme = "sphinx_book_theme"
html_title = "glazejax"
html_static_path = ["_static"]
html_favicon = "_static/favicon.svg"
html_css_files = ["site.css"]
html_js_files = ["search.js", "filter.js"]
html_copy_source = False
html_show_sourcelink = False
html_last_updated_fmt = None
html_theme_options = {
    "show_navbar_depth": 1,
    "use_download_button": False,
    "use_fullscreen_button": False,
    "home_page_in_toc": False,
    "show_toc_level": 2,
    "footer_content_items": ["copyright.html"],
    # One search field, the one of the side bar.
    "navbar_start": [],
    "navbar_center": [],
    "navbar_end": [],
    "navbar_persistent": [],
    "pygments_light_style": "tango",
    "pygments_dark_style": "monokai",
}


def _mark_notebook(app: "Sphinx", page: str, content: list[str]) -> None:
    """Make what is kept of a notebook depend on the code that it uses, or say that it did not run.

    Both stand in its front matter, of which jupyter-cache compares `kernelspec`.
    """
    folder, _, name = page.partition("/")
    if folder != "notebooks" or name not in NOTEBOOKS:
        return
    excluded = f"docs/{page}.md" in app.config.nb_execution_excludepatterns
    if app.config.nb_execution_mode == "off" or excluded:
        # The kernel, which did not start, would have named the language.
        front = "language_info:\n  name: python\n  pygments_lexer: ipython3\nkernelspec:\n"
        note = f"\n```{{note}}\n{NOT_RUN}\n```\n\n```{{code-cell}}"
        content[0] = content[0].replace("\n```{code-cell}", note, 1)
    else:
        front = f"kernelspec:\n  code: {digest(NOTEBOOKS[name])}\n"
        for path in files_of(NOTEBOOKS[name]):
            app.env.note_dependency(str(path))
    content[0] = content[0].replace("kernelspec:\n", front, 1)


def _skip(app: "Sphinx", kind: str, name: str, thing: Any, skip: bool, options: Any) -> bool:
    """Leave rooms out that are not public."""
    if kind in ("package", "module"):
        return name not in ROOMS
    return skip


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    from pygments.lexers.special import TextLexer

    app.add_lexer("rooms", TextLexer)  # lists in ARCHITECTURE.md
    app.connect("autoapi-skip-member", _skip)
    app.connect("source-read", _mark_notebook)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
