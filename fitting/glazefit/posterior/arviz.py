"""A posterior as ArviZ's InferenceData, the form that its plots, its statistics and NetCDF files
take.

Walkers are ArviZ's chains. Lengths are in m, k d and s d optical thicknesses, reflectance a
fraction.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from ..film.problem import FilmProblem
from ..film.reading import Reading
from ..film.solve import load_arviz


def inference_data(
    problem: FilmProblem,
    films: Sequence[Reading],
    draws: Mapping[str, Float[np.ndarray, "steps walkers blocks"]],
    free: Float[np.ndarray, "steps walkers blocks dims"],
    attributes: Mapping[str, Any],
) -> Any:
    """Groups posterior, sample_stats, log_likelihood, posterior_predictive, observed_data and
    constant_data.

    Thicknesses and fractions hold strengths of the paints, drawn at random, which would hide that a
    chain has not converged. Those with `_shown` behind their names are as the readings show them,
    and go with the log-likelihoods. The predictive group holds spectra without noise, of some
    draws; log-likelihoods are up to a constant.

    Args:
        problem: what was sampled.
        films: as measured.
        draws: of every reported quantity.
        free: the same draws of the free unknowns.
        attributes: of the whole and of the group posterior; NetCDF knows no booleans.
    """
    arviz = load_arviz()
    film = films[0]
    bands = problem.kind == "bands"
    single = len(problem.blocks) == 1
    block = "wavelength" if bands else "film"
    coords: dict[str, Any] = {
        "wavelength": film.wavelengths,
        "ground": list(film.grounds),
    }
    if not bands:
        coords["film"] = list(problem.blocks)
    dims: dict[str, list[str]] = {}

    def by_block(name: str, values: np.ndarray) -> np.ndarray:
        """(steps, walkers, blocks) as (walkers, steps, blocks), or without the last axis for a
        single film.
        """
        values = np.swapaxes(values, 0, 1)
        if single and not bands:
            return values[..., 0]
        dims[name] = [block]
        return values

    variables: dict[str, np.ndarray] = {}
    # What has a further axis: of paints, or of the bands of a spectrum.
    stacks: dict[str, list[np.ndarray]] = {}
    spectrum = {q.name: q.spectrum for q in problem.quantities}
    shown = problem.shown(free) if problem.random else {}
    rows = [(name, "", values) for name, values in draws.items()]
    rows += [
        (name, "_shown", values)
        for name, values in shown.items()
        if name.startswith(("fraction", "thickness"))
    ]
    for name, suffix, values in rows:
        paint = name.startswith("fraction ")
        key = ("fraction" if paint else spectrum[name] or name.replace(" ", "_")) + suffix
        values = by_block(key, values)
        if paint or spectrum[name]:
            stacks.setdefault(key, []).append(values)
        else:
            variables[key] = values
    for key, each_value in stacks.items():
        variables[key] = np.stack(each_value, axis=-1)
        axis = "paint" if key.startswith("fraction") else "wavelength"
        dims[key] = [*dims.get(key, []), axis]
    if "fraction" in stacks:
        coords["paint"] = [n.removeprefix("fraction ") for n in draws if n.startswith("fraction ")]

    flat = free.reshape(-1, *free.shape[2:])
    likelihood = problem.log_likelihood(flat).reshape(free.shape[:3])
    total = problem.log_probability(flat).reshape(free.shape[:3])
    # Spectra of so many draws are enough for a picture.
    spaced = flat[:: max(1, len(flat) // 400)]
    spectra = problem.readings(spaced)[None]
    reading_dims = ["wavelength", "ground"] if bands else ["film", "wavelength", "ground"]

    def each(what: str) -> np.ndarray:
        values = np.stack([getattr(film, what) for film in films])
        return values[0] if bands else values

    dims |= {name: reading_dims for name in ("reflectance", "ground_reflectance", "reflectance_sd")}
    return arviz.from_dict(
        posterior=variables,
        sample_stats={"lp": np.swapaxes(total.sum(axis=-1), 0, 1)},
        log_likelihood={"reading": by_block("reading", likelihood)},
        posterior_predictive={"reflectance": spectra},
        observed_data={"reflectance": each("reflectance")},
        constant_data={"ground_reflectance": each("ground"), "reflectance_sd": each("sd")},
        coords=coords,
        dims=dims,
        attrs=attributes,
        posterior_attrs=attributes,
    )
