"""What `identify` is given, checked and brought to one shape, and what the search for all spectra
shares.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int

from glazejax import Pigment
from glazejax.paint.media import MAX_THICKNESS
from glazejax.spectra import validate_wavelengths

from ...film.errors import Discrepancy, Prior, model_covariance, noise_covariance, whitening
from ...film.films import Noise
from ...film.mixing import Pigments, listed_pigments
from ...film.noise import noise_of_each
from ...film.optics import Optics
from ...film.response import FilmResponse
from .effort import Effort
from .screen import Paints, sets_of
from .table import FilmTable, FilmTables

_TOO_BRIGHT = 1.5
"""Above this a reflectance is a mistake, such as percent; below, it may be a highlight or a
calibration.
"""

# Of the errors that rank sets of paints before each is fitted.
TYPICAL_READING = 0.3

_OPAQUE = 200.0
"""Scattering optical thickness of a film that hides its ground."""

UNSEEN_GROUND = 0.5
"""Ground under films that hide it."""


@dataclass(frozen=True)
class Measured:
    """Spectra over one ground or several.

    Attributes:
        names: of the spectra.
        wavelengths: (bands,), nm.
        readings: reflectance, (spectra, grounds, bands).
        grounds: internal reflectance under the paint, the same shape.
        noise_sd: of the readings, the same shape: what the instrument is said to have, or what the
            spectra show.
        doubt: further errors of known shapes, independent and of standard deviation 1, (spectra,
            shapes, grounds, bands).
    """

    names: tuple[str, ...]
    wavelengths: Float[np.ndarray, "bands"]
    readings: Float[np.ndarray, "spectra grounds bands"]
    grounds: Float[np.ndarray, "spectra grounds bands"]
    noise_sd: Float[np.ndarray, "spectra grounds bands"]
    doubt: Float[np.ndarray, "spectra shapes grounds bands"]

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: Int[np.ndarray, "rows"]) -> "Measured":
        """Some of the spectra, by number."""
        names = tuple(self.names[i] for i in rows)
        spectra = (part[rows] for part in (self.readings, self.grounds, self.noise_sd, self.doubt))
        return type(self)(names, self.wavelengths, *spectra)

    def delta_e(
        self, computed: Float[np.ndarray, "spectra candidates grounds bands"]
    ) -> Float[np.ndarray, "spectra candidates"]:
        """CIEDE2000 (D65, 10 degrees) to computed readings, the largest over the grounds; NaN
        without a colour.
        """
        from glazejax.colour import delta_e_of_spectra

        try:
            each = delta_e_of_spectra(
                self.wavelengths, self.readings[:, None], computed, observer=10
            )
        except ValueError:
            return np.full(computed.shape[:2], np.nan)
        return np.asarray(each).max(axis=-1)

    @classmethod
    def join(cls, parts: Sequence["Measured"]) -> "Measured":
        """Several batches on one grid as one."""
        names = tuple(name for part in parts for name in part.names)
        spectra = ((part.readings, part.grounds, part.noise_sd, part.doubt) for part in parts)
        return cls(
            names,
            parts[0].wavelengths,
            *(np.concatenate(same) for same in zip(*spectra, strict=True)),
        )


def check_spectra(
    spectra: ArrayLike,
    wavelengths: ArrayLike,
    grounds: ArrayLike | None,
    names: Sequence[str] | None,
    noise: Noise,
) -> Measured:
    """Spectra and grounds as (spectra, grounds, bands); see `glazefit.identify`.

    Raises:
        ValueError: shapes that do not match, values that are not reflectances, or repeated names.
    """
    grid = validate_wavelengths(np.asarray(wavelengths, dtype=np.float64))
    readings = np.asarray(spectra, dtype=np.float64)
    given = readings.shape
    if readings.ndim == 1:
        readings = readings[None]
    if readings.ndim == 2:
        readings = readings[:, None]
    if readings.ndim != 3 or readings.shape[-1] != grid.size or 0 in readings.shape:
        raise ValueError(
            f"spectra of shape {given} are not (bands,), (spectra, bands) or (spectra, grounds, "
            f"bands) with {grid.size} bands"
        )
    labels = tuple(names) if names is not None else tuple(str(i + 1) for i in range(len(readings)))
    if len(labels) != len(readings):
        raise ValueError(f"{len(labels)} names were given for {len(readings)} spectra")
    if len(set(labels)) < len(labels):
        twice = next(name for name in labels if labels.count(name) > 1)
        raise ValueError(f"two spectra are called {twice!r}; names must differ")
    wrong = ~(np.isfinite(readings) & (readings >= 0) & (readings <= _TOO_BRIGHT))
    if wrong.any():
        row, _, band = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(
            f"the reflectance of {labels[row]!r} at {grid[band]:g} nm is {readings[wrong][0]:g}; "
            f"it must be a fraction from 0 to {_TOO_BRIGHT:g} (divide percent by 100)"
        )
    ground = np.asarray(UNSEEN_GROUND if grounds is None else grounds, dtype=np.float64)
    if ground.ndim == 1 and ground.shape[0] != grid.size:
        raise ValueError(
            f"grounds of shape {ground.shape} do not end in the {grid.size} bands of the spectra"
        )
    try:
        ground = np.broadcast_to(ground, readings.shape)
    except ValueError:
        raise ValueError(
            f"grounds of shape {ground.shape} do not fit spectra of shape (spectra, grounds, "
            f"bands) = {readings.shape}"
        ) from None
    if not ((ground >= 0) & (ground <= 1)).all():
        value = ground[~((ground >= 0) & (ground <= 1))][0]
        raise ValueError(f"a ground's internal reflectance is {value:g}; it must lie in [0, 1]")
    seen = noise_of_each(readings).max(axis=-1)[:, None, None]
    doubt = np.empty((len(readings), 0, *readings.shape[1:]))
    return Measured(
        names=labels,
        wavelengths=grid,
        readings=readings,
        grounds=ground,
        noise_sd=np.maximum(noise.sd(readings), seen),
        doubt=doubt,
    )


def check_pigments(pigments: Pigments, wavelengths: Float[np.ndarray, "bands"]) -> list[Pigment]:
    """The catalogue on the grid of the spectra.

    Raises:
        ValueError: no pigment, repeated names, several spectra in one pigment, or a grid that is
            too short.
    """
    known = listed_pigments(pigments)
    if not known:
        raise ValueError("the catalogue is empty; give at least one pigment")
    names = [pigment.name for pigment in known]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two pigments of the catalogue are called {twice!r}; names must differ")
    for pigment in known:
        if pigment.absorption.ndim != 1 or pigment.scattering.ndim != 1:
            raise ValueError(
                f"the pigment {pigment.name!r} is a batch; give its members one by one"
            )
        if pigment.phase is not None:
            raise ValueError(
                f"pigment {pigment.name!r} has a phase function; here paint scatters isotropically"
            )
    try:
        return [pigment.resample(wavelengths) for pigment in known]
    except ValueError as error:
        raise ValueError(f"the catalogue does not cover the spectra: {error}") from None


def hiding(prior: Prior, pigments: Sequence[Pigment]) -> Prior:
    """Of films so thick that their ground does not matter: the thickness is set, not sought."""
    typical = np.median([np.median(np.asarray(p.scattering)) for p in pigments])
    return replace(
        prior, thickness=min(_OPAQUE / max(float(typical), 1.0), MAX_THICKNESS), spread=0.05
    )


class IdentificationTask(NamedTuple):
    """What all spectra of an identification share."""

    response: FilmResponse
    paints: Paints
    errors: Float[np.ndarray, "paints 2 bands"]  # relative, of the paints' k and s
    modes: Float[np.ndarray, "paints 2 bands modes"]  # correlated errors of their logarithms
    wavelengths: Float[np.ndarray, "bands"]
    optics: Optics
    surface: float  # what a smooth surface adds to a reading
    noise: Noise
    discrepancy: Discrepancy
    prior: Prior
    extenders: Bool[np.ndarray, "paints"]  # those that a film of usual thickness hardly shows
    max_paints: int
    layers: int
    effort: Effort
    tables: FilmTables  # of this task alone

    @property
    def known(self) -> int:
        """Paints in the catalogue."""
        return self.paints.absorption.shape[0]

    @property
    def middle(self) -> int:
        """Scale of the discrepancy that is fitted with: the one nearest to 1."""
        return int(np.argmin(np.abs(np.log(self.discrepancy.scales))))

    def target(
        self, readings: Float[np.ndarray, "spectra grounds bands"]
    ) -> Float[np.ndarray, "spectra readings"]:
        """Readings without the mean surface."""
        return (readings - self.discrepancy.gloss * self.surface).reshape(len(readings), -1)

    def common_whitening(self, grounds: int) -> Float[np.ndarray, "readings readings"]:
        """Of a reading of middling size, for the searches that only rank."""
        sd = self.noise.sd(np.full((grounds, self.wavelengths.size), TYPICAL_READING))
        model = model_covariance(
            self.wavelengths, grounds, self.discrepancy, self.discrepancy.screening
        )
        return whitening(noise_covariance(sd, self.surface, self.discrepancy) + model)[0]

    def films_over(self, ground: Float[np.ndarray, "grounds bands"]) -> FilmTable:
        """The table of films over a ground."""
        return self.tables.over(ground, self.common_whitening)

    def log_sets(self, members: Int[np.ndarray, "*n size"]) -> Float[np.ndarray, "*n"]:
        """Log prior probability of sets of paints; a negative number is none."""
        sizes = np.asarray(self.prior.sizes[: self.max_paints])
        each = [
            share / sizes.sum() / len(sets_of(self.known, n))
            for n, share in enumerate(sizes, start=1)
        ]
        there = members >= 0
        count = there.sum(axis=-1)
        # Alone, an extender is as good as any other paint.
        hardly = np.where(count > 1, (there & self.extenders[members]).sum(axis=-1), 0)
        # No paint at all is no explanation.
        with np.errstate(divide="ignore"):
            return np.log(np.asarray([0.0, *each]))[count] + hardly * np.log(self.prior.extender)
