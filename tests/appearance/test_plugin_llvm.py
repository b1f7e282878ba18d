"""The BSDF of Mitsuba 3 where Dr.Jit has LLVM: sampling by chi-square tests, energy, and
derivatives.
"""

import numpy as np
import pytest

import glazejax as gj
from glazejax.appearance.mitsuba import glaze_bsdf

from ..slow import slow
from .plugin import BLUE, WHITE, direction, interaction, mitsuba_in, mixed_over_white

# Coats and roughness; of the blue ones all lobes are drawn, and more glazes change the table only.
GLAZES = [
    slow(BLUE, 0.0),
    (BLUE, 0.1),
    slow(BLUE, 0.5),
    slow("Eosin:3um, ZincWhite:20um", 0.1),
    slow("CobaltBlue:0um", 0.5),
    slow("Eosin:200um", 0.0),
]
# How often a lobe is drawn need not be exact, and a coarse table is made sooner.
COARSE = 0.02


@pytest.fixture(scope="module")
def mitsuba():
    return mitsuba_in("llvm_ad_spectral")


@pytest.mark.parametrize(("coats", "roughness"), GLAZES)
def test_directions_are_drawn_as_the_density_says(mitsuba, coats, roughness):
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain  # pyright: ignore[reportMissingImports]

    given = {"type": "glaze", "coats": coats, "roughness": roughness, "tolerance": COARSE}
    # A mirror has no density: there the body alone is drawn.
    flags = mitsuba.BSDFFlags
    kind = flags.All if roughness else flags.DiffuseReflection
    context = mitsuba.BSDFContext(mitsuba.TransportMode.Radiance, int(kind), 0xFFFFFFFF)
    for angle in (0.2, 1.1):
        wi = [float(np.sin(angle)), 0.0, float(np.cos(angle))]
        sample, density = BSDFAdapter("glaze", given, wi=wi, ctx=context)
        test = ChiSquareTest(
            domain=SphericalDomain(),
            sample_func=sample,
            pdf_func=density,
            sample_dim=3,
            sample_count=200_000,
            res=61,
            ires=16,
        )
        assert test.run(significance_level=0.001), angle


@pytest.mark.slow
def test_derivatives_by_textures_are_those_of_the_solver(mitsuba):
    import drjit as dr
    import jax

    mixture, glaze = mixed_over_white(np.arange(400.0, 701.0, 100.0))
    given: dict = {
        "thickness": np.array([[1.5e-6]]),
        "fraction": np.array([[0.3]]),
        "ground": np.array([[0.6]]),
    }
    bsdf = mitsuba.load_dict(glaze_bsdf(glaze, **given, thickness_max=6e-6, tolerance=1e-4))
    params = mitsuba.traverse(bsdf)
    names = [f"{name}.data" for name in given]
    assert set(names) <= set(params.keys())
    for name in names:
        dr.enable_grad(params[name])
    params.update()
    si = interaction(0.6, wavelengths=[500.0] * 4)
    cosine = 0.8
    dr.backward(bsdf.eval(mitsuba.BSDFContext(), si, direction(cosine))[0])
    # Mitsuba makes a map of one value one of 2 x 2.
    found = [float(np.array(dr.grad(params[name])).sum()) * np.pi / cosine for name in names]

    def factor(thickness, fraction, ground):
        one = gj.Mixture(mixture.pigments, jax.numpy.stack([1 - fraction, fraction]))
        there = gj.Glaze([gj.Layer(one, thickness * 1e-6), glaze.coats[1]], ground)
        seen = gj.Bidirectional(*np.rad2deg(np.arccos([0.6, cosine])).tolist())
        return gj.reflectance(there, seen)[1]  # at 500 nm

    slopes = jax.grad(factor, (0, 1, 2))(1.5, 0.3, 0.6)
    np.testing.assert_allclose(found, np.array(slopes), rtol=0.01, atol=1e-3)


def furnace(mi, bsdf):
    """What a sphere of the material sends back of even light of one, in every pixel's middle, as a
    share of it.
    """
    view = mi.ScalarTransform4f().look_at([0, 0, 3.0], [0, 0, 0], [0, 1, 0])
    film = {
        "type": "hdrfilm",
        "width": 16,
        "height": 16,
        "pixel_format": "luminance",
        "rfilter": {"type": "box"},
    }
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "sensor": {"type": "perspective", "fov": 25, "to_world": view, "film": film},
        "light": {"type": "constant"},
    }
    ball = {"thing": {"type": "sphere", "bsdf": bsdf}}
    lit, light = (
        np.array(mi.render(mi.load_dict(one), spp=256))[..., 0] for one in (scene | ball, scene)
    )
    return lit / light.mean()


@pytest.mark.parametrize("roughness", [0.0, slow(0.5)])
def test_all_light_comes_back_in_a_furnace(mitsuba, roughness):
    glaze = {"type": "glaze", "coats": WHITE, "roughness": roughness}
    sent_back = furnace(mitsuba, glaze | {"tolerance": 0.01 if roughness else 1e-3})
    assert sent_back.mean() == pytest.approx(1.0, abs=4e-3)


@pytest.mark.slow
def test_a_strokes_thickness_is_recovered_from_three_views(mitsuba):
    from benchmarks.render.strokes import brush_strokes
    from benchmarks.render.thickness_from_views import recover

    truth = brush_strokes(16)
    found = recover(mitsuba, truth, size=48, target_samples=512, samples=16, steps=120)
    assert np.linalg.norm(found.thickness - truth) < 0.03 * np.linalg.norm(truth)
