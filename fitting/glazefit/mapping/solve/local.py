"""Identification of spectra near one that was searched: every candidate, linear about it.

A search in full costs some milliseconds. Spectra that differ little from one that was searched have
the same candidates; what changes is how well each meets the spectrum. With a film's readings linear
in its log amounts, and its errors as they were, a candidate's most probable amounts move linearly
with the spectrum and its evidence follows in closed form: Laplace's approximation about a point
that moves (`glazefit.identify.search.fit`).
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ...film.model.errors import Prior
from ...film.numerics.columns import Columns
from ...identify.search.weigh import Misfits, weigh
from .answers import Answers
from .features import SpectraReadings

# Log amounts are not moved farther: a paint that does next to nothing would go anywhere.
_FAR = 1.5


@dataclass(frozen=True)
class Local(Columns):
    """Candidates of representative spectra, and how they move with the spectrum; single precision.

    Attributes:
        members, condition: as in `glazefit.Identification`.
        opaque: the film hides its ground, as it was searched.
        log_weight: at the representative.
        weight_by: its slopes by the readings, as far as a varnish bends the scale on which they are
            compared.
        amounts: log amounts, m; -inf for no paint.
        amounts_by: their slopes by the readings.
        covariance: of the log amounts.
        off: whitened residual of the fit that is weighed.
        off_by: its slopes by the readings.
        gradient, hessian: of minus the log prior in the log amounts.
        ratios: eigenvalues of the data's part of the posterior's Hessian relative to the prior's.
        numbers: Student's degrees of freedom, and readings that count as independent.
        seen, seen_by: Delta E00 to the fit as a vector of some coordinates, and its slopes.
        left, left_by: the same with errors of the paints allowed for.
        shape: root mean square of that residual, noise aside.
        fitted, fitted_by: readings of the fit that comes nearest, and their slopes.
    """

    members: Int[np.ndarray, "n 3"]
    condition: Int[np.ndarray, "n"]
    opaque: np.ndarray
    log_weight: Float[np.ndarray, "n"]
    weight_by: Float[np.ndarray, "n bands"]
    amounts: Float[np.ndarray, "n 3"]
    amounts_by: Float[np.ndarray, "n 3 bands"]
    covariance: Float[np.ndarray, "n 3 3"]
    off: Float[np.ndarray, "n bands"]
    off_by: Float[np.ndarray, "n bands bands"]
    gradient: Float[np.ndarray, "n 3"]
    hessian: Float[np.ndarray, "n 3 3"]
    ratios: Float[np.ndarray, "n 3"]
    numbers: Float[np.ndarray, "n 2"]
    seen: Float[np.ndarray, "n colours"]
    seen_by: Float[np.ndarray, "n colours bands"]
    left: Float[np.ndarray, "n colours"]
    left_by: Float[np.ndarray, "n colours bands"]
    shape: Float[np.ndarray, "n"]
    fitted: Float[np.ndarray, "n bands"]
    fitted_by: Float[np.ndarray, "n bands bands"]


@dataclass(frozen=True)
class Searched(Columns):
    """Representatives that were searched, and their candidates.

    Attributes:
        blur: Delta E00 that noise alone makes.
        rest: share of the candidates' odds that those left out have,
        rest_evidence: and of their evidence, before misfits count;
        rest_paints: and how probable each paint is among these.
        kept: candidates of each that are kept.
        local: these candidates, one representative's after another's.
    """

    blur: Float[np.ndarray, "representatives"]
    rest: Float[np.ndarray, "representatives"]
    rest_evidence: Float[np.ndarray, "representatives"]
    rest_paints: Float[np.ndarray, "representatives paints"]
    kept: Int[np.ndarray, "representatives"]
    local: Local

    @cached_property
    def candidates(self) -> list[slice]:
        """Of each representative, among all."""
        ends = np.cumsum([0, *self.kept]).tolist()
        return [slice(*pair) for pair in itertools.pairwise(ends)]

    def answers_near(self, number: int, prior: Prior, change: SpectraReadings) -> Answers:
        """Answers for spectra near one representative.

        Args:
            number: of the one that is meant.
            prior: what was expected.
            change: of the spectra's readings from the representative's.
        """
        local = self.local.take(self.candidates[number])
        rest = self.rest[number]
        count, bands = local.off.shape
        # All that is linear in the change of the reading, in one product.
        slopes = [
            slope.reshape(-1, bands)
            for slope in (local.off_by, local.amounts_by, local.seen_by, local.left_by)
        ]
        by = np.concatenate(slopes).T.copy()
        ends = np.cumsum([len(slope) for slope in slopes])[:-1]
        off, logs, colours, adjusted_colours = (
            block.reshape(len(change), count, -1) for block in np.split(change @ by, ends, axis=1)
        )
        # Weights of the candidates at the new reading, and their odds.
        logs = np.clip(logs, -_FAR, _FAR)
        met = log_weight_gain(local, local.off + off, logs)
        weight = local.log_weight + change @ local.weight_by.T + met
        misfits = Misfits(
            delta_e=np.linalg.norm(local.seen + colours, axis=-1),
            adjusted_delta_e=np.linalg.norm(local.left + adjusted_colours, axis=-1),
            residual=np.broadcast_to(local.shape, weight.shape),
            noise_delta_e=np.full(len(change), self.blur[number]),
        )
        odds = weigh(weight, misfits, prior)
        # Candidates that were left out keep their share, of the evidence and of the odds.
        kept = odds.candidates * (1.0 - self.rest_evidence[number])
        total = kept.sum(axis=1) / (1.0 - rest) + odds.none
        first = np.argmax(kept, axis=1)
        rows = np.arange(len(change))
        none = odds.none / total
        # One product for all spectra of the same first set.
        fitted = local.fitted[first].copy()
        for n in np.flatnonzero(np.bincount(first, minlength=count)):
            group = np.flatnonzero(first == n)
            fitted[group] += change[group] @ local.fitted_by[n].T
        paints = np.arange(self.rest_paints.shape[1])
        present = (local.members[..., None] == paints).any(axis=1).astype(np.float32)
        return Answers(
            members=local.members[first],
            condition=local.condition[first],
            opaque=local.opaque[first],
            probability=kept[rows, first] / total,
            none=none,
            explained=(none < 0.5) & ~odds.rejected[rows, first],
            paint_probability=(kept / total[:, None]) @ present
            + (rest * (1.0 - none))[:, None] * self.rest_paints[number],
            amounts=local.amounts[first] + logs[rows, first],
            covariance=local.covariance[first],
            misfit=odds.misfit,
            fitted=fitted,
        )


def log_weight_gain(
    local: Local, off: Float[np.ndarray, "spectra n bands"], logs: Float[np.ndarray, "spectra n 3"]
) -> Float[np.ndarray, "spectra n"]:
    """Increase of the log weights of candidates over those at their representative; see
    `glazefit.identify.search.fit`.

    Args:
        local: the candidates.
        off: their whitened residuals.
        logs: how far their log amounts have moved.
    """
    freedom = local.numbers[:, 0]
    degrees = local.numbers.sum(axis=1)
    before = np.sum(local.off**2, axis=-1)
    now = np.einsum("snb,snb->sn", off, off)
    met = -0.5 * degrees * (np.log1p(now / freedom) - np.log1p(before / freedom))
    # How sharply the data hold the amounts changes with how well all is met.
    share = degrees / (freedom + now)
    shared = degrees / (freedom + before)
    volume = np.log1p(share[..., None] * local.ratios) - np.log1p(shared[:, None] * local.ratios)
    # Half a quadratic form and a linear one, by products of each candidate's own matrices.
    turned = 0.5 * np.matmul(logs.transpose(1, 0, 2), local.hessian).transpose(1, 0, 2)
    prior = np.einsum("snm,snm->sn", logs, turned + local.gradient)
    return met - prior - 0.5 * volume.sum(axis=-1)
