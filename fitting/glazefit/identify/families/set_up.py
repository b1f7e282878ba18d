"""Setting up a search among families: computed films of all exemplars and of their mixtures, on the
bands of the readings, and how far paints of one family are apart.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int

from glazejax import Pigment, catalogue
from glazejax.geometry import resolve_instrument
from glazejax.progress import Progress, no_progress
from glazejax.radiative.common.chunks import pieces_of
from glazejax.spectra import Bands

from ...film.model.mixing import digest
from ...film.model.response import film_response
from ...film.model.varnish import under_varnish
from ..result.groups import COLOURLESS
from ..search.options import IdentificationOptions
from ..search.pool import NOBODY
from .calibration import exemplars_as_readings, learn_sureness
from .expected import EXPECTED
from .features import colours, views
from .metric import as_columns, learn_metric
from .search import FamilySearch, points_in
from .sureness import PerFamilySet, Sureness
from .templates import (
    PerExemplar,
    Templates,
    coefficients,
    mixed_templates,
    pure_templates,
    usual_coat,
    with_stand_ins,
)
from .varnish import CONDITIONS

# Share of the exemplars that must know a band that is compared: what fewer know, such as the bands
# beyond 1000 nm, says less of how far paints of one family are apart than it costs.
_ENOUGH = 0.45
# Share of these bands that an exemplar must know to teach how far they are, and the fewest that do.
_NEARLY_ALL, _FEWEST = 0.95, 13
# Share of the exemplars that know a band which nearly all know, and the least that these must hold.
_COMMON, _LEAST_SPAN = 0.985, 150.0
# Wavelength up to which one of these must lie, nm: without the visible nothing has been tested.
_VISIBLE = 700.0
# Bands in nm for each principal component of a spectrum: of one as it was read, and of one with its
# gloss at one level, which has lost what separates dark paints.
_COMPONENTS = (11.4, 24.0)
# Wavelength from which readings are compared, nm.
_FIRST = 415.0
# Films whose features are held at a time.
_FILMS = 8192


_SEARCHES: dict[tuple[object, ...], FamilySearch] = {}
"""The last searches that were set up, since that takes some seconds."""
_MOST_SEARCHES = 4


def prepare_search(
    wavelengths: Bands,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    ground: Bands | None,
    progress: Progress = no_progress,
) -> FamilySearch:
    """The search that `search_families` sets up, or one of the last that it did, with what else is
    known of a painting (`FamilySearch.with_facts`).

    Args:
        wavelengths: of the readings, (bands,), nm, in steps of `SEARCHED` or more.
        pigments, options, ground, progress: as for `search_families`.
    """
    exemplars = [
        (p.name, p.family, p.source, digest(p.wavelengths, p.absorption, p.scattering))
        for p in pigments
    ]
    key = (
        digest(wavelengths),
        tuple(exemplars),
        resolve_instrument(options.instrument),
        options.prior or EXPECTED,
        min(options.max_paints, 2),
        options.varnish or "none",
        None if ground is None else tuple(ground.tolist()),
    )
    if key not in _SEARCHES:
        if len(_SEARCHES) >= _MOST_SEARCHES:
            _SEARCHES.pop(next(iter(_SEARCHES)))
        _SEARCHES[key] = search_families(wavelengths, pigments, options, ground, progress)
    return _SEARCHES[key].with_facts(options)


def search_families(
    wavelengths: Bands,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    ground: Bands | None = None,
    progress: Progress = no_progress,
) -> FamilySearch:
    """A search among the families of some exemplars, for an instrument and a kind of film, that
    knows how much paints of one family differ, and how sure it may be.

    Args:
        wavelengths: of the readings, (bands,), nm, ascending; there may be gaps.
        pigments: exemplars, each with a family and a source.
        options: of the identification: instrument, prior, varnish, and films of one or of two
            pigments.
        ground: internal reflectance below the films, (bands,); None if they hide their ground.
        progress: called as films are computed, and as sureness is learnt.

    Raises:
        ValueError: no two exemplars of a family cover the readings' bands.
    """
    instrument = resolve_instrument(options.instrument)
    prior = options.prior or EXPECTED
    response = film_response(instrument)
    varnish = CONDITIONS[options.varnish or "none"]
    max_paints = min(options.max_paints, 2)
    families = tuple(sorted({pigment.family for pigment in pigments}, key=str.casefold))
    family_of = np.array([families.index(pigment.family) for pigment in pigments])
    _, source_of = np.unique([pigment.source for pigment in pigments], return_inverse=True)
    # A user may have read one reference many times: how far paints are apart the catalogue says.
    shipped = np.array([pigment.name in catalogue.provenance() for pigment in pigments])
    teaches = shipped if shipped.any() else ~shipped
    k_and_s = coefficients(pigments, wavelengths)
    # At 410 nm most exemplars' instruments end, below it few exemplars are known, and one edge of
    # rutile would outweigh all other slopes.
    k_and_s[:, :, wavelengths < _FIRST] = np.nan
    bands, teaches = _shared_bands(wavelengths, np.isfinite(k_and_s[0]), teaches)

    progress(0, 1, "computing films")
    grid = wavelengths[bands]
    below = None if ground is None else ground[bands]
    k_and_s = with_stand_ins(k_and_s[:, :, bands], family_of)
    # Exemplars that are known there, and the family of each.
    exemplars = np.flatnonzero(np.isfinite(k_and_s[0]).all(axis=1))
    k_and_s = k_and_s[:, exemplars]
    film_families = family_of[exemplars]

    def cover(films: Templates) -> Templates:
        if varnish is None:
            return films
        expected = varnish.expected(grid)
        return replace(films, readings=under_varnish(response, films.readings, expected))

    # One spectrum of each paint teaches how far paints are apart: all of one thickness come first.
    pure = cover(pure_templates(k_and_s, response, below))
    taught = teaches[exemplars]
    bodies = pure.readings[: len(exemplars)]
    view_features = views(grid, bodies)
    view_differences = (
        [features[:0] for features in view_features]
        if varnish is None
        else varnish.differences(response, grid, bodies[taught])
    )
    metrics = tuple(
        learn_metric(
            values[taught],
            film_families[taught],
            differences,
            components=round((grid[-1] - grid[0]) / width),
        )
        for values, differences, width in zip(
            view_features, view_differences, _COMPONENTS, strict=True
        )
    )

    groups = [pure]
    if max_paints > 1:
        mixtures = mixed_templates(
            k_and_s, film_families, metrics[0].place(view_features[0]), response, below
        )
        groups.append(cover(mixtures))
    templates, members, set_of = _by_set(Templates.join(groups), film_families)
    templates = replace(templates, members=np.append(exemplars, NOBODY)[templates.members])
    # Some films at a time: they have far more features.
    chunks = [
        points_in(metrics, grid, readings) for readings in pieces_of(templates.readings, _FILMS)
    ]
    search = FamilySearch(
        wavelengths=wavelengths,
        families=families,
        exemplars=tuple(pigments),
        family_of=family_of,
        source_of=source_of,
        members=members,
        log_prior=_log_prior(members, prior.sizes[:max_paints], families),
        unknown=prior.unknown,
        bands=bands,
        metrics=metrics,
        templates=templates,
        usual_coat=usual_coat(k_and_s),
        points=tuple(as_columns(np.concatenate(points)) for points in zip(*chunks, strict=True)),
        colours=colours(grid, templates.readings),
        set_of=set_of,
        surface=instrument.seen_surface,
        sureness=Sureness(),
    )
    readings, rows = exemplars_as_readings(search)
    if varnish is not None:
        # How sure a search may be is learnt from films under other varnishes than the expected one.
        varied = varnish.exchange_at_random(response, wavelengths, readings - search.surface)
        readings = varied + search.surface
    return replace(search, sureness=learn_sureness(search, readings, rows, progress))


def _by_set(
    templates: Templates, family_of: PerExemplar
) -> tuple[Templates, Int[np.ndarray, "sets 2"], Int[np.ndarray, "templates"]]:
    """Templates set by set, so that sums over one are of neighbours; families of each set, and the
    set of each template.
    """
    # Sets of one family come first: `NOBODY` is less than any number.
    pairs = np.sort(np.append(family_of, NOBODY)[templates.members], axis=1)
    members, set_of = np.unique(pairs, axis=0, return_inverse=True)
    members = np.where(members[:, :1] == NOBODY, members[:, ::-1], members)
    # NumPy 2.0 gives the numbers of rows another shape.
    set_of = set_of.ravel()
    order = np.argsort(set_of, kind="stable")
    return templates.take(order), members, set_of[order]


def _log_prior(
    members: Int[np.ndarray, "sets 2"], sizes: Sequence[float], families: Sequence[str]
) -> PerFamilySet:
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


def _shared_bands(
    wavelengths: Bands,
    known: Bool[np.ndarray, "exemplars bands"],
    teaches: Bool[np.ndarray, "exemplars"],
) -> tuple[Bool[np.ndarray, "bands"], Bool[np.ndarray, "exemplars"]]:
    """Bands that are compared, those that enough exemplars know of those that may teach the metric;
    and which of these know nearly all of them, and do teach it.

    Raises:
        ValueError: too few exemplars know any band, or nearly all know a narrow stretch alone; says
            how many know the rest.
    """
    share = known[teaches].mean(axis=0)
    if not share.max() > 0:
        raise ValueError("no exemplar is known at the wavelengths of the spectra")
    common = share >= _COMMON * share.max()
    first, last = wavelengths[common][[0, -1]]
    if first > _VISIBLE:
        raise ValueError(
            f"too little is known there: the spectra begin at {wavelengths[0]:g} nm, and no answer "
            "without the visible was ever tested; give readings that hold it, 410-700 nm"
        )
    if last - first < _LEAST_SPAN:
        count = int(known[:, ~common].all(axis=1).sum())
        raise ValueError(
            f"too little is known there: nearly all exemplars know {first:g} to {last:g} nm of the "
            f"spectra's bands alone, {count} of {len(known)} the others; give readings that "
            "hold the visible, 410-700 nm"
        )
    # Where too few know all that is compared, what nearly all know.
    for bands in (share >= min(_ENOUGH, share.max()), common):
        taught = teaches & (known[:, bands].mean(axis=1) >= _NEARLY_ALL)
        if bands.sum() >= 3 and taught.sum() >= _FEWEST:
            return bands, taught
    raise ValueError(
        f"{int(known.any(axis=1).sum())} exemplars have the spectra's bands, too few to learn how "
        "paints of one pigment differ: search more families (leave out --only), give more bands or "
        "exemplars, or search them as paints by own_films=True (--own-films)"
    )
