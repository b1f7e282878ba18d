"""Ctrl-C that ends a command at once: while modules load, and while XLA compiles for a minute and
Python hears nothing.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

INTERRUPTED = 130
"""What a shell reports of a program stopped from the keyboard."""
TERMINATED = 128 + signal.SIGTERM
"""What it reports of one that SIGTERM has stopped."""

_SHOW_CURSOR = "\x1b[?25h"
_COMPILING = "Interrupted while a program was compiled or ran."
_WAITING = (
    "Ctrl-C: what runs now ends first, so that what is finished can be kept; Ctrl-C again ends at "
    "once."
)

_heard = threading.Event()
_watching = False
_loading = False
_kept: list[Callable[[], str | None]] = []
_writes: socket.socket | None = None
"""Where the system writes signals' numbers; held, so that it stays open."""


def watch() -> None:
    """From here on end the process at Ctrl-C where Python itself cannot.

    Only in a process whose main thread this is, and in which nobody else handles Ctrl-C.
    """
    global _watching, _writes
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return
    reads, _writes = socket.socketpair()
    _writes.setblocking(False)
    # That happens whatever the main thread is busy with.
    signal.set_wakeup_fd(_writes.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _hear)
    threading.Thread(target=_listen, args=(reads,), daemon=True).start()
    _watching = True


def note_signal() -> None:
    """Note that Python has heard SIGINT or SIGTERM: one's own handlers call it."""
    _heard.set()


def _hear(number: int, frame: Any) -> None:
    note_signal()
    if _loading:
        # A module that is half there answers an exception with others.
        leave()
    signal.default_int_handler(number, frame)


def _listen(reads: socket.socket) -> None:
    times = 0
    while number := reads.recv(1):
        sent = number[0]
        if sent not in (signal.SIGINT, signal.SIGTERM):
            continue
        times += 1
        if sent == signal.SIGINT and times == 1 and signal.getsignal(sent) is not _hear:
            # Somebody else hears it meanwhile, and ends when that is good.
            continue
        # Seconds that Python has to hear of Ctrl-C; it does between two of its own steps.
        if _heard.wait(1.0):
            _heard.clear()
            continue
        message = _kept[-1]() if _kept else _COMPILING
        if message is None and times == 1:
            print(_WAITING, file=sys.stderr, flush=True)
            continue
        leave(message or _COMPILING, 128 + sent)


@contextmanager
def loading() -> Iterator[None]:
    """While modules load Ctrl-C ends the process without an exception: nothing is lost."""
    global _loading
    before = _loading
    _loading = True
    try:
        yield
    finally:
        _loading = before


@contextmanager
def keeping(message: Callable[[], str | None]) -> Iterator[None]:
    """Meanwhile say in these words what is kept where the process is ended in the midst of it.

    Args:
        message: called from another thread; None asks to end what runs first, once.
    """
    _kept.append(message)
    try:
        yield
    finally:
        _kept.remove(message)


def leave(message: str = "", status: int = INTERRUPTED) -> NoReturn:
    """End the process, at once where it is watched: without waiting for threads that compile."""
    if not _watching:
        sys.exit(status)
    with contextlib.suppress(Exception):
        sys.stdout.flush()
        if sys.stderr.isatty():
            sys.stderr.write(_SHOW_CURSOR)
        if message:
            sys.stderr.write(f"\n{message}\n")
        sys.stderr.flush()
    os._exit(status)
