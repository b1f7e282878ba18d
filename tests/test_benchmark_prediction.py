"""`benchmarks.paint.prediction`: which films are left out, and a scan that goes on where it was
stopped.
"""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmarks.paint import prediction, readings_of_mixtures

RECIPES = {
    "red": {"Red": 100.0, "White": 0.0},
    "pale": {"Red": 10.0, "White": 90.0},
    "deep": {"Red": 95.0, "Black": 5.0},
}


@pytest.fixture
def scanned(tmp_path, monkeypatch):
    """Runs the scan with fits that only count; the names of what was fitted, and the file of lines
    that are done.
    """
    fitted, part = [], tmp_path / "results" / "prediction_scan.part"

    def leave_out(films, recipes, name, **given):
        if name == "thickness 0.45" and not part.with_suffix(".go").exists():
            raise KeyboardInterrupt
        fitted.append(name)
        found = SimpleNamespace(
            names=("pale", "deep"),
            predicted=np.full((2, 2), len(fitted)),
            fitted=np.ones((2, 2)),
            inside=np.ones(2),
        )
        return SimpleNamespace(out=found)

    monkeypatch.setattr(prediction, "leave_out", leave_out)
    monkeypatch.setattr(prediction, "commit", lambda: "commit 1a2b3c4")
    recipes = RECIPES | {"deep": {"Red": 95.0, "BoneBlack": 5.0}}
    films: Any = SimpleNamespace(names=tuple(recipes))
    return lambda: prediction.scan(films, recipes, part), fitted, part


def test_only_mixtures_are_left_out():
    """A masstone is no mixture, also where its recipe names other paints with no weight."""
    assert prediction.mixtures(tuple(RECIPES), RECIPES) == ["pale", "deep"]


def test_a_scan_goes_on_where_it_was_stopped(scanned):
    run, fitted, part = scanned
    with pytest.raises(KeyboardInterrupt):
        run()
    before = len(fitted)
    assert 0 < before < len(prediction.SCAN)
    assert len(json.loads(part.read_text())) == before
    part.with_suffix(".go").touch()
    lines = run().splitlines()
    assert len(fitted) == len(set(fitted)) == len(prediction.SCAN)
    assert len(lines) == 1 + len(prediction.SCAN)
    assert [float(line.split()[0]) for line in lines[1:]] == list(
        range(1, len(prediction.SCAN) + 1)
    )


@pytest.mark.parametrize("before", ["commit 1a2b3c4", "commit 5d6e7f8 with changes", "no commit"])
def test_a_scan_of_other_code_starts_anew(scanned, monkeypatch, before):
    run, fitted, part = scanned
    part.with_suffix(".go").parent.mkdir()
    part.with_suffix(".go").touch()
    monkeypatch.setattr(prediction, "commit", lambda: before)
    run()
    monkeypatch.setattr(prediction, "commit", lambda: before.replace("1a2b3c4", "5d6e7f8"))
    run()
    assert len(fitted) == 2 * len(prediction.SCAN)


def test_a_film_has_no_say_in_how_far_films_scatter():
    """Two spreads, over two cards: what one film alone gains by the second is chosen for the
    others, not for itself.
    """
    off = np.ones((2, 2, 3))
    off[1, :, 0] = 0.1
    off[1, :, 1:] = 1.1
    np.testing.assert_array_equal(readings_of_mixtures.choose_without(off), [0, 1, 1])


def test_a_film_with_more_of_one_paint_is_an_addition_to_the_other():
    """To 100 parts with one of black come 10 more: 11 of 110. White is not added by the pound."""
    recipes = {
        "pale": {"White": 99.0, "Black": 1.0},
        "deep": {"White": 90.0, "Black": 10.0},
        "other": {"White": 90.0, "Red": 10.0},
        "pure": {"White": 100.0, "Black": 0.0},
    }
    ((first, then, paint, amount),) = readings_of_mixtures.additions([*recipes], recipes)
    assert (first, then, paint) == ("pale", "deep", "Black")
    mixed = {"White": 0.99, "Black": 0.01 + amount}
    np.testing.assert_allclose(mixed["Black"] / sum(mixed.values()), 0.1)
