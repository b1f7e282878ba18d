"""Directions that a posterior leaves open, hardly narrower than the prior, put into words.

The directions are eigenvectors of the posterior's covariance after the prior has been made round;
an eigenvalue of 1 is a direction of which the data say nothing, and .01 one that they narrow ten
times.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import eigh

from glazejax.spectra import Bands, ranges

from ..film.prior import UnknownsCovariance
from ..film.problem import FilmProblem, FreeDraws, Quantity, SpectraDraws
from ..recover.films.result import ABSOLUTE_LIMIT, RELATIVE_LIMIT
from .summary import LEVELS

OPEN = 0.25
"""A direction with this share of the prior's variance, half of its width, or more, is open."""


@dataclass(frozen=True)
class Identifiability:
    """Directions that are open.

    Attributes:
        sentences: what is open, in words; none if all is known.
    """

    sentences: tuple[str, ...]


def directions(
    free: Float[np.ndarray, "draws dims"], prior: UnknownsCovariance
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions of the free unknowns, from their draws.

    Returns:
        Posterior over prior variance in each direction, ascending, (dims,); the directions as unit
        vectors in prior standard deviations, (dims, dims), the last axis is the unknown; and the
        correlation of the unknowns, (dims, dims).
    """
    # Of a single unknown NumPy gives a number.
    covariance = np.atleast_2d(np.cov(free, rowvar=False))
    shares, axes = eigh(covariance, prior)
    # Back into unknowns, each in its own prior's standard deviations.
    vectors = (prior @ axes).T / np.sqrt(np.diag(prior))
    vectors /= np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return shares, vectors, covariance / sd[:, None] / sd


def _describe_correlated(
    correlation: Float[np.ndarray, "dims dims"], names: Sequence[str]
) -> list[str]:
    """Pairs of unknowns that move together: known together better than each by itself."""
    return [
        f"{names[j]} and {names[i]} can hardly be distinguished: they move "
        f"{'against each other' if correlation[i, j] < 0 else 'together'} (correlation "
        f"{correlation[i, j]:.2f})"
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) >= 0.95
    ]


def _describe_open(
    share: float,
    vector: Float[np.ndarray, "dims"],
    members: Int[np.ndarray, "members"],
    names: Sequence[str],
) -> str:
    """One open direction; signs say which unknowns rise together."""
    width = f"{min(np.sqrt(share), 1.0):.0%} of its prior's width"
    if len(members) == 1:
        return f"the data say little of {names[members[0]]}: it keeps {width}"
    first = np.sign(vector[members[0]])
    moves = ", ".join(f"{names[i]} {'up' if vector[i] * first > 0 else 'down'}" for i in members)
    return f"the data say little of one direction ({moves}): it keeps {width}"


def open_above(problem: FilmProblem, free: FreeDraws) -> list[str]:
    """Say of a film of paints that it hides its ground, if it does: it is so thick at least, and
    may be thicker.

    The prior hardly allows such thickness, so that the posterior may be narrow: its upper end is
    then the prior's.

    Args:
        problem: of a film of known paints.
        free: draws of the free unknowns.
    """
    draws = free[:: max(1, len(free) // 64)]
    thicker = draws.copy()
    thicker[..., problem.unknowns.index("thickness")] += np.log(3.0)
    loss = np.mean(problem.log_likelihood(draws) - problem.log_likelihood(thicker))
    open_above = (
        "thickness is open above: a film 3 times as thick would read the same, so that its upper "
        "end is what was expected, not what was measured"
    )
    return [open_above] if loss < 0.5 else []


def _of_spectra(spectra: SpectraDraws, wavelengths: Bands) -> list[str]:
    """Sentences on what is open in k d and s d, band by band."""
    k, s, ratio = _known_values(spectra)
    cases = (
        (only_ratio(spectra), "only k/s is known, not k and s by themselves"),
        (~ratio & s & ~k, "s is known, but of k only an upper limit"),
        (~ratio & k & ~s, "k is known, but s is not"),
        (~ratio & ~k & ~s, "neither k nor s nor k/s is known to half its value"),
    )
    return [f"{ranges(wavelengths, where)}: {what}" for where, what in cases if where.any()]


def identify_open(problem: FilmProblem, free: FreeDraws, wavelengths: Bands) -> list[str]:
    """Sentences that name what is open.

    Band by band a value is known if its standard deviation is less than half of it or than .01, the
    rule of `glazejax recover`. In a film of one coat of known paints directions of all unknowns are
    open, and a thickness above; in one of several first each unknown by itself, then ties of
    thicknesses and fractions.

    Args:
        problem: of a film, or of its bands.
        free: draws of the free unknowns.
        wavelengths: nm.
    """
    if problem.kind == "bands":
        return _of_spectra(problem.spectra(free), wavelengths)
    draws = free[:, 0]
    if problem.kind == "paints":
        sentences = open_above(problem, free)
        sentences += _open_directions(draws, problem, range(problem.dims), alone=True)
        return sentences
    prior = problem.prior_draws(np.random.default_rng(0), 4000)
    sentences = []
    ties = []
    for quantity in problem.quantities:
        if quantity.name not in problem.unknowns:
            continue
        unchanged, sentence = _compare_with_prior(quantity, draws, prior)
        sentences += [sentence] if sentence else []
        if not unchanged and " of coat " in quantity.name:
            ties.append(problem.unknowns.index(quantity.name))
    sentences += _open_directions(draws, problem, ties, alone=False)
    if spectra := problem.spectra(free):
        sentences += [
            f"unknown paint, {sentence}" for sentence in _of_spectra(spectra, wavelengths)
        ]
    return sentences


def _compare_with_prior(
    quantity: Quantity,
    free: Float[np.ndarray, "draws dims"],
    prior: Float[np.ndarray, "others dims"],
) -> tuple[bool, str]:
    """True if a quantity's posterior is its prior; a sentence if the readings constrain it little
    or not at all, else an empty one.
    """
    after, before = (np.quantile(quantity.scaled(draws), LEVELS) for draws in (free, prior))
    width = before[-1] - before[0]
    # A posterior is its prior if its median and both ends of 90 % are, nearly.
    if np.abs(after - before).max() <= 0.15 * width:
        return (
            True,
            f"{quantity.name}: not constrained by these readings: its posterior is its prior",
        )
    share = (after[-1] - after[0]) / width
    if share >= np.sqrt(OPEN):
        return (
            False,
            f"{quantity.name}: hardly constrained: it keeps {min(share, 1.0):.0%} of its prior's "
            "width",
        )
    return False, ""


def _open_directions(
    free: Float[np.ndarray, "draws dims"],
    problem: FilmProblem,
    columns: Sequence[int],
    *,
    alone: bool,
) -> list[str]:
    """Open directions of these unknowns, those of a single one `alone` too, and unknowns that move
    together.
    """
    if not columns:
        return []
    names = [problem.unknowns[i] for i in columns]
    prior = problem.prior_covariance[np.ix_(columns, columns)]
    shares, vectors, correlation = directions(free[:, columns], prior)
    sentences = []
    for share, vector in zip(shares, vectors, strict=True):
        # The unknowns that the direction is made of, largest first.
        members = np.flatnonzero(np.abs(vector) >= 0.3)
        members = members[np.argsort(-np.abs(vector[members]))]
        if share >= OPEN and (alone or len(members) > 1):
            sentences.append(_describe_open(share, vector, members, names))
    return sentences + _describe_correlated(correlation, names)


def only_ratio(spectra: SpectraDraws) -> Bool[np.ndarray, "bands"]:
    """Bands of which k/s is known, but not both k and s."""
    k, s, ratio = _known_values(spectra)
    return ratio & ~(k & s)


def _known_values(spectra: SpectraDraws) -> list[Bool[np.ndarray, "bands"]]:
    """Bands of which k, s and k/s are known."""
    return [
        values.std(axis=0) <= np.maximum(RELATIVE_LIMIT * values.mean(axis=0), ABSOLUTE_LIMIT)
        for values in spectra.values()
    ]
