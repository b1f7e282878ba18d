"""Spectra that tests write and read, and strategies that make them."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from glazejax.io import SpectraTable

GRID = np.arange(400.0, 701.0, 10.0)


def spectra(rows=3, grid=GRID):
    """Smooth, different, legal fractions."""
    centres = np.linspace(420, 680, rows)[:, None]
    return 0.05 + 0.8 / (1 + np.exp((centres - grid) / 15))


def same(table, grid, values, names, atol=0.0):
    """Assert that a table holds this."""
    assert table.names == tuple(names)
    np.testing.assert_allclose(table.wavelengths, grid, rtol=0, atol=1e-9)
    np.testing.assert_allclose(table.reflectance, values, rtol=0, atol=atol)


def complains(error, path):
    """Assert that an error is one line that names the file."""
    message = str(error.value)
    assert "\n" not in message
    assert path.stem in message
    return True


# Letters of all kinds, but no blanks at the ends or in a row and no control characters: those are changed on purpose.
NAMES = st.text(
    st.characters(exclude_categories=("Cs", "Cc", "Cn", "Zs", "Zl", "Zp"), exclude_characters="\ufeff"), min_size=1
)


@st.composite
def tables(draw, wavelengths=None, names=NAMES):
    """Tables of a few spectra with any legal fractions."""
    labels = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    if wavelengths is None:
        grid = draw(st.lists(st.floats(200, 3000), min_size=1, max_size=9, unique=True).map(sorted))
    else:
        grid = draw(wavelengths)
    values = draw(arrays.arrays(float, (len(labels), len(grid)), elements=st.floats(0, 3)))
    return SpectraTable(np.array(grid, float), tuple(labels), values)
