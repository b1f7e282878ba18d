"""`benchmarks.paint.prediction`: which films are left out, and what chooses how far films scatter."""

import numpy as np
from benchmarks.paint import prediction, readings_of_mixtures

RECIPES = {
    "red": {"Red": 100.0, "White": 0.0},
    "pale": {"Red": 10.0, "White": 90.0},
    "deep": {"Red": 95.0, "Black": 5.0},
}


def test_only_mixtures_are_left_out():
    """A masstone is no mixture, also where its recipe names other paints with no weight."""
    assert prediction.mixtures(tuple(RECIPES), RECIPES) == ["pale", "deep"]


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
