"""The usual way, for comparison: Kubelka-Munk's two constants under Saunderson's surface, in the
same joint fit.
"""

from jaxtyping import Array, ArrayLike, Float

from glazefit.film.films import Instrument, bare_surface
from glazefit.film.model.response import Response
from glazejax.radiative.twoflux import saunderson, two_flux_reflectance


class KubelkaMunk(Response):
    """Film of Kubelka-Munk's K d and S d instead of k d and s d."""

    outer: float
    inner: float

    def __init__(self, instrument: Instrument):
        self.outer = instrument.surface
        self.inner = bare_surface(instrument).back

    def body(
        self, absorption: ArrayLike, scattering: ArrayLike, ground: ArrayLike
    ) -> Float[Array, "*batch"]:
        """Reflectance without the outer surface's part; see `Response.body`."""
        return saunderson(
            two_flux_reflectance(absorption, scattering, ground), self.outer, self.inner
        )
