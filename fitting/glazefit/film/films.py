"""Measured films: paint over a black and over a white card, and the noise of the instrument that
saw them; or one film as a posterior needs it, over one or two known grounds, each reading with its
error.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import ArrayLike, Bool, Float

from glazejax.geometry import Geometry, resolve_instrument
from glazejax.geometry import Instrument as Instrument
from glazejax.io.spectra_table import list_names, there_are
from glazejax.names import first_repeated
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.spectra import MAX_DECLARED, Bands, describe_grid, validate_wavelengths

from .model.optics import Optics
from .model.response import ground_below
from .tables import WAVELENGTH, Tabulated, Variables

Spectra: TypeAlias = Float[np.ndarray, "films bands"]
"""A spectrum of each film."""
PerCard: TypeAlias = Float[np.ndarray, "*films bands cards"]
"""A spectrum of each card, or other ground, of each film."""
InstrumentLike = Instrument | Geometry | str
"""What an `instrument=` argument takes, see `glazejax.geometry.resolve_instrument`."""
SPECTRA = ("bare_black", "bare_white", "over_black", "over_white")
FLAGS = ("seen", "assumed", "opaque")
_BY_DEFAULT: Any = None


@dataclass(frozen=True)
class Noise:
    """Repeatability of a reading: independent Gaussian errors of sd = floor + share * R.

    The default is a fair bench instrument: printed to 0.01 %, zero and stray light to 0.05 %, scale
    to 0.2 %; repeats of paint-outs published by the Kimera project differ by 0.0018 on average.

    Raises:
        ValueError: a negative or not finite value, or both zero.
    """

    floor: float = 0.0005
    share: float = 0.002

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < np.inf:
                raise ValueError(
                    f"the noise's {name} is {value:g}; it must be 0 or more, such as 0.0005"
                )
        if self.floor == 0:
            raise ValueError(
                "a noise floor of 0 makes readings near 0 exact; give a value such as 0.0005"
            )

    def sd(
        self, reflectance: Float[np.ndarray | np.floating, "*shape"]
    ) -> Float[np.ndarray, "*shape"]:
        """Standard deviation of readings of this reflectance (fractions)."""
        return np.asarray(self.floor + self.share * np.abs(reflectance))


@dataclass(frozen=True)
class Films(Tabulated):
    """Films that share a wavelength grid.

    Attributes:
        names: what each paint is called, all different.
        wavelengths: (bands,), nm.
        bare_black, bare_white: (films, bands), reflectance of the cards without paint.
        over_black, over_white: (films, bands), reflectance of the paint on them.
        notes: sentences on what a reader changed or noticed.
        seen: (films, 2), whether there is a reading over black, and over white; by default all. The
            array of a reading that there is not holds the other's values, and what is computed of
            films leaves it out.
        assumed: (films, 2), whether the bare card was not measured: then its array holds the
            internal reflectance of a usual card (`usual_cards`); by default none.
        opaque: (films,), whether a film is known to hide whatever is below; by default none. Then
            its cards count not.

    Raises:
        ValueError: shapes that do not match, a value that is NaN, negative or too high for a
            fraction, a white card that is not brighter than the black one, a film without any
            reading, or names that repeat.
    """

    names: tuple[str, ...]
    wavelengths: Bands
    bare_black: Spectra
    bare_white: Spectra
    over_black: Spectra
    over_white: Spectra
    notes: tuple[str, ...] = ()
    seen: Bool[np.ndarray, "films 2"] = _BY_DEFAULT
    assumed: Bool[np.ndarray, "films 2"] = _BY_DEFAULT
    opaque: Bool[np.ndarray, "films"] = _BY_DEFAULT

    def __post_init__(self) -> None:
        grid = validate_wavelengths(self.wavelengths)
        object.__setattr__(self, "wavelengths", grid)
        if (twice := first_repeated(self.names)) is not None:
            raise ValueError(f"two films are called {twice!r}; names must differ")
        count = len(self.names)
        usually = {
            "seen": np.ones((count, 2)),
            "assumed": np.zeros((count, 2)),
            "opaque": np.zeros(count),
        }
        for what, usual in usually.items():
            flags = getattr(self, what)
            flags = np.asarray(usual if flags is _BY_DEFAULT else flags, dtype=bool)
            object.__setattr__(self, what, flags)
            if flags.shape != usual.shape:
                raise ValueError(f"{what} has shape {flags.shape}; it must be {usual.shape}")
        blind = ~self.seen.any(axis=1)
        if blind.any():
            raise ValueError(
                f"film {self.names[blind.argmax()]!r} has no reading, over black or over white"
            )
        for what in SPECTRA:
            values = np.asarray(getattr(self, what), dtype=np.float64)
            object.__setattr__(self, what, values)
            if values.shape != (count, grid.size):
                raise ValueError(
                    f"{what} has shape {values.shape} but there are {count} films and "
                    f"{grid.size} bands"
                )
            wrong = ~np.isfinite(values) | (values < 0)
            if wrong.any():
                i, j = np.argwhere(wrong)[0]
                raise ValueError(
                    f"{what} of {self.names[i]!r} at {grid[j]:g} nm is {values[i, j]:g}; "
                    "reflectance is 0 or more"
                )
            if values.max(initial=0.0) > MAX_DECLARED:
                i, j = np.argwhere(values > MAX_DECLARED)[0]
                raise ValueError(
                    f"{what} of {self.names[i]!r} at {grid[j]:g} nm is {values[i, j]:g}, which "
                    "looks like percent: divide by 100"
                )
        # A usual card is given from inside the paint, where the black one is darker and the white
        # one brighter.
        dim = (self.bare_white.mean(axis=1) <= self.bare_black.mean(axis=1)) & self.seen.all(axis=1)
        if dim.any():
            name = self.names[dim.argmax()]
            raise ValueError(
                f"the bare white card of {name!r} is not brighter than its bare black card: are "
                "the rows swapped?"
            )

        # Measured films that hide their cards read up to .004 darker over white (revigo's).
        darker = (self.over_black - self.over_white).mean(axis=1)
        darker = np.where(self.seen.all(axis=1) & ~self.opaque, darker, 0.0)
        if darker.max(initial=0.0) > 0.01:
            name = self.names[darker.argmax()]
            raise ValueError(
                f"film {name!r} is darker over white than over black, by {darker.max():.2g} on "
                f"average: are the rows {name}_ob and {name}_ow swapped?"
            )

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return (
            f"Films({len(self)} films, {describe_grid(self.wavelengths)}: {list_names(self.names)})"
        )

    def take(self, rows: Sequence[int] | slice) -> "Films":
        """Some of the films, by number."""
        index = np.arange(len(self))[rows]
        pick = {what: getattr(self, what)[index] for what in (*SPECTRA, *FLAGS)}
        return replace(self, names=tuple(self.names[i] for i in index), **pick)

    @property
    def over_cards(self) -> Float[np.ndarray, "films 2 bands"]:
        """Reflectance of the paint over black and over white."""
        return np.stack([self.over_black, self.over_white], axis=1)

    @property
    def bare_cards(self) -> Float[np.ndarray, "films 2 bands"]:
        """Reflectance of the black and of the white card without paint."""
        return np.stack([self.bare_black, self.bare_white], axis=1)

    @property
    def complete(self) -> bool:
        """True if every film was read over both cards, and both cards bare."""
        return bool(self.seen.all() and not self.assumed.any() and not self.opaque.any())

    def readings(self) -> tuple[Float[np.ndarray, "rows bands"], ...]:
        """Measured spectra: bare cards, black and white, and paint over them; rows that there are
        not are left out.
        """
        return tuple(getattr(self, what)[rows] for what, rows in self._measured().items())

    def _measured(self) -> dict[str, Bool[np.ndarray, "films"]]:
        """Of which films each of `SPECTRA` was measured."""
        bare = self.seen & ~self.assumed & ~self.opaque[:, None]
        return dict(zip(SPECTRA, (*bare.T, *self.seen.T), strict=True))

    def arrays_and_axes(self) -> Variables:
        """Arrays and their axes; NaN where nothing was measured."""
        axes = {"film": list(self.names), WAVELENGTH: self.wavelengths}
        measured = self._measured().items()
        return {
            what: (tuple(axes), np.where(rows[:, None], getattr(self, what), np.nan))
            for what, rows in measured
        }, axes

    def where_seen(
        self, values: Float[np.ndarray, "films 2 *rest"]
    ) -> Float[np.ndarray, "films 2 *rest"]:
        """Values over black and over white, with those of a reading that there is not replaced by
        the other's.
        """
        mask = self.seen.reshape(*self.seen.shape, *[1] * (values.ndim - 2))
        return np.where(mask, values, values[:, ::-1])

    def select(self, wanted: Sequence[str]) -> "Films":
        """Films of these names, in this order.

        Raises:
            ValueError: there is no film of that name; the message lists the nearest ones.
        """
        for name in wanted:
            if name not in self.names:
                raise ValueError(f"unknown sample {name!r}; {there_are(name, self.names)}")
        return self.take([self.names.index(name) for name in wanted])


class BareSurface(NamedTuple):
    """Effect of the surface on a bare Lambertian ground rho, which reads gain rho/(1 - back rho)
    without the mirror.

    `back` is the reflectance of the surface for diffuse light from inside, r_i: .5963 at an index
    of 1.5.
    """

    gain: float
    back: float


@functools.lru_cache(maxsize=32)
def bare_surface(instrument: Instrument) -> BareSurface:
    """Gain and back of an instrument, by the integral of Fresnel's reflectance over all directions.

    Diffuse light from inside is reflected by r_i = 1 - (1 - r_e)/n^2 with r_e that of diffuse light
    from outside (Duntley 1942, by the conservation of radiance over n^2).
    """
    nodes, weights = np.polynomial.legendre.leggauss(96)
    # Where light grazes the slope is infinite: nodes in the root of the cosine.
    root = 0.5 * (nodes + 1.0)
    *directions, index = Optics.of(instrument)
    cosines = [cosine for cosine in directions if cosine is not None]
    reflected = dielectric_reflectance(np.concatenate([root**2, cosines]), index)
    outside = float(np.sum(weights * 2.0 * root**3 * reflected[: root.size]))
    enters = (1.0 - outside) / index**2
    through = float(np.prod(1.0 - reflected[root.size :]))
    return BareSurface(through * (enters if len(cosines) == 1 else 1.0 / index**2), 1.0 - enters)


def card_reflectance(
    bare: Float[np.ndarray, "*shape"], instrument: Instrument
) -> tuple[Float[np.ndarray, "*shape"], Float[np.ndarray, "*shape"]]:
    """Internal reflectance of cards from their bare reflectance in air, and its derivative.

    Under paint only the internal reflectance counts: a card that reads 5 % in air is 2.5 % inside,
    one that reads 84 % is 93 %.

    Returns:
        rho, (...), and d rho / d bare, (...). Values outside [0, 1] are possible and the caller's
        to refuse.
    """
    gain, back = bare_surface(instrument)
    x = np.asarray(bare) - instrument.seen_surface
    return ground_below(x, gain, back), gain / (gain + x * back) ** 2


def ground_from_air(
    bare: Float[np.ndarray, "*shape"],
    instrument: InstrumentLike | None = None,
    refractive_index: float = 1.5,
) -> Float[np.ndarray, "*shape"]:
    """Internal reflectance of grounds from what they read bare, with the same instrument.

    Args:
        bare: reflectance as read, as fractions, (...).
        instrument: it, see `glazejax.geometry.resolve_instrument`; by default d:8 with the specular
            part.
        refractive_index: of the paint that lies on them later, where `instrument` is no whole
            `glazejax.Instrument`, which has its own.

    Returns:
        Reflectance as seen from inside the paint, (...).

    Raises:
        ValueError: a reading below the surface's reflection or above that of a perfect diffuser, by
            more than .01.

    Example:
        >>> ground_from_air(np.array([0.05, 0.84])).round(2).tolist()
        [0.03, 0.93]
    """
    seen_by = resolve_instrument(instrument, refractive_index)
    bare = np.asarray(bare, dtype=np.float64)
    internal, _ = card_reflectance(bare, seen_by)
    for wrong, reason in (
        (bare < seen_by.seen_surface - 0.01, "less than its surface alone"),
        (internal > 1.01, "more than white can"),
    ):
        if wrong.any():
            value = bare[wrong].flat[0]
            raise ValueError(
                f"the bare ground reads {value:.4f} ({reason}); is it seen with another instrument?"
            )
    return np.clip(internal, 0.0, 1.0)


def usual_cards(wavelengths: Bands) -> tuple[Bands, Bands]:
    """Internal reflectance of a black and of a white card of the usual kind, (bands,) each.

    In air they read 5 % and 80-89 %; the white one falls off below 430 nm, as paper with a
    brightener does.
    """
    black = np.full(np.shape(wavelengths), 0.025)
    white = 0.95 - 0.02 * np.maximum(700 - wavelengths, 0) / 300
    return black, white - 0.2 * np.exp(-np.maximum(wavelengths - 400, 0) / 12)


def check_ground(ground: ArrayLike | None, *, opaque: bool = False) -> None:
    """Refuse a ground of films that show none, none of films that show it, and internal
    reflectances that no ground has.

    Raises:
        ValueError: one of these.
    """
    if (ground is None) != opaque:
        raise ValueError(
            "opaque films show no ground: leave out ground, or leave out opaque"
            if opaque
            else "no ground is stated: what is under the paint? Give ground, its internal "
            "reflectance such as 0.9, or opaque=True for films that hide it"
        )
    values = np.asarray([] if ground is None else ground, dtype=np.float64)
    wrong = values[~((values >= 0) & (values <= 1))]
    if wrong.size:
        raise ValueError(f"a ground's internal reflectance is {wrong[0]:g}; it must lie in [0, 1]")


USUAL_CARD_SD = (0.005, 0.02)
"""How far a black and a white card of the usual kind may be off from band to band, in internal
reflectance.
"""


class CardReadings(NamedTuple):
    """Readings over cards, a black and a white one or others (last axis), and their standard
    deviations.
    """

    reflectance: PerCard
    ground: PerCard  # internal reflectance of the cards
    sd: PerCard
    ground_sd: PerCard


def card_readings(films: Films, instrument: Instrument, noise: Noise) -> CardReadings:
    """Readings of films over their cards, (films, bands, 2) each.

    Raises:
        ValueError: a card is darker than its surface alone, or brighter than a perfect diffuser, by
            more than four standard deviations.
    """
    over = films.over_cards.swapaxes(1, 2)
    bare = films.bare_cards.swapaxes(1, 2)
    internal, slope = card_reflectance(bare, instrument)
    # A usual card is given from inside.
    internal = np.where(films.assumed[:, None], bare, internal)
    needed = (films.seen & ~films.opaque[:, None])[:, None]
    sd = np.where(needed & ~films.assumed[:, None], slope * noise.sd(bare), USUAL_CARD_SD)
    # Cards that no reading needs are not judged, but films may be predicted over them.
    for wrong, complaint in (
        (
            (internal < -4 * sd) & needed,
            f"darker than its surface alone ({instrument.seen_surface:.4f}); was the specular part "
            "excluded?",
        ),
        (
            (internal > 1 + 4 * sd) & needed,
            "brighter than a perfect diffuser; is it fluorescent, or the scale wrong?",
        ),
    ):
        if wrong.any():
            film, band, card = np.argwhere(wrong)[0]
            raise ValueError(
                f"the bare {('black', 'white')[card]} card of {films.names[film]!r} reads "
                f"{bare[film, band, card]:.4f} at {films.wavelengths[band]:g} nm, {complaint}"
            )
    return CardReadings(
        reflectance=over,
        ground=np.clip(internal, 0.0, 1.0),
        sd=noise.sd(over),
        ground_sd=sd,
    )


@dataclass(frozen=True)
class Reading:
    """A film over one ground or more.

    Attributes:
        name: of the film.
        wavelengths: (bands,), nm.
        reflectance: as measured, with the surface's part if the instrument sees it, (bands,
            grounds).
        ground: internal reflectance of the grounds, (bands, grounds), in [0, 1].
        sd: standard deviation of `reflectance`.
        ground_sd: standard deviation of `ground`; 0 where it is known.
        grounds: what the grounds are called.

    Raises:
        ValueError: shapes that do not match, or a value out of range.
    """

    name: str
    wavelengths: Bands
    reflectance: PerCard
    ground: PerCard
    sd: PerCard
    ground_sd: PerCard
    grounds: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelengths", validate_wavelengths(self.wavelengths))
        shape = (self.wavelengths.size, len(self.grounds))
        for what, low, high in (
            ("reflectance", 0.0, MAX_DECLARED),
            ("ground", 0.0, 1.0),
            ("sd", 1e-9, np.inf),
            ("ground_sd", 0.0, np.inf),
        ):
            values = np.asarray(getattr(self, what), dtype=np.float64)
            object.__setattr__(self, what, values)
            if values.shape != shape:
                raise ValueError(
                    f"{what} of {self.name!r} has shape {values.shape}; it must be {shape}"
                )
            wrong = ~((values >= low) & (values <= high) & np.isfinite(values))
            if wrong.any():
                i, j = np.argwhere(wrong)[0]
                cure = " (divide percent by 100)" if values[i, j] > high else ""
                raise ValueError(
                    f"{what} of {self.name!r} over {self.grounds[j]} at {self.wavelengths[i]:g} "
                    f"nm is {values[i, j]:g}; it must be in [{low:g}, {high:g}]{cure}"
                )

    def __repr__(self) -> str:
        return (
            f"Reading({self.name!r} over {' and '.join(self.grounds)}, "
            f"{describe_grid(self.wavelengths)})"
        )


def readings(films: Films, instrument: Instrument, noise: Noise) -> list[Reading]:
    """The films over those of their cards, black and white, that they were read over; the cards'
    own errors count.

    Raises:
        ValueError: a film that is taken to hide its ground, or a card that its surface or a perfect
            diffuser contradicts (see `card_readings`).
    """
    if films.opaque.any():
        name = films.names[films.opaque.argmax()]
        raise ValueError(
            f"film {name!r} is taken to hide its ground, which must be known here: give its "
            "spectrum and the ground by reading_over"
        )
    measured = card_readings(films, instrument, noise)
    return [
        Reading(
            name=name,
            wavelengths=films.wavelengths,
            grounds=tuple(compress(("black", "white"), cards)),
            **CardReadings(*(values[:, cards] for values in arrays))._asdict(),
        )
        for name, cards, *arrays in zip(films.names, films.seen, *measured, strict=True)
    ]


def reading_over(
    wavelengths: Bands,
    reflectance: Bands,
    ground: float | Bands,
    *,
    noise: Noise | None = None,
    name: str = "film",
) -> Reading:
    """One spectrum over a known ground.

    Args:
        wavelengths: (bands,), nm.
        reflectance: measured, (bands,).
        ground: internal reflectance of the ground, a number or (bands,); from a card measured bare
            `card_reflectance` gives it.
        noise: of the reading.
        name: of the film.
    """
    measured = np.asarray(reflectance, dtype=np.float64)[:, None]
    under = np.broadcast_to(np.asarray(ground, dtype=np.float64).reshape(-1, 1), measured.shape)
    sd = (noise or Noise()).sd(measured)
    return Reading(
        name=name,
        wavelengths=wavelengths,
        reflectance=measured,
        ground=under,
        sd=sd,
        ground_sd=np.zeros_like(measured),
        grounds=("the ground",),
    )
