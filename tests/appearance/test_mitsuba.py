"""Glazes exported as measured BSDFs: the same reflectance in Mitsuba 3, where it is installed."""

import struct
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.mitsuba_compare import WAVELENGTHS, cases

import glazejax as gj
from glazejax.appearance.glaze.mitsuba import (
    export_glaze,
    measured_fields,
    reflectance_in_mitsuba,
    write_tensor_file,
)
from glazejax.appearance.glaze.table import glaze_table
from glazejax.appearance.scene.lights import ParallelLight
from glazejax.appearance.scene.materials import Lambert, Phong
from glazejax.appearance.scene.mitsuba import mitsuba_scene
from glazejax.appearance.scene.scene import Camera
from glazejax.appearance.scene.shapes import Plane
from glazejax.radiative.common.fresnel import dielectric_reflectance

from .scenes import scene

pytestmark = pytest.mark.optimised
VARIANT = "scalar_spectral"


@pytest.fixture(scope="module")
def table():
    paints = gj.catalogue.load()
    layers = [gj.Layer(paints["UltramarineBlue"], 2e-6), gj.Layer(paints["ZincWhite"], 10e-6)]
    return glaze_table(gj.Glaze(layers, 0.8), WAVELENGTHS, tolerance=1e-4)


@pytest.fixture
def mitsuba():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant(VARIANT)
    return mi


def test_tensor_files_hold_what_was_written(tmp_path):
    fields = {
        "a": np.arange(6, dtype=np.float32).reshape(2, 3),
        "name": np.frombuffer(b"xyz", np.uint8),
    }
    write_tensor_file(tmp_path / "t", fields)
    content = (tmp_path / "t").read_bytes()
    assert content[:18] == b"tensor_file\0" + bytes([1, 0]) + struct.pack("<I", 2)
    assert content[18:21] == b"\x01\x00a"
    ndim, kind, place = struct.unpack("<HBQ", content[21:32])
    assert (ndim, kind) == (2, 10)
    assert struct.unpack("<2Q", content[32:48]) == (2, 3)
    np.testing.assert_array_equal(
        np.frombuffer(content[place : place + 24], np.float32).reshape(2, 3), fields["a"]
    )
    assert content[place + 24 :] == b"xyz"
    with pytest.raises(ValueError, match="b holds float64"):
        write_tensor_file(tmp_path / "t", {"b": np.zeros(2)})


def test_the_table_holds_the_reflectance_factor(table):
    fields = measured_fields(table, WAVELENGTHS, angles=8, resolution=9)
    # Half vector along the normal: light and eye at the same angle.
    for k in (0, 3, 5):
        cosine = float(np.cos(fields["theta_i"][k]))
        exact = np.asarray(table.reflectance_factor(cosine, cosine)) * cosine / np.pi
        np.testing.assert_allclose(fields["spectra"][0, k, :, 4, 0], exact, rtol=1e-5)
    assert (fields["luminance"] > 0).all()


def test_files_are_not_overwritten(table, tmp_path):
    (tmp_path / "g.bsdf").write_text("mine")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        export_glaze(table, tmp_path / "g.bsdf", WAVELENGTHS)
    with pytest.raises(ValueError, match="31 bands, but 3 wavelengths"):
        export_glaze(table, tmp_path / "h.bsdf", [400.0, 500.0, 600.0])


def test_what_cannot_be_exported(table, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"the folder .*none does not exist"):
        export_glaze(table, tmp_path / "none" / "g.bsdf", WAVELENGTHS)
    with pytest.raises(ValueError, match="angles is 1; it must be at least 2"):
        export_glaze(table, tmp_path / "g.bsdf", WAVELENGTHS, angles=1)
    narrow = glaze_table(gj.Glaze([], 0.5), WAVELENGTHS, angles=((0, 90), (0, 45)))
    with pytest.raises(ValueError, match="0 to 45 degrees of viewing: export one of all angles"):
        export_glaze(narrow, tmp_path / "g.bsdf", WAVELENGTHS)
    made = scene(
        [Plane("m")], {"m": Lambert(0.5)}, [ParallelLight((0, 0, -1), 1.0)], Camera((0, -3, 2))
    )
    with pytest.raises(FileNotFoundError, match=r"the folder .*none for meshes does not exist"):
        mitsuba_scene(made, tmp_path / "none")
    assert list(tmp_path.iterdir()) == []


def test_mitsuba_finds_the_same_reflectance(table, tmp_path, mitsuba):
    bsdf = export_glaze(table, tmp_path / "g.bsdf", WAVELENGTHS, gloss=False)
    for light, view, azimuth in [
        (1.0, 0.7, 0.0),
        (0.7, 0.7, np.pi),
        (0.7, 0.7, 0.0),
        (0.3, 0.9, 1.0),
        (0.5, 0.15, 3.0),
    ]:
        there = reflectance_in_mitsuba(bsdf, WAVELENGTHS[::6], light, view, azimuth)
        here = np.asarray(table.reflectance_factor(light, view))[::6]
        np.testing.assert_allclose(there, here, atol=0.004)


def test_gloss_adds_the_reflection_of_the_surface(table, tmp_path, mitsuba):
    cosine, count = 0.4, 4000
    rng = np.random.default_rng(0)
    where = mitsuba.SurfaceInteraction3f()
    where.wi = mitsuba.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, cosine)
    where.wavelengths = mitsuba.UnpolarizedSpectrum(500.0)
    means, errors = [], []
    for gloss in (True, False):
        loaded = mitsuba.load_dict(
            export_glaze(table, tmp_path / f"{gloss}.bsdf", WAVELENGTHS, gloss=gloss)
        )
        draws = rng.random((count, 3)).tolist()
        weights = [
            loaded.sample(mitsuba.BSDFContext(), where, one, two)[1][0] for one, *two in draws
        ]
        means.append(np.mean(weights))
        errors.append(np.std(weights) / np.sqrt(count))
    exact = float(dielectric_reflectance(cosine, 1.5))
    assert abs(means[0] - means[1] - exact) < 4 * np.hypot(*errors)
    assert np.hypot(*errors) < 0.1 * exact


def test_what_mitsuba_has_no_counterpart_of(mitsuba, tmp_path):
    scene = cases(8, 6)["diffuse"].scene
    with pytest.raises(ValueError, match="'ball': Mitsuba has no counterpart of Phong"):
        mitsuba_scene(
            replace(scene, materials=dict(scene.materials) | {"ball": Phong(0.5)}), tmp_path
        )


def test_export_needs_no_mitsuba():
    code = (
        "import sys; import glazejax.appearance.glaze.mitsuba; assert 'mitsuba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
