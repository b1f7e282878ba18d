"""The site: `python -m sphinx -W -b html -D nb_execution_mode=off docs docs/_build/html`, with the
extra `docs` installed. Without `-D ...` its notebooks run too.

Everything comes from this repository: no font, script or style of another host is asked for
(`_ext/offline.py` looks). Pages under reference/, results/ and project/ are made from the code, the
result files and the texts of the repository when the site is built; they are not in git.
"""

import os
import sys
from importlib.metadata import version as installed
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE), str(ROOT)]

from stale_notebooks import NOTEBOOKS, digest, files_of  # noqa: E402

from glazejax.plots import STYLE  # noqa: E402

project = "glazejax"
author = "the authors of glazejax"
copyright = f"{author}, Apache-2.0"
release = version = installed("glazejax")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    # What is in _ext.
    "mathml",
    "pages_of_repository",
    "docstrings",
    "reference",
    "results",
    "reading",
    "studio_page",
    "offline",
]
exclude_patterns = ["_build", "_ext"]

# Markdown, as the forge reads it too: links to headings are made as there.
myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
math_numfig = True
math_number_all = False
# Curly quotes, but no dashes made of two hyphens: those are options.
smartquotes_action = "qe"

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
# Commands in notebooks print without colours; TERM, which a kernel sets anew, is theirs to say.
os.environ |= {"NO_COLOR": "1", "COLUMNS": "92"}
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
# One notebook maps the painting of the benchmarks.
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

toc_object_entries_show_parents = "hide"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
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


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("source-read", _mark_notebook)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
