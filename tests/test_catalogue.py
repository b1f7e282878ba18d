import csv

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Glaze, Layer, Mixture, Pigment, catalogue, colour, reflectance
from glazejax.io import read_spectra

from .refusals import refusal

_NAMES = """
Eosin1Wax Eosin Eosin2PbWax Cochineal Minium Vermillion ZincWhite ZincWhiteLinseed LeadWhite
ViridianGreen EmeraldGreen UltramarineBlue CobaltBlue PrussianBlue ChromeYellow
ChromeYellowPoppyseed ChromeYellowOtero BariumSulphate CalciumCarbonate BoneBlack
"""
NAMES = _NAMES.split()


def test_names_grid_and_provenance():
    paints = catalogue.load()
    assert sorted(paints) == sorted(NAMES)
    assert len(paints) == len(NAMES)
    for name, paint in paints.items():
        assert isinstance(paint, Pigment)
        assert paint.name == name
        assert_array_equal(paint.wavelengths, np.arange(400.0, 701.0, 10.0))
        assert paint.identifiable is not None
        assert paint.absorption_sd is not None
        for word in ("CC0", "25 micrometres", "10.1186/s40494-018-0181-6"):
            assert word in paint.provenance


def test_paints_are_read_once_for_each_precision():
    double = catalogue.load()["ZincWhite"]
    assert catalogue.load()["ZincWhite"] is double
    with jax.enable_x64(False):
        single = catalogue.load()["ZincWhite"]
    assert (double.absorption.dtype, single.absorption.dtype) == (np.float64, np.float32)
    assert_allclose(single.absorption, double.absorption, rtol=1e-6)


def test_what_is_first_read_in_a_traced_function_outlives_it():
    catalogue._read_once.cache_clear()
    traced = jax.jit(lambda x: x * catalogue.load()["ZincWhite"].absorption)(2.0)
    assert_allclose(traced, 2.0 * np.asarray(catalogue.load()["ZincWhite"].absorption))


@pytest.mark.parametrize("asked", ["Vermilion", "vermillion", "Vermillion Red"])
def test_unknown_names_meet_the_nearest(asked):
    with refusal(f"unknown pigment '{asked}'; nearest: 'Vermillion'"):
        catalogue.pigment(asked)
    with refusal("Vermillion", KeyError):
        catalogue.load()[asked]
    assert asked not in catalogue.load()
    assert catalogue.load().get(asked) is None


def test_name_like_none_lists_all():
    with refusal(r"the catalogue has.*ZincWhite"):
        catalogue.pigment("xq")


def test_what_films_hide_is_flagged():
    paints = catalogue.load()
    # Black never reflects enough to show how it scatters; chrome yellow's tints and shades show
    # all.
    assert np.mean(np.asarray(paints["BoneBlack"].identifiable)) < 0.5
    assert np.all(paints["ChromeYellow"].identifiable)


def under_the_surface(reading, outer):
    """What a ground reflects inside the paint, of its reading in air."""
    inner = 0.59634
    bare = (reading - outer) / (1 - outer)
    return bare / (1 - inner + inner * bare)


def test_masstones_come_back_as_measured(shared_data):
    """At some thickness over its own cards, each paint gives the film that was measured."""
    table = read_spectra(shared_data / "revigo" / "reflectance.tsv")
    lines = (shared_data / "revigo" / "mixtures.tsv").read_text().splitlines()
    samples = {
        rest.split("-")[0]: sample
        for sample, rest in (line.split("\t") for line in lines)
        if "|100" in rest
    }
    thickness = catalogue.ASSUMED_THICKNESS * np.geomspace(0.2, 10.0, 60)
    for name, paint in catalogue.load().items():
        if name in (
            "UltramarineBlue",
            "Cochineal",
            "BoneBlack",
        ):  # matte, matte, and no film of it alone
            continue
        off = []
        for card, film in (("_b", "_ob"), ("_w", "_ow")):
            ground = np.clip(under_the_surface(table[samples[name] + card], 0.04001), 0, 1)
            spectra = reflectance(Glaze([Layer(paint, thickness)], ground), "d:8", tolerance=1e-4)
            off.append(np.asarray(spectra) - table[samples[name] + film])
        assert np.sqrt(np.mean(np.square(off), axis=(0, 2))).min() < 0.02, name


def test_catalogues_by_name():
    assert catalogue.names() == ("oils", "acrylics")
    assert set(catalogue.load("oils")) == set(catalogue.load()) == set(NAMES)
    assert catalogue.pigment("PyrroleRed", "acrylics").name == "PyrroleRed"
    with refusal("no catalogue 'watercolours'; choose from oils, acrylics"):
        catalogue.load("watercolours")
    with refusal("choose from oils, acrylics"):
        catalogue.pigment("ZincWhite", "Oils")
    with refusal("unknown pigment 'ZincWhite'; nearest: 'TitaniumWhite'"):
        catalogue.pigment("ZincWhite", "acrylics")


def test_acrylics_grid_errors_and_provenance():
    paints = catalogue.load("acrylics")
    assert len(paints) == 19
    for paint in paints.values():
        assert_array_equal(paint.wavelengths, np.arange(380.0, 751.0, 10.0))
        assert paint.absorption_sd is None
        assert paint.scattering_sd is None
        assert paint.identifiable is not None
        for word in ("MIT", "William Acton", "4bf3d8c", "500000 1/m"):
            assert word in paint.provenance
    assert_array_equal(paints["TitaniumWhite"].scattering, 5e5)
    # Where a paint is as clear as the white its tint does not show it; where it colours the white,
    # it does.
    known = np.asarray(paints["BismuthVanadateYellow"].identifiable)
    assert known[:10].all()
    assert not known[20:].any()


def test_the_assumed_scale_is_said():
    assert "25 µm" in str(catalogue.assumed_scale(catalogue.pigment("ZincWhite")))
    assert "76 µm of titanium white" in str(
        catalogue.assumed_scale(catalogue.pigment("BoneBlack", "acrylics"))
    )
    assert catalogue.assumed_scale(Pigment("mine", [400.0, 500.0], [1.0, 1.0], [1.0, 1.0])) is None


@pytest.fixture(scope="module")
def golden(shared_data):
    """K and S of the source, (paints, bands), by the catalogue's names."""
    rows = {}
    with (shared_data / "golden" / "kubelka_munk.tsv").open() as file:
        for row in csv.DictReader(file, delimiter="\t"):
            rows.setdefault(row["paint"], []).append((float(row["K"]), float(row["S"])))
    assert list(rows) == list(catalogue.load("acrylics"))
    return np.moveaxis(np.array(list(rows.values())), -1, 0)


@pytest.mark.parametrize(
    ("white", "shared_light", "plainly"),
    [(0.0, 0.02, 0.25), (10 / 11, 0.02, 0.25), (0.5, 1.6, 1.8), (100 / 101, 1.1, 1.2)],
)
def test_acrylics_reflect_what_k_and_s_give(golden, white, shared_light, plainly):
    """Kubelka and Munk's opaque films under Saunderson's surface, in numpy, against this
    program's.
    """
    paints = list(catalogue.load("acrylics").values())
    absorption, scattering = (1 - white) * golden + white * golden[:, -1:]
    ratio = absorption / scattering
    inside = 1 + ratio - np.sqrt(ratio**2 + 2 * ratio)
    theirs = 0.03 + 0.97 * (1 - 0.65) * inside / (1 - 0.65 * inside)
    tints = [Mixture([paint, paints[-1]], [1 - white, white]) for paint in paints]
    films = [Glaze([Layer(tint, 0.01)], 0.0) for tint in tints]
    ours = np.stack([reflectance(film, "de:8") for film in films])
    fresnel = 0.0400  # of index 1.5 at 8 degrees
    grid = paints[0].wavelengths
    for values, bound in (
        (0.03 + 0.97 * ours / (1 - fresnel), shared_light),
        (0.03 + ours, plainly),
    ):
        apart = colour.delta_e_2000(colour.lab(grid, theirs), colour.lab(grid, values))
        assert apart.max() < bound


def test_titanium_white_hides_as_assumed():
    """Over a card that reads .8, a film of 76 micrometres reaches 98 % contrast."""
    white = catalogue.pigment("TitaniumWhite", "acrylics")
    luminance = []
    for ground in (0.0, under_the_surface(0.8, 0.03)):
        film = 0.03 + 0.97 / 0.96 * reflectance(Glaze([Layer(white, 76e-6)], ground), "de:8")
        luminance.append(float(colour.xyz(white.wavelengths, film)[1]))
    assert luminance[0] / luminance[1] == pytest.approx(0.98, abs=1e-3)


def test_own_paints_are_read_as_those_that_ship(tmp_path):
    own = tmp_path / "mine.csv"
    lines = [f"Night,{nm},{1000 + nm},{2000 - nm}" for nm in (400, 500, 600, 700)]
    own.write_text(
        "pigment,wavelength_nm,absorption,scattering\n" + "\n".join(lines) + "\n", encoding="utf-8"
    )
    mine = catalogue.read(own)
    assert list(mine) == ["Night"]
    assert_allclose(mine["Night"].absorption, [1400, 1500, 1600, 1700])
    with refusal("unknown pigment 'night blue'; nearest: 'Night'", KeyError):
        mine["night blue"]


def test_a_file_of_own_paints_that_is_not_there_is_said_in_a_line(tmp_path):
    with refusal(r"nowhere\.csv", FileNotFoundError):
        catalogue.read(tmp_path / "nowhere.csv")
