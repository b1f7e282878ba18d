"""The catalogue of pigments by family: what is in it, where it is from, and that it reflects what
its sources read.
"""

import numpy as np
import pytest
from benchmarks.paint import pigments as maker
from benchmarks.paintbench.library import grid_readings
from benchmarks.paintbench.sources import read_kimera, read_rrt, read_source

from glazefit.film.model.response import film_response
from glazefit.identify.families.templates import coefficients, hiding_body, pure_templates
from glazejax import catalogue, colour

from .tables import rows


@pytest.fixture(scope="module")
def shelf():
    return catalogue.load("pigments")


def test_every_exemplar_has_a_family_a_source_and_a_provenance(shelf):
    known = catalogue.families()
    origins = catalogue.provenance()
    assert set(origins) == set(shelf)
    assert 150 <= len(shelf) <= 400
    assert len({paint.family for paint in shelf.values()}) >= 45
    for name, paint in shelf.items():
        origin = origins[name]
        assert paint.name == name
        assert paint.family in known
        assert name.startswith(f"{paint.family}/{paint.source}-")
        assert (origin.family, origin.source) == (paint.family, paint.source)
        assert origin.licence in ("CC BY 4.0", "CC0 1.0", "MIT", "public domain")
        assert origin.citation
        assert origin.told_by
        assert float(paint.wavelengths[0]) == origin.first_nm
        assert float(paint.wavelengths[-1]) == origin.last_nm
        values = np.array([paint.absorption, paint.scattering])
        assert np.all(np.isfinite(values) & (values > 0))


def test_the_pigments_that_a_conservator_meets_first_are_there(shelf):
    families = {paint.family for paint in shelf.values()}
    first = (
        "azurite, malachite, smalt, lead-tin yellow, orpiment, yellow ochre, red ochre, "
        "burnt umber, raw umber, verdigris, indigo, gamboge, lead white, vermilion"
    )
    assert families >= set(first.split(", "))


def test_what_is_known_of_a_family():
    azurite = catalogue.families()["azurite"]
    assert azurite.elements == ("Cu",)
    assert azurite.colour_index == "PB30"
    for family in catalogue.families().values():
        assert family.last_year is None or family.first_year < family.last_year, family.name
        assert all(symbol.isalpha() for symbol in family.elements), family.name


def test_what_a_painter_of_today_may_not_want():
    known = catalogue.families()
    for family in known.values():
        assert family.sold in ("", "rarely", "no longer"), family.name
        # Eosin is a lake of lead at times; smalt and cobalt violet hold arsenic at times.
        if set(family.elements) & {"Pb", "Hg", "Cd", "As"}:
            sometimes = family.name in ("eosin", "smalt", "cobalt violet")
            assert bool(family.poison) is not sometimes, family.name
    assert known["cadmium red"].caution == "poisonous (cadmium)"
    assert known["titanium white"].caution == ""


MARKED = """
LeadWhite | oils | LeadWhite | poisonous (lead), rarely sold
ChromeYellowOtero | oils | ChromeYellowOtero | poisonous (lead chromate), rarely sold
UltramarineBlue | oils | UltramarineBlue |
CadmiumOrange | acrylics | acrylics:CadmiumOrange | poisonous (cadmium)
CadmiumOrange | acrylics | acrylics/CadmiumOrange | poisonous (cadmium)
PyrroleRed | acrylics | PyrroleRed |
"""


@pytest.mark.parametrize(("pigment", "shelf", "name", "words"), rows(MARKED))
def test_a_paint_is_marked_by_its_pigment(pigment, shelf, name, words):
    assert catalogue.caution(catalogue.pigment(pigment, shelf).renamed(name)) == words


def test_an_own_paint_is_not_marked_by_its_name():
    white = catalogue.pigment("LeadWhite")
    assert catalogue.caution(white.renamed(white.name, provenance="mine")) == ""


def test_an_exemplar_is_marked_by_its_family(shelf):
    for paint in shelf.values():
        assert catalogue.caution(paint) == catalogue.families()[paint.family].caution


def test_an_exemplar_is_on_the_scale_of_its_source(shelf):
    words = {paint.source: catalogue.assumed_scale(paint) for paint in shelf.values()}
    assert "films of unknown thickness" in str(words.pop("revigo"))
    assert "without lengths" in str(words.pop("golden"))
    (others,) = set(words.values())
    assert "by the median of s" in str(others)


def test_a_family_survives_another_grid_and_another_name(shelf):
    paint = next(iter(shelf.values()))
    grid = np.asarray(paint.wavelengths)[2:-2]
    for other in (paint.resample(grid), paint.renamed("mine")):
        for label in ("family", "source", "binder"):
            assert getattr(other, label) == getattr(paint, label)
    assert paint.renamed("mine", family="smalt").family == "smalt"


def test_films_that_hide_their_ground_reflect_what_was_read(shelf, shared_data):
    """Kimera's masstones are opaque, so k/s alone must give the reading again."""
    source = read_kimera(shared_data / "kimera")
    response = film_response("45:0")
    for name, paint in shelf.items():
        if paint.source != "kimera":
            continue
        code = name.partition("kimera-")[2].replace("-", " ")
        rows = [row for row, sample in enumerate(source.samples) if sample.paints == (code,)]
        grid = np.asarray(paint.wavelengths)
        read = grid_readings(source, rows, grid).mean(axis=0)
        ratio = np.asarray(paint.absorption) / np.asarray(paint.scattering)
        found = hiding_body(response, ratio[None])[0]
        assert np.sqrt(np.mean((found - read) ** 2)) < 0.01, name


def test_exemplars_of_a_palette_look_like_its_coats(shelf, shared_data):
    """Of one recipe, so that hiding or a coat of usual thickness each must be near its reading."""
    source = read_source(shared_data / "hyperdoc")
    paints = {name: paint for name, paint in shelf.items() if paint.source == "hyperdoc"}
    grid = np.arange(420.0, 701.0, 10.0)
    k_and_s = coefficients(list(paints.values()), grid)
    films = pure_templates(k_and_s, film_response("45:0"), None)
    for number, (name, paint) in enumerate(paints.items()):
        code = name.rpartition(f"{paint.binder.replace(' ', '-')}-")[2]
        rows = [
            row
            for row in source.chosen("pure")
            if source.samples[row].paints == (code,)
            and source.samples[row].binder.lower() == paint.binder
        ]
        bodies = films.readings[films.members[:, 0] == number]
        read = np.broadcast_to(grid_readings(source, rows, grid)[0], bodies.shape)
        assert colour.delta_e_of_spectra(grid, read, bodies).min() < 12.0, name


def test_thick_yellows_and_reds_are_bright_beyond_their_edge(shelf):
    """No paint of these is dark there; one fitted over the wrong ground is."""
    response = film_response("45:0")
    clear_from = {"azo yellow": 600.0, "cadmium yellow": 600.0, "Naples yellow": 600.0}
    clear_from |= dict.fromkeys(("cadmium orange", "cadmium red", "minium", "vermilion"), 650.0)
    for name, paint in shelf.items():
        if paint.family in clear_from:
            band = np.abs(np.asarray(paint.wavelengths) - clear_from[paint.family]).argmin()
            ratio = np.asarray(paint.absorption)[band] / np.asarray(paint.scattering)[band]
            assert hiding_body(response, np.array([[ratio]]))[0, 0] > 0.35, name


def test_a_fit_of_thin_and_thick_coats_meets_both(shared_data):
    source = read_rrt(shared_data / "rrt")
    kept = [row for row, s in enumerate(source.samples) if s.paints[0] in ("Azurite", "Gypsum")]
    (found,) = maker.fit_source(source.take(kept))
    assert found.family == "azurite"
    assert found.told_by == "a thin and a thick coat over gypsum"
    assert found.rms < 0.02
