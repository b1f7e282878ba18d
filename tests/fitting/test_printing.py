"""Results print as one line that says what they are, not as pages of arrays."""

import numpy as np
import pytest

from glazefit import Films, Noise, Posterior, Prediction, Recovery, Variation, reading_over
from glazefit.recover.predict.crossvalidation import LeftOut
from glazejax.appearance import Mesh

from .test_identify_page import identification

GRID = np.arange(400.0, 701.0, 10.0)
DARK, LIGHT = np.full((5, GRID.size), 0.1), np.full((5, GRID.size), 0.8)
NAMES = ("01A", "02A", "03A", "04A", "05A")
ON = "400-700 nm step 10 (31 bands)"
FILMS = Films(NAMES, GRID, DARK, LIGHT, DARK, LIGHT)
READING = reading_over(GRID, LIGHT[0], 0.9, name="spot", noise=Noise())
SEPARABLE = np.arange(5 * GRID.size).reshape(5, -1) % 2 == 0
RECOVERY = Recovery(
    FILMS,
    LIGHT,
    LIGHT,
    np.ones((5, GRID.size, 2, 2)),
    SEPARABLE,
    np.ones(5),
    DARK,
    LIGHT,
    DARK,
    SEPARABLE,
    ~SEPARABLE,
)
PREDICTION = Prediction(
    "a tint",
    GRID,
    DARK[0],
    LIGHT[0],
    ("Eosin", "ZincWhite"),
    {"film": np.zeros((2, 2, GRID.size))},
    Variation(),
)


@pytest.mark.parametrize(
    ("result", "line"),
    [
        (FILMS, f"Films(5 films, {ON}: 01A, 02A, 03A and 2 more)"),
        (READING, f"Reading('spot' over the ground, {ON})"),
        (
            identification(NAMES),
            "Identification(5 spectra among 5 paints; '01A': Red + White, '02A': Red + White, "
            "'03A': Red + White, and 2 more)",
        ),
        (
            RECOVERY,
            f"Recovery(5 films, {ON}, k and s separable in 50% of bands: 01A, 02A, 03A and 2 more)",
        ),
        (PREDICTION, f"Prediction('a tint' of Eosin, ZincWhite, {ON})"),
        (
            LeftOut((PREDICTION,), np.ones((1, 2)), FILMS.take([0]), Variation(), True),
            "LeftOut(1 films: a tint)",
        ),
        (
            Posterior(None, (READING,), None, None),  # type: ignore[arg-type]
            "Posterior('spot': nothing was sampled: these are Laplace's standard errors)",
        ),
        (
            Mesh("clay", np.eye(3), np.array([[0, 1, 2]])),
            "Mesh(material='clay', 3 vertices, 1 faces)",
        ),
    ],
    ids=lambda each: type(each).__name__,
)
def test_a_result_prints_as_a_line(result, line):
    assert repr(result) == line
    assert str(result) == line


def test_a_candidate_prints_as_its_words():
    assert repr(identification().ranked(0, 1)[0]).startswith(
        "Candidate('75 % White + 25 % Red', probability 0.60, Delta E "
    )
