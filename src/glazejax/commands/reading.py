"""A bar on the terminal while a large file is read."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..io.source import Progress

# A bar that comes and goes at once is only in the way.
_PATIENCE = 1.0


@contextmanager
def reading(path: Path) -> Iterator[Progress]:
    """What to give to `read_spectra` as ``progress``: a bar on a terminal once it has taken a second, else nothing."""
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    columns = (TextColumn("reading {task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    bar = Bar(*columns, console=console, transient=True)
    task = bar.add_task(path.name.replace("[", "\\["), total=None)
    start = time.monotonic()

    def told(done: int, size: int | None) -> None:
        if console.is_terminal and time.monotonic() - start > _PATIENCE:
            bar.start()
            bar.update(task, completed=done, total=size)

    try:
        yield told
    finally:
        # Rich ends a bar that never began with an empty line.
        if bar.live.is_started:
            bar.stop()
