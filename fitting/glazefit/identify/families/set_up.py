"""Setting up a search among families: computed films of all exemplars and of their mixtures, on the
bands of the readings, and how far paints of one family are apart.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax import Pigment, catalogue
from glazejax.geometry import Geometry, Instrument, resolve_instrument
from glazejax.progress import Progress, no_progress

from ...film.model.errors import Prior
from ...film.model.response import FilmResponse, film_response
from ..result.groups import COLOURLESS
from ..search.pool import NOBODY
from .calibration import calibrate
from .expected import EXPECTED
from .features import colours, views
from .metric import Metric, as_columns, learn_metric
from .search import FamilySearch, Range
from .sureness import Sureness
from .templates import Templates, coefficients, mixed_templates, pure_templates
from .varnish import CONDITIONS, Varnish

# Shares of the exemplars that must know a band, for the narrowest and for a wider range, and the
# fewest that teach a range: what fewer know, such as the bands beyond 1000 nm, says less of how far
# paints of one family are apart than it costs.
_NARROW, _WIDE, _FEWEST = 0.985, 0.45, 13
# Wavelength from which readings are compared, nm.
_FIRST = 415.0
# Films whose features are held at a time.
_FILMS = 8192


def search_families(
    wavelengths: Float[np.ndarray, "bands"],
    pigments: Sequence[Pigment],
    *,
    opaque: bool = False,
    ground: Float[np.ndarray, "bands"] | None = None,
    instrument: Instrument | Geometry | str | None = None,
    prior: Prior | None = None,
    max_paints: int = 2,
    varnish: str = "none",
    sureness: Sureness | None = None,
    progress: Progress = no_progress,
) -> FamilySearch:
    """A search among the families of some exemplars, for an instrument and a kind of film, that
    knows how much paints of one family differ, and how sure it may be.

    Args:
        wavelengths: of the readings, (bands,), nm, ascending; there may be gaps.
        pigments: exemplars, each with a family and a source.
        opaque: the films hide their ground.
        ground: internal reflectance below films that do not, (bands,).
        instrument: as for `glazefit.identify`.
        prior: how probable films of one and of two pigments are, and of none of the families.
        max_paints: 1 or 2.
        varnish: what is stated of it, a name of `varnish.CONDITIONS`.
        sureness: of another search among the same exemplars, over another ground; by default it
            is learnt.
        progress: called as films are computed, and as sureness is learnt.

    Raises:
        ValueError: no two exemplars of a family cover the readings' bands, or neither a ground nor
            `opaque`.
    """
    if (ground is None) != opaque:
        raise ValueError("no ground is stated: give ground, or opaque=True")
    seen_by = resolve_instrument(instrument)
    response = film_response(seen_by.geometry, seen_by.refractive_index)
    expected = prior or EXPECTED
    cover = CONDITIONS[varnish]
    families = tuple(sorted({pigment.family for pigment in pigments}, key=str.casefold))
    sources = tuple(sorted({pigment.source for pigment in pigments}))
    family_of = np.array([families.index(pigment.family) for pigment in pigments])
    source_of = np.array([sources.index(pigment.source) for pigment in pigments])
    # A user may have read one reference many times: how far paints are apart the catalogue says.
    shipped = np.array([pigment.name in catalogue.provenance() for pigment in pigments])
    teaches = shipped if shipped.any() else ~shipped
    k_and_s = coefficients(pigments, wavelengths)
    # At 410 nm most exemplars' instruments end, below it few exemplars are known, and one edge of
    # rutile would outweigh all other slopes.
    k_and_s[:, :, wavelengths < _FIRST] = np.nan
    members, number_of = _sets(len(families), max_paints)
    shared = _ranges(np.isfinite(k_and_s[0]), teaches)
    _check_span(wavelengths, shared[0][0], np.isfinite(k_and_s[0]))

    # In each range a metric of its own, from all exemplars that know its bands.
    ranges = []
    for number, (bands, widest) in enumerate(shared):
        progress(number, len(shared), "computing films")
        ranges.append(
            _set_up_range(
                wavelengths[bands],
                k_and_s[:, :, bands],
                bands=bands,
                widest=widest,
                teaches=teaches,
                family_of=family_of,
                number_of=number_of,
                response=response,
                ground=None if ground is None else ground[bands],
                mixed=max_paints > 1,
                varnish=cover,
            )
        )

    # Sets without a template, two families that no exemplars share bands of, take no part.
    used = np.unique(np.concatenate([band_range.sets for band_range in ranges]))
    renumbered = np.full(len(members), -1)
    renumbered[used] = np.arange(len(used))
    search = FamilySearch(
        wavelengths=wavelengths,
        families=families,
        exemplars=tuple(pigments),
        family_of=family_of,
        source_of=source_of,
        members=members[used],
        log_prior=_log_prior(members[used], expected.sizes[:max_paints], families),
        unknown=expected.unknown,
        ranges=tuple(
            replace(band_range, sets=renumbered[band_range.sets]) for band_range in ranges
        ),
        surface=seen_by.seen_surface,
        sureness=sureness or Sureness(),
    )
    if sureness is not None:
        return search
    change = cover and functools.partial(cover.exchange_at_random, response, wavelengths)
    return calibrate(search, change, progress)


def _set_up_range(
    wavelengths: Float[np.ndarray, "bands"],
    k_and_s: Float[np.ndarray, "2 exemplars bands"],
    *,
    bands: Bool[np.ndarray, "all_bands"],
    widest: Bool[np.ndarray, "exemplars"],
    teaches: Bool[np.ndarray, "exemplars"],
    family_of: Int[np.ndarray, "exemplars"],
    number_of: Int[np.ndarray, "families families"],
    response: FilmResponse,
    ground: Float[np.ndarray, "bands"] | None,
    mixed: bool,
    varnish: Varnish | None,
) -> Range:
    """Metrics and templates of one range.

    Args:
        wavelengths: of its bands.
        k_and_s: k and s of all exemplars there, NaN where they are not known.
        bands: of the readings.
        widest: exemplars that know no wider range, whose films are this one's.
        teaches: exemplars that the metric is learnt from.
        family_of: number of each exemplar's family.
        number_of: of a set, by its families.
        response: of the instrument.
        ground: below the films, or None.
        mixed: whether films of two families are tried.
        varnish: that may lie on them.
    """

    def cover(films: Templates) -> Templates:
        if varnish is None:
            return films
        return replace(films, readings=varnish.cover(response, wavelengths, films.readings))

    pure = pure_templates(k_and_s, response, ground)
    pure = pure.take(np.flatnonzero(np.isfinite(pure.readings).all(axis=1)))
    # One spectrum of each paint teaches how far paints are apart.
    exemplars, first = np.unique(pure.members[:, 0], return_index=True)
    taught = teaches[exemplars]
    bodies = pure.readings[first[taught]]
    pure = cover(pure)
    view_differences = (
        [None, None] if varnish is None else varnish.differences(response, wavelengths, bodies)
    )
    view_features = views(wavelengths, pure.readings[first])
    metrics = tuple(
        learn_metric(
            values[taught],
            family_of[exemplars[taught]],
            exemplars[taught],
            differences,
            components=components,
        )
        # The view of one gloss has lost what separates dark paints: fewer components hold it.
        for values, differences, components in zip(
            view_features, view_differences, (25, 12), strict=True
        )
    )

    groups = [pure.take(np.flatnonzero(widest[pure.members[:, 0]]))]
    if mixed:
        mixtures = mixed_templates(
            k_and_s[:, exemplars],
            family_of[exemplars],
            metrics[0].place(view_features[0]),
            response,
            ground,
        )
        mixtures = replace(mixtures, members=exemplars[mixtures.members])
        # Where both know more bands their mixture is a wider range's.
        groups.append(cover(mixtures.take(np.flatnonzero(widest[mixtures.members].any(axis=1)))))
    templates = Templates.join(groups)
    families = np.sort(np.append(family_of, NOBODY)[templates.members], axis=1)
    return Range(
        bands=bands,
        metrics=metrics,
        templates=templates,
        points=_points(wavelengths, templates.readings, metrics),
        colours=colours(wavelengths, templates.readings),
        sets=number_of[families[:, 0], families[:, 1]],
    )


def _points(
    wavelengths: Float[np.ndarray, "bands"],
    readings: Float[np.ndarray, "films bands"],
    metrics: Sequence[Metric],
) -> tuple[Float[np.ndarray, "components+2 films"], ...]:
    """Points of films in each metric (`as_columns`), some films at a time: they have far more
    features.
    """
    chunks = [
        [
            metric.place(values)
            for metric, values in zip(
                metrics, views(wavelengths, readings[start : start + _FILMS]), strict=True
            )
        ]
        for start in range(0, max(len(readings), 1), _FILMS)
    ]
    return tuple(as_columns(np.concatenate(points)) for points in zip(*chunks, strict=True))


def _log_prior(
    members: Int[np.ndarray, "sets 2"], sizes: Sequence[float], families: Sequence[str]
) -> Float[np.ndarray, "sets"]:
    """Log prior probability of each set: sets of one kind share theirs by how common their families
    are in paint.
    """
    catalogue_families = catalogue.families()
    # An own reference may be of a family that the catalogue does not have.
    common = [
        catalogue_families[name].common if name in catalogue_families else 1.0 for name in families
    ]
    weights = np.append(common, 1.0)[members].prod(axis=1)
    colourless = np.array([name in COLOURLESS for name in families])
    mixed = members[:, 1] >= 0
    # Half of all mixtures are of a colour with a white, an extender or a black.
    tinted = mixed & colourless[members].any(axis=1)
    kinds = [~mixed, tinted, mixed & ~tinted]
    shares = [sizes[0], *[chance / 2.0 for chance in sizes[1:]] * 2]
    for kind, share in zip(kinds, shares, strict=False):
        if kind.any():
            weights[kind] *= share / weights[kind].sum()
    return np.log(weights / weights.sum())


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


def _check_span(
    wavelengths: Float[np.ndarray, "bands"],
    shared: Bool[np.ndarray, "bands"],
    coverage: Bool[np.ndarray, "exemplars bands"],
) -> None:
    """Refuse readings of which nearly all exemplars know a narrow stretch alone.

    Raises:
        ValueError: says how many exemplars know the rest.
    """
    first, last = wavelengths[shared][[0, -1]]
    if last - first < 150.0:
        count = int(coverage[:, ~shared].all(axis=1).sum()) if not shared.all() else len(coverage)
        raise ValueError(
            f"too little is known there: nearly all exemplars know {first:g} to {last:g} nm of the "
            f"spectra's bands alone, {count} of {len(coverage)} the others; give readings that "
            "hold the visible, 410-700 nm"
        )


def _ranges(
    coverage: Bool[np.ndarray, "exemplars bands"], teaches: Bool[np.ndarray, "exemplars"]
) -> list[tuple[Bool[np.ndarray, "bands"], Bool[np.ndarray, "exemplars"]]]:
    """Ranges of bands, nested, by what those know that the metric is learnt from, and the exemplars
    of which each is the widest that they know.

    Raises:
        ValueError: too few exemplars know any band.
    """
    taught = coverage[teaches]
    share = taught.mean(axis=0)
    if not share.max() > 0:
        raise ValueError("no exemplar is known at the wavelengths of the spectra")
    # A narrow range that nearly all exemplars know, and a wide one that many know.
    limits = [_NARROW * share.max(), _WIDE]
    out: list[Bool[np.ndarray, "bands"]] = []
    for limit in limits:
        bands = share >= min(limit, share.max())
        wider = not out or bands.sum() > out[-1].sum()
        if bands.sum() >= 3 and wider and taught[:, bands].all(axis=1).sum() >= _FEWEST:
            out.append(bands)
    if not out:
        raise ValueError(
            f"{int(coverage.any(axis=1).sum())} exemplars have the spectra's bands, too "
            "few to learn how paints of one pigment differ: give more bands or exemplars, or "
            "search them as paints by own_films=True (--own-films)"
        )
    # Each exemplar belongs to the widest range that it knows.
    covered = [coverage[:, bands].all(axis=1) for bands in out]
    pairs = []
    for number, bands in enumerate(out):
        wider = np.zeros(len(coverage), bool)
        for further in covered[number + 1 :]:
            wider |= further
        pairs.append((bands, covered[number] & ~wider))
    return pairs
