"""A varnish over anybody's paint: how yellow it is is stated, its amount and shape are not known.

A yellowed resin's absorption falls to the red, about exponentially. Computed films are seen under
the varnish that is expected; what other amounts and steeper or flatter varnishes change of a
spectrum's features counts as a difference between paints of one family (`metric.py`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands

from ...film.model.response import FilmResponse
from ...film.model.varnish import AMOUNTS, DECAY, under_varnish, without_varnish, yellow
from .features import views
from .templates import FilmCurves

# Natural log of the factor by which a varnish's decay varies.
_DECAY_SPREAD = 0.4
# Varnishes that are drawn for each spectrum.
_DRAWS = 4
_SEED = 20


@dataclass(frozen=True, kw_only=True)
class Varnish:
    """Expectation of a varnish.

    Attributes:
        levels: optical thicknesses at 400 nm that it may be around.
        spreads: their standard deviations.
        chances: of each.
    """

    levels: tuple[float, ...]
    spreads: tuple[float, ...]
    chances: tuple[float, ...]

    def expected(self, wavelengths: Bands) -> Bands:
        """Mean optical thickness at each of some wavelengths, nm."""
        return float(np.dot(self.levels, self.chances)) * yellow(wavelengths)

    def at_random(self, wavelengths: Bands, count: int) -> FilmCurves:
        """Optical thicknesses of varnishes of different amounts and shapes; see `expected`."""
        rng = np.random.default_rng(_SEED)
        which = rng.choice(len(self.levels), count, p=self.chances)
        thickness = rng.normal(np.array(self.levels)[which], np.array(self.spreads)[which])
        decay = DECAY * np.exp(rng.normal(0.0, _DECAY_SPREAD, count))
        shape = np.stack([yellow(wavelengths, float(rate)) for rate in decay])
        return np.maximum(thickness, 0.0)[:, None] * shape

    def exchange_at_random(
        self, response: FilmResponse, wavelengths: Bands, bodies: FilmCurves
    ) -> FilmCurves:
        """Films under the expected varnish as they are seen under others.

        Args:
            response: of the instrument.
            wavelengths: nm.
            bodies: readings under the expected varnish, without the outer surface's part.
        """
        bare = without_varnish(response, bodies, self.expected(wavelengths))
        return under_varnish(response, bare, self.at_random(wavelengths, len(bodies)))

    def differences(
        self, response: FilmResponse, wavelengths: Bands, bodies: FilmCurves
    ) -> tuple[Float[np.ndarray, "draws features"], ...]:
        """Change of each view of spectra where other varnishes than the expected one lie on them;
        arguments as for `exchange_at_random`.
        """
        repeated = np.repeat(bodies, _DRAWS, axis=0)
        varied = self.exchange_at_random(response, wavelengths, repeated)
        pairs = zip(views(wavelengths, varied), views(wavelengths, repeated), strict=True)
        return tuple(features - usual for features, usual in pairs)


def _of_amounts(**chances: float) -> Varnish:
    """A varnish that may be one of `AMOUNTS`, and none at all with the rest of the chances."""
    levels, spreads = zip((0.0, 0.0), *(AMOUNTS[name] for name in chances), strict=True)
    return Varnish(
        levels=levels, spreads=spreads, chances=(1.0 - sum(chances.values()), *chances.values())
    )


CONDITIONS: dict[str, Varnish | None] = {
    "none": None,
    "thin": _of_amounts(thin=1.0),
    "yellowed": _of_amounts(yellowed=1.0),
    "unknown": _of_amounts(thin=0.2, yellowed=0.2),
}
"""What may be stated of a varnish -> what is then expected."""
