"""What a page is answered, without a page: files are read, searches are started, what is wrong is
one sentence.
"""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax import colour
from glazejax.studio.jobs import Jobs
from glazejax.studio.messages import pack, unpack
from glazejax.studio.session import Session

from .test_seen import JUNK, STACK


@pytest.fixture(scope="module")
def ask():
    """Asks a session; returns its answers."""
    answers = []
    session = Session(Jobs({}), lambda message: answers.append(unpack(message)))

    def call(header, arrays=None, rest=b""):
        answers.clear()
        session.handle(pack(header, arrays) + rest)
        return [(head, found) for head, found, _ in answers]

    return call


def test_messages_come_back_as_they_were():
    arrays = {"one": np.arange(6, dtype=np.float32).reshape(2, 3), "none": np.zeros(0)}
    header, found, rest = unpack(pack({"type": "x", "words": "µ"}, arrays) + b"more")
    assert header == {"type": "x", "words": "µ"}
    assert rest == b"more"
    assert_array_equal(found["one"], arrays["one"])
    assert found["none"].shape == (0,)


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"\xff\xff\xff\xff{}",
        "nonsense",
        "[1]",
        '{"a": 1}',
        pack({"type": "x"}, {"a": np.ones(9)})[:-8],
        pack({"type": "x"})[:-4] + b'":["',
    ],
)
def test_bytes_that_are_no_message_are_refused(message):
    with pytest.raises(ValueError, match="message"):
        unpack(message)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"type": "nothing"}, "does not know the message 'nothing'"),
        ({"type": "see", "stack": STACK}, "does not know the message 'see'"),
        ({"type": "start", "task": "recipes", "stack": {}}, "this is no stack"),
        ({"type": "start", "task": "recipes", "stack": STACK}, "'recipes' is not installed"),
        ({"type": "file", "name": "empty.csv"}, "empty.csv is empty"),
    ],
)
def test_what_is_wrong_is_one_sentence(ask, message, words):
    [(header, _)] = ask(message)
    assert header["type"] == "error"
    assert header["about"] == message["type"]
    assert words in header["words"]
    assert "\n" not in header["words"]


def test_the_page_is_told_all_that_it_needs_to_see(ask):
    [(header, _)] = ask({"type": "hello"})
    data = header["data"]
    listed = {entry["name"]: entry for entry in data["paints"]}
    assert len(listed) == 39
    assert listed["LeadWhite"]["unknown"]
    assert listed["acrylics/TitaniumWhite"]["label"] == "Titanium White"
    blue = gj.catalogue.pigment("CobaltBlue")
    found = listed["CobaltBlue"]["curves"]
    assert_allclose(found["absorption"], blue.absorption, rtol=1e-5)
    assert "modes" in found
    assert {"D65", "A", "FL11"} <= set(data["lamps"])
    assert len(data["eye"]["y"]) == 421


@pytest.mark.parametrize("message", ["start", "stop", "file", "hello"])
def test_junk_in_any_place_is_told_and_never_a_fault(ask, message):
    """Whatever stands where something else should: an answer, and no exception that was
    not meant.
    """
    usual = {"stack": STACK, "task": "none", "name": "a", "options": {}, "page": "p"}
    places = [(key,) for key in usual]
    places += [
        ("stack", key)
        for key in ("coats", "ground", "geometry", "refractive_index", "pigments", "version")
    ]
    places += [("stack", "coats", 0, "um"), ("stack", "coats", 0, "paint", "CobaltBlue")]
    for place in places:
        for junk in (*JUNK, float("nan"), int("9" * 400)):
            given = json.loads(json.dumps({"type": message, **usual}))
            holder = given
            for key in place[:-1]:
                holder = holder[key]
            holder[place[-1]] = junk
            for header, _ in ask(given):
                assert "failed at this" not in header.get("words", ""), (
                    place,
                    junk,
                    header["words"],
                )


def test_a_dropped_file_of_spectra(ask):
    content = b"nm,grey\n" + b"".join(b"%d,0.2\n" % w for w in range(400, 701, 10))
    [(header, found)] = ask({"type": "file", "name": "one.csv"}, rest=content)
    assert (header["films"], header["names"]) == (False, ["grey"])
    assert_allclose(
        found["rgb"][0],
        255 * np.asarray(colour.srgb(found["wavelengths"].astype(float), np.full(31, 0.2))),
        atol=0.5,
    )
    [(header, _)] = ask(
        {"type": "file", "name": "poem.csv"}, rest=b"roses are red\nviolets are blue\n"
    )
    assert header["type"] == "error"
    assert header["words"].startswith("poem.csv")
    films = gj.samples.path().read_bytes()
    [(header, _)] = ask({"type": "file", "name": "films.csv"}, rest=films)
    assert header["films"]
