"""Panels of other people's paint: what is hidden."""

import pytest
from benchmarks.maps.panel import lay_panel
from benchmarks.measured import data_folder

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
