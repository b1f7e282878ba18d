"""The studio in a notebook: its stack is read and set in Python, and its page is the same one."""

import base64
import json
import time
from typing import Any

import numpy as np
import pytest
import traitlets
from benchmarks.studio.studio import go_to
from numpy.testing import assert_allclose

import glazejax as gj
from glazejax import colour
from glazejax.stacks import stack_from_dict
from glazejax.studio import Widget, one_file
from glazejax.studio.messages import pack, unpack

from .browser import start_browser
from .coats import coat

STACK = {"glazejax": "stack", "coats": [coat("Eosin", 4)]}


@pytest.fixture
def wired(monkeypatch):
    """A widget, and what it sends to its page."""
    found: Any = Widget(STACK, tasks={})
    sent = []
    monkeypatch.setattr(
        found, "send", lambda content, buffers: sent.append((content, bytes(buffers[0])))
    )
    yield found, sent
    found.close()


def test_its_stack_is_read_and_set(wired):
    found: Any = wired[0]
    assert found.stack["coats"] == [{"paint": {"Eosin": 1.0}, "um": 4.0}]
    found.stack = {**STACK, "coats": []}
    assert found.stack["coats"] == []
    found.set_trait("stack", stack_from_dict(STACK))
    assert found.stack["ground"] == "card"
    with pytest.raises(ValueError, match="there is no pigment"):
        found.stack = {**STACK, "coats": [coat("Nothing", 4)]}
    assert found.stack["ground"] == "card"
    assert isinstance(type(found).stack, traitlets.TraitType)
    assert "stack" in found.keys


def test_the_pages_stack_is_not_sent_back_in_other_words(wired, monkeypatch):
    """Parts by weight stay parts: as shares they would replace the page's stack, and its undo."""
    widget = wired[0]
    messages = []
    monkeypatch.setattr(widget, "_send", lambda message, buffers=None: messages.append(message))
    mixed = {"paint": {"CobaltBlue": 3, "ZincWhite": 1}, "um": 2}
    stack = {**STACK, "version": 1, "ground": "card", "refractive_index": 1.5, "coats": [mixed]}
    widget.set_state({"stack": {**stack, "geometry": "45:0"}})
    assert widget.stack["coats"] == [mixed]
    assert "update" not in [message.get("method") for message in messages]
    # A stack set in Python reaches the page, a dictionary that was edited too.
    edited = {**STACK, "coats": [coat("Eosin", 5)]}
    for um in (5, 6):
        messages.clear()
        edited["coats"][0]["um"] = um
        widget.stack = edited
        assert "update" in [message.get("method") for message in messages]


def test_a_question_is_answered(wired):
    found, sent = wired
    found._take(found, {"glaze": "question"}, [pack({"type": "hello"})])
    content, message = sent[-1]
    assert content == {"glaze": "answer"}
    assert unpack(message)[0]["type"] == "hello"
    found._take(found, "nonsense", [])


def test_its_one_module_has_nothing_to_import():
    text = one_file.bundle("notebook")
    assert "\nimport " not in text
    assert text.count("\nexport ") == 1


_PAGE = """
const [text, css, stack] = arguments;
const sheet = new CSSStyleSheet();
sheet.replaceSync(css);
document.adoptedStyleSheets = [sheet];
window.questions = [];
const calls = {}, state = window.state = {stack};
const encode = (buffer) => btoa(String.fromCharCode(...new Uint8Array(buffer)));
const model = {
  get: (name) => state[name],
  set: (name, value) => { state[name] = value; },
  save_changes: () => { window.saved = JSON.stringify(state.stack); },
  send: (content, _, buffers) => window.questions.push(encode(buffers[0])),
  on: (name, call) => { calls[name] = call; },
  off: () => {},
};
window.answer = (message) => {
  const bytes = Uint8Array.from(atob(message), (c) => c.charCodeAt(0));
  calls["msg:custom"]({glaze: "answer"}, [new DataView(bytes.buffer)]);
};
window.follow = (stack) => { state.stack = stack; calls["change:stack"](); };
const el = document.createElement("div");
document.body.replaceChildren(el);
import(URL.createObjectURL(new Blob([text], {type: "text/javascript"}))).then((m) => m.default.render({model, el}));
"""


@pytest.mark.browser
def test_its_page_is_the_same_studio(wired, tmp_path):
    """A model that carries messages between Chromium and the widget, as a notebook's does."""
    found, sent = wired
    with start_browser(tmp_path) as browser:
        go_to(browser, "about:blank")
        js = browser.execute_script
        js(_PAGE, one_file.bundle("notebook"), found._css, found.stack)

        def carry(until):
            end = time.monotonic() + 60
            while time.monotonic() < end:
                for question in js("return (window.questions ?? []).splice(0)"):
                    found._take(found, {"glaze": "question"}, [base64.b64decode(question)])
                for _, message in sent:
                    js("window.answer(arguments[0])", base64.b64encode(message).decode())
                sent.clear()
                if js(f"return {until}"):
                    return
                time.sleep(0.05)
            raise AssertionError(f"{until}: {browser.get_log('browser')}")

        carry("!!document.querySelector('.glaze-studio')?.dataset.seen")
        code = """
            const c = document.querySelector("[data-at=swatch]");
            return [...c.getContext("2d").getImageData(c.width / 4, c.height / 2, 1, 1).data].slice(0, 3)"""
        carry("document.querySelector('.glaze-studio').dataset.busy === ''")
        # What the page sees, Python reads, and it is what the library says.
        seen = js("return window.state.seen")
        stack = stack_from_dict(STACK)
        expected = np.asarray(gj.reflectance(stack.glaze(), stack.instrument))
        assert_allclose(seen["reflectance"], expected, atol=1e-4)
        rgb = 255 * np.asarray(colour.srgb(seen["wavelengths"], expected))
        assert_allclose(seen["rgb"], rgb, atol=1)
        assert np.abs(np.array(js(code)) - seen["rgb"]).max() <= 1
        found.seen = seen
        assert found.seen["lab"] == seen["lab"]
        # The page's slider reaches Python, and Python's stack the page.
        js(
            "const s = document.querySelector('[data-at=slider]'); s.value = 1; "
            "s.dispatchEvent(new Event('input'))"
        )
        carry("!!window.saved && JSON.parse(window.saved).coats[0].um === 10")
        found.stack = json.loads(js("return window.saved"))
        assert found.stack["coats"][0]["um"] == 10
        js("window.follow(arguments[0])", {**found.stack, "coats": []})
        carry("document.querySelectorAll('.coat').length === 0")
