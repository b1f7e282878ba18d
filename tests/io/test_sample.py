"""FILE and FILE:SAMPLE name one measured spectrum, or say what is wrong in one line."""

import pytest
from numpy.testing import assert_array_equal

from glazejax.io import read_sample, read_spectra
from glazejax.io.files.sample import split_sample


@pytest.fixture
def cards(tmp_path):
    """Two cards in percent, wavelengths down the rows."""
    path = tmp_path / "cards.csv"
    rows = "\n".join(f"{nm},{80 + nm / 100},{nm / 100}" for nm in range(400, 701, 10))
    path.write_text(f"wavelength_nm,white card,black card\n{rows}\n")
    return path


def test_the_named_spectrum_alone_is_read(cards, tmp_path):
    whole = read_spectra(cards)
    for text, folder in ((f"{cards}:black card", ""), ("cards.csv:black card", tmp_path)):
        found = read_sample(text, folder=folder)
        assert found.names == ("black card",)
        assert found.notes == whole.notes
        assert_array_equal(found.reflectance, whole.reflectance[1:])
        assert_array_equal(found.wavelengths, whole.wavelengths)


def test_a_single_spectrum_needs_no_name(tmp_path):
    path = tmp_path / "grey: one.csv"
    path.write_text("Name,400,500\ngrey,0.4,0.5\n")
    # The colon belongs to the file's own name.
    assert split_sample(str(path)) == (path, "")
    assert split_sample(f"{path}:grey") == (path, "grey")
    assert_array_equal(read_sample(str(path)).reflectance, [[0.4, 0.5]])


def test_a_sample_may_have_colons(tmp_path):
    (tmp_path / "cards.csv").write_text("Name,400,500\nred: 12:30,0.4,0.5\nred,0.1,0.2\n")
    sample = read_sample("cards.csv:red: 12:30", folder=tmp_path)
    assert_array_equal(sample.reflectance, [[0.4, 0.5]])
    (tmp_path / "book.xlsx").touch()
    sheet = tmp_path / "book.xlsx:May"
    assert split_sample("book.xlsx:May:red: 12", tmp_path) == (sheet, "red: 12")
    # Of a file that is not there, as of one without colons in its samples.
    assert split_sample("none.csv:a:b", tmp_path) == (tmp_path / "none.csv:a", "b")


@pytest.mark.parametrize(
    ("text", "kind", "complaint"),
    [
        (
            "cards.csv",
            ValueError,
            r"^--ground \S*cards.csv holds 2 spectra: choose one, as cards.csv:white card "
            r"\(there are white card, b",
        ),
        ("cards.csv:", ValueError, "choose one, as cards.csv:white card "),
        (
            "cards.csv:grey",
            ValueError,
            r"^--ground .* holds no spectrum 'grey'; there are white card, black card$",
        ),
        (
            "cart.csv:grey",
            FileNotFoundError,
            "^--ground 'cart.csv:grey' is neither a number .* nor a file$",
        ),
    ],
)
def test_what_is_wrong_is_said(cards, tmp_path, text, kind, complaint):
    with pytest.raises(kind, match=complaint):
        read_sample(text, folder=tmp_path, argument="--ground")
