"""Answers for spectra near a representative, in closed form from its candidates."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ...film.model.errors import Prior
from ...film.numerics.columns import Columns
from ...identify.result import fractions_of, log_sds
from ...identify.search.pool import NOBODY
from ...identify.search.weigh import Misfits, weigh
from .local import Local, Searched
from .survey import PerSpectrum, SpectraReadings

# Log amounts are not moved farther: a paint that does next to nothing would go anywhere.
_FAR = 1.5


@dataclass(frozen=True)
class Answers(Columns):
    """Answers for spectra: the most probable set of each, and its odds against all others."""

    members: Int[np.ndarray, "spectra 3"]
    condition: Int[np.ndarray, "spectra"]
    opaque: Bool[np.ndarray, "spectra"]
    probability: PerSpectrum
    none: PerSpectrum
    explained: Bool[np.ndarray, "spectra"]
    paint_probability: Float[np.ndarray, "spectra paints"]
    amounts: Float[np.ndarray, "spectra 3"]  # log, m; -inf for no paint
    covariance: Float[np.ndarray, "spectra 3 3"]
    misfit: PerSpectrum
    fitted: SpectraReadings

    def put(self, rows: np.ndarray, source: "Answers") -> None:
        """Write others' answers into some rows."""
        for name, values in vars(source).items():
            getattr(self, name)[rows] = values

    @classmethod
    def empty(cls, spectra: int, paints: int, bands: int) -> "Answers":
        """Room for answers."""

        def unknown(*shape: int) -> np.ndarray:
            return np.full(shape, np.nan, np.float32)

        return cls(
            members=np.full((spectra, 3), NOBODY, np.int16),
            condition=np.zeros(spectra, np.int8),
            opaque=np.zeros(spectra, bool),
            probability=unknown(spectra),
            none=unknown(spectra),
            explained=np.zeros(spectra, bool),
            paint_probability=unknown(spectra, paints),
            amounts=np.full((spectra, 3), -np.inf, np.float32),
            covariance=np.zeros((spectra, 3, 3), np.float32),
            misfit=unknown(spectra),
            fitted=unknown(spectra, bands),
        )

    @property
    def thickness(self) -> PerSpectrum:
        """Of the film, m; NaN where it hides its ground."""
        return np.where(self.opaque, np.nan, np.exp(self.amounts).sum(axis=1))

    def columns(self, prior: Prior) -> dict[str, np.ndarray]:
        """Arrays of a map by the names of `layout.VARIABLES`; `prior` is what was expected."""
        fractions = fractions_of(np.exp(self.amounts))
        # Standard deviations of the logs of the fractions and of the thickness.
        _, fraction_sd, thickness_sd = log_sds(
            self.members, fractions, self.covariance, prior.spread
        )
        shares = np.where(self.members == NOBODY, np.nan, fractions)
        return {
            **vars(self),
            "fraction": shares,
            "fraction_sd": np.minimum(shares * fraction_sd, 0.3),
            "thickness": self.thickness,
            "thickness_sd": self.thickness * thickness_sd,
        }


def answers_near(
    representatives: Searched,
    number: int,
    prior: Prior,
    readings: SpectraReadings,
) -> Answers:
    """Answers for spectra near one representative.

    Args:
        representatives: that were searched.
        number: of the one that is meant.
        prior: what was expected.
        readings: of the spectra.
    """
    local = representatives.local.take(representatives.candidates[number])
    rest = representatives.rest[number]
    count, bands = local.off.shape
    change = readings - representatives.readings[number]
    # All that is linear in the change of the reading, in one product.
    slopes = [
        slope.reshape(-1, bands)
        for slope in (local.off_by, local.logs_by, local.seen_by, local.left_by)
    ]
    by = np.concatenate(slopes).T.copy()
    ends = np.cumsum([len(slope) for slope in slopes])[:-1]
    off, logs, colours, adjusted_colours = (
        block.reshape(len(change), count, -1) for block in np.split(change @ by, ends, axis=1)
    )
    # Weights of the candidates at the new reading, and their odds.
    met = log_weight_gain(local, local.off + off, np.clip(logs, -_FAR, _FAR))
    weight = local.log_weight + change @ local.weight_by.T + met
    misfits = Misfits(
        delta_e=np.linalg.norm(local.seen + colours, axis=-1),
        adjusted_delta_e=np.linalg.norm(local.left + adjusted_colours, axis=-1),
        residual=np.broadcast_to(local.shape, weight.shape),
        noise_delta_e=np.full(len(change), representatives.blur[number]),
    )
    odds = weigh(weight, misfits, prior)
    # Candidates that were left out keep their share, of the evidence and of the odds.
    kept = odds.candidates * (1.0 - representatives.rest_evidence[number])
    total = kept.sum(axis=1) / (1.0 - rest) + odds.none
    first = np.argmax(kept, axis=1)
    rows = np.arange(len(change))
    none = odds.none / total
    # One product for all spectra of the same first set.
    amounts = local.amounts[first].copy()
    fitted = local.fitted[first].copy()
    for n in np.flatnonzero(np.bincount(first, minlength=count)):
        group = np.flatnonzero(first == n)
        amounts[group] += np.clip(change[group] @ local.amounts_by[n].T, -_FAR, _FAR)
        fitted[group] += change[group] @ local.fitted_by[n].T
    paints = np.arange(representatives.rest_paints.shape[1])
    present = (local.members[..., None] == paints).any(axis=1).astype(np.float32)
    return Answers(
        members=local.members[first],
        condition=local.condition[first],
        opaque=local.opaque[first],
        probability=kept[rows, first] / total,
        none=none,
        explained=(none < 0.5) & ~odds.rejected[rows, first],
        paint_probability=(kept / total[:, None]) @ present
        + (rest * (1.0 - none))[:, None] * representatives.rest_paints[number],
        amounts=amounts,
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
