import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Pigment, catalogue
from glazejax.paint.pigment_table import read_pigments, write_pigments

from .refusals import refusal

HEADER = "pigment,wavelength_nm,absorption,scattering,absorption_sd,scattering_sd,identifiable\n"
GOOD = (
    HEADER
    + "A,400,10,20,1,2,True\nA,410,11,21,1,2,false\nB,400,1,2,0.1,inf,True\nB,410,3,4,0.1,0.2,True\n"
)


def put(tmp_path, text):
    path = tmp_path / "pigments.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_pigments_are_read(tmp_path):
    pigments = read_pigments(put(tmp_path, GOOD))
    assert list(pigments) == ["A", "B"]
    a, b = pigments["A"], pigments["B"]
    assert_array_equal(
        [a.wavelengths, a.absorption, a.scattering], [[400, 410], [10, 11], [20, 21]]
    )
    assert_array_equal(a.scattering_sd, [2, 2])
    assert_array_equal(a.identifiable, [True, False])
    assert_array_equal(b.scattering, [2, 4])
    assert b.scattering_sd is None
    assert "pigments.csv" in a.provenance


def test_pigments_that_were_written_read_back(tmp_path):
    oil = catalogue.pigment("ViridianGreen")
    plain = Pigment("=Spot, 1", [400.0, 500.0], [1.5, 2.0], [3.0, 0.1])
    numbered = plain.renamed("#1 blue")
    path = tmp_path / "mine.csv"
    write_pigments(path, [oil, plain, numbered], ["found in a map"])
    found = read_pigments(path)
    assert list(found) == [oil.name, plain.name, numbered.name]
    for one in (oil, plain):
        again = found[one.name]
        for name in ("absorption", "scattering", "absorption_sd", "scattering_sd", "error_modes"):
            wanted, got = getattr(one, name), getattr(again, name)
            assert (wanted is None) == (got is None), name
            if wanted is not None:
                assert_array_equal(got, wanted)
    assert_array_equal(found[oil.name].identifiable, oil.identifiable)
    assert "found in a map" in found[plain.name].provenance
    with pytest.raises(FileExistsError):
        write_pigments(path, [plain])


def test_coefficients_are_rounded_where_digits_are_asked_for(tmp_path):
    path = tmp_path / "mine.csv"
    paint = Pigment("A", [400.0, 500.0], [1.23456, 2e5 / 3], [3.0, 0.1], scattering_sd=[1e-7, 1.0])
    write_pigments(path, [paint], digits=3)
    assert path.read_text().splitlines()[1:] == [
        "A,400,1.23,3,,1e-07,True",
        "A,500,6.67e+04,0.1,,1,True",
    ]


def test_columns_in_any_order_comments_and_extras(tmp_path):
    text = (
        "# fitted, if each film is 20 um "
        "thick\nscattering,extra,pigment,absorption,wavelength_nm\n2,x,A,1,400\n"
    )
    pigment = read_pigments(put(tmp_path, text))["A"]
    assert (float(pigment.absorption[0]), float(pigment.scattering[0])) == (1, 2)
    assert pigment.identifiable is None
    assert pigment.provenance == "fitted, if each film is 20 um thick"


def test_paints_may_have_different_numbers_of_error_modes(tmp_path):
    grid = np.array([400.0, 500.0])
    few, many = np.full((1, 2, 2), 0.1), np.full((3, 2, 2), 0.2)
    paints = [
        Pigment(name, grid, [1e4, 2e4], [1e4, 1e4], error_modes=modes)
        for name, modes in (("few", few), ("many", many), ("none", None))
    ]
    write_pigments(tmp_path / "paints.csv", paints)
    again = read_pigments(tmp_path / "paints.csv")
    padded = np.concatenate([few, np.zeros((2, 2, 2))])
    for name, expected in (("few", padded), ("many", many)):
        modes = again[name].error_modes
        assert modes is not None
        assert_allclose(modes, expected)
    assert again["none"].error_modes is None


def test_error_modes_are_paired_by_their_numbers(tmp_path):
    text = (
        "pigment,wavelength_nm,absorption,scattering,k_mode_10,s_mode_2,k_mode_2,s_mode_10\n"
        "A,400,1,1,.1,.2,.3,.4\n"
    )
    modes = read_pigments(put(tmp_path, text))["A"].error_modes
    assert_array_equal(modes, [[[0.3], [0.2]], [[0.1], [0.4]]])
    alone = put(tmp_path, text.replace("s_mode_2", "s_mode_3"))
    assert read_pigments(alone)["A"].error_modes is None


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "the file is empty"),
        (HEADER, "no pigment below it"),
        (HEADER.replace("scattering,", "", 1), "line 1: no column scattering"),
        (
            GOOD.replace("A,410,11", "A,410,much"),
            "line 3: absorption is 'much', not a finite number",
        ),
        (GOOD.replace("A,410,11", "A,410,nan"), "line 3: absorption is 'nan'"),
        (GOOD.replace("A,410,11", "A,410,-11"), "pigment 'A': absorption of 'A' must be"),
        (GOOD.replace("A,410", "A,390"), "pigment 'A': wavelengths must ascend"),
        (GOOD.replace("false", "maybe"), "line 3: identifiable is 'maybe'"),
        (GOOD.replace(",false", ""), "line 3: 6 cells where the header has 7"),
        (GOOD.replace("\nA,410", "\n,410"), "line 3: the pigment has no name"),
    ],
)
def test_bad_tables_are_refused(tmp_path, text, complaint):
    with refusal(complaint):
        read_pigments(put(tmp_path, text))


def test_missing_file_and_folder(tmp_path):
    with refusal("no such file of pigments", FileNotFoundError):
        read_pigments(tmp_path / "none.csv")
    with refusal("is a folder"):
        read_pigments(tmp_path)
