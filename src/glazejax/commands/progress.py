"""What commands share while they compute: bars on stderr, Ctrl-C that keeps what is finished, and notes."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from rich.console import Console

INTERRUPTED = 130
"""What a shell reports of a program stopped from the keyboard."""

Part = TypeVar("Part", bound=Sized)


class Collected(NamedTuple):
    """How a computation in parts went: seconds until the first, seconds in all, and whether Ctrl-C ended it."""

    first: float
    seconds: float
    interrupted: bool


def collect(chunks: Iterable[Part], total: int, first: str, then: str) -> tuple[list[Part], Collected]:
    """Gather a computation's parts, with a progress bar; an interrupt keeps what is finished.

    Args:
        chunks: parts, each as long as the number of things that it finishes.
        total: number of things.
        first, then: what is done until the first part, and after.

    Raises:
        KeyboardInterrupt: Ctrl-C before any part was finished.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    screen = Console(stderr=True)
    parts: list[Part] = []
    interrupted, began, warm = False, time.perf_counter(), 0.0
    # Off the terminal rich leaves blank lines, which would stand before an error.
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as progress:
        bar = progress.add_task(first, total=total)
        try:
            for part in chunks:
                parts.append(part)
                warm = warm or time.perf_counter() - began
                progress.update(bar, advance=len(part), description=then)
        except KeyboardInterrupt:
            if not parts:
                raise
            interrupted = True
    return parts, Collected(warm, time.perf_counter() - began, interrupted)


@contextmanager
def doing(words: str) -> Iterator[None]:
    """Say on stderr what is being done, with a turning wheel, while it is; nothing off the terminal."""
    from rich.console import Console

    screen = Console(stderr=True)
    if not screen.is_terminal:
        yield
        return
    with screen.status(words):
        yield


def drawing(count: int) -> Callable[[], None]:
    """A bar for so many pictures; what is returned moves it on by one."""
    from rich.console import Console
    from rich.progress import track

    screen = Console(stderr=True)
    steps = iter(track(range(count), "drawing", console=screen, transient=True, disable=not screen.is_terminal))
    next(steps, None)

    def step() -> None:
        next(steps, None)

    return step


@contextmanager
def reading(path: Path) -> Iterator[Callable[[int, int | None], None]]:
    """A bar once a file has been read for a second; what is yielded goes to `read_spectra` as ``progress``."""
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("reading {task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    screen = Console(stderr=True)
    bar = Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal)
    task, start = bar.add_task(path.name.replace("[", "\\["), total=None), time.monotonic()

    def told(done: int, size: int | None) -> None:
        if time.monotonic() - start > 1.0:
            bar.start()
            bar.update(task, completed=done, total=size)

    try:
        yield told
    finally:
        # A bar that never began would end with an empty line.
        if bar.live.is_started:
            bar.stop()


def print_notes(console: "Console", file: Path | str, notes: Sequence[str]) -> None:
    """Print what a reader noticed in a file."""
    for note in notes:
        console.print(f"[dim]{file}: {note}[/dim]")


def stop_interrupted(console: "Console", done: int, total: int, things: str) -> NoReturn:
    """Say how much was finished before Ctrl-C, and stop as a shell expects."""
    console.print(f"[yellow]Interrupted: {done} of {total} {things} were finished and written.[/yellow]")
    raise typer.Exit(INTERRUPTED)
