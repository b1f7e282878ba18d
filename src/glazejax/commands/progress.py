"""What commands share while they compute: bars on stderr, Ctrl-C that keeps what is finished, and
notes.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn, TypeVar

import typer

from ..progress import Progress
from .interrupts import INTERRUPTED, keeping

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bar
    from rich.progress import ProgressColumn

Part = TypeVar("Part", bound=Sized)


def moving() -> bool:
    """Whether bars may move on stderr: on a terminal that moves its cursor, and not in a notebook's
    ``!glazejax``.

    Rich alone would go by FORCE_COLOR, which is about colour: notebooks and builds set it.
    """
    # Set by Jupyter for its kernels and what they start, which get a terminal of their own that
    # shows each step anew.
    if not sys.stderr.isatty() or "JPY_PARENT_PID" in os.environ:
        return False
    from rich.console import Console

    screen = Console(stderr=True)
    return screen.is_terminal and not screen.is_dumb_terminal


def bar(*columns: "str | ProgressColumn") -> "Bar":
    """A bar on stderr of these columns of rich, gone when it is done; nothing where nothing may
    move.
    """
    from rich.console import Console
    from rich.progress import Progress as Bar

    # Off the terminal rich leaves blank lines, which would stand before an error.
    return Bar(*columns, console=Console(stderr=True), transient=True, disable=not moving())


@contextmanager
def lines(every: float = 10.0) -> Iterator[Progress]:
    """A line on stderr every so many seconds, for long work where no bar may move; what is yielded
    says how far it is.
    """
    began = time.monotonic()
    ended = threading.Event()
    latest = ""

    def note(done: int, total: int | None, words: str, /) -> None:
        nonlocal latest
        # A stage that is one piece has nothing to count.
        count = "" if total == 1 else f" {done:,}" if total is None else f" {done:,} of {total:,}"
        latest = f"{words}{count}"

    def say() -> None:
        # Long pieces pass without a call: the time shows that it is alive.
        while not ended.wait(every):
            if latest:
                seconds = time.monotonic() - began
                print(f"{latest}, after {seconds:.0f} s", file=sys.stderr, flush=True)

    thread = threading.Thread(target=say, daemon=True)
    thread.start()
    try:
        yield note
    finally:
        ended.set()
        thread.join()


class Collected(NamedTuple):
    """How a computation in parts went: seconds until the first, seconds in all, and whether Ctrl-C
    ended it.
    """

    first: float
    seconds: float
    interrupted: bool


def collect(
    chunks: Iterable[Part], total: int, first: str, then: str
) -> tuple[list[Part], Collected]:
    """Gather a computation's parts, with a progress bar; an interrupt keeps what is finished.

    Args:
        chunks: parts, each as long as the number of things that it finishes.
        total: number of things.
        first, then: what is done until the first part, and after.

    Raises:
        KeyboardInterrupt: Ctrl-C before any part was finished.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

    parts: list[Part] = []
    interrupted = False
    began = time.perf_counter()
    warm = 0.0
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    # Parts that are finished are worth waiting for the one that runs.
    with (
        bar(*columns, TimeElapsedColumn()) as progress,
        keeping(lambda: None if parts else "Interrupted: nothing was finished."),
    ):
        task = progress.add_task(first, total=total)
        try:
            for part in chunks:
                parts.append(part)
                warm = warm or time.perf_counter() - began
                progress.update(task, advance=len(part), description=then)
        except KeyboardInterrupt:
            if not parts:
                raise
            interrupted = True
    return parts, Collected(warm, time.perf_counter() - began, interrupted)


@contextmanager
def doing(words: str) -> Iterator[Callable[[str], None]]:
    """Say on stderr what is being done, with a turning wheel, while it is; what is yielded says it
    in other words.
    """
    from rich.console import Console

    if not moving():
        yield lambda _: None
        return
    with Console(stderr=True).status(words) as status:
        yield status.update


def drawing(count: int) -> Callable[[], None]:
    """A bar for so many pictures; what is returned moves it on by one."""
    from rich.console import Console
    from rich.progress import track

    steps = iter(
        track(
            range(count),
            "drawing",
            console=Console(stderr=True),
            transient=True,
            disable=not moving(),
        )
    )
    next(steps, None)

    def step() -> None:
        next(steps, None)

    return step


@contextmanager
def reading(path: Path) -> Iterator[Progress]:
    """A bar once a file has been read for a second; what is yielded goes to `read_spectra` as
    ``progress``.
    """
    from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn

    shown = bar(
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TimeRemainingColumn(),
    )
    name = path.name.replace("[", "\\[")
    task = shown.add_task(name, total=None)
    start = time.monotonic()

    def move(done: int, total: int | None, words: str) -> None:
        if time.monotonic() - start > 1.0:
            shown.start()
            shown.update(task, completed=done, total=total, description=f"{words} {name}")

    try:
        yield move
    finally:
        # A bar that never began would end with an empty line.
        if shown.live.is_started:
            shown.stop()


def print_notes(console: "Console", file: Path | str, notes: Sequence[str]) -> None:
    """Print what a reader noticed in a file."""
    for note in notes:
        console.print(f"{file}: {note}", style="dim", markup=False)


def stop_interrupted(console: "Console", done: int, total: int, things: str) -> NoReturn:
    """Say how much was finished before Ctrl-C, and stop as a shell expects."""
    console.print(
        f"[yellow]Interrupted: {done} of {total} {things} were finished and written.[/yellow]"
    )
    raise typer.Exit(INTERRUPTED)
