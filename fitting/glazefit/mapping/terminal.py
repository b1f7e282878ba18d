"""Messages of `glazejax map` while it maps: windows that were damaged, and the state that is kept
when it is stopped.
"""

import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from glazejax.commands import interrupts

from .store.store import DamagedWindow, MapStore

if TYPE_CHECKING:
    from rich.console import Console


@contextmanager
def name_damage(console: "Console") -> Iterator[None]:
    """Print in a line each the windows that are warned of as damaged."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", DamagedWindow)
        show_warning = warnings.showwarning

        def show(
            message: Warning | str, category: type[Warning], *args: Any, **kwargs: Any
        ) -> None:
            if issubclass(category, DamagedWindow):
                console.print(str(message), style="yellow")
            else:
                show_warning(message, category, *args, **kwargs)

        warnings.showwarning = show
        yield


class _Terminated(KeyboardInterrupt):
    """SIGTERM, which stops a run as Ctrl-C does."""


@contextmanager
def say_what_is_kept(out: Path, console: "Console", *, overwrite: bool) -> Iterator[None]:
    """After Ctrl-C or SIGTERM, say what is finished and how to go on.

    Args:
        out: folder of the map.
        console: to print to.
        overwrite: the command has the option ``--overwrite``, by which it would start over.
    """

    def kept(stopped: str = "Interrupted") -> str:
        try:
            store = MapStore(out)
        except ValueError:
            return f"{stopped}: no map was begun."
        how = " without --overwrite" if overwrite else ""
        return (
            f"{stopped}: {len(store.done())} of {len(store.windows())} windows are finished and "
            f"kept in {out}; the same command{how} goes on from there."
        )

    try:
        with _stopped_by_sigterm(), interrupts.keeping(kept):
            yield
    except KeyboardInterrupt as stop:
        terminated = isinstance(stop, _Terminated)
        console.print(kept("Stopped") if terminated else kept(), style="yellow")
        raise typer.Exit(interrupts.TERMINATED if terminated else interrupts.INTERRUPTED) from None


@contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """Have SIGTERM raise an exception meanwhile."""
    if threading.current_thread() is not threading.main_thread():
        # Python hears signals in its main thread alone.
        yield
        return

    def stop(*_: Any) -> None:
        interrupts.note_signal()
        raise _Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
