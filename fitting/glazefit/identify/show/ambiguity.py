"""Sentences on what an answer leaves open, and what it rests on: for the screen, the page and the
record.
"""

from collections import defaultdict

import numpy as np

from glazejax.catalogue import family

from ...film.model.errors import ModelError
from ..result import Candidate, Identification, percent

# Probability relative to the first's below which another film is not looked at.
_LEAST = 1e-3
# Share of a film from which on it may as well be all of it.
_ALL = 0.99


def describe_ambiguity(identification: Identification, row: int) -> list[str]:
    """Sentences on what the spectrum leaves open, and on what the answer rests; none where
    nothing explains it.
    """
    undecided = describe_undecided(identification, row)
    if not identification.explained[row]:
        return [undecided] if undecided else []
    pairs = [
        " or ".join((paint, *alternatives))
        for paint, alternatives in identification.not_told(row).items()
    ]
    sentences = (
        f"This spectrum does not decide between {'; '.join(pairs)}." if pairs else "",
        describe_additions(identification, row),
        undecided,
        *evidence_relied_on(identification, row),
    )
    return [sentence for sentence in sentences if sentence]


def describe_undecided(identification: Identification, row: int) -> str:
    """Pigments that may or may not be in the film, in words; empty if there are none.

    Paints of one pigment count together. Where something explains the spectrum, that nothing might
    is left out: the headline says it.
    """
    explained = 1.0 - float(identification.none[row]) if identification.explained[row] else 1.0
    chances: defaultdict[str, float] = defaultdict(float)
    for paint, chance in zip(
        identification.paints, identification.paint_probability[row] / explained, strict=True
    ):
        chances[family(paint)] += float(chance)
    open_ = sorted(
        (name for name, chance in chances.items() if 0.05 < chance < 0.95),
        key=lambda name: -chances[name],
    )
    words = ", ".join(f"{name} ({chances[name]:.0%})" for name in open_)
    return f"Not settled by this spectrum: {words}." if words else ""


def describe_additions(identification: Identification, row: int) -> str:
    """Say what the film may hold next to the paints of the first candidate; empty if nothing is
    known of that.
    """
    shares = sorted(possible_additions(identification, row).items(), key=lambda pair: -pair[1])
    if not shares:
        return ""
    # Three are named; the others are counted.
    listed = shares[:3]
    # Below this share a paint that may be there is a trace, and its share is not said.
    least_share = 0.01
    phrases = [
        f"up to {percent(most)} {paint}" if most < _ALL else f"any amount of {paint}"
        for paint, most in listed
        if most >= least_share
    ]
    traces = [paint for paint, most in listed if most < least_share]
    if traces:
        phrases.append(f"a trace (below {percent(least_share)}) of {' or '.join(traces)}")
    unlisted = len(shares) - len(listed)
    if unlisted:
        phrases.append(f"less of {unlisted} other{'s' if unlisted > 1 else ''}")
    prefix = "one more paint: " if len(shares) > 1 else ""
    several = f"{', '.join(phrases[:-1])}, or " if len(phrases) > 1 else ""
    return f"It may also hold {prefix}{several}{phrases[-1]}."


def possible_additions(identification: Identification, row: int) -> dict[str, float]:
    """Paints that the first candidate has not -> the largest fraction of each that the spectrum
    allows in addition.

    The upper end of the 90 % interval in the candidate of the same paints and that one, where one
    was kept.
    """
    first, *others = identification.ranked(row)
    out: dict[str, float] = {}
    for larger in others:
        extra = set(larger.paints) - set(first.paints)
        same = (
            set(first.paints) < set(larger.paints)
            and larger.condition == first.condition
            and not any(larger.coats)
        )
        if same and len(extra) == 1 and larger.probability >= _LEAST * first.probability:
            (paint,) = extra
            most = float(larger.fractions_90[larger.paints.index(paint), 1])
            # From this share on the film may hold the paint.
            if most >= 0.001:
                out.setdefault(paint, most)
    return out


def evidence_relied_on(identification: Identification, row: int) -> list[str]:
    """Sentences on what decides between the first candidate and other pigments, where it is the
    ground, a varnish or an end.
    """
    first, *others = identification.ranked(row)
    rivals = [
        c
        for c in others
        if _pigments(c) != _pigments(first) and c.probability >= _LEAST * first.probability
    ]
    return [
        *_relies_on_condition(first, rivals),
        *_relies_on_spectrum_ends(identification, row, first, rivals),
    ]


def _pigments(candidate: Candidate) -> frozenset[str]:
    return frozenset(family(paint) for paint in candidate.paints)


def _relies_on_condition(first: Candidate, rivals: list[Candidate]) -> list[str]:
    """Say if the answer rests on how the film lies: on its ground, or on a varnish."""
    rival = next((c for c in rivals if c.condition != first.condition), None)
    # A film under another condition counts from a tenth of the first's probability on.
    if rival is None or rival.probability < 0.1 * first.probability:
        return []
    what = "varnish" if any("varnish" in c.condition for c in (first, rival)) else "ground"
    # A varnish may have been stated, and a film without one is then not as stated.
    plain = "without a varnish" if what == "varnish" else "as stated"
    statements = [f"{c.condition or plain} it is {c.mixture}" for c in (first, rival)]
    return [
        f"The answer rests on the {what}: {statements[0]}, but {statements[1]} "
        f"({rival.probability:.0%})."
    ]


def _relies_on_spectrum_ends(
    identification: Identification, row: int, first: Candidate, rivals: list[Candidate]
) -> list[str]:
    """Say if the first fits better than other pigments by the first or the last tenth of the
    spectrum alone.
    """
    measured = identification.measured
    grid = measured.wavelengths
    size = grid.size // 10
    if size == 0:
        return []
    usual = ModelError()
    sd = np.hypot(measured.noise_sd[row], usual.model_sd(measured.readings[row]))

    def misses(candidate: Candidate) -> np.ndarray:
        """Squared residual of each band, in units of what is expected."""
        return np.sum((candidate.residual / sd) ** 2, axis=0)

    # Another candidate that fits the rest as well, and the whole much worse, hangs on this end.
    first_misses = misses(first)
    out = []
    for what, end in (("first", slice(size)), ("last", slice(-size, None))):
        for rival in rivals:
            theirs = misses(rival)
            equal_elsewhere = (
                theirs.sum() - theirs[end].sum() <= first_misses.sum() - first_misses[end].sum()
            )
            # A misfit that is a tenth larger is worse.
            if equal_elsewhere and theirs.sum() > 1.1 * first_misses.sum():
                bands = f"{what} tenth of the spectrum ({grid[end][0]:g}-{grid[end][-1]:g} nm)"
                out.append(
                    f"The answer rests on the {bands}: elsewhere {rival.mixture} fits as well."
                )
                break
    return out
