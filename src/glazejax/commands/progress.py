"""Tools of commands while they compute: bars on stderr, Ctrl-C that keeps what is finished, and
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

Part = TypeVar("Part", bound=Sized)


def moving() -> bool:
    """Test whether bars may move on stderr: on a terminal that moves its cursor, and not in a
    notebook's ``!glazejax``.

    Rich alone would go by FORCE_COLOR, which is about colour: notebooks and builds set it.
    """
    # Set by Jupyter for its kernels and what they start, which get a terminal of their own that
    # shows each step again.
    if not sys.stderr.isatty() or "JPY_PARENT_PID" in os.environ:
        return False
    from rich.console import Console

    screen = Console(stderr=True)
    return screen.is_terminal and not screen.is_dumb_terminal


def _share(done: int, total: int) -> str:
    return f"{done:,} of {total:,} ({done / max(total, 1):.0%})"


def _duration(seconds: float) -> str:
    """A time in its usual unit."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


@contextmanager
def follow(stage: str, total: int | None = 1) -> Iterator[Progress]:
    """Show the progress of long work: percent, how much, the time gone and the time left, as a bar
    of the stage on a terminal, else as a line now and then.

    Args:
        stage: what is done at first; further stages have other words.
        total: parts of it; 1 where it is one piece.
    """
    # Off the terminal rich leaves blank lines, which would stand before an error.
    if not moving():
        with lines() as note_lines:
            note_lines(0, total, stage)
            yield note_lines
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[count]}")
    times = TimeElapsedColumn(), TimeRemainingColumn()
    with Bar(*columns, *times, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(stage, total=None if total == 1 else total, count="")

        def note(done: int, total: int | None, stage: str, /) -> None:
            steps = None if total == 1 else total
            count = "" if steps is None else _share(done, steps)
            if stage != progress.tasks[0].description:
                progress.reset(task, description=stage)
            progress.update(task, completed=done, total=steps, count=count)

        yield note


@contextmanager
def lines(seconds: float = 10.0) -> Iterator[Progress]:
    """A line on stderr every so many seconds, for long work where no bar may move; what is yielded
    says how far it is.
    """
    began = time.monotonic()
    ended = threading.Event()
    latest = ""
    # Of the stage: what it is, since when, and how much was done before.
    stage = ""
    since = began
    first = 0

    def note(done: int, total: int | None, title: str, /) -> None:
        nonlocal latest, stage, since, first
        now = time.monotonic()
        if title != stage:
            stage = title
            since = now
            first = done
        # A stage that is one piece has nothing to count.
        count = "" if total == 1 else f" {done:,}" if total is None else f" {_share(done, total)}"
        time_left = ""
        if total is not None and total > done > first:
            pace = (now - since) / (done - first)
            time_left = f", about {_duration(pace * (total - done))} left"
        latest = f"{title}{count}, after {{}}{time_left}"

    def say() -> None:
        # Long pieces pass without a call: the time shows that it is alive.
        while not ended.wait(seconds):
            if latest:
                gone = _duration(time.monotonic() - began)
                print(latest.format(gone), file=sys.stderr, flush=True)

    thread = threading.Thread(target=say, daemon=True)
    thread.start()
    try:
        yield note
    finally:
        ended.set()
        thread.join()


class Collected(NamedTuple):
    """Course of a computation in parts: seconds until the first, seconds in all, and whether Ctrl-C
    ended it.
    """

    first: float
    seconds: float
    interrupted: bool


def collect(
    chunks: Callable[[Progress], Iterable[Part]], total: int, first: str, then: str = ""
) -> tuple[list[Part], Collected]:
    """Gather a computation's parts, with a progress bar; an interrupt keeps what is finished.

    Args:
        chunks: gives the parts, each as long as the number of things that it finishes; takes what
            shows progress within a part.
        total: number of things.
        first, then: what is done until the first part, and after; empty where `chunks` says it.

    Raises:
        KeyboardInterrupt: Ctrl-C before any part was finished.
    """
    chunks_done: list[Part] = []
    interrupted = False
    began = time.perf_counter()
    warm = 0.0
    done = 0
    # Parts that are finished are worth waiting for the one that runs.
    with (
        follow(first, total) as note,
        keeping(lambda: None if chunks_done else "Interrupted: nothing was finished."),
    ):
        try:
            for chunk in chunks(note):
                chunks_done.append(chunk)
                warm = warm or time.perf_counter() - began
                done += len(chunk)
                if then:
                    note(done, total, then)
        except KeyboardInterrupt:
            if not chunks_done:
                raise
            interrupted = True
    return chunks_done, Collected(warm, time.perf_counter() - began, interrupted)


def plain_console(*, soft_wrap: bool = False) -> "Console":
    """Where commands print to: texts as they are, of which rich makes no marks of its own.

    Args:
        soft_wrap: whether long lines go on, whatever the width of the screen.
    """
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False, soft_wrap=soft_wrap)


def print_notes(console: "Console", file: Path | str, notes: Sequence[str]) -> None:
    """Print what a reader noticed in a file."""
    for note in notes:
        console.print(f"{file}: {note}", style="dim")


def stop_interrupted(console: "Console", done: int, total: int, things: str) -> NoReturn:
    """Say how much was finished before Ctrl-C, and stop as a shell expects."""
    console.print(
        f"Interrupted: {done} of {total} {things} were finished and written.", style="yellow"
    )
    raise typer.Exit(INTERRUPTED)
