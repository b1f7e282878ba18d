"""From measured paint to its absorption and scattering: the inverse of `glazejax`.

Read films with `read_films`, recover k and s with `recover_films`, and make test films with `simulate_films`.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .crossvalidation import LeftOut, leave_films_out
    from .evidence import Discrepancy, Prior
    from .films import Films, Instrument, Noise
    from .identification import ground_from_air, identify, identify_films
    from .identify_result import Candidate, Identification
    from .joint import recover_jointly
    from .joint_result import JointRecovery
    from .mixing import MixingLaw
    from .posterior import Posterior, posterior_of_bands, posterior_of_film
    from .posterior_film import FilmPrior
    from .posterior_reading import Reading, over_ground
    from .prediction import Prediction, predict_films
    from .readers import read_films
    from .recipe import Recipe, find_recipes
    from .recover import recover_films
    from .result import Recovery
    from .simulate import simulate_films
    from .targets import Target, colourchecker_targets, lab_target, spectral_target, srgb_target

__all__ = [
    "Candidate",
    "Discrepancy",
    "FilmPrior",
    "Films",
    "Identification",
    "Instrument",
    "JointRecovery",
    "LeftOut",
    "MixingLaw",
    "Noise",
    "Posterior",
    "Prediction",
    "Prior",
    "Reading",
    "Recipe",
    "Recovery",
    "Target",
    "colourchecker_targets",
    "find_recipes",
    "ground_from_air",
    "identify",
    "identify_films",
    "lab_target",
    "leave_films_out",
    "over_ground",
    "posterior_of_bands",
    "posterior_of_film",
    "predict_films",
    "read_films",
    "recover_films",
    "recover_jointly",
    "simulate_films",
    "spectral_target",
    "srgb_target",
]

_HOMES = {
    "Candidate": "identify_result",
    "Discrepancy": "evidence",
    "FilmPrior": "posterior_film",
    "Films": "films",
    "Identification": "identify_result",
    "Instrument": "films",
    "Noise": "films",
    "Posterior": "posterior",
    "Prior": "evidence",
    "Reading": "posterior_reading",
    "Recipe": "recipe",
    "Recovery": "result",
    "Target": "targets",
    "colourchecker_targets": "targets",
    "find_recipes": "recipe",
    "ground_from_air": "identification",
    "identify": "identification",
    "identify_films": "identification",
    "lab_target": "targets",
    "over_ground": "posterior_reading",
    "posterior_of_bands": "posterior",
    "posterior_of_film": "posterior",
    "read_films": "readers",
    "recover_films": "recover",
    "recover_jointly": "joint",
    "predict_films": "prediction",
    "Prediction": "prediction",
    "LeftOut": "crossvalidation",
    "leave_films_out": "crossvalidation",
    "JointRecovery": "joint_result",
    "MixingLaw": "mixing",
    "simulate_films": "simulate",
    "spectral_target": "targets",
    "srgb_target": "targets",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for, so that the command starts without optimistix."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
