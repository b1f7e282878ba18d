"""What `identify` is asked for reaches the search, and changes what it finds as it should."""

from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import (
    IdentificationOptions,
    Instrument,
    ModelError,
    Noise,
    Prior,
    identify,
    identify_films,
    map_cube,
)
from glazefit.film.model.response import film_response
from glazefit.identify.search.options import IdentificationKeywords
from glazefit.identify.search.searcher import check_pigments
from glazejax import Hemispherical, Pigment, catalogue
from glazejax.radiative.common.fresnel import dielectric_reflectance

from ..refusals import refusal
from .palette import optical_depths

GRID = np.arange(400.0, 701.0, 50.0)
GROUNDS = np.array([[0.03], [0.9]]) * np.ones(GRID.size)


@pytest.mark.parametrize(
    ("function", "given"),
    [
        (identify, dict(wavelengths=GRID, spectra=GRID, pigments=[], opaque=True)),
        (identify_films, dict(films=None, pigments=[])),
        (map_cube, dict(cube="image", pigments=[], out="map")),
    ],
)
@pytest.mark.usefixtures("unchecked")  # nothing stands for films
def test_a_keyword_that_is_unknown_is_refused_in_the_functions_own_name(function, given):
    words = rf"^{function.__name__}\(\) got an unexpected keyword argument 'exhaustive'"
    with pytest.raises(TypeError, match=words):
        function(**given, exhaustive=True)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise": 0.01}, r"noise is 0.01; give Noise\(floor, share\)"),
        ({"painted": "1620"}, "painted is '1620'; it is a year, such as 1620"),
        ({"elements": "CO"}, r"elements is 'CO'; list symbols, such as \['Cu', 'Pb'\]"),
        ({"without_elements": "Cu"}, "without_elements is 'Cu'; list symbols"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_options_of_another_kind_are_refused(given, words):
    with refusal(words):
        IdentificationOptions(**given)


@pytest.mark.usefixtures("unchecked")
def test_an_instrument_in_words_is_parsed():
    with refusal(r"not '45:0': use Instrument.parse\('45:0'\)"):
        Instrument("45:0")  # type: ignore[arg-type]


def test_options_and_their_keywords_are_the_same():
    assert IdentificationKeywords.__optional_keys__ == {
        field.name for field in fields(IdentificationOptions)
    }


@pytest.fixture(scope="module")
def paints() -> list[Pigment]:
    """A white and a red of the catalogue."""
    return [catalogue.pigment(name).resample(GRID) for name in ("ZincWhite", "Vermillion")]


def red_film(paints, seen_by):
    """What an instrument sees of a film of the red over two grounds, without its surface."""
    k, s = optical_depths(paints[1:], [25e-6])
    return np.asarray(film_response(seen_by).body(k, s, GROUNDS))


@pytest.fixture(scope="module")
def find(paints):
    """Identify one film of two paints over two grounds; options as given. All calls share their
    programs.
    """
    spectrum = 0.04 + red_film(paints, Hemispherical())

    def call(**options):
        return identify(GRID, spectrum[None], paints, ground=GROUNDS, max_paints=1, **options)

    return call


def spread(found):
    """Standard deviation of the log thickness of the best explanation."""
    return float(np.sqrt(found.log_covariance[0, 0, 0, 0]))


@pytest.mark.slow
def test_each_option_changes_what_it_should(find):
    usual, best = find(), find(keep=1)
    # Under the conditions that were told.
    assert (usual.condition[0] == 0).sum() == 2
    assert best.members.shape[1] == 1
    assert_array_equal(best.members[:, 0], usual.members[:, 0])
    assert find(names=["leaf"]).measured.names == ("leaf",)
    # What is read or predicted less well says less about the film.
    assert spread(find(noise=Noise(0.2, 0.0))) > 1.5 * spread(usual)
    assert spread(find(noise=Noise(0.0005, 0.3))) > 1.5 * spread(usual)
    assert spread(find(discrepancy=ModelError(amplitude=0.2))) > 1.5 * spread(usual)
    # A reading that says next to nothing leaves what was expected: a film as thick as films are.
    for thickness in (10e-6, 40e-6):
        vague = find(noise=Noise(30.0), prior=Prior(thickness=thickness))
        assert_allclose(vague.amounts[0, :, 0], thickness, rtol=0.1)
    often, rarely = (find(prior=Prior(unknown=unknown)).none[0] for unknown in (0.9, 0.01))
    assert often / (1.0 - often) > 100.0 * rarely / (1.0 - rarely)


@pytest.mark.slow  # a table for the instrument
def test_a_film_is_computed_as_its_instrument_reads_it(paints):
    """Index, geometry and surface of another instrument: the film is met, its thickness and gloss
    are right.
    """
    seen_by = Instrument(Hemispherical(30.0), 1.3)
    surface = float(dielectric_reflectance(np.cos(np.deg2rad(30.0)), 1.3))
    spectrum = surface + red_film(paints, seen_by)
    found = identify(GRID, spectrum[None], paints, ground=GROUNDS, max_paints=1, instrument=seen_by)
    assert found.ranked(0)[0].paints == ("Vermillion",)
    assert found.amounts[0, 0, 0] == pytest.approx(25e-6, rel=0.01)
    assert found.gloss[0, 0] == pytest.approx(1.0, abs=0.05)
    assert_allclose(found.fitted[0, 0], spectrum, atol=1e-3)


def test_pigments_carry_their_own_grid():
    """The catalogue's grid is brought to that of the spectra before anything is compared."""
    fine = np.arange(390.0, 711.0, 1.0)
    pigment = Pigment("x", fine, fine, 2.0 * fine)
    # A catalogue as `glazejax.catalogue.load` gives it, or a list.
    for catalogue_of_one in ([pigment], {"x": pigment}):
        (known,) = check_pigments(catalogue_of_one, GRID)
        assert_allclose(known.absorption, GRID)
