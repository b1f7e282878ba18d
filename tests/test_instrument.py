"""The instrument in words: one vocabulary for the command line and for Python."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazefit
import glazejax
from glazejax import Bidirectional, Hemispherical, Instrument
from glazejax.geometry import parse_geometry, resolve_instrument
from glazejax.stacks import stack_of

from .refusals import refusal
from .tables import rows


@pytest.mark.parametrize(
    ("spellings", "geometry"),
    [
        ("d:8 di:8 8:d", Hemispherical(8.0)),
        ("de:8 8:de", Hemispherical(8.0, False)),
        ("d:0 DI:0", Hemispherical(0.0)),
        ("45:0 45°/0°", Bidirectional(45.0, 0.0)),
        ("0:45", Bidirectional(0.0, 45.0)),
        ("30:30", Bidirectional(30.0, 30.0)),
        ("30:30:specular", Bidirectional(30.0, 30.0, True)),
        ("22.5:60", Bidirectional(22.5, 60.0)),
    ],
)
def test_words_for_a_geometry(spellings, geometry):
    """The first one is what the geometry is called."""
    for text in spellings.split():
        assert parse_geometry(f" {text} ") == geometry
        assert Instrument.parse(text, 1.4) == Instrument(geometry, 1.4)
    assert geometry.notation == spellings.split()[0]


IN_WORDS = """
d:8 | an integrating sphere at 8°, specular included
de:8 | an integrating sphere at 8°, specular excluded
22.5:60 | light at 22.5°, view at 60°, no mirror reflection
30:30:specular | light at 30°, view at 30°, mirror reflection included
"""


@pytest.mark.parametrize(("text", "words"), rows(IN_WORDS))
def test_a_geometry_in_words(text, words):
    assert parse_geometry(text).describe() == Instrument.parse(text).describe() == words


OTHER_WORDS = """
| it must be d:8 or di:8
8 | it must be d:8 or di:8
d | it must be d:8 or di:8
d:d | it must be d:8 or di:8
x:8 | it must be d:8 or di:8
d:8:specular | it must be d:8 or di:8
1:2:3 | it must be d:8 or di:8
1:2:3:4 | it must be d:8 or di:8
95:0 | angles must lie in
d:-8 | angles must lie in
nan:0 | angles must lie in
0:90 | angles must lie in
45:0:specular | at 45:0 the mirror reflection is not in view
"""


@pytest.mark.parametrize(("text", "complaint"), rows(OTHER_WORDS))
def test_other_words_are_one_sentence(text, complaint):
    with refusal(f"^--instrument is '{text}'.*{complaint}"):
        parse_geometry(text, argument="--instrument")


def test_the_class_has_one_name_in_both_packages():
    assert glazefit.Instrument is glazejax.Instrument
    assert Instrument() == Instrument(Hemispherical(8.0, True), 1.5)
    assert hash(Instrument.parse("45:0")) == hash(Instrument(Bidirectional(45, 0)))
    with refusal("refractive index 3 is outside"):
        Instrument(refractive_index=3)


@pytest.mark.parametrize(
    ("geometry", "name"),
    [
        (Bidirectional([30.0, 45.0], 0), "incidence"),
        (Bidirectional(45, [0.0]), "viewing"),
        (Bidirectional(45, 0, azimuth=[0.0, 90.0]), "azimuth"),
        (Hemispherical([8.0, 10.0]), "incidence"),
    ],
)
def test_an_instrument_has_one_angle_of_each_kind(geometry, name):
    with refusal(f"one angle of each kind, but {name} is an array"):
        Instrument(geometry)
    glaze = glazejax.Glaze([glazejax.Layer(glazejax.catalogue.pigment("CobaltBlue"), 1e-6)], 0.5)
    with refusal("one angle of each kind"):
        stack_of(glaze, geometry)


def test_an_angle_that_is_traced_makes_an_instrument():
    cosine = jax.jit(lambda angle: Instrument(Hemispherical(angle)).geometry.cos_incidence)
    assert cosine(60.0) == pytest.approx(0.5)


def test_surface_is_seen_by_the_mirror_direction_only():
    normal = ((1.5 - 1.0) / (1.5 + 1.0)) ** 2
    for text, surface, seen in (
        ("0:0", normal, 0.0),
        ("0:0:specular", normal, normal),
        ("di:0", normal, normal),
        ("de:0", normal, 0.0),
        ("0:45", normal, 0.0),
    ):
        instrument = Instrument.parse(text)
        assert instrument.surface == pytest.approx(surface, rel=1e-12)
        assert instrument.seen_surface == pytest.approx(seen, rel=1e-12)
    # Paper tables: R at 45 degrees and n = 1.5 is .0502.
    assert Instrument.parse("45:0").surface == pytest.approx(0.0502, abs=5e-5)
    assert Instrument(Bidirectional(45, 0, specular=True)).seen_surface == 0.0
    assert Instrument(Bidirectional(45, 45, specular=True, azimuth=180)).seen_surface == 0.0


@pytest.mark.parametrize(
    ("geometry", "notation"),
    [
        (Bidirectional(45, 0, specular=True), "45:0"),
        (Bidirectional(45, 45, specular=True, azimuth=180), "45:45"),
        (Bidirectional(45, 45, specular=True, azimuth=360), "45:45:specular"),
        (Bidirectional(0, 0, specular=True, azimuth=90), "0:0:specular"),
    ],
)
def test_words_say_whether_the_mirror_reflection_is_in_view(geometry, notation):
    in_view = bool(geometry.sees_surface)
    assert geometry.notation == notation
    assert bool(parse_geometry(notation).sees_surface) == in_view
    assert ("no mirror reflection" in geometry.describe()) != in_view


def test_mirror_direction_keeps_batch_axes():
    angles = np.array([0.0, 30.0, 45.0])
    seen = Bidirectional(
        angles, 30.0, specular=True, azimuth=np.array([10.0, 0.0, 0.0])
    ).sees_surface
    assert_array_equal(seen, [[False], [True], [False]])
    at_normal = Bidirectional(0.0, 0.0, specular=True, azimuth=np.array([0.0, 90.0])).sees_surface
    assert_array_equal(at_normal, [[True], [True]])
    assert (
        Bidirectional(angles, 30.0).describe()
        == "light at 0° to 45°, view at 30°, no mirror reflection"
    )


def test_one_argument_names_an_instrument_in_four_ways():
    side = Bidirectional(45, 0)
    assert resolve_instrument() == Instrument()
    assert resolve_instrument(None, 1.4) == Instrument(refractive_index=1.4)
    for words in (side, "45:0"):
        assert resolve_instrument(words, 1.4) == Instrument(side, 1.4)
    assert resolve_instrument(Instrument(side)) == Instrument(side)


def test_what_names_no_instrument_is_refused(unchecked):
    with refusal("45;0"):
        resolve_instrument("45;0")
    for wrong in (45.0, Bidirectional):
        with refusal(r"give a geometry, such as Bidirectional\(45, 0\), its words", TypeError):
            resolve_instrument(wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.slow
@pytest.mark.parametrize("words", ["d:8", "45:0"])
def test_bands_of_a_film_are_read_by_any_instrument(words):
    """What 45:0 reads over cards that it read too tells the same paint as a sphere does."""
    seen_by = Instrument.parse(words)
    films = glazefit.simulate_films(
        np.arange(400.0, 701.0, 100.0),
        np.full((1, 4), 0.3),
        np.full((1, 4), 1.0),
        names=["a"],
        instrument=seen_by,
        noise=glazefit.Noise(1e-4, 0.0),
    )
    posterior = glazefit.posterior_of_bands(films, instrument=seen_by, steps=0)
    assert_allclose(np.median(posterior.laplace_draws["absorption"], axis=0), 0.3, rtol=0.05)
