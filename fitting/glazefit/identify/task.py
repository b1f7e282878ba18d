"""What `identify` is given, checked and brought to one shape, and what the search for all spectra shares."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float, Int

from glazejax import Pigment
from glazejax.spectra import validate_wavelengths

from ..film.errors import Discrepancy, Prior, model_covariance, noise_covariance, whitening
from ..film.films import Noise
from ..film.optics import Optics
from ..film.response import FilmResponse
from .screen import Paints, sets_of

_TOO_BRIGHT = 1.5
"""Above this a reflectance is a mistake, such as percent; below, it may be a highlight or a calibration."""

# Of the errors that rank sets of paints before each is fitted.
_TYPICAL_READING = 0.3

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
    """

    names: tuple[str, ...]
    wavelengths: Float[np.ndarray, "bands"]
    readings: Float[np.ndarray, "spectra grounds bands"]
    grounds: Float[np.ndarray, "spectra grounds bands"]

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: Int[np.ndarray, "rows"]) -> "Measured":
        """Some of the spectra, by number."""
        names = tuple(self.names[i] for i in rows)
        return type(self)(names, self.wavelengths, self.readings[rows], self.grounds[rows])


def check_spectra(
    spectra: ArrayLike, wavelengths: ArrayLike, grounds: ArrayLike | None, names: Sequence[str] | None
) -> Measured:
    """Spectra and grounds as (spectra, grounds, bands); see `glazefit.identify.identify.identify_chunks`.

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
            f"spectra of shape {given} are not (bands,), (spectra, bands) or (spectra, grounds, bands) with "
            f"{grid.size} bands"
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
            f"the reflectance of {labels[row]!r} at {grid[band]:g} nm is {readings[wrong][0]:g}; it must be a fraction "
            f"from 0 to {_TOO_BRIGHT:g} (divide percent by 100)"
        )
    ground = np.asarray(UNSEEN_GROUND if grounds is None else grounds, dtype=np.float64)
    if ground.ndim == 1 and ground.shape[0] != grid.size:
        raise ValueError(f"grounds of shape {ground.shape} do not end in the {grid.size} bands of the spectra")
    try:
        ground = np.broadcast_to(ground, readings.shape)
    except ValueError:
        raise ValueError(
            f"grounds of shape {ground.shape} do not fit spectra of shape (spectra, grounds, bands) = {readings.shape}"
        ) from None
    if not ((ground >= 0) & (ground <= 1)).all():
        value = ground[~((ground >= 0) & (ground <= 1))][0]
        raise ValueError(f"a ground's internal reflectance is {value:g}; it must lie in [0, 1]")
    return Measured(labels, grid, readings, ground)


def check_pigments(pigments: Sequence[Pigment], wavelengths: Float[np.ndarray, "bands"]) -> list[Pigment]:
    """The catalogue on the grid of the spectra.

    Raises:
        ValueError: no pigment, repeated names, several spectra in one pigment, or a grid that is too short.
    """
    known = list(pigments)
    if not known:
        raise ValueError("the catalogue is empty; give at least one pigment")
    names = [pigment.name for pigment in known]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two pigments of the catalogue are called {twice!r}; names must differ")
    for pigment in known:
        if pigment.absorption.ndim != 1 or pigment.scattering.ndim != 1:
            raise ValueError(f"the pigment {pigment.name!r} is a batch; give its members one by one")
        if pigment.phase is not None:
            raise ValueError(f"pigment {pigment.name!r} has a phase function; here paint scatters isotropically")
    try:
        return [pigment.resample(wavelengths) for pigment in known]
    except ValueError as error:
        raise ValueError(f"the catalogue does not cover the spectra: {error}") from None


class IdentificationTask(NamedTuple):
    """What all spectra of an identification share."""

    response: FilmResponse
    paints: Paints
    errors: Float[np.ndarray, "paints 2 bands"]  # relative, of the paints' k and s
    wavelengths: Float[np.ndarray, "bands"]
    optics: Optics
    surface: float  # what a smooth surface adds to a reading
    noise: Noise
    discrepancy: Discrepancy
    prior: Prior
    max_paints: int
    layers: int

    @property
    def known(self) -> int:
        """Paints in the catalogue."""
        return self.paints.absorption.shape[0]

    @property
    def middle(self) -> int:
        """Scale of the discrepancy that is fitted with: the one nearest to 1."""
        return int(np.argmin(np.abs(np.log(self.discrepancy.scales))))

    def target(self, readings: Float[np.ndarray, "spectra grounds bands"]) -> Float[np.ndarray, "spectra readings"]:
        """Readings without the mean surface."""
        return (readings - self.discrepancy.gloss * self.surface).reshape(len(readings), -1)

    def common_whitening(self, grounds: int) -> Float[np.ndarray, "readings readings"]:
        """Of a reading of middling size, for the searches that only rank."""
        sd = self.noise.sd(np.full((grounds, self.wavelengths.size), _TYPICAL_READING))
        model = model_covariance(self.wavelengths, grounds, self.discrepancy, self.discrepancy.screening)
        return whitening(noise_covariance(sd, self.surface, self.discrepancy) + model)[0]

    def log_set(self, size: int) -> float:
        """Log prior probability of one set of so many paints."""
        sizes = np.asarray(self.prior.sizes[: self.max_paints])
        return float(
            np.log(sizes[size - 1] / sizes.sum() * (1.0 - self.prior.unknown)) - np.log(len(sets_of(self.known, size)))
        )
