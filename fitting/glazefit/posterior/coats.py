"""Prior knowledge of each coat of a film, in Python and in a painter's words, and of an unknown
paint's k and s.

The words are those of `glazejax render`, with marks for what is not known:

    Eosin:5um                       known paint, known thickness
    Eosin:~5um                      of about that thickness
    Eosin:?                         of any usual thickness
    ZincWhite+CobaltBlue:20um       known paints, unknown fractions
    ?:?                             unknown paint: its k and s times thickness are searched for

Spectra of an unknown paint are smooth and of about the catalogue's size. log k d and log s d are
each a Gaussian process of the wavelength: a level, and a shape about it with the Matern-5/2
correlation (1 + x + x^2/3) exp(-x), x = sqrt(5) |l - l'| / length. As unknowns they are sums of the
process's principal modes with standard normal weights; what the modes leave out is less than a
fiftieth of k or s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from glazejax import Pigment
from glazejax.names import first_repeated
from glazejax.paint import describe
from glazejax.paint.describe import find_name
from glazejax.spectra import Bands

from ..film.model.errors import principal_modes
from ..film.model.mixing import check_paints

UNKNOWN = "?"
ABOUT = "~"


@dataclass(frozen=True, eq=False)
class CoatPrior:
    """Prior knowledge of one coat.

    Attributes:
        paints: what it is made of, one to five; none if that is not known, and its k d and s d are
            searched for.
        thickness: m; None if it is not known: then the film's prior (`glazefit.Prior`) says
            what is usual. Always None of an unknown paint.
        spread: standard deviation of log thickness; 0 if the thickness is known exactly. Of no
            meaning without one.
        fractions: of the paints, (paints,), sum 1; None if they are not known.

    Raises:
        ValueError: a value out of range, a paint that is listed twice, is a batch or has a phase
            function, or fractions that do not fit the paints.
    """

    paints: Sequence[Pigment] = ()
    thickness: float | None = None
    spread: float = 0.0
    fractions: Sequence[float] | None = None

    def __post_init__(self) -> None:
        names = [paint.name for paint in self.paints]
        where = f"the coat of {' + '.join(names) or 'unknown paint'}"
        if len(names) > 5:
            raise ValueError(f"{where} has {len(names)} paints; name 5 at most")
        if (twice := first_repeated(names)) is not None:
            raise ValueError(f"{where}: the paint {twice!r} is listed twice")
        check_paints(self.paints)
        # No coat of paint is thicker: who says so means another unit.
        if self.thickness is not None and not 0 <= self.thickness <= 0.01:
            raise ValueError(
                f"{where} is {self.thickness:g} m thick; it must be in [0, 0.01], in metres"
            )
        if not 0 <= self.spread < np.inf:
            raise ValueError(
                f"{where}: the spread {self.spread:g} of its thickness must be 0 or more, such "
                "as 0.3"
            )
        if self.spread > 0 and self.thickness is None:
            raise ValueError(
                f"{where} has a spread of {self.spread:g} but no thickness to spread about; give "
                "one"
            )
        if self.spread > 0 and self.thickness == 0:
            raise ValueError(
                f"{where} cannot be about 0 thick; say 0 exactly, or a small thickness such as 1e-7"
            )
        if not names and self.thickness is not None:
            raise ValueError(
                f"{where} is stated to be {self.thickness:g} m thick, but only its k and s times "
                "thickness can be measured; leave its thickness out, as in ?:?"
            )
        if self.fractions is None:
            return
        shares = self.shares
        if shares.shape != (len(names),):
            raise ValueError(
                f"{where} has {len(names)} paints but {shares.size} fractions; give one a paint"
            )
        if not (np.all(shares >= 0) and abs(shares.sum() - 1.0) < 1e-6):
            raise ValueError(
                f"{where}: its fractions are {shares.tolist()}; they must be 0 or more and sum to 1"
            )

    @property
    def unknown(self) -> bool:
        """True if the paint is not known."""
        return not self.paints

    @property
    def open_thickness(self) -> bool:
        """True if the thickness is among the unknowns."""
        return not self.unknown and (self.thickness is None or self.spread > 0)

    @property
    def open_fractions(self) -> bool:
        """True if fractions are among the unknowns."""
        return self.fractions is None and len(self.paints) > 1

    @property
    def shares(self) -> Float[np.ndarray, "paints"]:
        """The fractions where they are known, and equal ones where not."""
        count = len(self.paints)
        return (
            np.full(count, 1.0 / max(count, 1))
            if self.fractions is None
            else np.asarray(self.fractions, float)
        )

    def on(self, wavelengths: Bands) -> "CoatPrior":
        """The same with its paints on other wavelengths, nm."""
        return replace(self, paints=tuple(paint.resample(wavelengths) for paint in self.paints))


@dataclass(frozen=True)
class SpectraPrior:
    """Prior of log k d and log s d of a coat of unknown paint.

    The defaults describe the twenty oil paints of the catalogue in films of 25 um. There log k d is
    -.9 with a standard deviation of 3.6, log s d .4 with 1.9; half the mean square of log k's
    difference between bands 10, 50 and 160 nm apart is .04, 1.0 and 6.4, that of log s .001, .03
    and .22. The prior lets s vary twice as much: few paints are known, and a prior that is too
    narrow misleads where one too wide only constrains less.

    Attributes:
        absorption, scattering: medians of k d and s d.
        absorption_level, scattering_level: standard deviations of the logarithm's level.
        absorption_shape, scattering_shape: standard deviations of what is added to it, band by
            band.
        length: wavelengths over which the shape changes, nm.

    Raises:
        ValueError: a value that is not positive.
    """

    absorption: float = 0.4
    scattering: float = 1.7
    absorption_level: float = 1.5
    scattering_level: float = 1.75
    absorption_shape: float = 3.5
    scattering_shape: float = 1.5
    length: float = 150.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < np.inf:
                raise ValueError(f"the spectra's {name} is {value:g}; it must be positive")

    def modes(self, wavelengths: Bands) -> Float[np.ndarray, "2 bands modes"]:
        """Slopes of log k d and of log s d by the weights of all modes: those of k d first, each
        scaled by its standard deviation, largest first; a mode is of one of the two.
        """
        distance = np.sqrt(5.0) * np.abs(wavelengths[:, None] - wavelengths) / self.length
        correlation = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)

        def principal(level_sd: float, shape: float) -> np.ndarray:
            scaled = principal_modes(level_sd**2 + shape**2 * correlation)[::-1].T
            # Variance of each band that the modes from the n-th on carry.
            remainder = np.cumsum((scaled**2)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
            return scaled[:, : max(1, np.count_nonzero(remainder > 0.02**2))]

        k = principal(self.absorption_level, self.absorption_shape)
        s = principal(self.scattering_level, self.scattering_shape)
        return np.asarray(block_diag(k, s)).reshape(2, wavelengths.size, -1)


def check_coats(coats: Sequence[CoatPrior]) -> tuple[CoatPrior, ...]:
    """The coats, top first, if they are a stack that readings can constrain.

    Raises:
        ValueError: no coat, too many, or more unknown paints than one.
    """
    if not 1 <= len(coats) <= 6:
        raise ValueError(f"{len(coats)} coats were given; describe 1 to 6, top first")
    unknown = [n + 1 for n, coat in enumerate(coats) if coat.unknown]
    if len(unknown) > 1:
        where = " and ".join(map(str, unknown))
        raise ValueError(
            f"the paints of coats {where} are unknown; k and s of one coat can be found, not of "
            "more"
        )
    return tuple(coats)


def parse_coats(text: str, shelf: Mapping[str, Pigment], spread: float) -> tuple[CoatPrior, ...]:
    """Read the description of a stack of which not all is known; see the head of this file.

    Args:
        text: coats separated by commas, top first.
        shelf: paints by name.
        spread: standard deviation of the logarithm of a thickness that is given with a ~.

    Raises:
        ValueError: text that does not read so, a paint that the shelf does not have, or no legal
            stack.
    """
    if not text.strip():
        raise ValueError(
            "the list of coats is empty: write them from top to bottom, such as "
            "Eosin:?,ZincWhite:20um"
        )
    return check_coats([_coat(entry.strip(), shelf, spread) for entry in text.split(",")])


def _coat(entry: str, shelf: Mapping[str, Pigment], spread: float) -> CoatPrior:
    paint, colon, size = (piece.strip() for piece in entry.rpartition(":"))
    if not colon and entry == UNKNOWN:
        paint = UNKNOWN
    elif not (colon and paint and size):
        raise ValueError(
            f"coat {entry!r}: write PAINT:THICKNESS, such as Eosin:5um, Eosin:~5um if that is "
            "about right, or Eosin:? if the thickness is not known"
        )
    about = size.startswith(ABOUT)
    size = size.removeprefix(ABOUT).strip()
    if about and (not size or size == UNKNOWN):
        raise ValueError(
            f"coat {entry!r}: after {ABOUT} comes a thickness, such as {ABOUT}5um; {UNKNOWN} "
            "says none"
        )
    # Reads the weights of a mixture and all thicknesses, and says what is wrong with them.
    mixed = "+" in paint and "*" not in paint
    names = [name.strip() for name in paint.split("+")] if mixed else [paint]
    if not all(names):
        raise ValueError(f"coat {entry!r}: there is a + too many; write ZincWhite+CobaltBlue:20um")
    written = f"{names[0]}:{'1um' if size == UNKNOWN else size}"
    (read,) = describe.parse_coats(written)
    thickness = None if size == UNKNOWN else read.total
    options = {"thickness": thickness, "spread": spread if about else 0.0}
    if paint == UNKNOWN:
        return CoatPrior(**options)
    fractions = None
    if not mixed:
        fractions = [weight for weight, _ in read.parts]
        names = [name for _, name in read.parts]
    paints = [shelf[find_name(name, shelf)] for name in names]
    return CoatPrior(paints, fractions=fractions, **options)
