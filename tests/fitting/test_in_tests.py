"""How often answers came true: the counts that ship, and where they are said."""

import numpy as np

from glazefit.identify.result.in_tests import FILE, came_true, has_infrared

from .tables import read_rows


def test_a_stated_probability_finds_the_answers_that_stated_as_much():
    rows = read_rows(FILE)
    for row in rows:
        low, high = float(row["from"]), float(row["to"])
        counts = int(row["right"]), int(row["answers"])
        assert counts[0] <= counts[1] > 0
        infrared = row["infrared"] == "1"
        for probability in (low, 0.5 * (low + high), high - 1e-6):
            assert came_true(probability, infrared) == counts
        if high == 1.0:
            assert came_true(1.0, infrared) == counts
    # Each kind of reading covers all probabilities, without a gap.
    for infrared in ("0", "1"):
        own = [row for row in rows if row["infrared"] == infrared]
        assert [own[0]["from"], *(row["to"] for row in own)] == [
            *(row["from"] for row in own),
            "1.0",
        ]


def test_near_infrared_begins_where_the_bench_counts_it():
    assert not has_infrared(np.arange(400.0, 891.0, 10.0))
    assert has_infrared(np.arange(400.0, 901.0, 10.0))
