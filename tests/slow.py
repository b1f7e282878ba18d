"""What the quick suite leaves out."""

import pytest


def slow(*values):
    """A case of a parametrised test that only the slow suite tries."""
    return pytest.param(*values, marks=pytest.mark.slow)
