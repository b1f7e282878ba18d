"""Small faults that no test notices: cosmic-ray changes a module, one place at a time, and runs
its tests.

python -m benchmarks.make.mutation SOURCE TEST... [--count N] [--seed S]

SOURCE is a file or folder of src or fitting, TEST a test file or folder. N places drawn at random
get one change each, in a copy of the repository. The settings are in mutation.toml;
mutation_equivalent.tsv names changes that alter nothing a user could see, with the reason: these
are not tried. A run that is stopped reports what it has tried.
"""

import ast
import contextlib
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.results import help_parser

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def bare(source: str) -> str:
    """Syntax tree without annotations, decorators, and the words of errors and f-strings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        for name in ("annotation", "returns", "decorator_list", "exc"):
            if hasattr(node, name):
                setattr(node, name, None)
        if isinstance(node, ast.JoinedStr):
            node.values = []
    return ast.dump(tree)


def draw(every: Path, session: Path, count: int, seed: int) -> None:
    """Make a session of at most `count` places, one change each, that a test ought to notice."""
    from cosmic_ray.mutating import mutate_code  # pyright: ignore[reportMissingImports]
    from cosmic_ray.plugins import get_operator  # pyright: ignore[reportMissingImports]
    from cosmic_ray.work_db import use_db  # pyright: ignore[reportMissingImports]

    rows = [row.split("\t") for row in (HERE / "mutation_equivalent.tsv").read_text().splitlines()]
    unnoticed: dict[Path, set[str]] = {}
    places = {}
    with use_db(every) as work:
        items = sorted(work.pending_work_items, key=lambda item: str(item.mutations))
    random.Random(seed).shuffle(items)
    for item in items:
        (change,) = item.mutations
        path, kind = change.module_path, change.operator_name.partition("_")[0]
        source = path.read_text()
        if path not in unnoticed:
            judged = [
                source[: at.start()] + changed + source[at.end() :]
                for file, code, changed, _ in rows
                if file == str(path)
                for at in re.finditer(re.escape(code), source)
            ]
            unnoticed[path] = {bare(text) for text in (source, *judged)}
        try:
            operator = get_operator(change.operator_name)()
            changed = bare(mutate_code(source, operator, change.occurrence))
        except SyntaxError:
            continue
        if changed not in unnoticed[path]:
            places.setdefault((path, change.start_pos, kind), item)
        if len(places) == count:
            break
    # Items marked as skipped would count as killed in the report, so the session has none.
    with use_db(session) as work:
        work.add_work_items(places.values())


def main() -> None:
    """Copy the repository, draw the changes, try them and print the report."""
    parser = help_parser(__doc__)
    parser.add_argument("source", help="file or folder to change")
    parser.add_argument("tests", nargs="+", help="what must fail")
    parser.add_argument("--count", type=int, default=30, help="places (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (default: %(default)s)")
    options = parser.parse_args()
    from cosmic_ray.config import (  # pyright: ignore[reportMissingImports]
        load_config,
        serialize_config,
    )

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder, tree = Path(name), Path(name) / "tree"
        every, session = folder / "every.sqlite", folder / "session.sqlite"
        settings = folder / "settings.toml"
        search = os.pathsep.join(str(tree / name) for name in ("src", "fitting", "."))
        programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        environment = {**os.environ, "PYTHONPATH": search, "PATH": programs}

        def cosmic_ray(program: str, *words: str | Path) -> None:
            command = [sys.executable, "-m", f"cosmic_ray.{program}", *words]
            subprocess.run(command, cwd=tree, env=environment, check=True)

        skip = shutil.ignore_patterns("__pycache__", ".*", "results", "_build")
        shutil.copytree(ROOT, tree, ignore=skip)
        config = load_config(HERE / "mutation.toml")
        config["module-path"] = [options.source]
        config["test-command"] += " " + " ".join(options.tests)
        settings.write_text(serialize_config(config))
        # The tests must pass as long as nothing is changed.
        cosmic_ray("cli", "baseline", settings)
        cosmic_ray("cli", "init", settings, every)
        cosmic_ray("tools.filters.operators_filter", every, settings)
        # Paths of a session begin at the top of the repository.
        with contextlib.chdir(tree):
            draw(every, session, options.count, options.seed)
        try:
            cosmic_ray("cli", "exec", settings, session)
        finally:
            cosmic_ray("tools.report", "--surviving-only", "--show-diff", session)


if __name__ == "__main__":
    main()
