"""`benchmarks.paint.prediction`: what chooses how far films scatter."""

import numpy as np
from benchmarks.paint import readings_of_mixtures


def test_a_film_has_no_say_in_how_far_films_scatter():
    """Two spreads, over two cards: what one film alone gains by the second is chosen for the
    others, not for itself.
    """
    off = np.ones((2, 2, 3))
    off[1, :, 0] = 0.1
    off[1, :, 1:] = 1.1
    np.testing.assert_array_equal(readings_of_mixtures.choose_without(off), [0, 1, 1])
