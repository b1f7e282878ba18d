"""Which notebooks differ from a git revision: in their text, or in the code whose names they use.

    python docs/stale_notebooks.py [--since REVISION]

prints their names, one a line. `GLAZEJAX_NOTEBOOKS="first-glaze coats"` before the command that
builds the site has only these run.
"""

import argparse
import ast
import hashlib
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = {
    path.stem: path
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.md"))
    if "{code-cell}" in path.read_text(encoding="utf-8")
}
"""Name of a notebook -> its file."""
_TOPS = {"glazejax": ROOT / "src", "glazefit": ROOT / "fitting", "benchmarks": ROOT}
_CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(?:---\n.*?\n---\n)?(.*?)^```$", re.M | re.S)


def home_of(name: str) -> Path | None:
    """The module that defines a dotted public name, by the packages' own lists (`__init__.pyi`)."""
    top, *inside = name.replace("glazejax.fit.", "glazefit.").split(".")
    if top not in _TOPS:
        return None
    home = _TOPS[top] / top
    for word in inside:
        stub = home / "__init__.pyi"
        text = stub.read_text(encoding="utf-8") if stub.is_file() else ""
        listed = re.search(rf"^from \.(\S+) import \(?\s*{word} as", text, re.MULTILINE)
        step = home.joinpath(*listed[1].split(".")) if listed else home / word
        if not step.is_dir() and not step.with_suffix(".py").is_file():
            break
        home = step
    return home if home.is_dir() else home.with_suffix(".py")


def _names(cells: str) -> set[str]:
    """Dotted names that Python code takes from modules, such as `glazejax.catalogue.load`."""
    tree = ast.parse(cells)
    aliases: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            aliases |= {one.asname or one.name: one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            aliases |= {one.asname or one.name: f"{node.module}.{one.name}" for one in node.names}
    names = set(aliases.values()) - {"glazejax", "glazefit"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            first, _, rest = ast.unparse(node).partition(".")
            if first in aliases and re.fullmatch(r"[\w.]+", rest):
                names.add(f"{aliases[first]}.{rest}")
    return names


def files_of(notebook: Path) -> set[Path]:
    """A notebook's own file, and all files of the rooms whose names its cells use.

    A room is a folder without the folders in it, or a module that lies in none. What these import
    in turn does not count: their tests see that.
    """
    names = _names("\n".join(_CELL.findall(notebook.read_text(encoding="utf-8"))))
    files = {notebook}
    for home in filter(None, map(home_of, names)):
        room = home if home.is_dir() else home.parent
        alone = home.is_file() and room in [folder / top for top, folder in _TOPS.items()]
        files |= {home} if alone else {path for path in room.iterdir() if path.is_file()}
    return files


def digest(notebook: Path) -> str:
    """What a notebook's outputs depend on, in one word."""
    files = sorted(files_of(notebook))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def stale_notebooks(revision: str) -> list[str]:
    """Names of the notebooks of which a file differs from a git revision."""

    def git(*words: str) -> set[Path]:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
        return {ROOT / line for line in done.stdout.splitlines()}

    changed = git("diff", "--name-only", "--no-renames", revision, "--")
    changed |= git("ls-files", "--others", "--exclude-standard")
    return [name for name, path in NOTEBOOKS.items() if files_of(path) & changed]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--since", default="HEAD", metavar="REVISION", help="default: %(default)s")
    for name in stale_notebooks(parser.parse_args().since):
        print(name)
