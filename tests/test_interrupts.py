"""Ctrl-C ends a command at once, with one sentence: while modules load, and while no Python runs."""

import signal
import subprocess
import sys
import threading
import time

import pytest

# A call of C that is some minutes long, as XLA's of a large program: Python hears nothing.
_BUSY = """
import hashlib, sys
from glazejax.commands import interrupts

interrupts.watch()
with {context}:
    try:
        print("ready", flush=True)
        hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
    except KeyboardInterrupt:
        print("heard")
"""


def hear_ctrl_c() -> None:
    """A shell starts what runs in the background deaf to Ctrl-C; a terminal's commands hear it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def started(program: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        preexec_fn=hear_ctrl_c,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.5)  # From the line to the call behind it.
    return process


def interrupted(process: subprocess.Popen[str]) -> tuple[int, str]:
    process.send_signal(signal.SIGINT)
    try:
        out, words = process.communicate(timeout=20)
    finally:
        process.kill()
    assert "Traceback" not in words
    assert out == ""
    return process.returncode, words


@pytest.mark.parametrize(
    ("context", "words"),
    [
        ("interrupts.loading()", "Interrupted while a program was compiled or ran."),
        ("interrupts.keeping(lambda: 'Interrupted: 3 of 4 windows.')", "3 of 4 windows."),
    ],
)
def test_no_call_of_c_is_waited_for(context, words):
    status, said = interrupted(started(_BUSY.format(context=context)))
    assert status == 130
    assert said.strip().endswith(words)


def test_what_is_finished_is_waited_for_once():
    process = started(_BUSY.format(context="interrupts.keeping(lambda: None)"))
    assert process.stderr is not None
    process.send_signal(signal.SIGINT)
    # Nothing waits for ever where the sentence does not come.
    guard = threading.Timer(20.0, process.kill)
    guard.start()
    assert "Ctrl-C again ends at once" in process.stderr.readline()
    guard.cancel()
    assert process.poll() is None
    status, said = interrupted(process)
    assert status == 130
    assert said.strip() == "Interrupted while a program was compiled or ran."


def test_where_python_runs_it_is_an_exception_as_ever():
    program = _BUSY.replace("hashlib.pbkdf2_hmac", "while True: pass #")
    process = started(program.format(context="interrupts.keeping(lambda: 'kept')"))
    process.send_signal(signal.SIGINT)
    try:
        assert process.communicate(timeout=20) == ("heard\n", "")
    finally:
        process.kill()
    assert process.returncode == 0


def test_threads_that_compile_are_not_waited_for():
    program = """
import hashlib, threading
from glazejax.commands import interrupts

interrupts.watch()
long = "sha256", b"", b"", 2**31 - 1
threading.Thread(target=hashlib.pbkdf2_hmac, args=long).start()
try:
    print("ready", flush=True)
    while True:
        pass
except KeyboardInterrupt:
    interrupts.leave("words")
"""
    assert interrupted(started(program)) == (130, "\nwords\n")


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.3, 0.6, 1.0, 1.5, 2.0])
def test_no_traceback_while_modules_load(after):
    process = subprocess.Popen(
        [sys.executable, "-m", "glazejax", "recipe", "--help"],
        preexec_fn=hear_ctrl_c,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, words = process.communicate(timeout=60)
    assert "Traceback" not in words
    # Before Python hears it, on a slow machine, the signal itself ends the process: -2 here, and
    # 130 in a shell.
    assert process.returncode in (0, 130, -signal.SIGINT)
