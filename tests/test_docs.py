"""Documents hold together: links lead somewhere, commands have these options, examples run,
pictures have words.

The site itself is built by `.ci/run`: it executes the notebooks, and a warning ends it.
"""

import ast
import doctest
import importlib
import inspect
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from benchmarks.fill import MADE, documents

from glazejax.appearance.mitsuba.variants import works
from glazejax.appearance.scene.file import example
from glazejax.stacks import parse_stack

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

from docstrings import as_links, join_returns, short_defaults  # noqa: E402
from notebook_times import slow_notebooks  # noqa: E402
from offline import faults_of  # noqa: E402
from pages_of_repository import TEXTS, links_for_site  # noqa: E402
from reading import code_that_breaks, folded, modules_that_break, pictures_that_open  # noqa: E402
from reference import as_markdown  # noqa: E402
from results import with_links  # noqa: E402
from studio_page import write_studio  # noqa: E402

PAGES = [*documents(), *(ROOT / text for text in TEXTS)]
NOTEBOOKS = [
    path
    for path in PAGES
    if path.parent.name == "notebooks" and "code-cell" in path.read_text("utf-8")
]
_FENCE = re.compile(r"^ *(`{3,})([^\n]*)\n(.*?)^ *\1 *$", re.MULTILINE | re.DOTALL)


def blocks(page: Path, kind: str) -> list[str]:
    """Fenced blocks of a language, or of a directive."""
    return [
        found[3]
        for found in _FENCE.finditer(page.read_text("utf-8"))
        if found[2].strip().startswith(kind)
    ]


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return _FENCE.sub("", page.read_text("utf-8"))


def anchors(page: Path) -> set[str]:
    """Anchors of headings, as the forge and the site make them."""
    titles = re.findall(r"^#+ (.*?)\s*$", prose(page), re.MULTILINE)
    words = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower() for title in titles)
    return {re.sub(r"[^\w\- ]", "", word).replace(" ", "-") for word in words}


def name(page: Path) -> str:
    """A page as a fault names it."""
    return page.relative_to(ROOT).as_posix()


def source_of(page: Path) -> Path | None:
    """What a page that the site makes is made of; None for one of the reference."""
    inside = page.relative_to(DOCS).with_suffix("")
    if inside.parts[0] == "results":
        return (
            ROOT
            / "benchmarks"
            / ("results" if inside.name == "index" else f"results/{inside.name}.txt")
        )
    if inside.parts[0] == "project":
        return next(
            (ROOT / text for text, made in TEXTS.items() if made == inside.as_posix()), page
        )
    return None


def test_links_lead_to_what_is_there():
    faults = []
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            there: Path | None = page if not path else (page.parent / path).resolve()
            if there is not None and MADE & set(there.parts) and there.is_relative_to(DOCS):
                there = source_of(there)
            if there is None:
                continue  # Sphinx knows the reference's pages, and warns
            if not there.exists() or (
                anchor and there.suffix == ".md" and anchor not in anchors(there)
            ):
                faults.append(f"{name(page)} links to {target}")
    assert not faults, "\n".join(faults)


def test_commands_have_these_options():
    """In blocks of code, and in backquotes."""
    import typer.main

    from glazejax.commands.main import make_app

    commands = typer.main.get_command(make_app()).commands  # type: ignore[attr-defined]
    options = {
        command: {flag for one in made.params for flag in (*one.opts, *one.secondary_opts)}
        | {"--help"}
        for command, made in commands.items()
    }
    faults = []
    for page in PAGES:
        shown = [
            line
            for kind in ("sh", "{code-cell}")
            for block in blocks(page, kind)
            for line in block.splitlines()
        ]
        shown += [
            " ".join(span.split())
            for span in re.findall(r"(?<!`)`(glazejax [^`]+)`(?!`)", prose(page))
        ]
        for line in shown:
            for command, rest in re.findall(
                r"(?:^!?|[\s/])glazejax ([a-z]+) (.*?)(?:&&|$)", line.replace("\\", "")
            ):
                given = set(
                    re.findall(
                        r"(?<![\w-])(--?[a-z][a-z-]*)", re.sub(r"'[^']*'|\"[^\"]*\"", "", rest)
                    )
                )
                if command in options and given - options[command]:
                    faults.append(
                        f"{name(page)}: glazejax {command} has no {given - options[command]}"
                    )
    assert not faults, "\n".join(faults)


def test_every_command_and_every_extra_is_told():
    """In the lists of what there is; of extras, those for who changes the program are
    told to them.
    """
    told = (DOCS / "what-there-is.md").read_text("utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    commands = project["entry-points"]["glazejax.commands"]
    assert not [command for command in commands if f"| `glazejax {command}` |" not in told]
    extras = set(project["optional-dependencies"]) - {"release"}
    assert not [
        extra
        for extra in extras
        if not re.search(rf"^\| (?:`\w+`, )?`{extra}`", told, re.MULTILINE)
    ]


def test_pictures_have_words():
    """The site's build looks at all pictures; here those of notebooks, which programs draw."""
    faults = []
    for page in NOTEBOOKS:
        cells = blocks(page, "{code-cell}")
        drawn = [cell for cell in cells if "plt.show()" in cell]
        worded = [
            cell for cell in drawn if re.search(r"^ +alt: \"[^\"]{20,}\"$", cell, re.MULTILINE)
        ]
        if (
            not drawn
            or worded != drawn
            or any("plt.subplots" in cell and cell not in drawn for cell in cells)
        ):
            faults.append(
                f"{name(page)}: each notebook has a picture, each picture is shown and has an `alt`"
            )
    for page in PAGES:
        faults += [
            f"{name(page)}: a picture has no words but {words!r}"
            for words in re.findall(r"!\[([^\]]*)\]", prose(page))
            if len(words) <= 10
        ]
    assert not faults, "\n".join(faults)


def test_notebooks_begin_in_double_precision_and_are_listed():
    begun = [
        page
        for page in NOTEBOOKS
        if 'update("jax_enable_x64", True)' in blocks(page, "{code-cell}")[0]
    ]
    assert begun == NOTEBOOKS
    listed = (DOCS / "notebooks" / "index.md").read_text("utf-8").split()
    assert {page.stem for page in NOTEBOOKS} == {
        name for name in listed if (DOCS / f"notebooks/{name}.md").is_file()
    }


def test_python_is_python():
    for page in PAGES:
        for block in blocks(page, "python"):
            ast.parse(block, filename=name(page))


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted((DOCS / "start").glob("*.md")), ids=lambda path: path.stem)
def test_the_python_of_the_first_steps_runs(page, tmp_path):
    """In a process of its own, block by block; those that read a file of the reader's are
    left out.
    """
    small = example().replace("width = 640", "width = 32").replace("height = 480", "height = 24")
    (tmp_path / "scene.toml").write_text(small)
    for code in blocks(page, "python"):
        if "panel.hdr" in code or ("mitsuba" in code and not works("llvm_ad_spectral")):
            continue
        subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=600)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["interpolation", "varnish", "exports", "studio-guide"])
def test_the_python_of_a_page_runs(name, tmp_path):
    """All blocks of a page as one program. What docs/mitsuba.md shows takes minutes;
    tests/appearance has its like.
    """
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
        done = doctest.testmod(
            importlib.import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE
        )
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
            assert "Union[" not in words, (
                f"{name}: its module lacks `from __future__ import annotations`"
            )


def test_the_site_asks_no_other_host():
    page = (
        '<link rel="canonical" href="https://a"><a href="https://b">b</a><img src="c.png" alt="A '
        'glaze">'
    )
    assert faults_of(page) == []
    assert faults_of('<script src="https://cdn/x.js"></script>') == [
        "<script> asks for https://cdn/x.js"
    ]
    assert faults_of('<link rel="stylesheet" href="//fonts/x.css">') == [
        "<link> asks for //fonts/x.css"
    ]
    assert faults_of('<img src="c.png">') == ["the picture c.png has no words (alt)"]


def test_the_site_carries_the_studio_and_its_solver(tmp_path):
    write_studio(tmp_path)
    page = (tmp_path / "studio.html").read_text("utf-8")
    assert faults_of(page) == []
    assert "CobaltBlue" in page
    assert "export function reflect" in (tmp_path / "solver.js").read_text("utf-8")
    assert {"paints", "lamps", "eye"} <= set(
        json.loads((tmp_path / "paints.json").read_text("utf-8"))
    )
    for text in ("index.md", "studio-guide.md"):
        assert 'href="studio.html"' in (DOCS / text).read_text("utf-8")


@pytest.mark.browser
def test_a_long_table_shows_the_rows_with_all_words_that_are_typed(tmp_path):
    from .studio.browser import start_browser

    rows = "".join(f"<tr><td>paint {n}</td><td>k<wbr/>_s of {n}</td></tr>" for n in range(40))
    page = tmp_path / "page.html"
    script = (DOCS / "_static" / "filter.js").as_uri()
    page.write_text(
        f'<meta charset="utf-8"><script src="{script}"></script><article>'
        f"<table><tbody>{rows}</tbody></table><table><tbody><tr><td>short</td></tr></tbody></table>"
        "</article>"
    )
    browser = start_browser(tmp_path)
    try:
        browser.get(page.as_uri())
        (field,) = browser.find_elements("css selector", "input")

        def shown() -> list[str]:
            return [
                row.text
                for row in browser.find_elements("css selector", "tr")
                if row.is_displayed()
            ]

        assert len(shown()) == 41
        field.send_keys("K_S 12")
        assert shown() == ["paint 12 k_s of 12", "short"]
        assert browser.find_element("css selector", "[role=status]").text == "1 of 40 rows"
        field.clear()
        field.send_keys(" ")
        assert len(shown()) == 41
    finally:
        browser.quit()


def test_what_to_cite_stands_on_the_page():
    """Titles, doi and families of authors of CITATION.cff."""
    wanted = re.findall(
        r"^ +(?:- )?(?:title|doi|family-names): (.+)$",
        (ROOT / "CITATION.cff").read_text("utf-8"),
        re.MULTILINE,
    )
    page = (DOCS / "cite.md").read_text("utf-8")
    assert wanted
    assert not [words for words in wanted if words not in page]


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
    assert "<wbr/>" not in code("--refractive-index") + code("glazejax") + code(
        "&quot;&lt;&gt;&amp;&quot;"
    )


def test_names_of_modules_break_at_their_dots():
    assert modules_that_break("<h1>glazejax.radiative.rough<a>#</a></h1>").count("<wbr/>") == 2
    assert (
        modules_that_break("<p>see glazejax.io, or glazefit.</p>")
        == "<p>see glazejax.io, or glazefit.</p>"
    )


def test_a_picture_opens_unless_it_is_a_link():
    picture = '<img alt="a glaze" src="_images/glaze.png" />'
    assert (
        pictures_that_open(picture) == f'<a class="picture" href="_images/glaze.png">{picture}</a>'
    )
    assert (
        pictures_that_open(f'<a href="coats.html">{picture}</a>')
        == f'<a href="coats.html">{picture}</a>'
    )


def test_words_of_a_result_are_folded_and_tables_are_not():
    words, row = "a long sentence " * 10, "film  " * 40
    assert all(len(line) <= 120 for line in folded(words).splitlines())
    assert folded(words).split() == words.split()
    assert folded(row) == row


def test_help_of_a_command_keeps_its_asterisks_and_its_lines():
    assert (
        as_markdown("0.7*ZincWhite + 0.3*Eosin, --coats")
        == "0.7\\*ZincWhite + 0.3\\*Eosin, `--coats`"
    )
    assert (
        as_markdown("Example: glazejax convert a b --long")
        == "Example: `glazejax convert a b --long`"
    )
    told = as_markdown("Example: glazejax scene --example > a\n         glazejax scene a -o b")
    assert "```sh\nglazejax scene --example > a\nglazejax scene a -o b\n```" in told


def test_words_before_a_colon_are_no_type():
    lines = [":returns: of each band.", ":rtype: What came back"]
    join_returns(lines)
    assert lines == [":returns: What came back: of each band."]


def test_a_notebook_that_runs_too_long_is_told():
    told = slow_notebooks(
        {"notebooks/a": 61.0, "notebooks/b": 59.0, "notebooks/c": 125.0, "notebooks/d": None}
    )
    assert told == ["notebooks/c ran for 125 s", "notebooks/a ran for 61 s"]


def test_links_work_on_the_site_and_on_the_forge():
    here = DOCS
    assert (
        links_for_site("[a](../benchmarks/results/frontier.txt)", here)
        == "[a](/results/frontier.md)"
    )
    assert (
        links_for_site("[a](../ARCHITECTURE.md#rules)", here)
        == "[a](/project/architecture.md#rules)"
    )
    assert (
        links_for_site("![a](../benchmarks/results/truth.png)", here)
        == "![a](/../benchmarks/results/truth.png)"
    )
    assert links_for_site("[a](https://b) [c](#d)", here) == "[a](https://b) [c](#d)"
    assert links_for_site("```\n[a](../README.md)\n```\n", here) == "```\n[a](../README.md)\n```\n"
    assert (
        with_links("| 0.6<!--scaling.million_seconds .0f--> s |")
        == "| [0.6](/results/scaling.md){.result} s |"
    )


def test_spelling():
    """codespell, as pyproject sets it up; a word that is right goes to
    `ignore-words-list` there.
    """
    program = shutil.which("codespell", path=str(Path(sys.executable).parent)) or shutil.which(
        "codespell"
    )
    if program is None:
        pytest.skip("codespell is not installed (extra docs)")
    done = subprocess.run([program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_stacks_of_the_notebooks_open_in_the_studio():
    """Each link holds a stack, of paints that its notebook names, in coats as thick as it says."""
    found = 0
    for path in NOTEBOOKS:
        text = path.read_text("utf-8")
        for fragment in re.findall(r'href="\.\./studio\.html#([^"]+)"', text):
            for coat in parse_stack(unquote(fragment)).shown:
                assert f'"{coat.name}"' in text, path.name
                assert re.search(rf"\b{1e6 * coat.thickness:g}(e-6)?\b", text), path.name
            found += 1
    assert found >= 5
