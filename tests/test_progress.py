"""Bars and wheels move on a terminal alone: elsewhere they would leave control sequences and empty
lines.
"""

import os
import pty
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from glazejax.commands import progress

ROOT = Path(__file__).parents[1]


@contextmanager
def terminal(monkeypatch) -> Iterator[int]:
    """Stderr is a terminal; what is yielded reads it."""
    for name in ("FORCE_COLOR", "NO_COLOR", "JPY_PARENT_PID", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    ours, theirs = pty.openpty()
    os.set_blocking(ours, False)
    with os.fdopen(theirs, "w") as screen:
        monkeypatch.setattr(sys, "stderr", screen)
        yield ours
    os.close(ours)


def work() -> None:
    """All that a command may show while it works."""
    progress.collect(lambda _: [[1], [2]], 2, "compiling", "searching")
    with progress.follow("fitting"):
        pass


def test_bars_move_on_a_terminal(monkeypatch):
    with terminal(monkeypatch) as seen:
        assert progress.moving()
        work()
        assert b"\x1b[" in os.read(seen, 65536)


@pytest.mark.parametrize("named", [{"JPY_PARENT_PID": "1"}, {"TERM": "dumb"}])
def test_nothing_moves_in_a_notebook_or_on_a_dumb_terminal(monkeypatch, named):
    with terminal(monkeypatch) as seen:
        for name, value in (named | {"FORCE_COLOR": "1"}).items():
            monkeypatch.setenv(name, value)
        work()
        with pytest.raises(BlockingIOError):
            os.read(seen, 65536)


@pytest.mark.parametrize(
    "named", [{}, {"FORCE_COLOR": "1"}, {"NO_COLOR": "1"}, {"TTY_COMPATIBLE": "1"}]
)
def test_nothing_is_written_off_the_terminal(capfd, monkeypatch, named):
    for name, value in named.items():
        monkeypatch.setenv(name, value)
    work()
    assert capfd.readouterr() == ("", "")


def test_nobody_moves_anything_but_by_this():
    """Bars of rich go by FORCE_COLOR, and a status of a console for answers writes to stdout."""
    for folder in ("src", "fitting"):
        for path in (ROOT / folder).rglob("*.py"):
            found = re.search(r"\b(Progress\(\*|track\(range|console\.status\()", path.read_text())
            assert found is None or path.name == "progress.py", path


def test_lines_say_how_far_long_work_is_off_the_terminal(capfd):
    def wait_for(words: str) -> None:
        until = time.monotonic() + 10
        said = ""
        while words not in said and time.monotonic() < until:
            time.sleep(0.01)
            said += capfd.readouterr().err
        assert words in said

    with progress.lines(0.02) as note:
        time.sleep(0.1)
        assert capfd.readouterr() == ("", "")
        note(3, 1036, "mapping")
        wait_for("mapping 3 of 1,036 (0%), after 0 s\n")
        # Nothing new is said by a long piece: the time goes on.
        wait_for("mapping 3 of 1,036 (0%), after 1 s\n")
        # A second of three parts: 1,030 more take three hundred times as long.
        note(6, 1036, "mapping")
        wait_for("mapping 6 of 1,036 (1%), after 1 s, about ")
        note(0, 1, "checking")
        wait_for("\nchecking, after 1 s\n")
        note(70_000, None, "reading")
        wait_for("\nreading 70,000, after ")
    capfd.readouterr()
    time.sleep(0.1)
    assert capfd.readouterr() == ("", "")


def test_short_work_says_nothing_off_the_terminal(capfd):
    with progress.lines() as note:
        note(1, 2, "mapping")
    assert capfd.readouterr() == ("", "")
