"""From measured paint to its absorption and scattering: the inverse of `glazejax`.

Read films with `read_films`, recover k and s with `recover_films`, and make test films with
`simulate_films`.
"""

import warnings
from typing import Any

import lazy_loader

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_FORMER_NAMES = {
    "Discrepancy": "ModelError",
    "FilmPrior": "Prior",
    "leave_films_out": "cross_validate",
    "mixture_of": "mix",
    "named_recipes": "recipes_from_names",
    "over_ground": "reading_over",
    "read_names": "read_recipes",
    "set_names": "set_labels",
}
"""Names before version 0.2, which still work for that version: old -> new."""


def __getattr__(name: str) -> Any:
    if name in _FORMER_NAMES:
        new = _FORMER_NAMES[name]
        warnings.warn(
            f"glazefit.{name} is called glazefit.{new} now", DeprecationWarning, stacklevel=2
        )
        return _load(new)
    return _load(name)
