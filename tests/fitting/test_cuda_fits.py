"""The compiled programs of the inverse commands, as they are called, lower for an NVIDIA GPU and
call no host.
"""

import numpy as np
import pytest

import glazejax.radiative.stack  # noqa: F401  what is watched must be loaded
from glazefit import find_recipes, identify, lab_target, recover_films, simulate_films
from tests.cuda import Programs, watch

from .palette import GRID, palette

pytestmark = pytest.mark.slow


def watched(monkeypatch) -> Programs:
    """Every jitted function of both packages, after a call that has loaded them."""
    return watch(monkeypatch, "glazejax", "glazefit")


def films(count: int):
    rng = np.random.default_rng(0)
    k, s = rng.uniform(0.1, 1.0, (count, GRID.size)), rng.uniform(1.0, 4.0, (count, GRID.size))
    return simulate_films(GRID, k, s, names=[str(i) for i in range(count)])


def test_identification(monkeypatch):
    spectra = np.clip(np.linspace(0.2, 0.6, GRID.size) * np.array([[1.0], [1.2]]), 0, 1)[None]
    grounds = np.array([[0.05], [0.85]]) * np.ones((2, GRID.size))
    identify(GRID, spectra, palette()[:3], ground=grounds, max_paints=1)
    programs = watched(monkeypatch)
    identify(GRID, spectra, palette()[:3], ground=grounds, max_paints=2)
    assert any("identify" in name for name in programs.seen)
    assert programs.trouble == {}


def test_recipes(monkeypatch):
    def find():
        return find_recipes(lab_target((60.0, 20.0, 20.0)), palette()[:3], max_paints=2, count=1)

    find()
    programs = watched(monkeypatch)
    find()
    assert any("recipe" in name for name in programs.seen)
    assert programs.trouble == {}


def test_recovery_film_by_film(monkeypatch):
    recover_films(films(2))
    programs = watched(monkeypatch)
    recover_films(films(2))
    assert any("recover" in name for name in programs.seen)
    assert programs.trouble == {}
