"""A mixture that was made and read: what to add to it, by weight, so that it comes nearer to a
colour.

What was read is a paint of its own (`glazefit.recover.predict.mixture.calibrate_mixture`), as
strong as it came out. Paints are added to it, one or two, and nothing can be taken away.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from glazejax import Pigment, colour
from glazejax.geometry import resolve_instrument
from glazejax.spectra import describe_grid

from ..film.films import InstrumentLike
from ..film.model.variation import SIZES, Variation
from ..recover.joint.joint import UNIT
from ..recover.joint.result import JointRecovery
from ..recover.predict.mixture import mix, predict_mixture
from ..recover.predict.prediction import Prediction
from .model import make_model, read
from .targets import Ground, Lab, Target

Trials: TypeAlias = Float[np.ndarray, "tried paints"]
"""Amounts of the paints that may be added, to one of the mixture."""


@dataclass(frozen=True)
class Addition:
    """The next addition to a mixture.

    Attributes:
        grams: of each paint to add; empty where nothing brings the colour nearer.
        batch: grams of the mixture.
        thickness: of the film whose colour counts, m; None if it hides the ground.
        before, after: CIEDE2000 from the target as the mixture is, and after the addition.
        lab_before, lab_after: colours, (3,).
        expected: CIEDE2000 that the colour after the addition is expected to be off.
        film: what the film will reflect.
    """

    grams: Mapping[str, float]
    batch: float
    thickness: float | None
    before: float
    after: float
    lab_before: Lab
    lab_after: Lab
    expected: float
    film: Prediction


def next_addition(
    calibrated: JointRecovery,
    target: Target,
    pigments: Sequence[Pigment],
    batch: float,
    *,
    ground: Ground = 0.9,
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
    # A film of 5 mm hides the ground.
    thickness = 5e-3 if hides else float(calibrated.thickness[0]) * UNIT
    model = make_model(components, ground, seen_by, eye[:1], eye[1])
    model = model._replace(surface=model.surface * float(calibrated.gloss[0]))

    def labs(amounts: Trials) -> Float[np.ndarray, "tried 3"]:
        """Colours after some amounts are added to one of the mixture."""
        shares = np.pad(amounts, ((0, 0), (1, 0)), constant_values=1.0)
        films = 1e6 * thickness * shares / shares.sum(axis=1, keepdims=True)
        return read(model, films[:, None], None).lab[:, 0]

    wanted = target.lab(*eye)

    def costs(amounts: Trials) -> Float[np.ndarray, "tried"]:
        """As much paint again must bring a Delta E00 of 1, for it is not added by the pound for
        what is hardly seen.
        """
        return colour.delta_e_2000(labs(amounts), wanted) + amounts.sum(axis=1)

    # What brings the colour nearest, in grams.
    amounts = _search(costs, len(pigments))
    grams = {paint.name: float(batch * a) for paint, a in zip(pigments, amounts, strict=True) if a}
    added = {
        p.name: mix({p.name: p}, {p.name: 1.0}, name=p.name) for p in components if p.name in grams
    }
    # The film after the addition, over black and over its ground.
    (film,) = predict_mixture(
        {name: mixture} | added,
        {name: batch} | grams,
        [thickness],
        wavelengths=grid,
        ground=(0.0, ground),
        instrument=seen_by,
        # It is this mixing that goes on; what is added may be as strong as another mixing of it.
        variation=Variation(np.eye(len(SIZES))[0]),
    )
    reached = labs(np.stack([np.zeros_like(amounts), amounts]))
    before, after = colour.delta_e_2000(reached, wanted).tolist()
    return Addition(
        grams=grams,
        batch=batch,
        thickness=None if hides else thickness,
        before=before,
        after=after,
        lab_before=reached[0],
        lab_after=reached[1],
        expected=float(film.expected_errors(*eye)[1]),
        film=film,
    )


Costs: TypeAlias = Callable[[Trials], Float[np.ndarray, "tried"]]


def _search(costs: Costs, count: int) -> Float[np.ndarray, "paints"]:
    """Amounts of the paint, or the two, that bring the colour nearest; nothing, if that is not
    seen.
    """
    best = np.zeros(count)
    least = float(costs(best[None])[0])
    near = np.arange(count)
    for together in range(1, min(count, 2) + 1):
        amounts = _refine(costs, np.eye(count)[list(itertools.combinations(near, together))])
        cost = costs(amounts)
        # A second paint must bring the colour this much nearer, and so must the first.
        if cost.min() < least - 0.3:
            least, best = float(cost.min()), amounts[cost.argmin()]
        # Of these paints pairs are tried.
        near = np.argsort(cost)[:6]
    return best


def _refine(
    costs: Costs, sets: Float[np.ndarray, "sets n paints"]
) -> Float[np.ndarray, "sets paints"]:
    """Amounts of the paints of each set at the least cost of adding them: on a grid of their
    logarithms, and on ever finer ones about the best.
    """
    count, together, paints = sets.shape
    offsets = np.stack(np.meshgrid(*[np.linspace(-1, 1, 15)] * together), -1)
    # Grams to a gram of the mixture: from a trace on a knife to as much again.
    reach = -0.5 * np.log(1e-3)
    logs = np.full((count, 1, together), -reach)
    # At last the amounts are right to a thousandth.
    while reach > 5e-3:
        tried = np.minimum(logs + reach * offsets.reshape(-1, together), 0.0)
        cost = costs((np.exp(tried) @ sets).reshape(-1, paints)).reshape(count, -1)
        logs = np.take_along_axis(tried, cost.argmin(axis=1)[:, None, None], axis=1)
        reach *= 0.3
    return (np.exp(logs) @ sets)[:, 0]
