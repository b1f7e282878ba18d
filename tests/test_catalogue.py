import numpy as np
import pytest

from glazejax import Glaze, Hemispherical, Layer, Pigment, catalogue, reflectance
from glazejax.io import read_spectra

NAMES = [
    "Eosin1Wax",
    "Eosin",
    "Eosin2PbWax",
    "Cochineal",
    "Minium",
    "Vermillion",
    "ZincWhite",
    "ZincWhiteLinseed",
    "LeadWhite",
    "ViridianGreen",
    "EmeraldGreen",
    "UltramarineBlue",
    "CobaltBlue",
    "PrussianBlue",
    "ChromeYellow",
    "ChromeYellowPoppyseed",
    "ChromeYellowOtero",
    "BariumSulphate",
    "CalciumCarbonate",
    "BoneBlack",
]


def test_names_grid_and_provenance():
    paints = catalogue.load()
    assert sorted(paints) == sorted(NAMES)
    assert len(paints) == len(NAMES)
    for name, paint in paints.items():
        assert isinstance(paint, Pigment)
        assert paint.name == name
        np.testing.assert_array_equal(paint.wavelengths, np.arange(400.0, 701.0, 10.0))
        assert paint.identifiable is not None
        assert paint.absorption_sd is not None
        for word in ("CC0", "25 micrometres", "10.1186/s40494-018-0181-6"):
            assert word in paint.provenance


@pytest.mark.parametrize("asked", ["Vermilion", "vermillion", "Vermillion Red"])
def test_unknown_names_meet_the_nearest(asked):
    with pytest.raises(ValueError, match=f"unknown pigment '{asked}'; nearest: 'Vermillion'"):
        catalogue.pigment(asked)
    with pytest.raises(KeyError, match="Vermillion"):
        catalogue.load()[asked]
    assert asked not in catalogue.load()
    assert catalogue.load().get(asked) is None


def test_name_like_none_lists_all():
    with pytest.raises(ValueError, match=r"the catalogue has.*ZincWhite"):
        catalogue.pigment("xq")


def test_known_name():
    assert catalogue.pigment("ZincWhite").name == "ZincWhite"


def test_what_films_hide_is_flagged():
    paints = catalogue.load()
    # Black never reflects enough to show how it scatters; chrome yellow's tints and shades show all.
    assert np.mean(np.asarray(paints["BoneBlack"].identifiable)) < 0.5
    assert np.all(paints["ChromeYellow"].identifiable)


def test_every_paint_renders():
    for paint in catalogue.load().values():
        for thickness in (2e-6, 25e-6, 200e-6):
            value = np.asarray(reflectance(Glaze([Layer(paint, thickness)], 0.9), Hemispherical(8.0)))
            assert np.all((value > 0.039) & (value < 1.0)), (paint.name, thickness)


def test_masstones_come_back_as_measured(shared_data):
    """At some thickness over its own cards, each paint gives the film that was measured."""
    table = read_spectra(shared_data / "revigo" / "reflectance.tsv")
    lines = (shared_data / "revigo" / "mixtures.tsv").read_text().splitlines()
    samples = {rest.split("-")[0]: sample for sample, rest in (line.split("\t") for line in lines) if "|100" in rest}
    inner, outer = 0.59634, 0.04001
    thickness = catalogue.ASSUMED_THICKNESS * np.geomspace(0.2, 10.0, 60)[:, None]
    for name, paint in catalogue.load().items():
        if name in ("UltramarineBlue", "Cochineal", "BoneBlack"):  # matte, matte, and no film of it alone
            continue
        off = []
        for card, film in (("_b", "_ob"), ("_w", "_ow")):
            bare = (table[samples[name] + card] - outer) / (1 - outer)
            ground = np.clip(bare / (1 - inner + inner * bare), 0, 1)
            glaze = Glaze([Layer(paint, thickness[:, 0])], ground)
            off.append(np.asarray(reflectance(glaze, Hemispherical(8.0), tolerance=1e-4)) - table[samples[name] + film])
        assert np.sqrt(np.mean(np.square(off), axis=(0, 2))).min() < 0.02, name
