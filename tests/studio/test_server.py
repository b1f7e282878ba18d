"""The studio's door: token, Host, Origin, sizes; and its command."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from glazejax.extras import advice
from glazejax.stacks import stack_from_dict, write_stack
from glazejax.studio import jobs, server
from glazejax.studio.messages import MOST_BYTES, unpack
from tests.commands import invoke

from ..refusals import refusal
from .browser import Served


@pytest.fixture(scope="module")
def served():
    found = Served(
        tasks={
            "echo": "tests.studio.test_server:echo",
            "fail": "tests.studio.test_server:fail",
            "wait": "tests.studio.test_server:wait",
        }
    )
    yield found
    found.stop()


def echo(asked, report):
    report("echoing")
    return asked["options"]


def fail(asked, report):
    raise ValueError("nothing comes of this")


run = partial(invoke, "studio")


def get(link: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    try:
        with urlopen(Request(link, headers=headers), timeout=30) as found:
            return found.status, found.read().decode(), dict(found.headers)
    except HTTPError as error:
        return error.code, error.read().decode(), dict(error.headers)


def test_the_page_loads_nothing_from_elsewhere(served):
    status, text, headers = get(served.studio.link)
    assert status == 200
    assert "<noscript>" in text
    policy = headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
    assert "unsafe" not in policy
    for name in ("main.js", "studio.js", "style.css"):
        status, text, _ = get(served.studio.link + name)
        assert status == 200
        assert "https://" not in text
        assert "http://" not in text.replace("http://www.w3.org/2000/svg", "")


def test_it_listens_on_this_computer_alone(served):
    assert served.studio._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("", {"Host": "evil.example"}, 400),
        ("", {"Origin": "http://evil.example"}, 403),
        ("main.js", {"Origin": "null"}, 403),
        ("../../etc/passwd", {}, 403),
        ("%2e%2e%2fserver.py", {}, 403),
        ("nothing.js", {}, 404),
    ],
)
def test_others_are_refused(served, path, headers, status):
    found, text, _ = get(served.studio.link + path, **headers)
    assert found in {status, 404}
    assert "script" not in text


def test_without_its_token_nothing_is_answered(served):
    base = f"http://127.0.0.1:{served.studio.port}/"
    for path in ("", "guess/", "guess/main.js", f"{'x' * 32}/"):
        status, text, _ = get(base + path)
        assert status == 403
        assert "open the link that glazejax studio printed" in text


@pytest.mark.parametrize(
    ("token", "origin"),
    [(None, "http://evil.example"), (None, None), ("guess", "own"), (None, "null")],
)
def test_sockets_of_others_are_refused(served, token, origin):
    studio = served.studio
    link = f"ws://127.0.0.1:{studio.port}/{token or studio.token}/socket"
    asked = f"http://127.0.0.1:{studio.port}" if origin == "own" else origin
    found = None if asked is None else Origin(asked)
    with pytest.raises((InvalidStatus, ConnectionClosed)), connect(link, origin=found) as refused:
        refused.recv(timeout=10)


def soon(true, seconds=60):
    """Assert that something comes true in time."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def join(studio):
    link = f"ws://127.0.0.1:{studio.port}/{studio.token}/socket"
    return connect(link, origin=Origin(f"http://127.0.0.1:{studio.port}"), max_size=None)


@pytest.fixture
def talk(served):
    with join(served.studio) as found:
        yield found


def until(talk, *types: str) -> dict:
    while True:
        header = unpack(talk.recv(timeout=120))[0]
        if header["type"] in types and "progress" not in header:
            return header


def running(talk, page: str) -> list[str]:
    """Searches of a page, as it is told when it comes."""
    talk.send(json.dumps({"type": "hello", "page": page}))
    return until(talk, "hello")["running"]


STACK = {"glazejax": "stack", "coats": [{"paint": {"Eosin": 1}, "um": 1}]}


def test_a_message_that_is_none_is_a_sentence(talk):
    talk.send("{")
    assert "not JSON" in until(talk, "error")["words"]
    talk.send(b"\xff\xff\xff\xff")
    assert "header" in until(talk, "error")["words"]


def test_a_message_that_is_too_large_ends_the_socket(talk):
    with contextlib.suppress(ConnectionClosed):
        talk.send(b"\0" * (MOST_BYTES + 1))
    with pytest.raises(ConnectionClosed):
        talk.recv(timeout=30)


def test_a_search_runs_beside_and_its_errors_are_told(talk):
    ask = {"type": "start", "task": "echo", "name": "one", "stack": STACK, "options": {"a": 1}}
    talk.send(json.dumps(ask))
    assert until(talk, "job")["result"] == {"a": 1}
    talk.send(json.dumps({**ask, "task": "fail"}))
    assert until(talk, "job")["error"] == "nothing comes of this"


def wait(asked, report):
    """Until a file is there."""
    import time
    from pathlib import Path

    while not Path(asked["options"]["path"]).exists():
        time.sleep(0.05)
    return "done"


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_search_survives_a_lost_connection(served, tmp_path, when):
    studio = served.studio
    path = tmp_path / "go"
    ask = {
        "type": "start",
        "task": "wait",
        "name": "one 1",
        "stack": STACK,
        "options": {"path": str(path)},
    }
    with join(studio) as first:
        assert running(first, "mine") == []
        first.send(json.dumps(ask))
        while unpack(first.recv(timeout=120))[0].get("progress", {}).get("seconds", 0) < 0.4:
            pass
    if when == "before":
        path.touch()
        soon(lambda: "mine one 1" in studio.jobs._unheard)
    with join(studio) as other:
        assert running(other, "other") == []
    with join(studio) as again:
        assert running(again, "mine") == ["one 1"]
        path.touch()
        assert until(again, "job")["result"] == "done"


def test_a_search_whose_page_stays_away_ends(served, tmp_path, monkeypatch):
    monkeypatch.setattr(jobs, "PATIENCE", 0.1)
    studio = served.studio
    given = {"options": {"path": str(tmp_path / "never")}}

    def tell(name, message):
        pass

    studio.jobs.start("gone one", "wait", given, tell)
    studio.jobs.leave(tell)
    soon(lambda: studio.jobs._running == {}, 30)


def test_a_page_that_is_back_before_it_was_missed_keeps_its_search(served, tmp_path, monkeypatch):
    """A lost connection may be noticed when the page has another one already."""
    monkeypatch.setattr(jobs, "PATIENCE", 0.1)
    studio, path, answers = served.studio, tmp_path / "go", []

    def lost(name, message):
        pass

    def again(name, message):
        if "progress" not in message:
            answers.append((name, message["result"]))

    studio.jobs.start("back one", "wait", {"options": {"path": str(path)}}, lost)
    studio.jobs.come_back("back", again)
    studio.jobs.leave(lost)
    time.sleep(0.5)
    path.touch()
    soon(lambda: answers)
    assert answers == [("back one", "done")]


def test_a_process_that_the_next_search_took_is_not_ended():
    """It is taken in the moment after its answer, before that search's thread is done."""
    searches = jobs.Jobs({"echo": "tests.studio.test_server:echo"})
    taken = []
    answers = []

    class Times(dict):
        def __setitem__(self, task, seconds):
            taken.append(searches._idle.pop())

    searches._took = Times()

    def tell(name, message):
        if "progress" not in message:
            answers.append(message)

    searches.start("one", "echo", {"options": {}}, tell)
    soon(lambda: answers)
    [process] = taken
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.5)
    process.kill()
    process.wait()


def test_what_can_be_searched_is_registered():
    """In pyproject, and so in an installed glazejax."""
    import tomllib
    from importlib import import_module
    from pathlib import Path

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    listed = project["entry-points"]["glazejax.studio"]
    assert set(listed) == {"recipes", "identify", "recover"}
    for target in listed.values():
        module, _, name = target.partition(":")
        assert callable(getattr(import_module(module), name))
    assert isinstance(jobs.Jobs().tasks, dict)


def test_the_command_prints_its_link_and_ends_with_ctrl_c(tmp_path):
    stack = write_stack(tmp_path / "stack.json", stack_from_dict(STACK))
    code = (
        "import typer; from glazejax.studio.command import studio; app = typer.Typer(); "
        "app.command()(studio); "
        f"app(['--no-open', {str(stack)!r}])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=os.environ
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    link, _, fragment = line.removeprefix("The studio is at ").strip().partition("#")
    assert "Eosin" in fragment
    assert get(link)[0] == 200
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 0
    assert "The studio is closed" in process.stdout.read()


def test_what_the_command_cannot_do_is_told(tmp_path):
    assert "--port is 99999" in str(run("--port", "99999").exception)
    assert isinstance(run(tmp_path / "none.json").exception, FileNotFoundError)


def test_the_page_as_one_file(tmp_path):
    """Own paints and a stack to begin with are in it, and no host is named; nothing is replaced."""
    stack = write_stack(tmp_path / "stack.json", stack_from_dict(STACK))
    mine, page = tmp_path / "mine.csv", tmp_path / "studio.html"
    rows = [f"Mine</script>,{w},1000,50000" for w in range(400, 701, 10)]
    mine.write_text("\n".join(["pigment,wavelength_nm,absorption,scattering", *rows]) + "\n")
    given = stack, "--page", page, "--catalogue", mine
    done = run(*given)
    assert done.exit_code == 0, done.exception
    assert "MB" in done.output
    text = page.read_text()
    assert len(text.encode()) < 1_000_000
    assert text.count("</script>") == 2
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    assert data["begin"]["coats"][0]["paint"] == {"Eosin": 1.0}
    assert data["paints"][-1]["name"] == "Mine</script> (own)"
    assert "default-src 'none'" in text
    for word in ("src=", "@import", "https://", "fetch("):
        assert word not in text, word
    again = run(*given)
    assert isinstance(again.exception, FileExistsError)
    assert "--overwrite" in str(again.exception)
    assert run(*given, "--overwrite").exit_code == 0


def test_a_port_that_is_taken_is_one_sentence(served):
    from glazejax.studio.command import serve

    with refusal(f"--port {served.studio.port} cannot be used"):
        serve(served.studio.port, "", open_browser=False)


def test_a_missing_package_is_one_sentence(monkeypatch):
    def missing(*modules):
        raise ModuleNotFoundError(advice(modules[0]))

    monkeypatch.setattr(server, "require", missing)
    with refusal(r'pip install "glazejax\[studio\]"', ModuleNotFoundError):
        server.Studio()
