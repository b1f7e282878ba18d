"""Searches that take long, each in a process of its own: the page stays quick, and a search can be
stopped at once.

What can be searched is registered as entry points `glazejax.studio`, so that this package never
imports the inverse
one: name -> ``module:function`` of (what is asked for, report) -> result, all plain JSON. A process
that is done waits for the next search, with its programs compiled.
"""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib.metadata import entry_points
from typing import Any

from .messages import JsonObject

MOST = 2
"""Searches at a time."""
PATIENCE = 120.0
"""Seconds that a search whose page is gone goes on: connections are lost, and pages come back."""

Send = Callable[[str, JsonObject], None]
"""Tells a page of a search by its name; a page that has come back has another one."""


class Jobs:
    """Starts and stops searches.

    Args:
        tasks: name -> ``module:function``; those installed if left out.
    """

    def __init__(self, tasks: Mapping[str, str] | None = None):
        if tasks is None:
            tasks = {point.name: point.value for point in entry_points(group="glazejax.studio")}
        self.tasks: dict[str, str] = dict(tasks)
        self._running: dict[str, subprocess.Popen[str]] = {}
        self._idle: list[subprocess.Popen[str]] = []
        self._senders: dict[str, Send] = {}
        self._unheard: dict[str, JsonObject] = {}
        self._took: dict[str, float] = {}
        self._ends: dict[str, threading.Timer] = {}
        self._lock = threading.Lock()

    def start(self, name: str, task: str, request: Mapping[str, Any], send: Send) -> None:
        """Start a search; `send` gets its progress, then its result or its error.

        Raises:
            ValueError: the search is not installed, or enough of them run.
        """
        if task not in self.tasks:
            raise ValueError(
                f"{task!r:.60} is not installed here; there are "
                f"{', '.join(sorted(self.tasks)) or 'none'}"
            )
        with self._lock:
            if name in self._running:
                raise ValueError("this search runs already; stop it first")
            if len(self._running) >= MOST:
                raise ValueError(f"{MOST} searches run already; stop one first")
            # A process that waits has its programs compiled already.
            process = self._idle.pop() if self._idle else _process()
            self._running[name] = process
            self._senders[name] = send
        threading.Thread(
            target=self._follow, args=(name, task, request, process), daemon=True
        ).start()

    def leave(self, send: Send) -> None:
        """A page is gone: the searches that were told to it go on for a while, and their answers
        are kept. Those that it asked about again meanwhile, by another connection, have another
        `send`.
        """
        with self._lock:
            names = [name for name, sender in self._senders.items() if sender == send]
            for name in names:
                del self._senders[name]
        # Connections are lost, and pages come back: only then are the searches stopped.
        for name in names:
            self._ends[name] = timer = threading.Timer(PATIENCE, self._give_up, [name])
            timer.daemon = True
            timer.start()

    def names(self, page: str) -> list[str]:
        """Names of a page's searches: those that run, and those whose answer waits for it."""
        with self._lock:
            return [
                name for name in (*self._running, *self._unheard) if name.startswith(f"{page} ")
            ]

    def come_back(self, page: str, send: Send) -> None:
        """A page is there again: it gets the answers that came meanwhile, and those to come."""
        for name in self.names(page):
            if (timer := self._ends.pop(name, None)) is not None:
                timer.cancel()
            with self._lock:
                answer = self._unheard.pop(name, None)
                # What still runs sends to the page again.
                if answer is None:
                    self._senders[name] = send
            if answer is not None:
                send(name, answer)

    def _give_up(self, name: str) -> None:
        # The page did not come back.
        if name not in self._senders:
            self.stop(name)

    def _send(self, name: str, message: JsonObject) -> None:
        """To the page, or kept for it if it is an answer and the page is gone."""
        with self._lock:
            send = self._senders.get(name)
            # An answer ends the search; it is kept where the page is gone.
            if "progress" not in message:
                self._senders.pop(name, None)
                if send is None:
                    self._unheard[name] = message
        if send is not None:
            send(name, message)

    def stop(self, name: str) -> None:
        """End a search, if it runs, and forget its answer."""
        with self._lock:
            self._unheard.pop(name, None)
            self._senders.pop(name, None)
            process = self._running.pop(name, None)
        if (timer := self._ends.pop(name, None)) is not None:
            timer.cancel()
        if process is not None:
            process.kill()
            process.wait()

    def close(self) -> None:
        """End everything."""
        for name in list(self._running):
            self.stop(name)
        with self._lock:
            idle, self._idle = self._idle, []
        for process in idle:
            process.kill()
            process.wait()

    def _follow(
        self, name: str, task: str, request: Mapping[str, Any], process: subprocess.Popen[str]
    ) -> None:
        """Hand a search to its process, and its answers on."""
        began = time.monotonic()
        stage = "starting"
        done = threading.Event()

        # The page hears twice a second how long it takes, whatever the search is doing.
        def beat() -> None:
            while not done.wait(0.5):
                state = {
                    "seconds": time.monotonic() - began,
                    "words": stage,
                    "usual": self._took.get(task),
                }
                self._send(name, {"progress": state})

        threading.Thread(target=beat, daemon=True).start()
        answer: JsonObject | None = None
        # A process that ends before its answer gives none.
        with suppress(OSError, ValueError):
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(json.dumps({"target": self.tasks[task], "given": request}) + "\n")
            process.stdin.flush()
            for line in process.stdout:
                message = json.loads(line)
                # A line of words says what is being done; any other is the answer.
                if "words" not in message:
                    answer = message
                    break
                stage = message["words"]
        done.set()
        with self._lock:
            # Who stopped a search has taken it off the list and ended its process.
            stopped = self._running.pop(name, None) is None
            # One process waits for the next search, no more.
            waits = answer is not None and not stopped and not self._idle
            if waits:
                self._idle.append(process)
        if stopped:
            return
        if answer is None:
            words = (
                f"the search ended before it was done (exit status {process.wait()}); try it again"
            )
            self._send(name, {"error": words})
            return
        # The next search of this kind shows how long it usually takes.
        if "result" in answer:
            self._took[task] = time.monotonic() - began
        # One that waited may run the next search by now: it is not looked up again.
        if not waits:
            process.kill()
        self._send(name, answer | {"seconds": time.monotonic() - began})


def _process() -> subprocess.Popen[str]:
    """A process that waits for searches, importing what this one does."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(
        [sys.executable, "-m", "glazejax.studio.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    )
