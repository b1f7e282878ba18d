"""Where a benchmark's output goes: lines to the screen and to NAME.txt, a picture to NAME.png, in
one folder.

Every file begins with a head, two lines and an empty one:

    made 2026-11-23 at commit 1a2b3c4 by python -m benchmarks.tubes --paints 50; glazejax 0.1.0
    x86_64, AMD EPYC, 2 cores, load 0.3; Python 3.11.7, jax 0.9.2

It says `commit 1a2b3c4 with changes` where code had changes that were not committed, and `no
commit` outside of git. The load is how many processes wanted the processor in the minute before.
Results from before heads told the commit say
`kept at commit` instead, the one in which their numbers came into the repository. `head` reads all
of these. A benchmark of which no result is kept says why: `NO_RESULT = "..."`.
"""

import argparse
import ast
import datetime
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).parent
FOLDER = HERE / "results"
QUICK_FOLDER = Path(tempfile.gettempdir()) / "glazejax-benchmarks"


def add_option(parser: argparse.ArgumentParser, **quick: Any) -> None:
    """`--out FOLDER`, by default the repository's benchmarks/results, and `--quick`.

    Args:
        parser: gets both.
        quick: what other options are with `--quick`, unless they are given: `stacks=50`.
    """
    parser.add_argument(
        "--out", type=Path, default=FOLDER, help="folder for the results (default: %(default)s)"
    )
    parser.add_argument(
        "--quick",
        action=_Quick,
        small=quick,
        help=(
            f"try it at small size: another folder ({QUICK_FOLDER}), and numbers that are worth "
            "nothing"
        ),
    )


class _Quick(argparse.Action):
    """Small settings and another folder, where the user has not said otherwise."""

    def __init__(self, option_strings: Sequence[str], dest: str, small: dict[str, Any], help: str):
        super().__init__(option_strings, dest, nargs=0, default=False, help=help)
        self._small = small

    def __call__(self, parser, namespace, values, option_string=None) -> None:
        setattr(namespace, self.dest, True)
        for name, value in {"out": QUICK_FOLDER, **self._small}.items():
            if getattr(namespace, name, None) == parser.get_default(name):
                setattr(namespace, name, value)


def progress(text: str = "") -> None:
    """Say on a terminal's last line what is being done, and nothing in a log; without text, clear
    it.
    """
    if sys.stderr.isatty():
        print(f"\r{text:<40}" + "\r" * (not text), end="", file=sys.stderr, flush=True)


class Results:
    """Prints what a benchmark says and keeps it; `save` writes it to the folder, with the head.

    results = Results("tubes", options.out, "emcee")
    results("a line")
    results.save(figure)
    """

    def __init__(self, name: str, folder: Path = FOLDER, *packages: str):
        """Name of the file, folder, and packages whose versions the head tells beside Python's and
        jax's.

        Raises:
            SystemExit: small numbers would take the place of the committed ones.
        """
        if "--quick" in sys.argv and Path(folder).resolve() == FOLDER.resolve():
            raise SystemExit(
                f"--quick does not write to {FOLDER}, whose results are of full size; give "
                "another --out"
            )
        self._name, self._stem, self._packages = name, Path(folder) / name, packages
        self._lines: list[str] = []

    def __call__(self, line: str = "") -> None:
        """Print a line, at once, and keep it."""
        # The head comes with the first line: by then the benchmark has told JAX which device to
        #     take.
        if not self._lines:
            self._lines = new_head(self._name, self._packages)
            if "--quick" in sys.argv:
                self._lines += [
                    "Small size (--quick): this shows that it runs; its numbers are worth nothing.",
                    "",
                ]
            print("\n".join(self._lines), flush=True)
        print(line, flush=True)
        self._lines.append(line.rstrip())

    def save(self, figure: "Figure | None" = None) -> None:
        """Write NAME.txt and, with a figure, NAME.png; the folder is made if it is not there."""
        self._stem.parent.mkdir(parents=True, exist_ok=True)
        text = self._stem.with_name(self._stem.name + ".txt")
        text.write_text("\n".join(self._lines) + "\n")
        written = [text.name]
        if figure is not None:
            picture = text.with_suffix(".png")
            figure.savefig(picture, dpi=160, bbox_inches="tight")
            written.append(picture.name)
        print(f"written to {self._stem.parent}: {', '.join(written)}")


@dataclass(frozen=True)
class Head:
    """What a result file says of itself.

    date: when it was made, at the latest.
    commit: at which it was made or kept; empty if it was made outside of git.
    command: that made it; of older files without its options, which were not kept.
    processor: name of it; empty if it was not kept.
    load: processes that wanted the processor in the minute before; None if that was not kept.
    """

    date: str
    commit: str
    command: str
    processor: str = ""
    load: float | None = None


_HEAD = re.compile(
    r"made (?P<date>\d{4}-\d\d-\d\d)(?: or before)?(?:, kept)? "
    r"at (?:commit (?P<commit>[0-9a-f]+)(?: with changes)?|no commit),? by (?P<command>.+?)(?:; "
    r"glazejax \S+)?"
)
# In the second line; old files have it within the first few.
_MACHINE = re.compile(
    r"(?:^|; )\w+, (?P<processor>[^,;\n]+), \d+ cores(?:, load (?P<load>[\d.]+))?", re.MULTILINE
)


def git(*words: str) -> str:
    """What git says of this repository; empty where there is none, or git fails."""
    try:
        done = subprocess.run(
            ["git", *words], cwd=HERE.parent, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def commit() -> str:
    """At which commit this is, as heads say it."""
    # A copy without git may lie in the folder of another repository.
    if not git("ls-files", "benchmarks/results.py"):
        return "no commit"
    changes = git(
        "status", "--porcelain", "--untracked-files=no", "--", "src", "fitting", "benchmarks/*.py"
    )
    return f"commit {git('rev-parse', '--short', 'HEAD')}" + " with changes" * bool(changes)


def new_head(name: str, packages: Sequence[str] = ()) -> list[str]:
    """Head of the result NAME, made now by this process."""
    from benchmarks.timing import environment

    by = f"{_command(module_of(name))}; glazejax {version('glazejax')}"
    return [f"made {datetime.date.today()} at {commit()} by {by}", environment(*packages), ""]


def _command(module: Path) -> str:
    """The command of this process, but for where results go; of paths of this machine only the
    name.
    """
    words, given = ["python", "-m", f"benchmarks.{module.stem}"], iter(sys.argv[1:])
    for word in given:
        if word == "--out":
            next(given, None)
        elif not word.startswith("--out="):
            words.append(Path(word).name if os.sep in word else word)
    return shlex.join(words)


def head(name: str, folder: Path = FOLDER) -> Head:
    """Head of a result file.

    Raises:
        ValueError: there is no such file, or it has none.
    """
    path = Path(folder) / f"{name}.txt"
    if not path.is_file():
        raise ValueError(f"there is no result {name}.txt in {folder}")
    first, *rest = path.read_text().splitlines()[:6] or [""]
    if found := _HEAD.fullmatch(first):
        machine = _MACHINE.search("\n".join(rest))
        return Head(
            date=found["date"],
            commit=found["commit"] or "",
            command=found["command"],
            processor=machine["processor"] if machine else "",
            load=float(machine["load"]) if machine and machine["load"] else None,
        )
    raise ValueError(
        f"{path.name} has no head: run `python -m benchmarks.{module_of(name).stem}` again"
    )


def modules() -> list[Path]:
    """Benchmarks: the modules of this folder that write results, and its packages that do."""
    packages = [path.parent for path in HERE.glob("*/__main__.py")]
    return [
        path
        for path in sorted([*HERE.glob("*.py"), *packages])
        if "Results(" in code_of(path) and path != Path(__file__)
    ]


def code_of(module: Path) -> str:
    """What is run of a benchmark: its own text, or that of its `__main__` if it is a package."""
    return (module / "__main__.py" if module.is_dir() else module).read_text()


def module_of(name: str) -> Path:
    """The benchmark that makes a result: that of its name, or of how its name begins (`scaling`
    makes `scaling_gpu`).

    Raises:
        ValueError: there is none.
    """
    fitting = [path for path in modules() if f"{name}_".startswith(f"{path.stem}_")]
    if not fitting:
        raise ValueError(f"no module of benchmarks makes the result {name!r}")
    return max(fitting, key=lambda path: len(path.stem))


def declared(module: Path, name: str, default: Any = None) -> Any:
    """What a module says at its top, `NEEDS = ("gpu",)`, without importing it: it may need what is
    not installed.
    """
    for node in ast.parse(code_of(module)).body:
        if isinstance(node, ast.Assign) and any(
            isinstance(t, ast.Name) and t.id == name for t in node.targets
        ):
            return ast.literal_eval(node.value)
    return default
