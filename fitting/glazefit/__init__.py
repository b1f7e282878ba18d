"""From measured paint to its absorption and scattering: the inverse of `glazejax`.

Read films with `read_films`, recover k and s with `recover_films`, and make test films with `simulate_films`.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .films import Films, Instrument, Noise
    from .readers import read_films
    from .recover import recover_films
    from .result import Recovery
    from .simulate import simulate_films

__all__ = ["Films", "Instrument", "Noise", "Recovery", "read_films", "recover_films", "simulate_films"]

_HOMES = {
    "Films": "films",
    "Instrument": "films",
    "Noise": "films",
    "Recovery": "result",
    "read_films": "readers",
    "recover_films": "recover",
    "simulate_films": "simulate",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for, so that the command starts without optimistix."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
