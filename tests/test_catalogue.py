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


def test_opaque_paints_are_flagged_and_clear_ones_not():
    paints = catalogue.load()
    for name in ("Vermillion", "PrussianBlue"):
        assert not np.any(paints[name].identifiable)
    for name in ("BariumSulphate", "CalciumCarbonate"):
        assert np.all(paints[name].identifiable)


def test_every_paint_renders():
    for paint in catalogue.load().values():
        for thickness in (2e-6, 25e-6, 200e-6):
            value = np.asarray(reflectance(Glaze([Layer(paint, thickness)], 0.9), Hemispherical(8.0)))
            assert np.all((value > 0.039) & (value < 1.0)), (paint.name, thickness)


def test_masstones_come_back_as_measured(shared_data):
    """At the assumed thickness over its own white card, each paint gives the film that was measured."""
    table = read_spectra(shared_data / "revigo" / "reflectance.tsv")
    lines = (shared_data / "revigo" / "mixtures.tsv").read_text().splitlines()
    samples = {rest.split("-")[0]: sample for sample, rest in (line.split("\t") for line in lines) if "|100" in rest}
    inner, outer = 0.59634, 0.04001
    for name, paint in catalogue.load().items():
        if name == "UltramarineBlue":  # matte: its surface is not the model's
            continue
        bare = (table[samples[name] + "_w"] - outer) / (1 - outer)
        card = bare / (1 - inner + inner * bare)
        value = reflectance(Glaze([Layer(paint, catalogue.ASSUMED_THICKNESS)], card), Hemispherical(8.0))
        np.testing.assert_allclose(value, table[samples[name] + "_ow"], atol=4e-3, err_msg=name)
