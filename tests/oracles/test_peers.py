"""Other programs give the same numbers on work that they can do; each is skipped where it is not
installed.
"""

import functools
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from benchmarks.peers import (
    Streams,
    Work,
    adding_doubling,
    cdisort,
    installed,
    ours,
    pythonic_disort,
    sasktran,
)
from numpy.testing import assert_allclose

import glazejax as gj

pytestmark = pytest.mark.optimised

# Pale and dark, thinner and thicker layers. What peers cannot do is left out: an albedo of one
# (PythonicDISORT), a thickness of zero and the derivative by an albedo of zero (sasktran2), very
# thin layers (all converge slowly there).
WORK = Work(
    albedo=np.array([[0.999, 0.3, 0.9], [0.02, 0.95, 0.5], [0.8, 0.9999, 0.1], [0.6, 0.6, 0.98]]),
    optical_thickness=np.array(
        [[0.15, 1.5, 4.0], [0.3, 0.2, 2.0], [6.0, 0.5, 0.7], [1.0, 12.0, 0.15]]
    ),
    ground=0.35,
    cos_incidence=0.72,
    cos_viewing=0.44,
)


def needs(peer: ModuleType) -> Any:
    """Marks a test that is skipped where the peer is missing."""
    words = f"{peer.PACKAGE} is not installed; pip install '.[benchmark]' brings it"
    return pytest.mark.skipif(not installed(peer.PACKAGE), reason=words)


@functools.cache
def expected(index: float) -> np.ndarray:
    found = gj.stack_reflectance_factor(
        WORK.albedo,
        WORK.optical_thickness,
        WORK.ground,
        refractive_index=index,
        cos_incidence=WORK.cos_incidence,
        cos_viewing=WORK.cos_viewing,
        tolerance=1e-10,
    )
    return np.asarray(found)


# What is left is the peer's own error, which falls with its directions.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("peer", "setting", "error"),
    [
        pytest.param(cdisort, 64, 1e-8, marks=needs(cdisort)),
        pytest.param(sasktran, Streams(64, 1), 1e-8, marks=needs(sasktran)),
        pytest.param(pythonic_disort, 64, 1e-5, marks=needs(pythonic_disort)),
    ],
)
def test_no_surface(peer: Any, setting: Any, error: float) -> None:
    assert_allclose(peer.reflectance(WORK, setting)(), expected(1.0), rtol=error)


@needs(adding_doubling)
def test_surface() -> None:
    found = adding_doubling.reflectance(WORK, adding_doubling.Setting(8, 18, 4), 1.5)()
    assert_allclose(found, expected(1.5), rtol=3e-8)


@pytest.mark.slow
@needs(sasktran)
def test_derivatives() -> None:
    value, theirs = sasktran.reflectance_and_gradient(WORK, Streams(64, 1))()
    mine: Any = ours.reflectance(WORK, 1.0, 1e-9, gradient=True)()
    assert_allclose(value, mine[0], rtol=1e-8)
    for a, b in zip(theirs, mine[1], strict=True):
        assert_allclose(a, b, rtol=1e-6, atol=2e-7 * np.max(np.abs(b)))
