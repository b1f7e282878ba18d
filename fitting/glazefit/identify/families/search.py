"""Odds of sets of pigment families for readings: evidence of each computed film, summed by set.

Evidence is the log of how much more probable a reading is as a paint like a template than as any
paint at all (`metric.py`), over the bands at which the template's exemplars are known. It is
tempered by a power, and 'none of these families' stands beside it with a weight of its own: both
are learnt from the exemplars, each sought among those of other sources, once with its family and
once without (a tempered posterior: Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax import Pigment
from glazejax.geometry import Geometry, Instrument, resolve_instrument

from ...film.model.errors import Prior
from ...film.model.response import FilmResponse, film_response
from ..search.pool import NOBODY
from .features import features
from .groups import COLOURLESS, group_of
from .metric import Metric, learn_metric
from .templates import (
    Templates,
    coefficients,
    mixed_templates,
    pure_templates,
)

# Shares of the exemplars that must know a band, for the narrowest and for a wider range, and the
# fewest that make a range of their own.
_NARROW, _WIDE, _FEWEST = 0.985, 0.45, 25
# A family says no less by few exemplars than by as many as these.
_EXEMPLARS = 3.0
# Powers and weights of 'none' that are tried while both are learnt.
_POWERS = (0.15, 0.22, 0.33, 0.5, 0.75)
_BIASES = np.linspace(-4.0, 6.0, 41)
# Log probability below which one answer counts as a plain mistake, no worse.
_MISTAKE = -8.0
# Exemplars of a source's family that are sought while they are.
_SOUGHT = 4
# Comparisons of readings with templates that are held at a time.
_COMPARISONS = 3_000_000


@dataclass(frozen=True, kw_only=True)
class Range:
    """Bands that some exemplars know, and the films of these.

    Attributes:
        bands: of the readings.
        metric: learnt from the exemplars that know all of these bands.
        templates: films of exemplars whose widest range this is.
        places: of the templates in the metric.
        sets: number of each template's set of families.
    """

    bands: Bool[np.ndarray, "bands"]
    metric: Metric
    templates: Templates
    places: Float[np.ndarray, "templates components"]
    sets: Int[np.ndarray, "templates"]


@dataclass(frozen=True, kw_only=True)
class FamilyOdds:
    """What a search says of some readings.

    Attributes:
        sets: probability of each set of families, (spectra, sets).
        none: probability that it is none of them, (spectra,).
        best: number of the most probable template of each set, (spectra, sets).
        fraction: mean fraction of each set's first family, (spectra, sets).
        fraction_sd: its standard deviation.
        evidence: log evidence of the best template, (spectra,): what 'none' is judged by.
    """

    sets: Float[np.ndarray, "spectra sets"]
    none: Float[np.ndarray, "spectra"]
    best: Int[np.ndarray, "spectra sets"]
    fraction: Float[np.ndarray, "spectra sets"]
    fraction_sd: Float[np.ndarray, "spectra sets"]
    evidence: Float[np.ndarray, "spectra"]


@dataclass(frozen=True, kw_only=True)
class FamilySearch:
    """A search among families that is set up once and takes any number of readings.

    Attributes:
        wavelengths: of the readings, nm.
        families: by name.
        exemplars: the paints, and number of each one's family.
        family_of: number of each exemplar's family.
        source_of: number of each exemplar's source.
        members: families of each set, -1 for none, (sets, 2).
        log_prior: of each set.
        log_prior_none: of none.
        ranges: from the narrowest.
        power, bias: learnt; see the file's head.
    """

    wavelengths: Float[np.ndarray, "bands"]
    families: tuple[str, ...]
    exemplars: tuple[Pigment, ...]
    family_of: Int[np.ndarray, "exemplars"]
    source_of: Int[np.ndarray, "exemplars"]
    members: Int[np.ndarray, "sets 2"]
    log_prior: Float[np.ndarray, "sets"]
    log_prior_none: float
    ranges: tuple[Range, ...]
    surface: float
    power: float = 1.0
    bias: float = 0.0

    def odds(
        self,
        readings: Float[np.ndarray, "spectra bands"],
        hidden: Bool[np.ndarray, "spectra families"] | None = None,
        sources: Int[np.ndarray, "spectra"] | None = None,
    ) -> FamilyOdds:
        """Probabilities of all sets of families.

        Args:
            readings: reflectance factors.
            hidden: families that are taken to be unknown, for each reading.
            sources: number of the source whose exemplars are left out, for each reading.
        """
        step = self.chunk
        parts = [
            self._odds(
                readings[start : start + step],
                None if hidden is None else hidden[start : start + step],
                None if sources is None else sources[start : start + step],
            )
            for start in range(0, len(readings), step)
        ]
        return FamilyOdds(
            **{
                name: np.concatenate([getattr(part, name) for part in parts])
                for name in FamilyOdds.__dataclass_fields__
            }
        )

    @property
    def chunk(self) -> int:
        """Readings that are compared at a time."""
        return max(1, _COMPARISONS // sum(len(one.templates) for one in self.ranges))

    def _odds(
        self,
        readings: Float[np.ndarray, "spectra bands"],
        hidden: Bool[np.ndarray, "spectra families"] | None,
        sources: Int[np.ndarray, "spectra"] | None,
    ) -> FamilyOdds:
        evidence = self._evidence(readings, sources)
        log_sets, best, mean, sd = self._sum_by_set(evidence, self.power)
        log_sets = log_sets + self.log_prior
        if hidden is not None:
            log_sets = np.where(self._is_hidden(hidden), -np.inf, log_sets)
        log_none = self.log_prior_none + self.bias
        top = np.maximum(log_sets.max(axis=1), log_none)[:, None]
        weights = np.exp(log_sets - top)
        none = np.exp(log_none - top[:, 0])
        total = weights.sum(axis=1) + none
        return FamilyOdds(
            sets=weights / total[:, None],
            none=none / total,
            best=best,
            fraction=mean,
            fraction_sd=sd,
            evidence=evidence.max(axis=1),
        )

    def _is_hidden(
        self, hidden: Bool[np.ndarray, "spectra families"]
    ) -> Bool[np.ndarray, "spectra sets"]:
        padded = np.concatenate([hidden, np.zeros((len(hidden), 1), bool)], axis=1)
        return np.asarray(padded[:, self.members].any(axis=-1))

    def _evidence(
        self,
        readings: Float[np.ndarray, "spectra bands"],
        sources: Int[np.ndarray, "spectra"] | None,
    ) -> Float[np.ndarray, "spectra templates"]:
        """Of all templates, those of the narrowest range first; -inf where one may not be used."""
        out = []
        body = readings - self.surface
        for one in self.ranges:
            values = features(self.wavelengths[one.bands], body[:, one.bands])
            found = one.metric.log_evidence(one.metric.place(values), one.places)
            if sources is not None:
                of_members = np.append(self.source_of, NOBODY)[one.templates.members]
                own = (of_members[None] == sources[:, None, None]).any(axis=-1)
                found = np.where(own, -np.inf, found)
            out.append(found)
        return np.concatenate(out, axis=1)

    def _sum_by_set(
        self, evidence: Float[np.ndarray, "spectra templates"], power: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Log evidence of each set, its best template, and mean and standard deviation of the
        fraction of its first family.
        """
        order, starts, counts = self._by_set()
        sorted_evidence = power * evidence[:, order]
        top = np.maximum.reduceat(sorted_evidence, starts, axis=1)
        safe = np.where(np.isfinite(top), top, 0.0)
        weights = np.exp(sorted_evidence - np.repeat(safe, counts, axis=1))
        sums = np.add.reduceat(weights, starts, axis=1)
        usable = np.add.reduceat(np.isfinite(sorted_evidence).astype(float), starts, axis=1)
        with np.errstate(divide="ignore"):
            log_sets = np.log(sums) + safe - np.log(np.maximum(usable, _EXEMPLARS))
        fraction = np.concatenate([one.templates.fractions[:, 0] for one in self.ranges])[order]
        mean = np.add.reduceat(weights * fraction, starts, axis=1) / np.maximum(sums, 1e-300)
        square = np.add.reduceat(weights * fraction**2, starts, axis=1) / np.maximum(sums, 1e-300)
        best = np.stack(
            [
                order[start + sorted_evidence[:, start : start + count].argmax(axis=1)]
                for start, count in zip(starts, counts, strict=True)
            ],
            axis=1,
        )
        return log_sets, best, mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def _by_set(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Templates in the order of their sets, where each set starts, and how many it has."""
        sets = np.concatenate([one.sets for one in self.ranges])
        order = np.argsort(sets, kind="stable")
        starts = np.flatnonzero(np.diff(np.append(-1, sets[order])))
        return order, starts, np.diff(np.append(starts, len(sets)))

    def bands_of(self, template: int) -> Bool[np.ndarray, "bands"]:
        """Bands of the range that a template is in, by its number over all ranges."""
        for one in self.ranges:
            if template < len(one.templates):
                return one.bands
            template -= len(one.templates)
        raise IndexError(template)

    def template(self, number: int) -> tuple[Templates, int]:
        """A template by its number over all ranges: the films of its range, and its row there."""
        for one in self.ranges:
            if number < len(one.templates):
                return one.templates, number
            number -= len(one.templates)
        raise IndexError(number)


def search_families(
    wavelengths: Float[np.ndarray, "bands"],
    pigments: Sequence[Pigment],
    *,
    opaque: bool = False,
    ground: Float[np.ndarray, "bands"] | None = None,
    instrument: Instrument | Geometry | str | None = None,
    prior: Prior | None = None,
    max_paints: int = 2,
    sureness: tuple[float, float] | None = None,
) -> FamilySearch:
    """A search among the families of some exemplars, for an instrument and a kind of film.

    Args:
        wavelengths: of the readings, (bands,), nm, ascending; there may be gaps.
        pigments: exemplars, each with a family and a source.
        opaque: the films hide their ground.
        ground: internal reflectance below films that do not, (bands,).
        instrument: as for `glazefit.identify`.
        prior: how probable films of one and of two pigments are, and of none of the families.
        max_paints: 1 or 2.
        sureness: power and bias of another search among the same exemplars, over another ground;
            by default they are learnt.

    Raises:
        ValueError: no two exemplars of a family cover the readings' bands, or neither a ground nor
            `opaque`.
    """
    if (ground is None) != opaque:
        raise ValueError("what is under the paint? Give ground, or opaque=True")
    seen_by = resolve_instrument(instrument)
    expected = prior or Prior()
    return set_up(
        wavelengths,
        pigments,
        film_response(seen_by.geometry, seen_by.refractive_index),
        surface=seen_by.seen_surface,
        ground=ground,
        sizes=expected.sizes,
        unknown=expected.unknown,
        max_paints=max_paints,
        sureness=sureness,
    )


def set_up(
    wavelengths: Float[np.ndarray, "bands"],
    pigments: Sequence[Pigment],
    response: FilmResponse,
    *,
    surface: float,
    ground: Float[np.ndarray, "bands"] | None,
    sizes: Sequence[float],
    unknown: float,
    max_paints: int = 2,
    sureness: tuple[float, float] | None = None,
) -> FamilySearch:
    """A search that knows how much paints of one family differ, and how sure it may be.

    Args:
        wavelengths: of the readings, (bands,), nm.
        pigments: exemplars, each with a family and a source.
        response: of the instrument.
        surface: what the outer surface adds to its readings.
        ground: internal reflectance below the films, (bands,), or None for films that hide it.
        sizes: how probable films of one and of two pigments are.
        unknown: how probable it is that it is none of the families.
        max_paints: 1 or 2.
        sureness: power and bias, by default learnt (`calibrate`).

    Raises:
        ValueError: no two exemplars of a family cover the readings' bands.
    """
    families = tuple(sorted({pigment.family for pigment in pigments}, key=str.casefold))
    sources = tuple(sorted({pigment.source for pigment in pigments}))
    family_of = np.array([families.index(pigment.family) for pigment in pigments])
    source_of = np.array([sources.index(pigment.source) for pigment in pigments])
    known = coefficients(pigments, wavelengths)
    members, number_of = _sets(len(families), max_paints)

    # In each range a metric of its own, from all exemplars that know its bands.
    ranges = [
        _set_up_range(
            wavelengths[bands],
            known[:, :, bands],
            bands=bands,
            own=own,
            family_of=family_of,
            number_of=number_of,
            response=response,
            ground=None if ground is None else ground[bands],
            mixed=max_paints > 1,
        )
        for bands, own in _ranges(np.isfinite(known[0]))
    ]

    # Sets without a template, two families that no exemplars share bands of, take no part.
    used = np.unique(np.concatenate([one.sets for one in ranges]))
    renumbered = np.full(len(members), -1)
    renumbered[used] = np.arange(len(used))
    search = FamilySearch(
        wavelengths=wavelengths,
        families=families,
        exemplars=tuple(pigments),
        family_of=family_of,
        source_of=source_of,
        members=members[used],
        log_prior=_log_prior(members[used], sizes[:max_paints], unknown),
        log_prior_none=float(np.log(unknown)),
        ranges=tuple(replace(one, sets=renumbered[one.sets]) for one in ranges),
        surface=surface,
    )
    if sureness is not None:
        return replace(search, power=sureness[0], bias=sureness[1])
    return calibrate(search)


def _set_up_range(
    wavelengths: Float[np.ndarray, "bands"],
    known: Float[np.ndarray, "2 exemplars bands"],
    *,
    bands: Bool[np.ndarray, "all_bands"],
    own: Bool[np.ndarray, "exemplars"],
    family_of: Int[np.ndarray, "exemplars"],
    number_of: Int[np.ndarray, "families families"],
    response: FilmResponse,
    ground: Float[np.ndarray, "bands"] | None,
    mixed: bool,
) -> Range:
    """Metric and templates of one range.

    Args:
        wavelengths: of its bands.
        known: k and s of all exemplars there, NaN where they are not known.
        bands: of the readings.
        own: exemplars that know no wider range, whose films are this one's.
        family_of: number of each exemplar's family.
        number_of: of a set, by its families.
        response: of the instrument.
        ground: below the films, or None.
        mixed: whether films of two families are tried.
    """
    pure = pure_templates(known, response, ground)
    pure = pure.take(np.flatnonzero(np.isfinite(pure.readings).all(axis=1)))
    values = features(wavelengths, pure.readings)

    # One spectrum of each paint teaches how far paints are apart.
    exemplars, first = np.unique(pure.members[:, 0], return_index=True)
    metric = learn_metric(values[first], family_of[exemplars], exemplars)

    parts = [pure.take(np.flatnonzero(own[pure.members[:, 0]]))]
    if mixed:
        both = mixed_templates(
            known[:, exemplars],
            family_of[exemplars],
            metric.place(values[first]),
            response,
            ground,
        )
        both = replace(both, members=exemplars[both.members])
        # Where both know more bands their mixture is a wider range's.
        parts.append(both.take(np.flatnonzero(own[both.members].any(axis=1))))
    templates = _joined(parts)
    families = np.sort(np.append(family_of, NOBODY)[templates.members], axis=1)
    return Range(
        bands=bands,
        metric=metric,
        templates=templates,
        places=metric.place(features(wavelengths, templates.readings)),
        sets=number_of[families[:, 0], families[:, 1]],
    )


def _log_prior(
    members: Int[np.ndarray, "sets 2"], sizes: Sequence[float], unknown: float
) -> Float[np.ndarray, "sets"]:
    """Log probability of each set beforehand: all of one size alike."""
    of_size = (members >= 0).sum(axis=1)
    shares = np.asarray(sizes, dtype=float)
    shares = (1.0 - unknown) * shares / shares.sum()
    counts = np.bincount(of_size, minlength=len(shares) + 1)[1:]
    return np.log(shares / np.maximum(counts, 1))[of_size - 1]


def _joined(parts: Sequence[Templates]) -> Templates:
    return Templates(
        members=np.concatenate([part.members for part in parts]),
        fractions=np.concatenate([part.fractions for part in parts]),
        thickness=np.concatenate([part.thickness for part in parts]),
        readings=np.concatenate([part.readings for part in parts]),
    )


def _sets(
    families: int, max_paints: int
) -> tuple[Int[np.ndarray, "sets 2"], Int[np.ndarray, "families families"]]:
    """Families of each set, and the number of a set by its families, sorted, with -1 first for
    none.
    """
    singles = [(a, -1) for a in range(families)]
    pairs = [(a, b) for a in range(families) for b in range(a + 1, families)]
    members = np.array(singles + (pairs if max_paints > 1 else []))
    number = np.full((families + 1, families + 1), -1)
    for n, (a, b) in enumerate(members):
        number[min(a, b), max(a, b)] = n
    return members, number


def _ranges(
    known: Bool[np.ndarray, "exemplars bands"],
) -> list[tuple[Bool[np.ndarray, "bands"], Bool[np.ndarray, "exemplars"]]]:
    """Ranges of bands, nested, and the exemplars of which each is the widest that they know.

    Raises:
        ValueError: too few exemplars know any band.
    """
    share = known.mean(axis=0)
    if not share.max() > 0:
        raise ValueError("no exemplar is known at the wavelengths of the spectra")
    limits = [_NARROW * share.max(), _WIDE, _FEWEST / len(known)]
    out: list[Bool[np.ndarray, "bands"]] = []
    for limit in limits:
        bands = share >= min(limit, share.max())
        wider = not out or bands.sum() > out[-1].sum()
        if bands.sum() >= 3 and wider and known[:, bands].all(axis=1).sum() >= _FEWEST / 2:
            out.append(bands)
    if not out:
        raise ValueError(
            f"{int(known.any(axis=1).sum())} exemplars are known at the spectra's bands, too few "
            "to learn how paints of one pigment differ: give more, or seek them as paints by "
            "own_films=True (--own-films)"
        )
    covered = [known[:, bands].all(axis=1) for bands in out]
    pairs = []
    for number, bands in enumerate(out):
        wider = np.zeros(len(known), bool)
        for further in covered[number + 1 :]:
            wider |= further
        pairs.append((bands, covered[number] & ~wider))
    return pairs


def calibrate(search: FamilySearch) -> FamilySearch:
    """The power of the evidence and the weight of 'none' with which what is said of the exemplars
    comes true: each sought among those of other sources, with its family and without.
    """
    readings, rows = _exemplars_as_readings(search)
    kept = _few_of_each(search.source_of[rows], search.family_of[rows])
    readings = readings[kept]
    rows = rows[kept]
    sources = search.source_of[rows]
    truth = search.family_of[rows]
    others = np.array(
        [
            bool(((search.family_of == family) & (search.source_of != source)).any())
            for family, source in zip(truth, sources, strict=True)
        ]
    )
    hidden = np.zeros((len(rows), len(search.families)), bool)
    hidden[np.arange(len(rows)), truth] = True
    without = search._is_hidden(hidden)
    named = _right_sets(search)[truth]
    each = _weights(search, sources, truth)
    known = each * others
    # A few readings at a time: log odds of all sets at each power.
    step = search.chunk
    log_sets: dict[float, list[np.ndarray]] = {power: [] for power in _POWERS}
    for start in range(0, len(readings), step):
        evidence = search._evidence(readings[start : start + step], sources[start : start + step])
        for power in _POWERS:
            log_sets[power].append(search._sum_by_set(evidence, power)[0] + search.log_prior)

    def at(power: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Log odds of the right sets, of all, and of all without the paint's family."""
        whole = np.concatenate(log_sets[power])
        return (
            _log_sum(np.where(named, whole, -np.inf)),
            _log_sum(whole),
            _log_sum(np.where(without, -np.inf, whole)),
        )

    # First how sure one set is beside others, among paints whose family is there.
    tried = {power: at(power) for power in _POWERS}
    power = max(
        tried, key=lambda p: np.sum(known * np.maximum(tried[p][0] - tried[p][1], _MISTAKE))
    )
    _, everything, rest = tried[power]
    # Then how probable none is, with the family and without; both count alike.
    scores = []
    for bias in _BIASES:
        log_none = search.log_prior_none + bias
        found = np.maximum(log_none - np.logaddexp(rest, log_none), _MISTAKE)
        kept = np.maximum(everything - np.logaddexp(everything, log_none), _MISTAKE)
        scores.append(np.sum(known * kept) / np.sum(known) + np.sum(each * found) / np.sum(each))
    return replace(search, power=power, bias=float(_BIASES[int(np.argmax(scores))]))


def _right_sets(search: FamilySearch) -> Bool[np.ndarray, "families sets"]:
    """Which sets name a pure paint of each family rightly: by its group, whatever colourless family
    stands beside a coloured one.
    """
    groups = [
        {group_of(search.families[member]) for member in row if member >= 0}
        for row in search.members
    ]
    out = np.zeros((len(search.families), len(groups)), dtype=bool)
    for number, family in enumerate(search.families):
        own = group_of(family)
        for column, named in enumerate(groups):
            coloured = named - COLOURLESS
            out[number, column] = (
                own in named and not coloured if own in COLOURLESS else coloured == {own}
            )
    return out


def _few_of_each(
    sources: Int[np.ndarray, "exemplars"], families: Int[np.ndarray, "exemplars"]
) -> Int[np.ndarray, "kept"]:
    """Exemplars of each source's families, evenly through their order, at most some of each."""
    kept: list[int] = []
    for pair in sorted(set(zip(sources.tolist(), families.tolist(), strict=True))):
        own = np.flatnonzero((sources == pair[0]) & (families == pair[1]))
        places = np.linspace(0, len(own) - 1, min(len(own), _SOUGHT)).round().astype(int)
        kept += own[places].tolist()
    return np.array(sorted(kept))


def _weights(
    search: FamilySearch, sources: Int[np.ndarray, "readings"], truth: Int[np.ndarray, "readings"]
) -> Float[np.ndarray, "readings"]:
    """Each source counts by the share of the exemplars that are left without it: where most are
    gone, little is learnt of how sure all of them make. In a source each family counts alike.
    """
    of_family = np.array(
        [
            np.sum((sources == source) & (truth == family))
            for source, family in zip(sources, truth, strict=True)
        ]
    )
    share = 1.0 / of_family
    of_source = np.array([share[sources == source].sum() for source in sources])
    left = np.array([np.mean(search.source_of != source) for source in sources])
    return left * share / of_source


def _log_sum(values: Float[np.ndarray, "n sets"]) -> Float[np.ndarray, "n"]:
    top = values.max(axis=1)
    safe = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.log(np.exp(values - safe[:, None]).sum(axis=1)) + safe


def _exemplars_as_readings(
    search: FamilySearch,
) -> tuple[Float[np.ndarray, "exemplars bands"], Int[np.ndarray, "exemplars"]]:
    """One film of each exemplar, on all bands; where it is not known, as its last known band."""
    rows = []
    readings = []
    for one in search.ranges:
        pure = one.templates.members[:, 1] < 0
        for exemplar in np.unique(one.templates.members[pure, 0]):
            row = np.flatnonzero(pure & (one.templates.members[:, 0] == exemplar))[0]
            filled = np.full(search.wavelengths.size, np.nan)
            filled[one.bands] = one.templates.readings[row]
            seen = np.isfinite(filled)
            rows.append(int(exemplar))
            readings.append(
                np.interp(search.wavelengths, search.wavelengths[seen], filled[seen])
                + search.surface
            )
    return np.array(readings), np.array(rows)
