"""A map by families of pigments, beside searches of its pixels."""

import numpy as np
import pytest

from glazefit import identify, set_labels
from glazefit.film.shared_bands import SEARCHED, means_of_steps
from glazefit.identify.families import set_up
from glazefit.identify.families.references import read_references
from glazefit.identify.search.options import IdentificationOptions
from glazefit.mapping.family_facts import describe_sets
from glazefit.mapping.map_cube import map_cube
from glazefit.mapping.show.overview import shown_sets
from glazefit.mapping.solve.by_family import FamilySearcher
from glazefit.mapping.solve.image import working_bands
from glazefit.mapping.spot_files import write_spots
from glazefit.mapping.store.store import MapStore
from glazejax import Glaze, Layer, catalogue, reflectance
from glazejax.geometry import resolve_instrument
from tests.mapping import small

from ..refusals import refusal
from .toy import Said

GRID = np.arange(400.0, 901.0, 10.0)
PAINTED = ("azurite", "vermilion", "yellow ochre", "lead white")


@pytest.fixture(scope="module")
def paints():
    return catalogue.load("pigments")


@pytest.fixture(scope="module")
def cube(paints):
    """Four strokes of thick paint, each by one hand, uneven by a hundredth."""
    level = np.random.default_rng(0).normal(1.0, 0.01, (4, 12, 1))
    strokes = []
    for family in PAINTED:
        known = [p for p in paints.values() if p.family == family and p.source == "hyperdoc"]
        paint = known[0].resample(GRID)
        strokes.append(reflectance(Glaze([Layer(paint, 1e-3)], ground=0.5), "45:0"))
    return small.image(np.array(strokes)[:, None] * level, GRID)


KNOWN = {"instrument": "45:0", "painted": 1900, "elements": ("Cu",)}


@pytest.fixture(scope="module")
def made(cube, paints, tmp_path_factory):
    """A map, what it said on the way, and where it lies."""
    set_up._SEARCHES.clear()
    said = Said()
    out = tmp_path_factory.mktemp("map") / "map.zarr"
    found = map_cube(cube, paints, opaque=True, out=out, progress=said, **KNOWN)
    return found, said, out


def test_a_map_by_families_says_what_identify_says(cube, paints, made):
    found, said, _ = made
    # The bar moves while the search is set up, which takes longer than all else.
    assert list(dict.fromkeys(stage for *_, stage in said)) == [
        "reading",
        "surveying",
        "computing films",
        "trying families",
        "searching",
        "checking",
        "mapping",
    ]
    assert len({done for done, _, stage in said if stage == "trying families"}) > 2
    single = identify(GRID, cube.values.reshape(-1, GRID.size), paints, opaque=True, **KNOWN)
    labels = set_labels(found).values.ravel()
    best = [single.families(row)[0] for row in range(len(single))]
    assert labels.tolist() == [" + ".join(families) for families, _ in best]
    assert [label.partition(" + ")[0] for label in labels[::12]] == list(PAINTED)
    names = found["paint"].values.tolist()
    assert "a white" in names
    # Close to a search of each pixel, though most are answered by a neighbour.
    first = [probability for _, probability in best]
    assert np.abs(found["probability"].values.ravel() - first).max() < 0.1
    assert np.abs(found["none"].values.ravel() - single.none).max() < 0.1
    azurite = found["paint_probability"].sel(paint="azurite")
    assert azurite[0].min() > 0.5
    assert azurite[1:].max() < 0.1
    # A family that is told apart is of its group.
    assert found["paint_probability"].sel(paint="a white")[3].min() > 0.5
    assert np.isnan(found["thickness"]).all()
    assert np.allclose(found["fraction"].sum("place"), 1.0, atol=1e-5)
    assert found.attrs["agreement"]["first"] == 1.0


def test_a_report_says_what_the_sets_are(paints, made, tmp_path):
    """Their families with the nearest exemplars, and what is unexplained as references."""
    found, _, out = made
    store = MapStore(out)
    assert store.options["elements"] == [["Cu"], []]
    sets = store.sums().sets
    asked = IdentificationOptions(**KNOWN)
    facts = describe_sets(found, sets, list(paints.values()), asked, store.options["ground"])
    assert set(facts) == set(shown_sets(sets))
    names = found["paint"].values
    for members, about in facts.items():
        said = {one["family"] for one in about["pigments"]}
        assert said & {str(names[n]) for n in members} or len(said) > 1
        exemplars = [paint["name"] for paint in about["film"]["paints"]]
        assert any(name.partition("/")[0] in said for name in exemplars)
    late = {
        one["family"] for about in facts.values() for one in about["pigments"] if one["anachronism"]
    }
    assert late == {"azurite"}
    reading = sets[next(iter(facts))].mean
    spots = [{"name": "Spot1", "reading": reading}, {"name": "Spot2", "reading": reading[::-1]}]
    (file,) = write_spots(
        tmp_path,
        found.assign_attrs(spots=spots),
        GRID,
        list(paints.values()),
        instrument=resolve_instrument("45:0"),
    )
    file.write_text(file.read_text().replace("Spot1,,", "Spot1,PB29,"))
    read = read_references(file, "45:0")
    assert [paint.pigment.family for paint in read.paints] == ["ultramarine"]
    assert len(read.unclear) == 1


def test_elements_are_weighed_for_families_alone(cube, tmp_path):
    with refusal("elements and years apply to families"):
        map_cube(cube, catalogue.load(), opaque=True, out=tmp_path / "map.zarr", elements=("Cu",))


def test_noise_makes_no_pigments(cube, paints, tmp_path):
    """A flat field is one answer, whatever noise, relief and light do to its pixels."""
    fields = np.repeat(np.repeat(cube.values[:, :1], 14, axis=0), 14, axis=1)
    light = np.random.default_rng(2).normal(np.linspace(0.97, 1.03, 14), 0.02, fields.shape[:2])
    fields = fields * light[..., None]
    noise = np.random.default_rng(1).normal(0.0, 1.0, fields.shape)
    noisy = small.image(fields + (0.006 + 0.01 * fields) * noise, GRID)
    found = map_cube(noisy, paints, opaque=True, out=tmp_path / "map.zarr", instrument="45:0")
    labels = set_labels(found).values.reshape(4, -1)
    for name, field in zip(PAINTED, labels, strict=True):
        assert {label.partition(" + ")[0] for label in field} == {name}
        assert len(set(field)) == 1
    assert found.attrs["representatives"] <= 40


def test_uneven_bands_are_those_of_a_search(paints):
    """A search would average bands of 4.83 nm once more if they were not its own."""
    for step in (3.7, 4.83, 6.1):
        bands = working_bands(np.arange(410.0, 991.0, step), list(paints.values()))
        again = means_of_steps(bands.wavelengths, SEARCHED)
        assert again is None or np.array_equal(again, np.eye(bands.wavelengths.size))


def test_a_search_is_of_the_coefficients_that_are_given(cube, paints):
    """Also where another catalogue of the same names was searched before."""
    azurites, vermilions = (
        [paint for paint in paints.values() if paint.family == family] for family in PAINTED[:2]
    )
    other = dict(paints)
    for one, two in zip(azurites, vermilions, strict=False):
        other[one.name] = two.renamed(one.name, family=one.family, source=one.source)
        other[two.name] = one.renamed(two.name, family=two.family, source=two.source)
    asked = IdentificationOptions(instrument=resolve_instrument("45:0"))
    named = []
    for shelf in (paints, other):
        search = FamilySearcher(GRID, tuple(shelf.values()), asked, None)
        reading = cube.values[1, :1]
        answers = search.search(reading, np.full_like(reading, 0.003))
        named.append(search.paints[answers.members[0, 0]])
    assert named == ["vermilion", "azurite"]


def test_a_misfit_is_at_the_readings_brightness_and_of_the_bands_that_are_compared(cube, paints):
    asked = IdentificationOptions(instrument=resolve_instrument("45:0"))
    search = FamilySearcher(GRID, tuple(paints.values()), asked, None)
    readings = cube.values[:, 0] * np.array([[1.0], [0.9], [1.1], [0.9]])
    fitted = search.search(readings, np.full_like(readings, 0.003)).fitted
    # From 415 nm on readings are compared.
    assert np.isnan(fitted[:, :2]).all()
    assert np.isfinite(fitted[:, 2:]).all()
    assert np.abs((fitted / readings)[:, 2:].mean(axis=1) - 1.0).max() < 0.03


def test_an_image_is_used_where_any_exemplar_is_known(paints):
    bands = working_bands(np.arange(360.0, 1101.0, 5.0), list(paints.values()))
    assert bands.wavelengths[0] < 390
    assert bands.wavelengths[-1] > 1090
    assert np.allclose(np.diff(bands.wavelengths)[1:-1], 10.0)


def test_a_spot_has_no_family(cube, paints, tmp_path):
    with refusal("the spot 'Mine' has no family"):
        map_cube(
            cube, paints, opaque=True, out=tmp_path / "map.zarr", spots={"Mine": np.full(51, 0.3)}
        )
