"""The BSDF of Mitsuba 3 in its scalar variant: the solver's reflectance, textures, and what is
refused.
"""

import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Glaze, Layer, Mixture, Pigment, catalogue, stack_reflectance_factor
from glazejax.appearance.mitsuba import glaze_bsdf
from glazejax.appearance.mitsuba.bsdf import _table, _text_of
from glazejax.appearance.mitsuba.coats import on_even_grid
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.stacks import read_stack

from ..fresh import run_python
from ..glazes import coated
from ..refusals import refusal
from .plugin import (
    BLUE,
    WAVELENGTHS,
    WHITE,
    direction,
    factor,
    interaction,
    mitsuba_in,
    mixed_over_white,
)
from .scenes import half_range

PAIRS = [(1.0, 1.0), (0.9, 0.2), (0.5, 0.7), (0.05, 0.95), (0.1, 0.1), (0.02, 0.3)]


@pytest.fixture(scope="module")
def mitsuba():
    return mitsuba_in("scalar_spectral")


def loaded(**given):
    import mitsuba

    return mitsuba.load_dict({"type": "glaze", **given})


@pytest.fixture(scope="module")
def blue(mitsuba):
    return loaded(coats=BLUE)


def check_factor(bsdf, glaze, cos_in, cos_out, *wavelengths, **how):
    """The plugin gives what the solver does, within the error of its table."""
    solved = stack_reflectance_factor(
        glaze.albedo,
        glaze.optical_thickness,
        glaze.ground,
        refractive_index=glaze.refractive_index,
        cos_incidence=cos_in,
        cos_viewing=cos_out,
    )
    found = factor(bsdf, cos_in, cos_out, *wavelengths, **how)
    assert 0 < bsdf.table.error <= 1e-3
    assert_allclose(found, solved, rtol=0, atol=bsdf.table.error)


def bitmap(values):
    import mitsuba

    values = mitsuba.Bitmap(np.asarray(values, np.float32)[..., None])
    texture = {"type": "bitmap", "bitmap": values, "raw": True}
    return texture | {"wrap_mode": "clamp", "filter_type": "nearest"}


@pytest.mark.parametrize(
    ("below", "depth", "ground", "index"),
    [
        ("ZincWhite", 20e-6, 0.8, 1.5),
        ("ZincWhite", 20e-6, np.linspace(0.2, 0.9, 31), 1.3),
        # It hides its ground: how the ground is seen cannot be computed.
        ("BoneBlack", 2e-3, 0.8, 1.5),
    ],
)
def test_eval_is_the_solvers_reflectance(mitsuba, below, depth, ground, index):
    glaze = coated(ground, index, UltramarineBlue=3e-6, **{below: depth})
    bsdf = mitsuba.load_dict(glaze_bsdf(glaze))
    for pair in PAIRS:
        check_factor(bsdf, glaze, *pair)


@pytest.mark.slow
def test_a_rough_surface_is_that_of_the_solver(mitsuba):
    from glazejax.radiative.rough import rough_reflectance_factor, surface_reflectance_factor

    glaze = coated(0.7, Eosin=2e-6, ZincWhite=9e-6)
    body, whole = (
        mitsuba.load_dict(glaze_bsdf(glaze, roughness=0.5, gloss=gloss)) for gloss in (False, True)
    )
    stack = glaze.albedo, glaze.optical_thickness, glaze.ground
    for azimuth, (a, b) in zip((0.0, 50.0, 180.0), PAIRS[1:4], strict=True):
        solved = rough_reflectance_factor(*stack, roughness=0.5, cos_incidence=a, cos_viewing=b)
        found = factor(body, a, b)
        assert_allclose(found, solved, rtol=0, atol=body.table.error)
        # In Mitsuba both directions point away, so that the mirror's side is opposite.
        added = factor(whole, a, b, azimuth=np.pi - np.deg2rad(azimuth)) - found
        assert_allclose(added, surface_reflectance_factor(a, b, azimuth, roughness=0.5), rtol=2e-3)


def test_textures_of_thickness_fraction_and_ground(mitsuba):
    bands = np.array([450.0, 550.0, 650.0])
    mixture, glaze = mixed_over_white(bands)
    # Maps of different sizes: each is a texture of its own.
    thickness = np.array([[0.0, 1e-6], [2e-6, 3e-6]])
    fraction = np.array([[0.0, 0.3, 1.0]])
    ground = np.array([[0.1], [0.9]])
    maps: dict[str, Any] = {"thickness": thickness, "fraction": fraction, "ground": ground}
    made = glaze_bsdf(glaze, **maps)
    for name in maps:
        made[name]["filter_type"] = "nearest"
    bsdf = mitsuba.load_dict(made)
    assert bsdf.table.error < 1e-3
    for u, v in [(0.1, 0.2), (0.9, 0.2), (0.45, 0.8), (0.9, 0.9)]:
        share = fraction[0, int(3 * u)]
        one = Mixture(mixture.pigments, [1 - share, share])
        layers = [Layer(one, thickness[int(2 * v), int(2 * u)]), glaze.coats[1]]
        there = Glaze(layers, ground[int(2 * v), 0])
        for pair in PAIRS[:4]:
            check_factor(bsdf, there, *pair, bands, uv=(u, v))


def test_a_ground_with_a_spectrum_at_each_place(mitsuba):
    ground = np.random.default_rng(0).uniform(0, 1, (2, 3, 31))
    glaze = coated(0.5, UltramarineBlue=1e-6)
    bsdf = mitsuba.load_dict(glaze_bsdf(glaze, ground=ground))
    for row, column in [(0, 0), (1, 2)]:
        there = Glaze(glaze.coats, ground[row, column])
        uv = (column + 0.5) / 3, (row + 0.5) / 2
        check_factor(bsdf, there, 0.6, 0.8, uv=uv)


def test_numbers_count_for_the_coat_that_is_named(mitsuba):
    bsdf = loaded(
        coats="Eosin:1um, 0.5*ZincWhite+0.5*UltramarineBlue:9um",
        layer=1,
        thickness=4e-6,
        fraction=0.25,
        ground=0.6,
        refractive_index=1.3,
    )
    paints = catalogue.load()
    mixture = Mixture([paints["ZincWhite"], paints["UltramarineBlue"]], [0.75, 0.25])
    glaze = Glaze([Layer(paints["Eosin"], 1e-6), Layer(mixture, 4e-6)], 0.6, 1.3)
    check_factor(bsdf, glaze, 0.5, 0.9)


def test_what_glaze_bsdf_is_given(unchecked, tmp_path):
    (tmp_path / "glaze.json").write_text(WHITE)
    stack = read_stack(tmp_path / "glaze.json")
    assert glaze_bsdf(stack) == glaze_bsdf(stack.glaze())
    with refusal("glaze must be a Glaze, not a list", TypeError):
        glaze_bsdf(["Eosin:1um"])  # pyright: ignore[reportArgumentType]


def test_a_file_of_the_studio(mitsuba, tmp_path):
    path = tmp_path / "s.json"
    coats = [{"paint": {"CobaltBlue": 1}, "um": 2}]
    stack = {"glazejax": "stack", "coats": coats, "ground": 0.7}
    path.write_text(json.dumps(stack))
    bsdf = loaded(coats=str(path))
    check_factor(bsdf, coated(0.7, CobaltBlue=2e-6), 0.5, 0.9)
    # The same name, another glaze.
    path.write_text(json.dumps(stack | {"ground": 0.1}))
    dark = loaded(coats=str(path))
    assert factor(dark, 0.5, 0.9).mean() < 0.8 * factor(bsdf, 0.5, 0.9).mean()


def test_coats_of_a_text_longer_than_a_files_name_may_be(mitsuba, blue):
    bsdf = loaded(coats=BLUE.replace(", ", "," + " " * 300))
    assert_array_equal(factor(bsdf, 0.5, 0.9), factor(blue, 0.5, 0.9))
    # A name that cannot be is refused by the reader.
    with pytest.raises(RuntimeError, match="cannot be read: File name too long"):
        loaded(coats="a" * 300 + ".json")


def test_blanks_around_a_files_name_do_not_keep_what_it_held(tmp_path):
    path = tmp_path / "s.json"
    path.write_text(WHITE)
    assert _text_of(f" {path} ") == WHITE


def test_wavelengths_beyond_the_paints_are_those_of_the_ends(mitsuba, blue):
    ends = factor(blue, 0.5, 0.7, np.array([360.0, 400.0, 700.0, 830.0]))
    assert_allclose(ends[[0, 3]], ends[[1, 2]])
    between = factor(blue, 0.5, 0.7, np.array([500.0, 503.0, 510.0]))
    assert_allclose(between[1], between[0] + 0.3 * (between[2] - between[0]), rtol=1e-4)


def test_light_from_behind_meets_black(mitsuba, blue):
    context = mitsuba.BSDFContext()
    up, down = direction(0.5), direction(-0.5)
    below = interaction(-0.5)
    for dark in (
        blue.eval(context, below, up),
        blue.eval(context, interaction(0.5), down),
        blue.pdf(context, below, up),
        blue.sample(context, below, 0.5, [0.3, 0.3])[1],
    ):
        assert not np.any(np.array(dark))
    both = mitsuba.load_dict({"type": "twosided", "bsdf": {"type": "glaze", "coats": BLUE}})
    assert np.all(np.array(both.eval(context, below, down)) > 0)


def test_the_mirror_and_the_body_are_drawn_by_their_albedos(mitsuba, blue):
    flags = mitsuba.BSDFFlags
    assert blue.component_count() == 2
    assert mitsuba.has_flag(blue.flags(0), flags.DeltaReflection)
    context = mitsuba.BSDFContext()
    for cosine in (0.9, 0.2):
        si = interaction(cosine)
        mirror, weight = blue.sample(context, si, 0.0, [0.3, 0.7])
        assert_allclose(np.array(mirror.wo), np.array(si.wi) * [-1, -1, 1], atol=1e-6)
        assert mitsuba.has_flag(mirror.sampled_type, flags.DeltaReflection)
        fresnel = float(dielectric_reflectance(cosine, 1.5))
        assert_allclose(np.array(weight) * mirror.pdf, fresnel, rtol=1e-5)
        assert mirror.pdf == pytest.approx(fresnel / (fresnel + albedo(blue, cosine)), rel=0.02)
        body, weight = blue.sample(context, si, 0.999, [0.3, 0.7])
        assert mitsuba.has_flag(body.sampled_type, flags.DiffuseReflection)
        value = np.array(blue.eval(context, si, body.wo))
        assert_allclose(np.array(weight), value / body.pdf, rtol=1e-5)
    assert loaded(coats=BLUE, gloss=False).component_count() == 1


def albedo(bsdf, cosine):
    """Of the body, mean of the bands, by quadrature."""
    return sum(
        weight * mu * factor(bsdf, cosine, mu).mean()
        for mu, weight in zip(*half_range(12), strict=True)
    )


def test_only_the_lobes_that_are_asked_for(mitsuba, blue):
    si, wo = interaction(0.6), direction(0.7, 2.0)
    only = mitsuba.BSDFContext()
    only.component = 0
    assert np.all(np.array(blue.eval(only, si, wo)) == 0)
    assert blue.sample(only, si, 0.99, [0.2, 0.2])[0].pdf == 1
    only.component = 1
    assert blue.pdf(only, si, wo) == pytest.approx(0.7 / np.pi, rel=1e-5)
    only.component = 2
    assert blue.sample(only, si, 0.5, [0.2, 0.2])[0].pdf == 0


def test_the_fused_calls_say_the_same(mitsuba, blue):
    context, si, wo = mitsuba.BSDFContext(), interaction(0.6), direction(0.7, 2.0)
    value, density = blue.eval_pdf(context, si, wo)
    assert density == blue.pdf(context, si, wo)
    fused = blue.eval_pdf_sample(context, si, wo, 0.7, [0.2, 0.4])
    sampled = blue.sample(context, si, 0.7, [0.2, 0.4])
    assert fused[1] == density
    for one, other in (
        (value, blue.eval(context, si, wo)),
        (value, fused[0]),
        (sampled[0].wo, fused[2].wo),
        (sampled[1], fused[3]),
    ):
        assert_array_equal(np.array(one), np.array(other))


def test_alike_glazes_share_a_table(mitsuba):
    before = _table.cache_info().misses
    one, two = (loaded(coats=BLUE, gloss=gloss) for gloss in (True, False))
    assert one.table is two.table
    assert _table.cache_info().misses <= before + 1


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"coats": None}, 'a glaze needs "coats"'),
        (
            {"coats": "Nonsense:3um"},
            "there is no pigment 'Nonsense': `glazejax render --list` shows all names",
        ),
        ({"coats": "ZincWhite"}, "has no thickness: write paint:thickness"),
        ({"coats": "no/such.json"}, "no/such.json"),
        ({"thicknes": 2e-6}, "a glaze has no 'thicknes'; you may mean 'thickness'"),
        ({"thickness": 20.0}, "thickness must be in [0, 0.01], not 20: thickness is in metres"),
        ({"thickness": [[1e-6, -1e-6]]}, "thickness must be in [0, 0.01], not -1e-06"),
        ({"thickness": [[1e-6, np.nan]]}, "thickness must be in [0, 0.01], not nan"),
        ({"thickness": [[4e-6]], "thickness_max": 3e-6}, "beyond the thickness_max of 3e-06 m"),
        (
            {"thickness": 1e-6, "layer": 2},
            "layer is 2, but the glaze has 2 coats, the top one is number 0",
        ),
        ({"fraction": 0.5}, "the share of the second paint of coat 0, but that is UltramarineBlue"),
        (
            {"coats": "0.5*Eosin+0.5*ZincWhite:2um", "fraction": [[1.5]]},
            "fraction must be in [0, 1], not 1.5",
        ),
        ({"ground": [[-0.5]]}, "ground must be in [0, 1], not -0.5"),
        ({"ground": "white"}, "ground is str; give a number or a texture"),
        ({"roughness": 2.0}, "roughness is 2.0; it must be a number between 0 and 1"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
        ({"gloss": 0.5}, "gloss is 0.5; it must be true or false"),
    ],
)
def test_what_is_refused(mitsuba, given, sentence):
    given = {
        name: bitmap(value) if isinstance(value, list) else value
        for name, value in ({"coats": BLUE} | given).items()
        if value is not None
    }
    with pytest.raises(RuntimeError, match=re.escape(sentence)):
        loaded(**given)


def test_maps_that_are_refused(mitsuba):
    glaze = coated(0.8, Eosin=2e-6)
    for given, sentence in [
        ({"thickness": np.zeros(3)}, r"thickness has shape \(3,\)"),
        ({"thickness": np.zeros((3, 3, 1))}, r"thickness has shape \(3, 3, 1\)"),
        ({"fraction": np.full((2, 2), 0.5)}, "write it as a mixture of two paints"),
        (
            {"ground": np.full(5, 0.5)},
            r"ground has shape \(5,\): its last axis must be the 31 bands",
        ),
        ({"ground": np.full((2, 2, 31), 1.5)}, r"ground must be in \[0, 1\], not 1.5"),
    ]:
        with refusal(sentence):
            glaze_bsdf(glaze, **given)
    with pytest.raises(RuntimeError, match="the ground has 5 bands, but the coats have 31"):
        mitsuba.load_dict(glaze_bsdf(glaze, ground=np.full((2, 2, 5), 0.5)))
    with refusal("wavelengths belong to a Glaze"):
        glaze_bsdf(BLUE, wavelengths=WAVELENGTHS)
    with refusal("a glaze without coats is its ground"):
        glaze_bsdf(Glaze([], 0.5))


_VARIANTS = """
import glazejax.appearance.mitsuba as plugin
import mitsuba

def told(call):
    try:
        call()
    except (ValueError, RuntimeError) as error:
        return str(error)

assert "Mitsuba has no variant set: call mitsuba.set_variant with one of scalar_spectral, llvm_ad_spectral" in told(
    plugin.register)
mitsuba.set_variant("scalar_rgb")
assert "the variant scalar_rgb has none: call mitsuba.set_variant with one of scalar_spectral" in told(plugin.register)
mitsuba.set_variant("scalar_spectral")
plugin.register()
made = plugin.glaze_bsdf("Eosin:2um")
mitsuba.set_variant("scalar_rgb")
assert "the variant scalar_rgb has none" in told(lambda: mitsuba.load_dict(made))
mitsuba.set_variant("scalar_spectral")
assert "Eosin" in str(mitsuba.load_dict(made))
"""


@pytest.mark.slow
def test_variants_without_spectra_are_refused(mitsuba):
    run_python(_VARIANTS)


def test_reciprocity(mitsuba, blue):
    for one, two in PAIRS:
        assert_allclose(factor(blue, one, two), factor(blue, two, one), rtol=2e-6)


def test_all_light_comes_back_where_nothing_absorbs(mitsuba):
    bsdf = loaded(coats=WHITE)
    for cosine in (1.0, 0.4, 0.1):
        whole = albedo(bsdf, cosine) + float(dielectric_reflectance(cosine, 1.5))
        assert whole == pytest.approx(1.0, abs=2e-3)


def test_wavelengths_come_at_even_distances():
    grid = np.array([400.0, 420.0, 430.0, 460.0])
    paint = Pigment("p", grid, [1e4] * 4, [2e5] * 4)
    even = on_even_grid(Glaze([Layer(paint, 1e-6)], np.array([0.1, 0.3, 0.4, 0.7])))
    assert_allclose(even.wavelengths, np.arange(400, 461, 10))
    assert_allclose(even.ground, np.linspace(0.1, 0.7, 7), atol=1e-9)
