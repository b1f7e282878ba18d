"""Limits of the renderers' layer rules: no coat, nothing absorbed, reciprocity, what is exact; the
table of truth.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from benchmarks.render.layer_rules import RULES, Coat, albedo, even_light, factor, internal
from benchmarks.render.layered_csv import layers_in_words
from benchmarks.render.layered_stacks import STACKS
from numpy.testing import assert_allclose

from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor

LIT, SEEN = np.array([0.3, 0.7, 1.0]), np.array([0.2, 0.7])
BASE, CLEAR = np.array([0.05, 0.5, 1.0]), np.ones(3)
TABLE = Path(__file__).parents[1] / "benchmarks" / "results" / "layered_truth.csv"


def _smooth(index):
    """<E>, and cosines with E at them."""
    y, w = np.polynomial.legendre.leggauss(64)
    mu = 0.5 * (1.0 + y)
    even = even_light(np.asarray(dielectric_reflectance(mu, index)), mu, 0.5 * w)
    lit, seen = ((c, np.asarray(dielectric_reflectance(c, index))) for c in (LIT, SEEN))
    return even, lit, seen


@pytest.mark.parametrize("rule", RULES)
def test_no_coat_is_the_base(rule):
    even, lit, seen = _smooth(1.0)
    coat = Coat(BASE, CLEAR, 1.0, even)
    assert_allclose(factor(rule, coat, lit, seen), np.broadcast_to(BASE, (3, 2, 3)), atol=1e-12)
    assert_allclose(albedo(rule, coat, seen), np.broadcast_to(BASE, (2, 3)), atol=1e-12)


@pytest.mark.parametrize("rule", RULES)
def test_a_clear_coat_on_white_loses_nothing(rule):
    even, _, seen = _smooth(1.5)
    body = albedo(rule, Coat(BASE, CLEAR, 1.5, even), seen)
    assert_allclose(body[:, 2] + seen[1], 1.0, atol=1e-12)


def test_only_one_is_reciprocal():
    even, lit, _ = _smooth(1.5)
    coat = Coat(BASE, CLEAR, 1.5, even)
    for rule in RULES:
        there = factor(rule, coat, lit, lit)
        assert np.allclose(there, there.transpose(1, 0, 2)) == (rule == "reciprocal")


def test_darkening_is_exact_on_a_diffuse_base():
    """A clear smooth coat on a Lambertian ground: OpenPBR's and Belcour's albedo is the
    solver's.
    """
    even, lit, seen = _smooth(1.5)
    coat = Coat(BASE, CLEAR, 1.5, even)
    exact = stack_hemispherical_reflectance(
        np.zeros((2, 3, 1)), np.zeros((2, 3, 1)), BASE, cos_incidence=SEEN[:, None], tolerance=1e-8
    )
    for rule in ("openpbr", "belcour"):
        assert_allclose(albedo(rule, coat, seen), exact, atol=1e-6)
    for rule in ("scaling", "reciprocal"):
        assert np.max(np.abs(albedo(rule, coat, seen) - exact)) > 0.1
    # The shape over both angles is exact only with both surfaces' transmittances and the darkening.
    expected = stack_reflectance_factor(
        np.zeros((3, 2, 3, 1)),
        np.zeros((3, 2, 3, 1)),
        BASE,
        cos_incidence=LIT[:, None, None],
        cos_viewing=SEEN[:, None],
    )
    k = internal(coat)
    shape = factor("reciprocal", coat, lit, seen) * (1 - k) / (1 - BASE * k)
    assert_allclose(shape, expected, atol=1e-6)


@pytest.mark.skipif(not TABLE.exists(), reason="the table has not been made")
def test_the_table_is_of_these_stacks():
    """Stacks and values in the published table are those of the code."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 24 * (9 + 81)
    for number, stack in enumerate(STACKS, 1):
        mine = [row for row in rows if row["number"] == str(number)]
        assert {row["stack"] for row in mine} == {layers_in_words(stack)}
        assert {(float(row["ground"]), float(row["alpha"])) for row in mine} == {
            (stack.ground, stack.roughness)
        }
    for number in (1, 11, 16):
        stack = STACKS[number - 1]
        cosines = np.cos(np.deg2rad([10.0, 45.0, 75.0]))[:, None]
        found = stack_hemispherical_reflectance(
            stack.albedo, stack.thickness, stack.ground, cos_incidence=cosines, tolerance=1e-6
        )
        mine = [
            float(row["body"])
            for row in rows
            if row["number"] == str(number) and row["kind"] == "albedo"
        ]
        assert_allclose(np.reshape(mine, (3, -1)), found, atol=2e-6)
