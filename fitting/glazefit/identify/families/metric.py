"""Metric of how far one paint of a pigment is from another's, learnt from exemplars that share a
family.

Two paints of one family differ by what their makers, binders, grounds and instruments do. The
differences between each exemplar and the nearest one of its family from another paint, in all
families together, give one covariance: large along what varies between hands (level, gloss, how
steep a flank is), small along what does not. A reading is compared with an exemplar by a Student's
t of that covariance, and with 'any paint at all' by one of the covariance of all exemplars; the log
of their ratio is the evidence that the reading is of the exemplar's pigment. This is probabilistic
linear discriminant analysis (Ioffe, ECCV 2006; Prince and Elder, ICCV 2007) with each family as a
mixture of its exemplars in place of one mean, so that a family may have several shapes.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from .templates import PerExemplar

ComponentMatrix: TypeAlias = Float[np.ndarray, "components components"]
"""Of components: a covariance, or a root of its inverse."""
# How much of a covariance is taken from its diagonal alone (Ledoit and Wolf's shrinkage, fixed).
_SHRINKAGE = 0.2
# Degrees of freedom of Student's t: some paints are much further from their kind than others.
_FREEDOM = 5.0
# A family with many exemplars says as much of the covariance as one with this many.
_MOST_OF_A_FAMILY = 15
# Rounds in which nearest exemplars and covariance are found in turn.
_ROUNDS = 3


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A space in which differences between paints of one family are standard normal.

    Attributes:
        mean: of the features of all exemplars.
        project: from features to components, (features, components).
        whiten: from components to the space, (components, components).
        middle: of all exemplars in that space.
        log_volume: log of the ratio of the volumes of all exemplars and of one family's.
        spread: from the space to one in which all exemplars are standard normal.
    """

    mean: Float[np.ndarray, "features"]
    project: Float[np.ndarray, "features components"]
    whiten: ComponentMatrix
    middle: Float[np.ndarray, "components"]
    log_volume: float
    spread: ComponentMatrix

    def place(
        self, features: Float[np.ndarray, "*n features"]
    ) -> Float[np.ndarray, "*n components"]:
        """Features as points of the space."""
        return (features - self.mean) @ self.project @ self.whiten

    def log_evidence(
        self,
        readings: Float[np.ndarray, "n components"],
        references: Float[np.ndarray, "components+2 m"],
    ) -> Float[np.ndarray, "n m"]:
        """Log of how much more probable each reading is as a paint like each known one, than as any
        paint at all; `references` by `as_columns`.
        """
        evidence = _log_t(squares_between(readings, references), readings.shape[1])
        evidence += (self.log_volume - self.log_any_paint(readings))[:, None]
        return evidence

    def log_any_paint(self, readings: Float[np.ndarray, "n components"]) -> Float[np.ndarray, "n"]:
        """Log density of each reading as any paint at all, but for a constant."""
        squares = np.sum(((readings - self.middle) @ self.spread) ** 2, axis=1)
        return _log_t(squares.astype(np.float32), readings.shape[1])


def as_columns(points: Float[np.ndarray, "m axes"]) -> Float[np.ndarray, "axes+2 m"]:
    """Points that others are compared with (`squares_between`); computed once for all of these."""
    terms = np.column_stack([points, np.ones(len(points)), np.sum(points**2, axis=1)])
    return terms.astype(np.float32).T


def squares_between(
    first: Float[np.ndarray, "n axes"], columns: Float[np.ndarray, "axes+2 m"]
) -> Float[np.ndarray, "n m"]:
    """Squares of the distances between points, in single precision and one product of matrices: of
    thousands of films this is most of a search's time.
    """
    row_terms = np.column_stack([-2.0 * first, np.sum(first**2, axis=1), np.ones(len(first))])
    squares = row_terms.astype(np.float32) @ columns
    return np.maximum(squares, 0.0, out=squares)


def _log_t(squares: Float[np.ndarray, "*n"], dimensions: int) -> Float[np.ndarray, "*n"]:
    """Log density of a multivariate Student's t, but for its constant; in the squares' place."""
    # NumPy's log of single precision takes a quarter of its log1p's time.
    squares /= _FREEDOM
    squares += 1.0
    np.log(squares, out=squares)
    squares *= -0.5 * (_FREEDOM + dimensions)
    return squares


def learn_metric(
    features: Float[np.ndarray, "exemplars features"],
    families: PerExemplar,
    disturbances: Float[np.ndarray, "draws features"],
    components: int,
) -> Metric:
    """The metric of some exemplars.

    Args:
        features: of a spectrum of each paint.
        families: number of the family of each.
        disturbances: differences that what lies on a paint may make besides, such as a varnish;
            there may be none.
        components: principal components of the slopes that are compared, besides the level.

    Raises:
        ValueError: no two paints share a family.
    """
    mean = features.mean(axis=0)
    centred = features - mean
    # The level, last, is a component of its own; slopes share the others.
    _, _, directions = np.linalg.svd(centred[:, :-1], full_matrices=False)
    project = np.asarray(block_diag(directions[: min(components, len(features) - 1)].T, 1.0))
    points = centred @ project

    # What a varnish, say, adds to the differences between paints; without any, nothing.
    projected = disturbances @ project
    besides = projected.T @ projected / max(len(projected), 1)

    # The nearest exemplar depends on the metric, and the metric on the nearest ones.
    within = np.cov(points.T) + 1e-9 * np.eye(points.shape[1])
    for _ in range(_ROUNDS):
        whiten = _inverse_root(within)
        within = _within_families(points, points @ whiten, families) + besides
    whiten = _inverse_root(within)

    # All exemplars in that space, against which one family's are weighed.
    white = points @ whiten
    total = _shrink(np.cov(white.T)) + whiten.T @ besides @ whiten
    return Metric(
        mean=mean,
        project=project,
        whiten=whiten,
        middle=white.mean(axis=0),
        log_volume=float(0.5 * np.linalg.slogdet(total)[1]),
        spread=_inverse_root(total),
    )


def _within_families(
    points: Float[np.ndarray, "exemplars components"],
    white: Float[np.ndarray, "exemplars components"],
    families: PerExemplar,
) -> ComponentMatrix:
    """Covariance of differences to the nearest other exemplar of the same family."""
    total = np.zeros((points.shape[1], points.shape[1]))
    weight = 0.0
    for family in np.unique(families):
        # Each exemplar and the nearest other one of its family.
        rows = np.flatnonzero(families == family)
        if len(rows) < 2:
            continue
        squares = np.sum((white[rows][:, None] - white[rows]) ** 2, axis=-1)
        np.fill_diagonal(squares, np.inf)
        off = points[rows] - points[rows[squares.argmin(axis=1)]]
        # A large family counts as so many differences at most.
        share = min(1.0, _MOST_OF_A_FAMILY / len(off))
        total += share * off.T @ off
        weight += share * len(off)
    if weight == 0:
        raise ValueError(
            "no two exemplars of a family are different paints: how much one paint of a pigment "
            "differs from another cannot be learnt; give more exemplars"
        )
    return _shrink(total / weight)


def _shrink(covariance: ComponentMatrix) -> ComponentMatrix:
    return (1.0 - _SHRINKAGE) * covariance + _SHRINKAGE * np.diag(np.diag(covariance))


def _inverse_root(covariance: ComponentMatrix) -> ComponentMatrix:
    """Matrix W with W W^T the inverse: points times it have unit covariance."""
    return np.linalg.cholesky(np.linalg.inv(covariance))
