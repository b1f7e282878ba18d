"""Which paints are in a film: from its spectrum, over one ground or several, and a catalogue.

Sets of one, two and three paints compete, and with them the hypothesis that none of the catalogue's
paints explain the film; `glazefit.identify.search.screen` says which sets are looked at,
`glazefit.film.errors` what counts as an error, and
`glazefit.identify.search.fit` how a set's probability follows. Sets that are not looked at count as
impossible; the search keeps far more than ever come near the best.
"""

from collections.abc import Iterator, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from glazejax import Hemispherical
from glazejax.geometry import Geometry, resolve_instrument

from ..film.errors import Discrepancy, Prior
from ..film.films import Films, Instrument, Noise, cards
from ..film.mixing import Pigments
from ..film.response import film_response
from .result import Identification
from .search.searcher import Searcher
from .search.weigh import weigh


def identify_chunks(
    spectra: ArrayLike,
    wavelengths: ArrayLike,
    pigments: Pigments,
    *,
    grounds: ArrayLike | None,
    instrument: Instrument | None = None,
    geometry: Geometry | None = None,
    noise: Noise | None = None,
    discrepancy: Discrepancy | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    layers: int = 1,
    names: Sequence[str] | None = None,
    keep: int = 20,
    thorough: bool = False,
) -> Iterator[Identification]:
    """As `identify`, a few spectra at a time, so that progress can be shown and an interrupt loses
    little.

    Args and errors are those of `identify`.
    """
    searcher = Searcher.of(
        wavelengths,
        pigments,
        opaque=grounds is None,
        instrument=instrument,
        geometry=geometry,
        noise=noise,
        discrepancy=discrepancy,
        prior=prior,
        max_paints=max_paints,
        layers=layers,
        thorough=thorough,
    )
    measured = searcher.check(spectra, grounds, names)
    for batch, pool, odds in searcher.search(measured):
        yield weigh(batch, pool, odds, searcher.paints, searcher.opaque, keep)


def identify(
    spectra: ArrayLike,
    wavelengths: ArrayLike,
    pigments: Pigments,
    *,
    grounds: ArrayLike | None,
    instrument: Instrument | None = None,
    geometry: Geometry | None = None,
    noise: Noise | None = None,
    discrepancy: Discrepancy | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    layers: int = 1,
    names: Sequence[str] | None = None,
    keep: int = 20,
    thorough: bool = False,
) -> Identification:
    """Paints, fractions and thickness of films from their spectra, as ranked lists with
    probabilities.

    Args:
        spectra: reflectance as fractions, (bands,), (spectra, bands), or (spectra, grounds, bands)
            for one film over several grounds.
        wavelengths: (bands,), nm.
        pigments: the catalogue, a mapping as `glazejax.catalogue.load` gives it or a list, on any
            grids that cover the spectra's.
        grounds: internal reflectance (that under paint) of the grounds: a number, (bands,) or
            (grounds, bands), or one for each spectrum, (spectra, grounds, bands). None for films
            that hide their ground; their thickness is then unknown.
        instrument: by default d:8 with the specular part, index 1.5.
        geometry: replaces the instrument's, such as `glazejax.Bidirectional(45, 0)` for one without
            a sphere.
        noise: of a reading; where the spectra themselves are rougher, their roughness counts.
        discrepancy: of the model; by default `glazefit.film.errors.BETWEEN_FILMS`.
        prior: what is expected beforehand.
        max_paints: largest set, 1 to 3.
        layers: 2 tries the best sets as two coats too, in both orders.
        names: of the spectra.
        keep: candidates kept for each spectrum.
        thorough: fit every pair, and give every set errors of its own: some four times as long for
            the same first answer in most cases (`glazefit.identify.search.effort`).

    Returns:
        `Identification`; ``ranked(row)`` lists the explanations of a spectrum, ``none[row]`` is the
        probability that no paints of the catalogue explain it.

    Raises:
        ValueError: shapes that do not match, values that are not reflectances, an empty catalogue,
            repeated names.
    """
    parts = identify_chunks(
        spectra,
        wavelengths,
        pigments,
        grounds=grounds,
        instrument=instrument,
        geometry=geometry,
        noise=noise,
        discrepancy=discrepancy,
        prior=prior,
        max_paints=max_paints,
        layers=layers,
        names=names,
        keep=keep,
        thorough=thorough,
    )
    return Identification.join(list(parts))


def identify_films(
    films: Films,
    pigments: Pigments,
    *,
    instrument: Instrument | None = None,
    geometry: Geometry | None = None,
    noise: Noise | None = None,
    discrepancy: Discrepancy | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    layers: int = 1,
    keep: int = 20,
    thorough: bool = False,
) -> Identification:
    """As `identify`, for films over a black and a white card that were measured bare.

    Args:
        films: such as `read_films` reads; their bare cards say what is below the paint.
        pigments, instrument, geometry, noise, discrepancy, prior: see `identify`.
        max_paints, layers, keep, thorough: see `identify`.

    Returns:
        `Identification`, a row for each film.

    Raises:
        ValueError: as `identify`, or cards that are not possible (see `ground_from_air`).
    """
    seen_by = resolve_instrument(geometry or instrument)
    if isinstance(seen_by.geometry, Hemispherical):
        black, white, _, _ = cards(films, seen_by, noise or Noise())
    else:
        bare = np.stack([films.bare_black, films.bare_white])
        black, white = ground_from_air(bare, seen_by.geometry, seen_by.refractive_index)
    over = np.stack([films.over_black, films.over_white], axis=1)
    return identify(
        over,
        films.wavelengths,
        pigments,
        grounds=np.stack([black, white], axis=1),
        instrument=instrument,
        geometry=geometry,
        noise=noise,
        discrepancy=discrepancy,
        prior=prior,
        max_paints=max_paints,
        layers=layers,
        names=films.names,
        keep=keep,
        thorough=thorough,
    )


def ground_from_air(
    bare: Float[np.ndarray, "*shape"],
    geometry: Geometry | None = None,
    refractive_index: float = 1.5,
) -> Float[np.ndarray, "*shape"]:
    """Internal reflectance of grounds from what they read bare, with the same instrument.

    Args:
        bare: reflectance as read, as fractions, (...).
        geometry: of the instrument; by default d:8 with the specular part.
        refractive_index: of the paint that lies on them later.

    Returns:
        Reflectance as seen from inside the paint, (...).

    Raises:
        ValueError: a reading below the surface's reflection or above that of a perfect diffuser, by
            more than .01.

    Example:
        >>> ground_from_air(np.array([0.05, 0.84])).round(2).tolist()
        [0.03, 0.93]
    """
    instrument = resolve_instrument(geometry, refractive_index)
    within = np.asarray(bare, dtype=np.float64) - instrument.seen_surface
    response = film_response(instrument.geometry, instrument.refractive_index)
    inside = np.asarray(response.internal(jnp.asarray(within)))
    for wrong, words in (
        (within < -0.01, "less than its surface alone"),
        (inside > 1.01, "more than white can"),
    ):
        if wrong.any():
            value = np.asarray(bare)[wrong].flat[0]
            raise ValueError(
                f"the bare ground reads {value:.4f} ({words}); is it seen with another instrument?"
            )
    return np.clip(inside, 0.0, 1.0)
