"""Why paints were not found in a film, a sentence each."""

from typing import NamedTuple

import numpy as np

from ..result import Candidate, Identification, percent
from ..search.pool import NOBODY
from ..search.weigh import REJECTED, UNSEEN
from .contenders import LEAST_SHARE, Contenders

IMPROBABLE = 0.01
"""Probability below which a paint counts as ruled out."""

# Where there is no colour, a root mean square that is as bad as a Delta E00 of `REJECTED`; and how
# much worse is worse.
_OFF = 0.03
_WORSE = 1.5


class RuledOut(NamedTuple):
    """A paint that is not in a film, as far as the spectrum tells.

    Attributes:
        paint: its name.
        probability: that it is in the film.
        film: the nearest film with at least 1 % of it, in words.
        paints: of that film, the one ruled out first, and their fractions.
        delta_e: of that film; NaN where the bands give no colour.
        rmse: of its residual.
        kind: "misfit" (a person sees that it does not fit), "trace" (the same, but a trace stays
            possible), "worse" (others fit better), or "unneeded" (it fits as well, but a film
            without it is more probable).
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


def ruled_out(found: Identification, contenders: Contenders, row: int) -> list[RuledOut]:
    """Paints that do not fit, or whose probability to be in a film is below 1 %, the worst fits
    first.

    A paint that more likely is there than not is not among them, however little of it.
    """
    chances = found.paint_probability[row]
    best = found.ranked(row, 1)[0]
    judged = [_judge(found, contenders, row, int(i), best) for i in np.flatnonzero(chances < 0.5)]
    out = [paint for paint in judged if paint.probability < IMPROBABLE or paint.kind == "trace"]
    kinds = ("misfit", "trace", "worse", "unneeded")
    return sorted(
        out, key=lambda paint: (kinds.index(paint.kind), -np.nan_to_num(paint.delta_e), -paint.rmse)
    )


def _judge(
    found: Identification, contenders: Contenders, row: int, paint: int, best: Candidate
) -> RuledOut:
    name = found.paints[paint]
    off = float(contenders.delta_e[row, paint])
    rmse = float(contenders.rmse[row, paint])
    members = contenders.members[row, paint]
    shares = contenders.fractions[row, paint]
    shown = [n for n in range(3) if members[n] != NOBODY and (n == 0 or shares[n] >= 1e-4)]
    film = (
        " + ".join(f"{percent(shares[n])} {found.paints[members[n]]}" for n in shown)
        if len(shown) > 1
        else name
    )
    if (contenders.coats[row, paint] > 0).any():
        film += " (in two coats)"
    seen = not np.isnan(off)
    by = f"Delta E00 {off:.1f}" if seen else f"{rmse:.3f} in reflectance (RMSE)"
    if (off > REJECTED) if seen else (rmse > _OFF):
        kind = "misfit"
        reason = f"the best film with it is off by {by}"
    elif seen and off > max(UNSEEN, best.delta_e):
        kind = "worse"
        reason = (
            f"the best film with it is off by {by}, the most probable film by {best.delta_e:.1f}"
        )
    elif rmse > _WORSE * max(best.rmse, float(np.median(found.measured.noise_sd[row]))):
        kind = "worse"
        reason = (
            f"its colour comes near ({by}), its spectrum less so: RMSE {rmse:.4f} against "
            f"{best.rmse:.4f}"
        )
        reason = (
            reason
            if seen
            else f"its spectrum is further off: RMSE {rmse:.4f} against {best.rmse:.4f}"
        )
    else:
        kind = "unneeded"
        reason = (
            f"a film with {percent(shares[0])} of it fits as well ({by}), but a film without it "
            "is more probable"
        )
    chance = float(found.paint_probability[row, paint])
    if kind == "misfit" and shares[0] < 2 * LEAST_SHARE and len(shown) > 1:
        reason += f", with as little as {percent(shares[0])} of it"
    if kind == "misfit" and chance >= IMPROBABLE:
        kind = "trace"
        reason = f"{reason}; less than {LEAST_SHARE:.0%} of it stays possible"
    parts = {found.paints[members[n]]: float(shares[n]) for n in shown}
    return RuledOut(
        paint=name,
        probability=chance,
        film=film,
        paints=parts,
        delta_e=off,
        rmse=rmse,
        kind=kind,
        reason=f"{name}: {reason}.",
    )
