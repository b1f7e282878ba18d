"""`glazejax.fit` is the inverse package, loaded when somebody asks for it."""

import sys

import pytest

import glazejax

from .fresh import run_python


def test_fit_is_the_inverse_package():
    import glazefit

    assert glazejax.fit is glazefit
    assert glazejax.fit.identify is glazefit.identify


def test_the_inverse_package_is_not_loaded_before():
    lines = (
        "import sys, glazejax",
        "assert 'glazefit' not in sys.modules",
        "glazejax.fit",
        "assert 'glazefit' in sys.modules",
    )
    run_python("\n".join(lines))


def test_without_the_inverse_package_a_sentence_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "glazefit", None)
    with pytest.raises(AttributeError, match="package glazefit, which is not installed"):
        glazejax.fit  # noqa: B018
