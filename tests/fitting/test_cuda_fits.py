"""The compiled programs of the inverse commands, as they are called, lower for an NVIDIA GPU and
call no host.
"""

import numpy as np
import pytest

import glazejax.radiative.stack  # noqa: F401  what is watched must be loaded
from glazefit import find_recipes, identify, lab_target, recover_films, simulate_films
from tests.cuda import watch

from .palette import GRID, PALETTE

pytestmark = pytest.mark.slow


def check(monkeypatch, name, call, first=None):
    """Assert that the programs of a call lower, after one that has loaded them."""
    (first or call)()
    programs = watch(monkeypatch, "glazejax", "glazefit")
    call()
    assert any(name in program for program in programs.seen)
    assert programs.trouble == {}


def test_identification(monkeypatch):
    spectra = np.clip(np.linspace(0.2, 0.6, GRID.size) * np.array([[1.0], [1.2]]), 0, 1)[None]
    grounds = np.array([[0.05], [0.85]]) * np.ones(GRID.size)

    def find(most):
        identify(GRID, spectra, PALETTE[:3], ground=grounds, max_paints=most)

    check(monkeypatch, "identify", lambda: find(2), lambda: find(1))


def test_recipes(monkeypatch):
    target = lab_target((60.0, 20.0, 20.0))
    check(monkeypatch, "recipe", lambda: find_recipes(target, PALETTE[:3], max_paints=2, count=1))


def test_recovery_film_by_film(monkeypatch):
    rng = np.random.default_rng(0)
    k, s = rng.uniform(0.1, 1.0, (2, GRID.size)), rng.uniform(1.0, 4.0, (2, GRID.size))
    check(monkeypatch, "recover", lambda: recover_films(simulate_films(GRID, k, s, names="ab")))
