"""What the studio's searches take of a stack: its ground, and one's own paints."""

import numpy as np
import pytest

from glazefit.identify import identify
from glazefit.recipe import recipe
from glazefit.studio import tasks

from .coats import coat

STACK = {"glazejax": "stack", "coats": [coat("CobaltBlue", 2)]}
GRID = np.arange(400.0, 701.0, 10.0)
FILM = {"wavelengths": GRID.tolist(), "reflectance": [0.4] * GRID.size}
# Known from 420 to 680 nm, and the oils from 400 to 700.
TUBE = {"wavelengths": [420, 680], "absorption": [1e4, 1e4], "scattering": [1e5, 1e5]}


class Started(Exception):
    """A search was started."""


@pytest.fixture
def start(monkeypatch):
    """Starts a task on a stack with changes: the search's options, and the words reported."""
    options = {}

    def search(*_, **asked):
        options.update(asked)
        raise Started

    monkeypatch.setattr(recipe, "find_recipes", search)
    monkeypatch.setattr(identify, "identify_chunks", search)

    def call(task, choices, **changes):
        words = []
        with pytest.raises(Started):
            task({**FILM, "stack": {**STACK, **changes}, "options": choices}, words.append)
        return options, words

    return call


@pytest.mark.parametrize("task", [tasks.recipes, tasks.identification])
def test_a_ground_of_paint_is_refused(task):
    """It would count as grey, whatever its colour."""
    request = {
        **FILM,
        "stack": {**STACK, "ground": {"paint": {"ChromeYellow": 1}}},
        "options": {"below": "ground"},
    }
    with pytest.raises(ValueError, match="choose white, black, grey or a measured one"):
        task(request, lambda _: None)


def test_a_film_that_hides_needs_no_ground(start):
    """A measured ground may be of fewer wavelengths; it counts where it is asked for."""
    ground = {"wavelengths": [420, 680], "reflectance": [0.5, 0.5]}
    options, _ = start(tasks.identification, {"below": "opaque"}, ground=ground)
    assert options["ground"] is None
    assert options["opaque"]
    options, _ = start(tasks.identification, {"below": "ground"}, ground=0.3)
    assert options["ground"] == 0.3


def test_own_paints_that_are_left_out_are_named(start):
    short = "Mine is known from 420 to 680 nm; a search needs 400 to 700 nm"
    pigments = {"Mine": TUBE}
    for task in (tasks.recipes, tasks.identification):
        _, words = start(task, {"below": "white"}, pigments=pigments)
        assert words[-1].endswith(short)
    request = {**FILM, "stack": {**STACK, "pigments": pigments}, "options": {"own": True}}
    with pytest.raises(ValueError, match=short):
        tasks.recipes(request, lambda _: None)
