"""Why paints were not found in a film, a sentence each.

The search has fitted candidates; of these the nearest with a paint says how near it comes. A paint
that no candidate has was left behind before films were compared closely.
"""

from typing import NamedTuple

import numpy as np

from ..result import Candidate, Identification, percent
from ..search.weigh import REJECTED, UNSEEN

IMPROBABLE = 0.01
"""Probability below which a paint counts as ruled out."""
LEAST_SHARE = 0.01
"""Of a paint by mass, in the films that it is judged by: less of it can hide in any film."""


class RuledOut(NamedTuple):
    """A paint that is not in a film by its spectrum.

    Attributes:
        paint: its name.
        probability: that it is in the film.
        film: of the candidates with at least 1 % of it the nearest, in words; empty if there is
            none.
        paints: of that film, the one ruled out first, and their fractions.
        delta_e: of that film; NaN where the bands give no colour.
        rmse: of its residual; NaN if there is none.
        kind: "misfit" (a person sees that it does not fit), "trace" (the same, but a trace stays
            possible), "worse" (others fit better), "unneeded" (it fits as well, but a film without
            it is more probable), or "absent" (no candidate has it).
        reason: one sentence.
    """

    paint: str
    probability: float
    film: str
    paints: dict[str, float]
    delta_e: float
    rmse: float
    kind: str
    reason: str


def ruled_out(identification: Identification, row: int) -> list[RuledOut]:
    """Paints that do not fit, or whose probability to be in a film is below 1 %, the worst fits
    first; last those that no candidate has.

    A paint that more likely is there than not is not among them, however little of it.
    """
    chances = identification.paint_probability[row]
    candidates = identification.ranked(row)
    judged = [
        _judge(identification, candidates, row, int(i)) for i in np.flatnonzero(chances < 0.5)
    ]
    out = [paint for paint in judged if paint.probability < IMPROBABLE or paint.kind == "trace"]
    kinds = ("misfit", "trace", "worse", "unneeded", "absent")
    return sorted(
        out,
        key=lambda paint: (
            kinds.index(paint.kind),
            -np.nan_to_num(paint.delta_e),
            -np.nan_to_num(paint.rmse),
        ),
    )


def _share(candidate: Candidate, name: str) -> float:
    """Of a paint in a candidate, by mass; 0 where it is not in it, or no amount is known."""
    shares = dict(zip(candidate.paints, candidate.fractions.tolist(), strict=True))
    return float(np.nan_to_num(shares.get(name, 0.0)))


def _judge(
    identification: Identification, candidates: list[Candidate], row: int, paint: int
) -> RuledOut:
    name = identification.paints[paint]
    chance = float(identification.paint_probability[row, paint])
    best = candidates[0]
    # What has no probability was left behind, and its amounts were not fitted to come near.
    fitted = [candidate for candidate in candidates if candidate.probability > 0.0]
    with_it = [candidate for candidate in fitted if _share(candidate, name) >= LEAST_SHARE]
    if not with_it:
        return RuledOut(
            paint=name,
            probability=chance,
            film="",
            paints={},
            delta_e=np.nan,
            rmse=np.nan,
            kind="absent",
            reason=(
                f"{name}: no film with {LEAST_SHARE:.0%} of it or more came near enough to be "
                "compared closely."
            ),
        )
    nearest = min(with_it, key=lambda candidate: candidate.rmse)
    share = _share(nearest, name)
    off = nearest.delta_e
    rmse = nearest.rmse
    has_colour = not np.isnan(off)
    by = f"Delta E00 {off:.1f}" if has_colour else f"{rmse:.3f} in reflectance (RMSE)"
    # Where there is no colour, this root mean square is as bad as a Delta E00 of `REJECTED`.
    if (off > REJECTED) if has_colour else (rmse > 0.03):
        kind = "misfit"
        reason = f"the nearest film with it has an error of {by}"
    elif has_colour and off > max(UNSEEN, best.delta_e):
        kind = "worse"
        reason = (
            f"the nearest film with it has an error of {by}, the most probable film of "
            f"{best.delta_e:.1f}"
        )
    # Half as much again is worse.
    elif rmse > 1.5 * max(best.rmse, float(np.median(identification.measured.noise_sd[row]))):
        kind = "worse"
        how = (
            f"its colour comes near ({by}), its spectrum less so"
            if has_colour
            else "its spectrum is further off"
        )
        reason = f"{how}: RMSE {rmse:.4f} against {best.rmse:.4f}"
    else:
        kind = "unneeded"
        reason = (
            f"a film with {percent(share)} of it fits as well ({by}), but a film without it is "
            "more probable"
        )
    if kind == "misfit" and share < 2 * LEAST_SHARE and len(nearest.paints) > 1:
        reason += f", with as little as {percent(share)} of it"
    if kind == "misfit" and chance >= IMPROBABLE:
        kind = "trace"
        reason = f"{reason}; less than {LEAST_SHARE:.0%} of it stays possible"
    companions = [companion for companion in nearest.paints if companion != name]
    return RuledOut(
        paint=name,
        probability=chance,
        film=nearest.words,
        paints={member: _share(nearest, member) for member in (name, *companions)},
        delta_e=off,
        rmse=rmse,
        kind=kind,
        reason=f"{name}: {reason}.",
    )
