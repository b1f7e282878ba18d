"""A mixture that was made and read: what to add to it, by weight, so that it comes nearer to a
colour.

What was read is a paint of its own (`glazefit.recover.mixture.calibrate_mixture`), as strong as it
came out. Paints are added to it, one or two, and nothing can be taken away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from glazejax import Pigment, colour
from glazejax.geometry import resolve_instrument

from ..film.films import InstrumentLike
from ..film.model.response import film_response
from ..film.model.variation import SIZES, Variation
from ..recover.joint import UNIT
from ..recover.joint_result import JointRecovery
from ..recover.mixture import film_readings, mix, predict_mixture
from ..recover.prediction import Prediction
from .targets import Target

# Grams to a gram of the mixture: a drop on a knife, and three times as much.
_LEAST = 1e-3
_MOST = 3.0
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
    response = film_response(seen_by)
    grid = calibrated.wavelengths
    light = colour.find_illuminant(illuminant)
    eye = colour.find_observer(observer)
    aim = target.lab(light, eye)
    name = calibrated.paints[0]
    made = calibrated.pigment(name, UNIT, provenance=name)
    shelf = {paint.name: paint.resample(grid) for paint in pigments}
    hides = bool(calibrated.films.opaque[0])
    metres = _THICK if hides else float(calibrated.thickness[0]) * UNIT
    base = np.broadcast_to(np.asarray(ground, dtype=float), grid.shape)
    surface = seen_by.seen_surface * float(calibrated.gloss[0])

    def labs(
        names: Sequence[str], amounts: Float[np.ndarray, "tried paints"]
    ) -> Float[np.ndarray, "tried 3"]:
        total = 1.0 + amounts.sum(axis=1, keepdims=True)
        k, s = (
            (np.asarray(getattr(made, what)) + amounts @ _table(shelf, names, what)) / total
            for what in ("absorption", "scattering")
        )
        nothing = np.zeros((len(amounts), 2, grid.size))
        body = film_readings(response, k * metres, s * metres, nothing, (base,))[:, 0]
        return np.asarray(colour.lab(grid, body + surface, illuminant=light, observer=eye))

    def distances(names: Sequence[str], amounts: np.ndarray) -> Float[np.ndarray, "tried"]:
        return np.asarray(colour.delta_e_2000(labs(names, amounts), aim))

    nothing = np.zeros((1, 0))
    now = labs((), nothing)[0]
    before = float(distances((), nothing)[0])
    steps = np.geomspace(_LEAST, _MOST, _STEPS)
    alone = {paint: float(distances((paint,), steps[:, None]).min()) for paint in shelf}
    best = sorted(alone, key=lambda paint: alone[paint])[:_TRIED_TOGETHER]
    chosen: tuple[str, ...] = ()
    amounts = np.zeros(0)
    nearest = before
    coarse = np.geomspace(_LEAST, _MOST, _STEPS // 2)
    for count in (1, 2):
        tried = np.stack(np.meshgrid(*[(steps, coarse)[count - 1]] * count), axis=-1)
        found = [
            _refine(lambda a, names=names: distances(names, a), names, tried.reshape(-1, count))
            for names in combinations(best[: 1 if count == 1 else None], count)
        ]
        if not found:
            continue
        distance, names, added = min(found, key=lambda item: item[0])
        if distance < nearest - _WORTH:
            nearest, chosen, amounts = distance, names, added
    grams = {paint: float(batch * a) for paint, a in zip(chosen, amounts, strict=True)}
    film = _foretell(
        made, shelf, grams, batch=batch, metres=metres, ground=base, instrument=seen_by
    )
    expected = float(film.expected_errors(light, eye)[1])
    return Addition(
        target=target,
        grams=grams,
        batch=batch,
        thickness=None if hides else metres,
        before=before,
        after=nearest,
        lab_before=now,
        lab_after=labs(chosen, amounts[None])[0],
        expected=expected,
        film=film,
    )


def _table(
    shelf: Mapping[str, Pigment], names: Sequence[str], what: str
) -> Float[np.ndarray, "paints bands"]:
    bands = next(iter(shelf.values())).wavelengths.size
    rows = [np.asarray(getattr(shelf[name], what)) for name in names]
    return np.stack(rows) if rows else np.zeros((0, bands))


def _refine(
    distances, names: tuple[str, ...], tried: Float[np.ndarray, "tried paints"]
) -> tuple[float, tuple[str, ...], Float[np.ndarray, "paints"]]:
    """The nearest of the amounts that were tried, and from there downhill."""
    start = np.log(tried[int(distances(tried).argmin())])

    def off(logs: np.ndarray) -> float:
        return float(distances(np.exp(np.minimum(logs, np.log(_MOST)))[None])[0])

    found = minimize(off, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
    return float(found.fun), names, np.exp(np.minimum(found.x, np.log(_MOST)))


def _foretell(
    made: Pigment,
    shelf: Mapping[str, Pigment],
    grams: Mapping[str, float],
    *,
    batch: float,
    metres: float,
    ground: Float[np.ndarray, "bands"],
    instrument: InstrumentLike,
) -> Prediction:
    """The film after the addition, over black and over its ground."""
    added = {paint: mix(shelf, {paint: 1.0}, name=paint) for paint in grams}
    (film,) = predict_mixture(
        {made.name: made} | added,
        {made.name: batch} | dict(grams),
        [metres],
        wavelengths=made.wavelengths,
        ground=(0.0, ground),
        instrument=instrument,
        variation=_THE_SAME,
    )
    return film
