"""Panels of other people's paint: what is hidden, what a camera does, and how answers are scored."""

import numpy as np
import pytest
from benchmarks.maps.mosaic import score_answers
from benchmarks.maps.panel import NOISE, lay_panel
from benchmarks.measured import data_folder
from benchmarks.paintbench.library import Answer

if not (data_folder() / "hyperdoc").is_dir():
    pytest.skip("no folder hyperdoc of measured data", allow_module_level=True)


@pytest.fixture(scope="module")
def panel():
    return lay_panel("hyperdoc", seed=3)


def test_the_catalogue_has_neither_the_source_nor_the_unknown_paints(panel):
    library = panel.library()
    assert panel.readings.shape == (60, 80, 121)
    assert sum(paint.unknown for paint in panel.paints) == 2
    for paint in panel.paints:
        here = set(paint.families) <= set(library.families)
        assert here != paint.unknown
        assert {p.family for p in panel.pigments()} >= set(paint.families) or paint.unknown
    assert "hyperdoc" not in library.groups
    assert all(pigment.source != "hyperdoc" for pigment in panel.pigments())
    assert not panel.hidden & {pigment.family for pigment in panel.pigments()}


def test_a_field_has_the_shape_of_its_spectrum_and_the_noise_that_was_asked_for(panel):
    clear = lay_panel("hyperdoc", seed=3, noise=0.0)
    assert (clear.labels == panel.labels).all()
    off = (panel.readings - clear.readings)[panel.inside]
    assert off.std() == pytest.approx(NOISE, rel=0.02)
    for number in range(len(panel.paints)):
        # Away from the blur of the edges.
        deep = clear.readings[panel.labels == number].reshape(20, 20, -1)[5:15, 5:15]
        spectra = deep.reshape(100, -1)
        ratio = spectra / spectra.mean(axis=0)
        assert np.ptp(ratio, axis=1).max() < 1e-5


def test_truth_scores_full_marks_and_one_name_for_all_few(panel):
    drawn = np.arange(panel.labels.size)
    paints = [panel.paints[label] for label in panel.labels.ravel()]
    true = [
        Answer(
            ranked=(tuple((family,) for family in paint.families),),
            doubt=float(paint.unknown),
            refused=paint.unknown,
        )
        for paint in paints
    ]
    best = score_answers(panel, drawn, true, 1.0)
    assert (best.right, best.pure, best.whole, best.none, best.doubted) == (1.0,) * 5
    assert (best.false, best.small) == (0.0, 0.0)
    assert best.sets == pytest.approx(10 / 12)
    one = [Answer(ranked=((("gypsum",),),), doubt=0.0, refused=False)] * len(drawn)
    worst = score_answers(panel, drawn, one, 1.0)
    assert (worst.right, worst.none, worst.doubted) == (0.0, 0.0, 0.0)
    assert worst.sets == pytest.approx(1 / 12)
