"""A mixture that was made and read: what to add to it, by weight, so that it comes nearer to a
colour.

What was read is a paint of its own (`glazefit.recover.predict.mixture.calibrate_mixture`), as
strong as it came out. Paints are added to it, one or two, and nothing can be taken away.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from glazejax import Pigment, colour
from glazejax.geometry import resolve_instrument
from glazejax.spectra import describe_grid

from ..film.films import InstrumentLike
from ..film.model.response import Response, film_response
from ..film.model.variation import SIZES, Variation
from ..recover.joint.joint import UNIT
from ..recover.joint.result import JointRecovery
from ..recover.predict.mixture import mix, predict_mixture
from ..recover.predict.prediction import Prediction
from ..recover.predict.reading_errors import film_readings
from .targets import Target


@dataclass(frozen=True)
class Addition:
    """The next addition to a mixture.

    Attributes:
        target: colour to search for.
        grams: of each paint to add; empty where nothing brings the colour nearer.
        batch: grams of the mixture.
        thickness: of the film whose colour counts, m; None if it hides the ground.
        before, after: CIEDE2000 from the target as the mixture is, and after the addition.
        lab_before, lab_after: colours, (3,).
        expected: CIEDE2000 that the colour after the addition is expected to be off.
        film: what the film will reflect.
    """

    target: Target
    grams: Mapping[str, float]
    batch: float
    thickness: float | None
    before: float
    after: float
    lab_before: Float[np.ndarray, "3"]
    lab_after: Float[np.ndarray, "3"]
    expected: float
    film: Prediction


def next_addition(
    calibrated: JointRecovery,
    target: Target,
    pigments: Sequence[Pigment],
    batch: float,
    *,
    ground: float | Float[np.ndarray, "bands"] = 0.9,
    instrument: InstrumentLike | None = None,
    illuminant: str = "D65",
    observer: str = "2",
) -> Addition:
    """Choose what to add to a mixture that was read, for a film as thick as that one.

    Args:
        calibrated: what `glazefit.recover.predict.mixture.calibrate_mixture` found by the reading.
        target: colour or spectrum to search for; its colour under the illuminant counts.
        pigments: that may be added.
        batch: grams of the mixture that are there.
        ground: internal reflectance of the ground; does not matter if the film read hid it.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        illuminant, observer: under which the colour counts.

    Raises:
        ValueError: a batch that is not positive, or a paint that does not cover the reading's
            wavelengths.
    """
    if not 0 < batch < np.inf:
        raise ValueError(f"the batch is {batch:g} g; it must be above 0, such as 20")
    seen_by = resolve_instrument(instrument)
    grid = calibrated.wavelengths
    for paint in pigments:
        if paint.wavelengths[0] > grid[0] or paint.wavelengths[-1] < grid[-1]:
            raise ValueError(
                f"{paint.name} is known at {describe_grid(paint.wavelengths)} and the mixture at "
                f"{describe_grid(grid)}: leave {paint.name} out of what may be added"
            )
    # The mixture as it came out, then the paints that may be added.
    name = calibrated.paints[0]
    hides = bool(calibrated.films.opaque[0])
    eye = (colour.find_illuminant(illuminant), colour.find_observer(observer))
    mixture = calibrated.pigment(name, UNIT, provenance=name)
    components = [mixture, *(paint.resample(grid) for paint in pigments)]
    pot = _Pot(
        absorption=np.stack([np.asarray(paint.absorption) for paint in components]),
        scattering=np.stack([np.asarray(paint.scattering) for paint in components]),
        wavelengths=grid,
        # A film of 5 mm hides the ground.
        thickness=5e-3 if hides else float(calibrated.thickness[0]) * UNIT,
        ground=np.broadcast_to(np.asarray(ground, dtype=float), grid.shape),
        surface=seen_by.seen_surface * float(calibrated.gloss[0]),
        response=film_response(seen_by),
        goal=target.lab(*eye),
        eye=eye,
    )
    # What brings the colour nearest, in grams.
    amounts = _search(pot)
    grams = {paint.name: float(batch * a) for paint, a in zip(pigments, amounts, strict=True) if a}
    added = {
        p.name: mix({p.name: p}, {p.name: 1.0}, name=p.name) for p in components if p.name in grams
    }
    # The film after the addition, over black and over its ground.
    (film,) = predict_mixture(
        {name: mixture} | added,
        {name: batch} | grams,
        [pot.thickness],
        wavelengths=grid,
        ground=(0.0, pot.ground),
        instrument=seen_by,
        # It is this mixing that goes on; what is added may be as strong as another mixing of it.
        variation=Variation(np.eye(len(SIZES))[0]),
    )
    before, after = np.stack([np.zeros_like(amounts), amounts])[:, None]
    return Addition(
        target=target,
        grams=grams,
        batch=batch,
        thickness=None if hides else pot.thickness,
        before=float(pot.distances(before)[0]),
        after=float(pot.distances(after)[0]),
        lab_before=pot.labs(before)[0],
        lab_after=pot.labs(after)[0],
        expected=float(film.expected_errors(*eye)[1]),
        film=film,
    )


@dataclass(frozen=True)
class _Pot:
    """The mixture, then what may be added to it, and the film and eye that judge it."""

    absorption: Float[np.ndarray, "1+paints bands"]
    scattering: Float[np.ndarray, "1+paints bands"]
    wavelengths: Float[np.ndarray, "bands"]
    thickness: float
    ground: Float[np.ndarray, "bands"]
    surface: float
    response: Response
    goal: Float[np.ndarray, "3"]
    eye: tuple[str, str]

    def labs(self, amounts: Float[np.ndarray, "tried paints"]) -> Float[np.ndarray, "tried 3"]:
        """Colours after some amounts are added to one of the mixture."""
        shares = np.pad(amounts, ((0, 0), (1, 0)), constant_values=1.0)
        films = self.thickness * shares / shares.sum(axis=1, keepdims=True)
        nothing = np.zeros((len(amounts), 2, self.wavelengths.size))
        body = film_readings(
            self.response,
            films @ self.absorption,
            films @ self.scattering,
            nothing,
            (self.ground,),
        )[:, 0]
        light, eye = self.eye
        reading = body + self.surface
        return np.asarray(colour.lab(self.wavelengths, reading, illuminant=light, observer=eye))

    def distances(self, amounts: Float[np.ndarray, "tried paints"]) -> Float[np.ndarray, "tried"]:
        """CIEDE2000 of these from the target."""
        return np.asarray(colour.delta_e_2000(self.labs(amounts), self.goal))

    def costs(self, amounts: Float[np.ndarray, "tried paints"]) -> Float[np.ndarray, "tried"]:
        """Distances, and what the amounts cost: as much again must bring a Delta E00 of 1, for
        paint is not added by the pound for what is hardly seen.
        """
        return self.distances(amounts) + amounts.sum(axis=1)


def _search(pot: _Pot) -> Float[np.ndarray, "paints"]:
    """Amounts of the paint, or the two, that bring the colour nearest; nothing, if that is not
    seen.
    """
    # Grams to a gram of the mixture: from a trace on a knife to as much again.
    steps = np.geomspace(1e-3, 1.0, 40)
    alone = np.eye(len(pot.absorption) - 1)
    costs = [pot.costs(steps[:, None] * paint).min() for paint in alone]
    # The first paint is tried alone, and these in pairs.
    near = np.argsort(costs)[:6]
    best = np.zeros(len(alone))
    least = float(pot.costs(best[None])[0])
    for count in range(1, min(len(near), 2) + 1):
        tried = np.stack(np.meshgrid(*[steps[::count]] * count), axis=-1).reshape(-1, count)
        sets = itertools.combinations(near if count > 1 else near[:1], count)
        cost, amounts = min(
            (_refine(pot, alone[list(paints)], tried) for paints in sets),
            key=lambda trial: trial[0],
        )
        # A second paint must bring the colour this much nearer, and so must the first.
        if cost < least - 0.3:
            least, best = cost, amounts
    return best


def _refine(
    pot: _Pot, paints: Float[np.ndarray, "n paints"], tried: Float[np.ndarray, "tried n"]
) -> tuple[float, Float[np.ndarray, "paints"]]:
    """The nearest of the amounts that were tried, and from there downhill: cost and amounts."""
    start = np.log(tried[int(pot.costs(tried @ paints).argmin())])

    def amounts(logs: np.ndarray) -> np.ndarray:
        return np.exp(np.minimum(logs, 0.0)) @ paints

    solution = minimize(
        lambda logs: float(pot.costs(amounts(logs)[None])[0]),
        start,
        method="Nelder-Mead",
        options={"xatol": 1e-3, "fatol": 1e-3},
    )
    return float(solution.fun), amounts(solution.x)
