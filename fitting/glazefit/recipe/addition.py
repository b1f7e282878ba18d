"""A mixture that was made and read: what to add to it, by weight, so that it comes nearer to a
colour.

What was read is a paint of its own (`glazefit.recover.mixture.calibrate_mixture`), as strong as it
came out. Paints are added to it, one or two, and nothing can be taken away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from glazejax import Pigment, colour
from glazejax.geometry import resolve_instrument
from glazejax.spectra import describe_grid

from ..film.films import InstrumentLike
from ..film.model.response import Response, film_response
from ..film.model.variation import SIZES, Variation
from ..recover.joint import UNIT
from ..recover.joint_result import JointRecovery
from ..recover.mixture import mix, predict_mixture
from ..recover.prediction import Prediction
from ..recover.reading_errors import film_readings
from .targets import Target

# Grams to a gram of the mixture: from a trace on a knife to as much again.
_LEAST = 1e-3
_MOST = 1.0
# Delta E00 that as much again must bring: paint is not added by the pound for what is hardly seen.
_DEAR = 1.0
_STEPS = 40
_TRIED_TOGETHER = 6
# A second paint must bring the colour this much nearer, and so must the first.
_WORTH = 0.3
# Thickness that hides the ground, m.
_THICK = 5e-3
# It is this mixing that goes on; what is added may be as strong as another mixing of it.
_THE_SAME = Variation(np.eye(len(SIZES))[0])


@dataclass(frozen=True)
class Addition:
    """The next addition to a mixture.

    Attributes:
        target: the colour that is sought.
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
    """What to add to a mixture that was read, for a film as thick as that one.

    Args:
        calibrated: what `glazefit.recover.mixture.calibrate_mixture` found by the reading.
        target: colour or spectrum that is sought; its colour under the illuminant counts.
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
    light = colour.find_illuminant(illuminant)
    eye = colour.find_observer(observer)
    name = calibrated.paints[0]
    hides = bool(calibrated.films.opaque[0])
    pot = _Pot(
        made=calibrated.pigment(name, UNIT, provenance=name),
        shelf={paint.name: paint.resample(grid) for paint in pigments},
        thickness=_THICK if hides else float(calibrated.thickness[0]) * UNIT,
        ground=np.broadcast_to(np.asarray(ground, dtype=float), grid.shape),
        surface=seen_by.seen_surface * float(calibrated.gloss[0]),
        response=film_response(seen_by),
        aim=target.lab(light, eye),
        eye=(light, eye),
    )
    nothing = _Tried(float(pot.distances((), np.zeros((1, 0)))[0]), (), np.zeros(0))
    best = _search(pot, nothing)
    grams = {paint: float(batch * a) for paint, a in zip(best.paints, best.amounts, strict=True)}
    film = _foretell(pot, grams, batch, seen_by)
    return Addition(
        target=target,
        grams=grams,
        batch=batch,
        thickness=None if hides else pot.thickness,
        before=nothing.cost,
        after=float(pot.distances(best.paints, best.amounts[None])[0]),
        lab_before=pot.labs((), np.zeros((1, 0)))[0],
        lab_after=pot.labs(best.paints, best.amounts[None])[0],
        expected=float(film.expected_errors(light, eye)[1]),
        film=film,
    )


class _Tried(NamedTuple):
    """Amounts of some paints to one of the mixture, and how far that is from the target: with what
    they cost.
    """

    cost: float
    paints: tuple[str, ...]
    amounts: Float[np.ndarray, "paints"]


@dataclass(frozen=True)
class _Pot:
    """The mixture, what may be added, and the film and eye that judge it."""

    made: Pigment
    shelf: Mapping[str, Pigment]
    thickness: float
    ground: Float[np.ndarray, "bands"]
    surface: float
    response: Response
    aim: Float[np.ndarray, "3"]
    eye: tuple[str, str]

    def labs(
        self, paints: Sequence[str], amounts: Float[np.ndarray, "tried paints"]
    ) -> Float[np.ndarray, "tried 3"]:
        """Colours after some amounts are added to one of the mixture."""
        grid = self.made.wavelengths
        total = 1.0 + amounts.sum(axis=1, keepdims=True)
        kd, sd = (
            self.thickness
            * (np.asarray(getattr(self.made, what)) + amounts @ self._table(paints, what))
            / total
            for what in ("absorption", "scattering")
        )
        nothing = np.zeros((len(amounts), 2, grid.size))
        body = film_readings(self.response, kd, sd, nothing, (self.ground,))[:, 0]
        light, eye = self.eye
        seen = body + self.surface
        return np.asarray(colour.lab(grid, seen, illuminant=light, observer=eye))

    def distances(
        self, paints: Sequence[str], amounts: Float[np.ndarray, "tried paints"]
    ) -> Float[np.ndarray, "tried"]:
        """CIEDE2000 of these from the target."""
        return np.asarray(colour.delta_e_2000(self.labs(paints, amounts), self.aim))

    def costs(
        self, paints: Sequence[str], amounts: Float[np.ndarray, "tried paints"]
    ) -> Float[np.ndarray, "tried"]:
        """Distances, and what the amounts cost."""
        return self.distances(paints, amounts) + _DEAR * amounts.sum(axis=1)

    def _table(self, paints: Sequence[str], what: str) -> Float[np.ndarray, "paints bands"]:
        rows = [np.asarray(getattr(self.shelf[paint], what)) for paint in paints]
        return np.stack(rows) if rows else np.zeros((0, self.made.wavelengths.size))


def _search(pot: _Pot, nothing: _Tried) -> _Tried:
    """The paint, or the two, that bring the colour nearest; nothing, if that is not seen."""
    steps = np.geomspace(_LEAST, _MOST, _STEPS)
    alone = {paint: float(pot.costs((paint,), steps[:, None]).min()) for paint in pot.shelf}
    near = sorted(alone, key=lambda paint: alone[paint])[:_TRIED_TOGETHER]
    best = nothing
    for paints in (near[:1], near):
        count = min(len(paints), 2)
        each = steps if count == 1 else steps[::2]
        tried = np.stack(np.meshgrid(*[each] * count), axis=-1).reshape(-1, count)
        found = min(
            (_refine(pot, names, tried) for names in combinations(paints, count)),
            key=lambda tried: tried.cost,
        )
        if found.cost < best.cost - _WORTH:
            best = found
    return best


def _refine(pot: _Pot, paints: tuple[str, ...], tried: Float[np.ndarray, "tried paints"]) -> _Tried:
    """The nearest of the amounts that were tried, and from there downhill."""
    start = np.log(tried[int(pot.costs(paints, tried).argmin())])

    def amounts(logs: np.ndarray) -> np.ndarray:
        return np.exp(np.minimum(logs, np.log(_MOST)))

    def off(logs: np.ndarray) -> float:
        return float(pot.costs(paints, amounts(logs)[None])[0])

    found = minimize(off, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
    return _Tried(float(found.fun), paints, amounts(found.x))


def _foretell(
    pot: _Pot, grams: Mapping[str, float], batch: float, instrument: InstrumentLike
) -> Prediction:
    """The film after the addition, over black and over its ground."""
    added = {paint: mix(pot.shelf, {paint: 1.0}, name=paint) for paint in grams}
    (film,) = predict_mixture(
        {pot.made.name: pot.made} | added,
        {pot.made.name: batch} | dict(grams),
        [pot.thickness],
        wavelengths=pot.made.wavelengths,
        ground=(0.0, pot.ground),
        instrument=instrument,
        variation=_THE_SAME,
    )
    return film
