"""Documents hold together: links lead somewhere, commands have these options, figures and pictures are there.

The site itself is built by `.ci/run`: it executes the notebooks, and a warning ends it.
"""

import ast
import doctest
import importlib
import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glazejax.appearance.scene.file import example
from glazejax.appearance.scene.variants import works

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

from docstrings import as_links, join_returns, short_defaults  # noqa: E402
from notebook_times import too_slow  # noqa: E402
from offline import faults_of  # noqa: E402
from pages_of_repository import TEXTS, links_for_site  # noqa: E402
from reading import code_that_breaks, folded, modules_that_break, pictures_that_open  # noqa: E402
from reference import as_markdown  # noqa: E402

MADE = {"reference", "results", "project"}
"""Folders of the site that are written when it is built."""
PAGES = [
    *(path for path in DOCS.rglob("*.md") if not ({"_build", *MADE} & set(path.relative_to(DOCS).parts))),
    *(ROOT / name for name in ("README.md", *TEXTS)),
]
NOTEBOOKS = [path for path in PAGES if path.parent.name == "notebooks" and "code-cell" in path.read_text("utf-8")]
_FENCE = re.compile(r"^ *(`{3,})([^\n]*)\n(.*?)^ *\1 *$", re.MULTILINE | re.DOTALL)
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
each_notebook = pytest.mark.parametrize("page", NOTEBOOKS, ids=lambda path: path.stem)


def blocks(page: Path, kind: str) -> list[str]:
    """Fenced blocks of a language, or of a directive."""
    return [found[3] for found in _FENCE.finditer(page.read_text("utf-8")) if found[2].strip().startswith(kind)]


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return _FENCE.sub("", page.read_text("utf-8"))


def anchors(page: Path) -> set[str]:
    """Anchors of headings, as the forge and the site make them."""
    titles = re.findall(r"^#+ (.*?)\s*$", prose(page), re.MULTILINE)
    words = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower() for title in titles)
    return {re.sub(r"[^\w\- ]", "", word).replace(" ", "-") for word in words}


def source_of(page: Path) -> Path | None:
    """What a page that the site makes is made of; None for one of the reference."""
    inside = page.relative_to(DOCS).with_suffix("")
    if inside.parts[0] == "results":
        return ROOT / "benchmarks" / ("results" if inside.name == "index" else f"results/{inside.name}.txt")
    if inside.parts[0] == "project":
        return next((ROOT / text for text, made in TEXTS.items() if made == inside.as_posix()), page)
    return None


@each_page
def test_links_lead_to_what_is_there(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there: Path | None = page if not path else (page.parent / path).resolve()
        if there is not None and MADE & set(there.parts) and there.is_relative_to(DOCS):
            there = source_of(there)
        if there is None:
            continue  # Sphinx knows the reference's pages, and warns
        assert there.exists(), f"{page.name} links to {target}"
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there), f"{page.name} links to {target}; headings are {sorted(anchors(there))}"


@each_page
def test_pictures_have_words(page):
    assert all(len(words) > 10 for words in re.findall(r"!\[([^\]]*)\]", prose(page)))


def _commands() -> dict[str, set[str]]:
    """Options of each sub-command."""
    import typer.main

    from glazejax.commands.main import make_app

    group = typer.main.get_command(make_app())
    return {
        name: {flag for one in command.params for flag in (*one.opts, *one.secondary_opts)} | {"--help"}
        for name, command in group.commands.items()  # type: ignore[attr-defined]
    }


@pytest.fixture(scope="module")
def commands() -> dict[str, set[str]]:
    return _commands()


@each_page
def test_commands_have_these_options(page, commands):
    lines = [line for kind in ("sh", "{code-cell}") for block in blocks(page, kind) for line in block.splitlines()]
    for line in lines:
        for said in re.findall(r"(?:^!?|[\s/])glazejax ((?:[a-z]+) .*?)(?:&&|$)", line.replace("\\", "")):
            name, _, rest = said.partition(" ")
            if name not in commands:
                continue
            given = set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", re.sub(r"'[^']*'|\"[^\"]*\"", "", rest)))
            assert given <= commands[name], f"{page.name}: glazejax {name} has no {given - commands[name]}"


@each_notebook
def test_a_notebook_says_what_its_pictures_show(page):
    cells = blocks(page, "{code-cell}")
    drawn = [cell for cell in cells if "plt.show()" in cell]
    assert drawn, "a notebook has a picture"
    assert all(re.search(r"^ +alt: \"[^\"]{20,}\"$", cell, re.MULTILINE) for cell in drawn)
    assert not any("plt.subplots" in cell and "plt.show()" not in cell for cell in cells)


@each_notebook
def test_a_notebook_begins_in_double_precision(page):
    assert 'jax.config.update("jax_enable_x64", True)' in blocks(page, "{code-cell}")[0]


def test_every_notebook_is_in_the_list():
    listed = (DOCS / "notebooks" / "index.md").read_text("utf-8").split()
    assert {page.stem for page in NOTEBOOKS} == {name for name in listed if (DOCS / f"notebooks/{name}.md").is_file()}


PYTHON = [(page, n) for page in PAGES for n, _ in enumerate(blocks(page, "python"))]


@pytest.mark.parametrize(("page", "n"), PYTHON, ids=lambda value: getattr(value, "stem", value))
def test_python_is_python(page, n):
    ast.parse(blocks(page, "python")[n])


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted((DOCS / "start").glob("*.md")), ids=lambda path: path.stem)
def test_the_python_of_the_first_steps_runs(page, tmp_path):
    """In a process of its own, block by block; those that read a file of the reader's are left out."""
    small = example().replace("width = 640", "width = 32").replace("height = 480", "height = 24")
    (tmp_path / "scene.toml").write_text(small)
    for code in blocks(page, "python"):
        if "panel.hdr" in code or ("mitsuba" in code and not works("llvm_ad_spectral")):
            continue
        subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=600)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["what-there-is", "exports", "studio"])
def test_the_python_of_a_page_runs(name, tmp_path):
    """All blocks of a page as one program. What docs/mitsuba.md shows takes minutes; tests/appearance has its like."""
    code = "\n".join(blocks(DOCS / f"{name}.md", "python"))
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=600)


EXAMPLES = [
    ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix(".__init__")
    for folder in (ROOT / "src", ROOT / "fitting")
    for path in sorted(folder.rglob("*.py"))
    if re.search(r">>> (?!.*doctest: \+SKIP)", path.read_text("utf-8"))
]


@pytest.mark.parametrize("module", EXAMPLES)
def test_examples_of_docstrings_are_true(module):
    # colour-science, which another test may have imported, sets NumPy's printing of 2016.
    with np.printoptions(legacy=False):
        done = doctest.testmod(importlib.import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert done.attempted
    assert not done.failed


def test_every_public_name_is_in_the_reference():
    from reference import ALL, public_names, room_of

    import glazefit
    import glazejax

    for package in (glazejax, glazefit):
        offered = {name for name in package.__all__ if not name.startswith("_")}
        assert offered == set(public_names(package))
    for name in ALL:
        room = room_of(name)
        assert public_names(room), name
        assert all(hasattr(room, public) for public in public_names(room)), name


def test_help_names_types_and_does_not_spell_them_out():
    import glazejax

    for name in glazejax.__all__:
        thing = getattr(glazejax, name)
        if callable(thing):
            words = str(inspect.signature(thing))
            assert "Union[" not in words, f"{name}: its module lacks `from __future__ import annotations`"


def test_the_site_asks_no_other_host():
    page = '<link rel="canonical" href="https://a"><a href="https://b">b</a><img src="c.png" alt="A glaze">'
    assert faults_of(page) == []
    assert faults_of('<script src="https://cdn/x.js"></script>') == ["<script> asks for https://cdn/x.js"]
    assert faults_of('<link rel="stylesheet" href="//fonts/x.css">') == ["<link> asks for //fonts/x.css"]
    assert faults_of('<img src="c.png">') == ["the picture c.png has no words (alt)"]


def test_types_of_the_reference_are_links():
    assert as_links("Films | None") == "`~.Films` | ``None``"
    assert as_links("float") == "``float``"
    assert as_links("Mapping[str, Films | None]") == "``Mapping[str, Films | None]``"


def test_defaults_without_words_are_left_out_of_signatures():
    given = "(name, labs=<factory>, progress=<function <lambda>>, count=5)"
    assert short_defaults(given) == "(name, labs=..., progress=..., count=5)"
    assert short_defaults("(_rows, _groups)") == ""
    assert short_defaults(None) is None


def test_code_breaks_at_its_joints_and_options_never():
    def code(words: str) -> str:
        return code_that_breaks(f'<code><span class="pre">{words}</span></code>')

    assert code("split_reflectance_factor").count("<wbr/>") == 2
    assert "split_<wbr/>reflectance_<wbr/>factor" in code("split_reflectance_factor")
    assert "option" in code("--refractive-index")
    assert "<wbr/>" not in code("--refractive-index") + code("glazejax") + code("&quot;&lt;&gt;&amp;&quot;")


def test_names_of_modules_break_at_their_dots():
    assert modules_that_break("<h1>glazejax.radiative.rough<a>#</a></h1>").count("<wbr/>") == 2
    assert modules_that_break("<p>see glazejax.io, or glazefit.</p>") == "<p>see glazejax.io, or glazefit.</p>"


def test_a_picture_opens_unless_it_is_a_link():
    picture = '<img alt="a glaze" src="_images/glaze.png" />'
    assert pictures_that_open(picture) == f'<a class="picture" href="_images/glaze.png">{picture}</a>'
    assert pictures_that_open(f'<a href="coats.html">{picture}</a>') == f'<a href="coats.html">{picture}</a>'


def test_words_of_a_result_are_folded_and_tables_are_not():
    words, row = "a long sentence " * 10, "film  " * 40
    assert all(len(line) <= 120 for line in folded(words).splitlines())
    assert folded(words).split() == words.split()
    assert folded(row) == row


def test_help_of_a_command_keeps_its_asterisks_and_its_lines():
    assert as_markdown("0.7*ZincWhite + 0.3*Eosin, --layers") == "0.7\\*ZincWhite + 0.3\\*Eosin, `--layers`"
    assert as_markdown("Example: glazejax convert a b --long") == "Example: `glazejax convert a b --long`"
    told = as_markdown("Example: glazejax scene --example > a\n         glazejax scene a -o b")
    assert "```sh\nglazejax scene --example > a\nglazejax scene a -o b\n```" in told


def test_words_before_a_colon_are_no_type():
    lines = [":returns: of each band.", ":rtype: What came back"]
    join_returns(lines)
    assert lines == [":returns: What came back: of each band."]


def test_a_notebook_that_runs_too_long_is_told():
    told = too_slow({"notebooks/a": 61.0, "notebooks/b": 59.0, "notebooks/c": 125.0, "notebooks/d": None}, 60.0)
    assert [one.split(" for")[0] for one in told] == ["notebooks/c ran", "notebooks/a ran"]
    assert "125 s" in told[0]
    assert "60" in told[0]
    assert too_slow({"notebooks/a": 60.0}, 60.0) == []


def test_links_work_on_the_site_and_on_the_forge():
    here = DOCS
    assert links_for_site("[a](../benchmarks/results/frontier.txt)", here) == "[a](/results/frontier.md)"
    assert links_for_site("[a](../ARCHITECTURE.md#rules)", here) == "[a](/project/architecture.md#rules)"
    assert links_for_site("![a](../benchmarks/results/truth.png)", here) == "![a](/../benchmarks/results/truth.png)"
    assert links_for_site("[a](https://b) [c](#d)", here) == "[a](https://b) [c](#d)"
    assert links_for_site("```\n[a](../README.md)\n```\n", here) == "```\n[a](../README.md)\n```\n"


def test_spelling():
    """codespell, as pyproject sets it up; a word that is right goes to `ignore-words-list` there."""
    program = shutil.which("codespell", path=str(Path(sys.executable).parent)) or shutil.which("codespell")
    if program is None:
        pytest.skip("codespell is not installed (extra docs)")
    done = subprocess.run([program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
