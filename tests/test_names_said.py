"""Names in backquotes stand in the code: in the documents and in docstrings, with their options, files and parts."""

import functools
import importlib
import re
from pathlib import Path

import pytest

from tests.test_docs import PAGES, ROOT, _commands, prose

PACKAGES = [ROOT / "src" / "glazejax", ROOT / "fitting" / "glazefit"]
CODE = [*PACKAGES, ROOT / "benchmarks", ROOT / "tests", ROOT / "docs" / "_ext"]
# Of examples, of other programs, or made in ways that leave no such word in the code.
ELSEWHERE = {
    *("Ultramarine", "MyBlue", "libllvm19", "band_450nm", "X_b", "X_w", "X_ob", "X_ow"),
    *("bxdf", "bsdfs", "cpp", "ClassicalTrustRegion", "cauchy_termination", "solve_triangular"),
    *("glaze_height", "glaze_roughness", "identification_gpu", "savings_gpu", "pyi", "cff", "Retouch"),
    *("Datasets", "ArtistPaint", "cs", "TF_CPP_MIN_LOG_LEVEL", "venv"),
}
# What a page calls a thing that it has made.
MADE = {"studio": "glazejax.studio.Widget"}
# Where a dotted name of the documents may begin.
ROOTS = ("", "glazejax.", "glazefit.", "glazejax.radiative.", "glazejax.appearance.")
# The changelog names what is gone, too.
LIVING = [page for page in PAGES if page.name != "CHANGELOG.md"]
each_page = pytest.mark.parametrize("page", LIVING, ids=lambda path: path.relative_to(ROOT).as_posix())
IDENTIFIER = r"[A-Za-z_]\w*"
DOCSTRING = r'^ *r?(?s:""".*?""")'
MISSING = object()


@functools.cache
def words() -> frozenset[str]:
    """Every word and option of the code, but for those of docstrings and of lines that are comments."""
    found = {*ELSEWHERE, Path(__file__).stem}
    for path in (path for folder in CODE for path in folder.rglob("*.py") if path != Path(__file__)):
        code = re.sub(r"^ *#.*|" + DOCSTRING, "", path.read_text("utf-8"), flags=re.MULTILINE)
        found |= {*path.with_suffix("").parts, *re.findall(rf"(?<!-)--[a-z][a-z-]*|{IDENTIFIER}", code)}
    return frozenset(found)


def spans(markdown: str) -> list[str]:
    """What stands in single backquotes, as one line; not what a role of the site makes of it."""
    markdown = re.sub(r"\{\w+\}`[^`]+`|``[^`].*?``", "", markdown)
    return [" ".join(span.split()) for span in re.findall(r"(?<!`)`([^`]+)`(?!`)", markdown)]


def unknown_of(span: str) -> set[str]:
    """Its words and options that no code says; words in capitals stand for what a reader puts there."""
    said = {*re.findall(r"(?<![\w-])--[a-z][a-z-]*", span), *re.findall(rf"(?<![\w-]){IDENTIFIER}", span)}
    return {word for word in said - words() if not word.isupper()}


def resolved(dotted: str) -> bool:
    """Whether some room, and then attributes of what it offers, lead there."""
    first, _, rest = dotted.partition(".")
    for begun in [root + dotted for root in ROOTS] + [f"{MADE.get(first, first)}.{rest}"]:
        parts = begun.split(".")
        for k in range(len(parts), 0, -1):
            try:
                thing = importlib.import_module(".".join(parts[:k]))
            except ImportError:
                continue
            if all((thing := attribute(thing, name)) is not MISSING for name in parts[k:]):
                return True
            break
    return False


def attribute(thing: object, name: str) -> object:
    """What is called so; a field's annotation where it has no value before it is made; or MISSING."""
    declared = [getattr(part, "__annotations__", {}) for part in getattr(thing, "__mro__", ())]
    return getattr(thing, name, next((fields[name] for fields in declared if name in fields), MISSING))


@functools.cache
def public() -> frozenset[str]:
    """Public names of both packages and the rooms below them that the documents shorten names by."""
    offered = (name for package in PACKAGES for name in importlib.import_module(package.name).__all__)
    return frozenset({*offered, "glazejax", "glazefit", "radiative", "appearance"})


@each_page
def test_names_in_backquotes_stand_in_the_code(page):
    for span in spans(prose(page)):
        assert not unknown_of(span), f"{page.name} says `{span}`, and no code says {unknown_of(span)}"


@each_page
def test_dotted_names_lead_somewhere(page):
    for span in spans(prose(page)):
        found = re.match(rf"(?:gj\.)?({IDENTIFIER}(?:\.{IDENTIFIER})+)(?!\S*/)(?:\(.*\))?$", span)
        if found and found[1].partition(".")[0] in public() and not found[1].endswith((".py", ".csv", ".tsv")):
            assert resolved(found[1]), f"{page.name} says `{span}`"


@each_page
def test_files_in_backquotes_are_there(page):
    """Paths of the repository, and files of Python by their name alone."""
    for span in spans(prose(page)):
        path = re.fullmatch(r"[\w./-]+", span) and span
        if not path or "NAME" in path:
            continue
        if path.startswith(("docs/", "tests/", "src/", "benchmarks/")):
            assert (ROOT / path).exists() or "_build" in path, f"{page.name} says `{span}`"
        elif path.endswith(".py"):
            assert any(next(folder.parent.rglob(path), None) for folder in CODE), f"{page.name} says `{span}`"


@each_page
def test_paints_of_coats_are_in_a_catalogue(page):
    """In code, too: `CobaltBlue:2um`, `0.7*ZincWhite+0.3*CobaltBlue:12um`, `paints["CobaltBlue"]`."""
    from glazejax import catalogue

    known = {*catalogue.load("oils"), *catalogue.load("acrylics"), "Ultramarine", "MyBlue"}  # own tubes
    text = page.read_text("utf-8")
    coats = re.findall(r"([A-Z]\w+(?:\+[\d.*]*[A-Z]\w+)*):[~?]?[\d.]*(?:um|µm|\?)", text)
    said = {name for coat in coats for name in re.findall(r"[A-Z]\w+", coat)}
    said |= set(re.findall(r"paints\[\"(\w+)\"\]", text))
    assert said <= known, f"{page.name} says {said - known}"


@pytest.fixture(scope="module")
def commands() -> dict[str, set[str]]:
    return _commands()


@each_page
def test_command_lines_in_backquotes_have_these_options(page, commands):
    for span in spans(prose(page)):
        found = re.match(r"glazejax ([a-z]+)\b(.*)", span)
        if found:
            given = set(re.findall(r"(?<![\w-])(--[a-z][a-z-]*)", re.sub(r"'[^']*'|\"[^\"]*\"", "", found[2])))
            assert found[1] in commands, f"{page.name} says `{span}`"
            assert given <= commands[found[1]], f"{page.name}: glazejax {found[1]} has no {given - commands[found[1]]}"


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_names_in_docstrings_stand_in_the_code(package):
    wrong = []
    for path in sorted(package.rglob("*.py")):
        for told in re.findall(DOCSTRING, path.read_text("utf-8"), re.MULTILINE):
            for span in spans(told):
                dotted = re.fullmatch(rf"(?:glazejax|glazefit|benchmarks)(?:\.{IDENTIFIER})+", span)
                if unknown_of(span) or (dotted and not resolved(span)):
                    wrong.append(f"{path.relative_to(ROOT)}: `{span}`")
    assert not wrong, "\n".join(wrong)


def test_every_command_and_every_extra_is_told(commands):
    """In the lists of what there is; of extras, those for who changes the program are told to them."""
    import tomllib

    told = (ROOT / "docs" / "what-there-is.md").read_text("utf-8")
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    assert not [name for name in commands if f"| `glazejax {name}` |" not in told]
    assert not [name for name in set(extras) - {"release"} if not re.search(rf"^\| (?:`\w+`, )?`{name}`", told, re.M)]
