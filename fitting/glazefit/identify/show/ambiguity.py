"""What an answer leaves open, and what it rests on, in words: for the screen, the page and the
record.
"""

import numpy as np

from glazejax.catalogue import family

from ...film.model.errors import ModelError
from ..result import Candidate, Identification, percent

# Probability relative to the first's below which another film is not looked at.
_LEAST = 1e-3
# Share of a film from which on it may as well be all of it.
_ALL = 0.99


def describe_ambiguity(found: Identification, row: int) -> list[str]:
    """Sentences on what the spectrum leaves open, and on what the answer rests; none where
    nothing explains it.
    """
    if not found.explained[row]:
        return [settled] if (settled := describe_undecided(found, row)) else []
    said = (
        describe_indistinguishable(found, row),
        describe_additions(found, row),
        describe_undecided(found, row),
        *evidence_relied_on(found, row),
    )
    return [words for words in said if words]


def describe_indistinguishable(found: Identification, row: int) -> str:
    """Paints of the first film that the spectrum does not separate from others, in words; empty if
    there are none.
    """
    pairs = [" or ".join((paint, *others)) for paint, others in found.not_told(row).items()]
    return f"This spectrum does not decide between {'; '.join(pairs)}." if pairs else ""


def describe_undecided(
    found: Identification, row: int, least: float = 0.05, most: float = 0.95
) -> str:
    """Pigments that may or may not be in the film, in words; empty if there are none.

    Paints of one pigment count together. Where something explains the spectrum, that nothing might
    is left out: the headline says it.
    """
    whole = 1.0 - float(found.none[row]) if found.explained[row] else 1.0
    chances: dict[str, float] = {}
    for paint, chance in zip(found.paints, found.paint_probability[row] / whole, strict=True):
        chances[family(paint)] = chances.get(family(paint), 0.0) + float(chance)
    open_ = sorted(
        (name for name, chance in chances.items() if least < chance < most),
        key=lambda name: -chances[name],
    )
    if not open_:
        return ""
    return (
        "Not settled by this spectrum: "
        + ", ".join(f"{name} ({chances[name]:.0%})" for name in open_)
        + "."
    )


def describe_additions(found: Identification, row: int) -> str:
    """What the film may hold in addition to the paints of the first candidate, in words; empty if
    nothing is known of that.
    """
    shares = sorted(possible_additions(found, row).items(), key=lambda pair: -pair[1])
    if not shares:
        return ""
    # Three are named; the others are counted.
    listed = shares[:3]
    # Below this share a paint that may be there is a trace, and its share is not said.
    least_share = 0.01
    said = [
        f"up to {percent(most)} {paint}" if most < _ALL else f"any amount of {paint}"
        for paint, most in listed
        if most >= least_share
    ]
    traces = [paint for paint, most in listed if most < least_share]
    if traces:
        said.append(f"a trace (below {percent(least_share)}) of {' or '.join(traces)}")
    others = len(shares) - len(listed)
    if others:
        said.append(f"less of {others} other{'s' if others > 1 else ''}")
    one = "one more paint: " if len(shares) > 1 else ""
    several = f"{', '.join(said[:-1])}, or " if len(said) > 1 else ""
    return f"It may also hold {one}{several}{said[-1]}."


def possible_additions(found: Identification, row: int) -> dict[str, float]:
    """Paints that the first candidate has not -> the largest fraction of each that the spectrum
    allows in addition.

    The upper end of the 90 % interval in the candidate of the same paints and that one, where one
    was kept.
    """
    ranked = found.ranked(row)
    first = ranked[0]
    out: dict[str, float] = {}
    for other in ranked[1:]:
        more = set(other.paints) - set(first.paints)
        same = (
            set(first.paints) < set(other.paints)
            and other.condition == first.condition
            and not any(other.coats)
        )
        if same and len(more) == 1 and other.probability >= _LEAST * first.probability:
            (paint,) = more
            most = float(other.fractions_90[other.paints.index(paint), 1])
            # From this share on the film may hold the paint.
            if most >= 0.001:
                out.setdefault(paint, most)
    return out


def evidence_relied_on(found: Identification, row: int) -> list[str]:
    """What decides between the first candidate and other pigments, where it is the ground, a
    varnish or an end.
    """
    ranked = found.ranked(row)
    first = ranked[0]
    rivals = [
        c
        for c in ranked[1:]
        if _pigments(c) != _pigments(first) and c.probability >= _LEAST * first.probability
    ]
    return [
        words
        for words in (
            _relies_on_condition(first, rivals),
            *_relies_on_spectrum_ends(found, row, ranked, first),
        )
        if words
    ]


def _pigments(candidate: Candidate) -> frozenset[str]:
    return frozenset(family(paint) for paint in candidate.paints)


def _relies_on_condition(first: Candidate, rivals: list[Candidate]) -> str:
    """Whether the answer rests on how the film lies: on its ground, or on a varnish."""
    other = next((c for c in rivals if c.condition != first.condition), None)
    # A film under another condition counts from a tenth of the first's probability on.
    if other is None or other.probability < 0.1 * first.probability:
        return ""
    what = "varnish" if any("varnish" in c.condition for c in (first, other)) else "ground"
    ways = [f"{c.condition or 'as stated'} it is {c.mixture}" for c in (first, other)]
    return f"The answer rests on the {what}: {ways[0]}, but {ways[1]} ({other.probability:.0%})."


def _relies_on_spectrum_ends(
    found: Identification, row: int, ranked: list[Candidate], first: Candidate
) -> list[str]:
    """Whether the first fits better than other pigments by the first or the last tenth of the
    spectrum alone.
    """
    measured = found.measured
    grid = measured.wavelengths
    size = max(1, grid.size // 10)
    if grid.size < 10:
        return []
    usual = ModelError.between_films()
    sd = np.hypot(measured.noise_sd[row], usual.amplitude + usual.share * measured.readings[row])

    def misses(candidate: Candidate) -> np.ndarray:
        """Squared residual of each band, in units of what is expected."""
        return np.sum((candidate.residual / sd) ** 2, axis=0)

    # Another candidate that fits the rest as well, and the whole much worse, hangs on this end.
    own = misses(first)
    out = []
    for what, end in (("first", slice(0, size)), ("last", slice(grid.size - size, None))):
        for other in ranked[1:]:
            if (
                _pigments(other) == _pigments(first)
                or other.probability < _LEAST * first.probability
            ):
                continue
            theirs = misses(other)
            rest = theirs.sum() - theirs[end].sum() <= own.sum() - own[end].sum()
            # A misfit that is a tenth larger is worse.
            if rest and theirs.sum() > 1.1 * own.sum():
                bands = f"{what} tenth of the spectrum ({grid[end][0]:g}-{grid[end][-1]:g} nm)"
                out.append(
                    f"The answer rests on the {bands}: elsewhere {other.mixture} fits as well."
                )
                break
    return out
