"""Names that were changed work for one more version, and say what they are called now."""

import pytest

import glazefit

FORMER_NAMES = {
    "leave_films_out": "cross_validate",
    "mixture_of": "mix",
    "named_recipes": "recipes_from_names",
    "over_ground": "reading_over",
    "read_names": "read_recipes",
    "set_names": "set_labels",
}


@pytest.mark.parametrize(("old", "new"), FORMER_NAMES.items())
def test_a_former_name_warns_and_is_the_same(old, new):
    with pytest.warns(DeprecationWarning, match=f"glazefit.{old} is called glazefit.{new} now"):
        found = getattr(glazefit, old)
    assert found is getattr(glazefit, new)
    assert old not in dir(glazefit)
