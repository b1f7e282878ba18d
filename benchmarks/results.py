"""Results of benchmarks: a table for people in NAME.txt, a picture in NAME.png, and each number that
README or docs quote in NAME.json, all in one folder.

    python -m benchmarks.results        date, commit, load and command of every result

A benchmark records a number where it computes it:

    results = Results("scaling", options.out, "nanodisort")
    results("1000000   0.62 s")
    results.record(million_seconds=quantity(0.6231, "s", digits=2))
    results.save(figure)

`python -m benchmarks.fill` writes `million_seconds` wherever a text has the mark
`<!--scaling.million_seconds-->`. NAME.json holds `{"made": {date, commit, command, machine, load,
versions}, "values": {name: {value, unit, digits, form, n}}}`. The load is how many processes wanted
the processor in the minute before. The commit has a `+` where code had changes that were not
committed, and is empty outside of git.
"""

import argparse
import datetime
import functools
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).parent
FOLDER = HERE / "results"
QUICK_FOLDER = Path(tempfile.gettempdir()) / "glazejax-benchmarks"

Form = Literal["f", "e", "g", "s", ","]


@dataclass(frozen=True)
class Quantity:
    """A number and how texts write it.

    value: before rounding, as computed.
    unit: that follows it, such as `%` or `times`; empty if it has none.
    digits: after the point; of form `g` and `s` all digits that count.
    form: `f` 0.62, `e` 6e-1, `g` 0.62 or 6.2e-9, `s` 550 for 546.4 with two digits, `,` 10,000.
    n: how many samples it is taken over; None if that says nothing.
    """

    value: float
    unit: str = ""
    digits: int = 2
    form: Form = "f"
    n: int | None = None

    def as_json(self) -> dict[str, Any]:
        """The entry of NAME.json, without what is usual."""
        value = float(f"{self.value:.10g}")
        entry: dict[str, Any] = {"value": int(value) if value.is_integer() else value}
        entry |= {"unit": self.unit, "digits": self.digits}
        if self.form != "f":
            entry["form"] = self.form
        if self.n is not None:
            entry["n"] = self.n
        return entry


def quantity(
    value: Any, unit: str = "", digits: int = 2, *, form: Form = "f", n: int | None = None
) -> Quantity:
    """A number to record, see `Quantity`.

    Raises:
        ValueError: it is not finite.
    """
    number = float(value)
    if not abs(number) < float("inf"):
        raise ValueError(f"{number} is not a number that a text can quote")
    return Quantity(value=number, unit=unit, digits=digits, form=form, n=n)


def percent(share: Any, digits: int = 0, *, n: int | None = None) -> Quantity:
    """A share from 0 to 1, to record in per cent; see `quantity`."""
    return quantity(100 * share, "%", digits, n=n)


def quantities(
    values: dict[str, Any],
    unit: str = "",
    digits: int = 2,
    *,
    form: Form = "f",
    n: int | None = None,
) -> dict[str, Quantity]:
    """Numbers by name that texts write in one way; see `quantity`."""
    return {name: quantity(value, unit, digits, form=form, n=n) for name, value in values.items()}


def ends(key: str, values: Iterable[Any]) -> dict[str, Any]:
    """Least and largest of some values, as KEY_least and KEY_most."""
    listed = list(values)
    return {f"{key}_least": min(listed), f"{key}_most": max(listed)}


def help_parser(text: str | None, out: Path | None = None) -> argparse.ArgumentParser:
    """A parser whose help is a module's docstring, its lines as they are.

    Args:
        text: the docstring.
        out: where results go by default; adds the option `--out`.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m {_module()}",
        description=text,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    if out is not None:
        words = "where results go (default: %(default)s)"
        parser.add_argument("--out", type=Path, default=out, help=words)
    return parser


def command_line(
    text: str | None, quick: dict[str, Any] | None = None, **sizes: tuple[Any, Any, str]
) -> argparse.ArgumentParser:
    """The options of a benchmark: `--out FOLDER`, by default the repository's benchmarks/results,
    `--quick`, and numbers that say how large it is.

    Args:
        text: the docstring of the benchmark.
        quick: what options that are added later are with `--quick`, unless they are given.
        sizes: of each number its usual value, that with `--quick`, and what it is:
            `stacks=(1000, 50, "random stacks")`.
    """
    parser = help_parser(text, FOLDER)
    small = dict(quick or {})
    for name, (usual, few, words) in sizes.items():
        small[name] = few
        parser.add_argument(
            f"--{name}", type=type(usual), default=usual, help=f"{words} (default: %(default)s)"
        )
    parser.add_argument(
        "--quick",
        action=_Quick,
        small=small,
        help=(
            f"try it at small size: another folder ({QUICK_FOLDER}), and numbers that are worth "
            "nothing"
        ),
    )
    return parser


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
    """Prints what a benchmark says, keeps it with the numbers it records; `save` writes both."""

    def __init__(self, name: str, folder: Path = FOLDER, *packages: str):
        """Name of the files, their folder, and packages whose versions stand next to Python's and
        jax's.

        Raises:
            SystemExit: small numbers would take the place of the committed ones.
        """
        if "--quick" in sys.argv and Path(folder).resolve() == FOLDER.resolve():
            raise SystemExit(
                f"--quick does not write to {FOLDER}, whose results are of full size; give "
                "another --out"
            )
        self._stem, self._packages = Path(folder) / name, packages
        self._lines: list[str] = []
        self._made: dict[str, Any] = {}
        self._values: dict[str, Quantity] = {}

    def __call__(self, line: str = "") -> None:
        """Print a line, or several, at once, and keep it."""
        # The head comes with the first line: by then the benchmark has set for JAX which device to
        # take.
        if not self._lines:
            self._begin()
        print(line, flush=True)
        self._lines += [part.rstrip() for part in line.split("\n")]

    def record(self, **values: Quantity) -> None:
        """Keep numbers that texts may quote, by name.

        Raises:
            ValueError: a name is taken.
        """
        if taken := sorted(values.keys() & self._values.keys()):
            raise ValueError(f"recorded twice: {', '.join(taken)}")
        self._values |= values

    def save(self, figure: "Figure | None" = None) -> None:
        """Write NAME.txt, NAME.json and, with a figure, NAME.png; the folder is made if it is not
        there.
        """
        if not self._lines:
            self._begin()
        self._stem.parent.mkdir(parents=True, exist_ok=True)
        text = self._stem.with_name(f"{self._stem.name}.txt")
        text.write_text("\n".join(self._lines) + "\n")
        numbers = text.with_suffix(".json")
        numbers.write_text(_json(self._made, self._values))
        written = [text.name, numbers.name]
        if figure is not None:
            picture = text.with_suffix(".png")
            figure.savefig(picture, dpi=160, bbox_inches="tight")
            written.append(picture.name)
        print(f"written to {self._stem.parent}: {', '.join(written)}")

    def _begin(self) -> None:
        self._made = new_head(self._packages)
        self._lines = in_words(self._made)
        if "--quick" in sys.argv:
            self._lines += [
                "Small size (--quick): this shows that it runs; its numbers are worth nothing.",
                "",
            ]
        print("\n".join(self._lines), flush=True)


def _json(made: dict[str, Any], values: dict[str, Quantity]) -> str:
    """A value a line, so that a change of one shows as one."""
    lines = [
        f"  {json.dumps(name)}: {json.dumps(one.as_json(), ensure_ascii=False)}"
        for name, one in values.items()
    ]
    inner = "{\n" + ",\n".join(lines) + "\n }" if lines else "{}"
    return f'{{\n "made": {json.dumps(made, ensure_ascii=False)},\n "values": {inner}\n}}\n'


def new_head(packages: Sequence[str] = ()) -> dict[str, Any]:
    """Where a result comes from, of this process now: date, commit, command, machine, load,
    versions.
    """
    from benchmarks.timing import machine, versions

    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "date": str(datetime.date.today()),
        "commit": commit(),
        "command": _command(),
        "machine": machine(),
        "load": None if load is None else round(load, 1),
        "versions": versions("glazejax", "jax", *packages),
    }


def in_words(made: dict[str, Any]) -> list[str]:
    """The head of NAME.txt."""
    where = (
        f"commit {made['commit'].replace('+', ' with changes')}" if made["commit"] else "no commit"
    )
    load = "" if made["load"] is None else f", load {made['load']}"
    libraries = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
    return [
        f"made {made['date']} at {where} by {made['command']}",
        f"{made['machine']}{load}; {libraries}",
        "",
    ]


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
    """At which commit this is, with a `+` where code differs from it; empty outside of git."""
    # A copy without git may lie in the folder of another repository.
    if not git("ls-files", "benchmarks/results.py"):
        return ""
    sources = ("src", "fitting", "benchmarks/*.py")
    changes = git("status", "--porcelain", "--untracked-files=no", "--", *sources)
    return git("rev-parse", "--short", "HEAD") + "+" * bool(changes)


def _module() -> str:
    """The module that this process runs."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    return re.sub(r"\.__main__$", "", spec.name) if spec else Path(sys.argv[0]).stem


def _command() -> str:
    """The command of this process, but for where results go; of paths of this machine only the
    name.
    """
    words, options = ["python", "-m", _module()], iter(sys.argv[1:])
    for word in options:
        if word == "--out":
            next(options, None)
        elif not word.startswith("--out="):
            words.append(Path(word).name if os.sep in word else word)
    return shlex.join(words)


def names(folder: Path = FOLDER) -> list[str]:
    """Names of the results in a folder."""
    return sorted(
        path.stem for path in Path(folder).glob("*.txt") if path.with_suffix(".json").is_file()
    )


def read(name: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Content of NAME.json: `made` and `values`.

    Raises:
        ValueError: there is no such file.
    """
    path = Path(folder) / f"{name}.json"
    if not path.is_file():
        raise ValueError(f"there is no result {path.name} in {path.parent.name}")
    return json.loads(path.read_text("utf-8"))


def rounded(value: float, style: str) -> str:
    """A number as texts write it. A half goes up, as people round: 3.55 is 3.6.

    Raises:
        ValueError: there is no such style.
    """
    if not re.fullmatch(r",?\.\d+[feg]|\ds", style):
        raise ValueError(f"no style is called {style!r}; there are .1f, ,.0f, .2e, .3g and 2s")
    # Twelve digits, so that a half is a half after a division too.
    exact = Decimal(f"{value:.12g}")
    if style.endswith("s"):
        places = Decimal(1).scaleb(exact.adjusted() - int(style[0]) + 1)
        return f"{exact.quantize(places, ROUND_HALF_UP):.0f}"
    if style.endswith("f"):
        places = Decimal(1).scaleb(-int(style.rstrip("f").partition(".")[2]))
        exact = exact.quantize(places, ROUND_HALF_UP)
    return re.sub(r"e\+?(-?)0*(?=\d)", r"e\1", format(exact, style))


def figure(name: str, style: str | None = None, folder: Path = FOLDER) -> str:
    """A recorded value as text: `figure("scaling.million_seconds")` is `0.6`.

    Raises:
        ValueError: there is no such result, value or style.
    """
    result, _, key = name.partition(".")
    values = _values(result, folder)
    if key not in values:
        raise ValueError(f"{result}.json has no value {key!r}; it has {', '.join(sorted(values))}")
    one = values[key]
    digits, form = one["digits"], one.get("form", "f")
    usual = {"s": f"{digits}s", ",": f",.{digits}f"}.get(form, f".{digits}{form}")
    return rounded(one["value"], style or usual)


@functools.cache
def _values(result: str, folder: Path) -> dict[str, dict]:
    return read(result, folder)["values"]


def main() -> None:
    print(f"{'result':<24}{'date':<12}{'commit':<11}{'load':>5}  command")
    for name in names():
        made = read(name)["made"]
        load = "" if made["load"] is None else f"{made['load']:.1f}"
        print(f"{name:<24}{made['date']:<12}{made['commit']:<11}{load:>5}  {made['command']}")


if __name__ == "__main__":
    main()
