"""One measured film as a posterior needs it: readings over one or two known grounds, each with its
error.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands, describe_grid, validate_wavelengths

from .films import CardReadings, Films, Instrument, Noise, card_readings

Values = Float[np.ndarray, "bands grounds"]


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
    reflectance: Values
    ground: Values
    sd: Values
    ground_sd: Values
    grounds: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelengths", validate_wavelengths(self.wavelengths))
        shape = (self.wavelengths.size, len(self.grounds))
        for what, low, high in (
            ("reflectance", 0.0, np.inf),
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
                raise ValueError(
                    f"{what} of {self.name!r} over {self.grounds[j]} at {self.wavelengths[i]:g} "
                    f"nm is {values[i, j]:g}; it must be in [{low:g}, {high:g}]"
                )

    def __repr__(self) -> str:
        return (
            f"Reading({self.name!r} over {' and '.join(self.grounds)}, "
            f"{describe_grid(self.wavelengths)})"
        )


def readings(films: Films, instrument: Instrument, noise: Noise) -> list[Reading]:
    """The films over their black and white cards, whose own errors count.

    Raises:
        ValueError: a card that its surface or a perfect diffuser contradicts (see
            `glazefit.film.films.card_readings`).
    """
    measured = card_readings(films, instrument, noise)
    return [
        Reading(
            name=name,
            wavelengths=films.wavelengths,
            grounds=("black", "white"),
            **CardReadings(*arrays)._asdict(),
        )
        for name, *arrays in zip(films.names, *measured, strict=True)
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
            `glazefit.film.films.card_reflectance` gives it.
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
