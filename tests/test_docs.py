"""Documents hold together, as far as Sphinx does not see it: README's links, options of commands,
examples of pages.

Sphinx itself checks the links, names and pictures of the site (`-W`), and runs the examples of
docstrings (`-b doctest`).
"""

import ast
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
from benchmarks.fill import documents

from glazejax.appearance.mitsuba.variants import works
from glazejax.appearance.scene.file import example
from glazejax.stacks import parse_stack

from .commands import commands
from .fresh import run_python

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path[:0] = [str(DOCS / "_ext"), str(DOCS)]

from offline import faults_of  # noqa: E402
from pages_of_repository import TEXTS  # noqa: E402
from stale_notebooks import NOTEBOOKS  # noqa: E402
from studio_page import write_studio  # noqa: E402

PAGES = [*documents(), *(ROOT / text for text in TEXTS)]
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


def name(page: Path) -> str:
    """A page as a fault names it."""
    return page.relative_to(ROOT).as_posix()


def test_links_of_readme_lead_to_what_is_there():
    """It is no page of the site; anchors are the site's affair."""
    links = re.findall(r"\]\(([^)\s#]+)", prose(ROOT / "README.md"))
    inside = [link for link in links if not re.match(r"[a-z]+:", link)]
    assert len(inside) > 10
    assert not [link for link in inside if not (ROOT / link).exists()]


def test_notebooks_begin_in_double_precision():
    first = [blocks(page, "{code-cell}")[0] for page in NOTEBOOKS.values()]
    assert all('update("jax_enable_x64", True)' in cell for cell in first)


def test_commands_have_these_options():
    """In blocks of code, and in backquotes."""
    options = {
        command: {flag for one in made.params for flag in (*one.opts, *one.secondary_opts)}
        | {"--help"}
        for command, made in commands().items()
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
        run_python(code, cwd=tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["interpolation", "varnish", "exports", "studio-guide"])
def test_the_python_of_a_page_runs(name, tmp_path):
    """All blocks of a page as one program. What docs/mitsuba.md shows takes minutes;
    tests/appearance has its like.
    """
    run_python("\n".join(blocks(DOCS / f"{name}.md", "python")), cwd=tmp_path)


def test_help_names_types_and_does_not_spell_them_out():
    import glazejax

    for name in glazejax.__all__:
        thing = getattr(glazejax, name)
        if callable(thing):
            words = str(inspect.signature(thing))
            assert "Union[" not in words, (
                f"{name}: its module lacks `from __future__ import annotations`"
            )


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
    from benchmarks.studio.studio import go_to

    from .studio.browser import start_browser

    rows = "".join(f"<tr><td>paint {n}</td><td>k<wbr/>_s of {n}</td></tr>" for n in range(40))
    page = tmp_path / "page.html"
    script = (DOCS / "_static" / "filter.js").as_uri()
    page.write_text(
        f'<meta charset="utf-8"><script src="{script}"></script><article>'
        f"<table><tbody>{rows}</tbody></table><table><tbody><tr><td>short</td></tr></tbody></table>"
        "</article>"
    )
    with start_browser(tmp_path) as browser:
        go_to(browser, page.as_uri())
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
    for path in NOTEBOOKS.values():
        text = path.read_text("utf-8")
        for fragment in re.findall(r'href="\.\./studio\.html#([^"]+)"', text):
            for coat in parse_stack(unquote(fragment)).shown:
                assert f'"{coat.name}"' in text, path.name
                assert re.search(rf"\b{1e6 * coat.thickness:g}(e-6)?\b", text), path.name
            found += 1
    assert found >= 5


def test_the_example_of_readme_prints_what_is_shown(capsys):
    text = (ROOT / "README.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(code, {})
    shown = re.findall(r"^# (\[.+\])$", code, re.MULTILINE)
    printed = capsys.readouterr().out.splitlines()
    assert len(shown) == len(printed) == 2
    for one, other in zip(shown, printed, strict=True):
        values = [np.fromstring(line.strip("[]"), sep=" ") for line in (one, other)]
        np.testing.assert_allclose(values[1], values[0], atol=5e-3)
