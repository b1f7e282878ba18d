"""Constraints of a joint fit in addition to its films: paints that are known already, and
thicknesses from a gauge.

A known paint keeps its k and s, as far as they are known: its error modes become unknowns of the
fit, each expected to be nought with a standard deviation of one. So does the level of a card that
was not measured, and a factor that all thicknesses share: the scale of a known paint may rest on an
assumed length, and a gauge has an error of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from glazejax import Pigment
from glazejax.spectra import Bands, describe_grid

from ...film.films import Films
from ...film.model.errors import ModelError, relative_errors, smooth_modes
from ..films.result import PerFilm
from .problem import Expectations

MOST_ERROR = 0.5
"""Largest standard deviation of log k or log s that error modes state: errors are propagated by
first derivatives, which do not hold for larger ones."""


@dataclass(frozen=True)
class Gauge:
    """Thicknesses that were measured or set: a wet-film gauge, or the gap of a drawdown bar.

    Attributes:
        thickness: film -> m; films that are not named are as thick as these, more or less.
        error: standard deviation of the log of one film's thickness.
        common: of a factor that all of them share: the gauge's scale, and what the paint loses as
            it dries.

    Raises:
        ValueError: no film, or a number out of range.
    """

    thickness: Mapping[str, float]
    error: float = 0.1
    common: float = 0.1

    def __post_init__(self) -> None:
        if not self.thickness:
            raise ValueError("a gauge needs the thickness of one film at least")
        for film, value in self.thickness.items():
            if not 0 < value <= 0.01:
                raise ValueError(
                    f"the thickness of {film!r} is {value:g} m; it must be above 0 and at most "
                    "0.01 m"
                )
        for name in ("error", "common"):
            if not 0 < getattr(self, name) <= 2:
                raise ValueError(
                    f"the gauge's {name} is {getattr(self, name):g}; it must be above 0 and at "
                    "most 2"
                )

    @property
    def typical(self) -> float:
        """Geometric mean, m."""
        return float(np.exp(np.mean(np.log(list(self.thickness.values())))))


class PaintModes(NamedTuple):
    """Position of a known paint's error modes among the others: from `first` on, those of these
    numbers.
    """

    first: int
    numbers: tuple[int, ...]

    @property
    def indices(self) -> list[int]:
        """Numbers among the others."""
        return list(range(self.first, self.first + len(self.numbers)))


class Constraints(NamedTuple):
    """Arrays of a problem, by the names of its fields: means, and how unknowns that are standard
    normal a priori (`others`) move what a fit computes with; and what else is known.
    """

    arrays: Mapping[str, np.ndarray]
    known: Bool[np.ndarray, "paints"]
    thickness_sd: PerFilm
    modes_of: Mapping[str, PaintModes]


def gather_constraints(
    films: Films,
    paints: Sequence[str],
    references: Mapping[str, Pigment],
    gauge: Gauge | None,
    unit: float,
    expected: Expectations,
) -> Constraints:
    """Arrays of what is known.

    Args:
        films: measured.
        paints: of all films.
        references: paints that are known, by name; those that no film holds do not matter.
        gauge: thicknesses.
        unit: thickness of a film of unit relative thickness, m.
        expected: of thicknesses where there is no gauge, of a factor of all of them where a paint
            is known, and of each reading's gain.

    Raises:
        ValueError: a known paint does not cover the films' wavelengths, or the gauge names a film
            that there is not.
    """
    bands = films.wavelengths.size
    count = len(paints)
    known = {
        column: _on(references[name], films.wavelengths)
        for column, name in enumerate(paints)
        if name in references
    }
    # Known paints keep their k and s; of the others nothing is known.
    logs = np.zeros((bands, 2 * count))
    for column, paint in known.items():
        optical = unit * np.column_stack([paint.absorption, paint.scattering])
        logs[:, column::count] = np.log(np.maximum(optical, 1e-7))
    # Their errors, and those of cards, of the common scale and of gains, are unknowns of the fit.
    band_modes, modes_of = _paint_modes(known, bands, count)
    thickness, thickness_sd, factor = _thicknesses(
        films, gauge, unit, expected.thickness, expected.scale if known else 0.0
    )
    # A black and a white card that were not measured have one level each, for all films: of
    # log(rho / (1 - rho)), the same at all bands.
    cards = films.assumed & films.seen & ~films.opaque[:, None]
    # The log of its gain is each reading's own.
    gains = expected.gain * np.eye(films.seen.size).reshape(-1, *films.seen.shape)
    arrays = {
        "band_modes": band_modes,
        "ground_modes": (0.5 * np.eye(2)[:, None] * cards)[cards.any(axis=0)],
        "thickness_modes": factor,
        "gain_modes": gains[films.seen.ravel() & (expected.gain > 0)],
    }
    first = 0
    count_of_others = sum(map(len, arrays.values()))
    # Each group where it stands among the others.
    for name, modes in arrays.items():
        arrays[name] = np.zeros((count_of_others, *modes.shape[1:]))
        arrays[name][first : first + len(modes)] = modes
        first += len(modes)
    return Constraints(
        arrays=arrays | {"known": logs, "film_mean": thickness},
        known=np.isin(np.arange(count), list(known)),
        thickness_sd=thickness_sd,
        modes_of=modes_of,
    )


def _on(paint: Pigment, grid: Bands) -> Pigment:
    try:
        return paint.resample(grid)
    except ValueError:
        raise ValueError(
            f"{paint.name!r} is known at {describe_grid(paint.wavelengths)}, which does not cover "
            f"the films' {describe_grid(grid)}: crop the films"
        ) from None


def _paint_modes(
    references: Mapping[int, Pigment], bands: int, paints: int
) -> tuple[Float[np.ndarray, "modes bands local"], dict[str, PaintModes]]:
    """Modes of known paints, by column, and the places of each; those of one provenance share
    theirs.

    Modes that are nought for all of them, such as those of other paints of their file, are left
    out.
    """
    # Paints of one provenance, with as many modes, err together.
    groups: dict[object, dict[int, Pigment]] = {}
    for column, paint in references.items():
        stated_modes = paint.error_modes
        source = column if stated_modes is None else (paint.provenance, len(stated_modes))
        groups.setdefault(source, {})[column] = paint
    blocks = [np.zeros((0, bands, 2 * paints))]
    spans = {}
    first = 0
    for group in groups.values():
        modes = np.stack([error_modes(paint) for paint in group.values()], axis=-1)
        nonzero = np.flatnonzero(modes.any(axis=(1, 2, 3)))
        block = np.zeros((nonzero.size, bands, 2, paints))
        block[..., list(group)] = np.swapaxes(modes[nonzero], 1, 2)
        blocks.append(block.reshape(nonzero.size, bands, 2 * paints))
        spans |= {
            paint.name: PaintModes(first, tuple(nonzero.tolist())) for paint in group.values()
        }
        first += nonzero.size
    return np.concatenate(blocks), spans


def error_modes(paint: Pigment) -> Float[np.ndarray, "modes 2 bands"]:
    """Error modes of a paint: its own, or smooth errors of the size that its standard deviations
    say.
    """
    if paint.error_modes is not None:
        return np.asarray(paint.error_modes, dtype=np.float64)
    grid = paint.wavelengths
    # A paint that says nothing of its errors is known to a tenth.
    (size,) = relative_errors([paint], ModelError(most=MOST_ERROR, unstated=0.1))
    smooth = smooth_modes(grid, 100.0, 12)
    return np.einsum("cd,cb,mb->cmdb", np.eye(2), size, smooth).reshape(-1, 2, grid.size)


def _thicknesses(
    films: Films, gauge: Gauge | None, unit: float, spread: float, common: float
) -> tuple[PerFilm, PerFilm, Float[np.ndarray, "modes films"]]:
    """Log of each film's expected relative thickness, its standard deviation, and the factor that
    they share.
    """
    count = len(films)
    mean = np.zeros(count)
    sd = np.full(count, spread)
    if gauge is not None:
        for film in gauge.thickness:
            if film not in films.names:
                raise ValueError(f"no film is called {film!r}, whose thickness was given")
        gauged = np.isin(films.names, list(gauge.thickness))
        mean = np.log([gauge.thickness.get(name, gauge.typical) / unit for name in films.names])
        sd = np.where(gauged, gauge.error, spread)
        common = max(common, gauge.common)
    # No factor where nothing is common.
    return mean, sd, np.full((int(common > 0), count), common)
