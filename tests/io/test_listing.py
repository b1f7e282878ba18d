import json

import numpy as np
import pytest

from glazejax.io import read_spectra

from .samples import refused, same

GOOD = [
    {"type": "wavelengths", "values": [400, 410.5, 420]},
    {
        "name": "white",
        "type": "tint",
        "reflectance": [70, 80, 90],
        "components": [{"name": "white", "grams": 2.5}],
    },
    {"name": "white", "type": "tint", "reflectance": [71, 81, 91], "components": []},
]


FILE = "paints.json"


def changed(index, **fields):
    entries = [dict(entry) for entry in GOOD]
    entries[index].update(fields)
    return entries


def test_spectra_and_their_components(read):
    table = read(json.dumps(GOOD))
    same(
        table,
        [400, 410.5, 420],
        [[0.7, 0.8, 0.9], [0.71, 0.81, 0.91]],
        ["white", "white (2)"],
        atol=1e-12,
    )
    assert table.unit == "percent"
    assert table.attributes["type"] == ("tint", "tint")
    assert json.loads(table.attributes["components"][0]) == [{"name": "white", "grams": 2.5}]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (json.dumps(GOOD)[:-9], "line 1: not legal JSON"),
        ({"a": 1}, "expected a list"),
        ([], "0 entries of wavelengths"),
        (GOOD[1:], "0 entries of wavelengths"),
        (GOOD[:1], "no entry has a reflectance"),
        (changed(0, values=[400, 410]), "3 values for 2 wavelengths"),
        (changed(0, values=None), "'wavelengths' has no list of numbers"),
        (changed(1, reflectance=[70, "high", 90]), "'white' holds 'high', not a number"),
        (changed(1, reflectance=[70, None, 90]), "'white' holds 'None', not a number"),
        (changed(1, reflectance=[70, float("nan"), 90]), "'white' is not finite at band 2"),
        (changed(1, reflectance=[70, -float("inf"), 90]), "'white' is not finite at band 2: -inf"),
        (changed(1, reflectance=[]), "'white' has no list of numbers"),
        (changed(1, reflectance=[0.07, 0.8, 0.9]), "mixed"),
    ],
)
def test_errors_are_one_line(put, content, complaint):
    refused(put(content if isinstance(content, str) else json.dumps(content)), complaint)


def test_wavelengths_are_sorted(read):
    table = read(json.dumps(changed(0, values=[400, 420, 410])))
    assert "bands were sorted by wavelength" in table.notes


def test_kimera_masstones(shared_data):
    table = read_spectra(shared_data / "kimera" / "masstone.json")
    assert table.reflectance.shape == (39, 170)
    assert table.unit == "percent"
    # Three repeats of each paint, which differ by what its SOURCE.md says of the instrument's
    # noise.
    bands = (table.wavelengths > 410) & (table.wavelengths < 680)
    repeats = table.reflectance[:, bands].reshape(13, 3, -1)
    assert np.mean(repeats.std(axis=1)) == pytest.approx(0.0018, abs=1e-4)
    assert table.names[:3] == ("white", "white (2)", "white (3)")
