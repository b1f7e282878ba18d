"""How often answers came true: the counts that ship, and where they are said."""

import numpy as np

from glazefit import identify
from glazefit.identify.result.in_tests import FILE, came_true, has_infrared
from glazejax import catalogue

from .tables import read_rows


def test_a_stated_probability_finds_the_answers_that_stated_as_much():
    rows = read_rows(FILE)
    for row in rows:
        low, high = float(row["from"]), float(row["to"])
        counts = int(row["right"]), int(row["answers"])
        assert counts[0] <= counts[1] > 0
        highest = high if high == 1.0 else high - 1e-6
        for probability in (low, 0.5 * (low + high), highest):
            assert came_true(probability, row["infrared"] == "1") == counts
    # Each kind of reading covers all probabilities, without a gap.
    for infrared in ("0", "1"):
        bins = [(row["from"], row["to"]) for row in rows if row["infrared"] == infrared]
        starts, ends = zip(*bins, strict=True)
        assert ends == (*starts[1:], "1.0")


def test_near_infrared_begins_where_the_bench_counts_it():
    assert not has_infrared(np.arange(400.0, 891.0, 10.0))
    assert has_infrared(np.arange(400.0, 901.0, 10.0))


def test_a_reading_of_few_bands_is_like_none_of_the_tests():
    pigments = catalogue.load("pigments")
    for step, tested in ((10.0, True), (40.0, True), (60.0, False)):
        bands = np.arange(420.0, 701.0, step)
        ochre = np.interp(bands, [420.0, 500.0, 560.0, 700.0], [0.06, 0.1, 0.3, 0.45])
        identification = identify(bands, ochre[None], pigments, opaque=True)
        assert identification.explained[0]
        assert (identification.came_true(0) is not None) == tested
        assert ("in tests" in identification.verdict(0)) == tested
