"""Reflection by the surface of a glaze alone, in Dr.Jit."""

from typing import Any

from . import lookup
from .device import DrJit
from .rough import Rough
from .smooth import Smooth


class Mirror:
    """A smooth surface: Fresnel's mirror."""

    delta = True

    def __init__(self, mi: Any, dr: Any, surface: Smooth):
        self._mi = mi
        self._ops = DrJit(mi, dr)
        self._surface = surface
        self.kind: Any = mi.BSDFFlags.DeltaReflection

    def albedo(self, cosine: Any) -> Any:
        """Share of the light that it reflects."""
        return 1.0 - self._surface.let_in(self._ops, cosine)

    def sample(self, wi: Any, sample1: Any, sample2: Any) -> Any:
        """The mirrored direction."""
        return self._mi.reflect(wi)


class Facets:
    """A rough surface as `glazejax.radiative.rough` has it: GGX facets, Smith's separable masking
    (both by Mitsuba's own distribution), and what single facets lose as a lobe without azimuth.

    The table of the surface has, at cosines in air: all that it reflects, what single facets lose,
    and the share of the lost light in what it reflects, which is how often that lobe is drawn, by
    the cosine.
    """

    delta = False

    def __init__(self, mi: Any, dr: Any, surface: Rough):
        self._mi = mi
        self._dr = dr
        self._ops = DrJit(mi, dr)
        self._surface = surface
        self._table = self._ops.upload(surface.table)
        self._facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, surface.roughness, True)
        self.kind: Any = mi.BSDFFlags.GlossyReflection

    def albedo(self, cosine: Any) -> Any:
        """Share of the light that it reflects."""
        return self._columns(cosine)[0]

    def sample(self, wi: Any, sample1: Any, sample2: Any) -> Any:
        """A direction by visible normals, or by the cosine."""
        mi = self._mi
        loss = self._columns(wi.z)[2]
        normal, _ = self._facets.sample(wi, sample2)
        return self._dr.select(
            sample1 < loss, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(wi, normal)
        )

    def density(self, wi: Any, wo: Any) -> Any:
        """Of `sample`, in solid angle."""
        dr = self._dr
        loss = self._columns(wi.z)[2]
        normal = dr.normalize(wi + wo)
        along = dr.dot(wo, normal)
        # The density of a facet's normal, over 4 (o.m) for the direction mirrored by it.
        single = dr.select(
            along > 0.0, self._facets.pdf(wi, normal) / dr.maximum(4.0 * along, 1e-12), 0.0
        )
        drawn = self._mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return loss * drawn + (1.0 - loss) * single

    def value(self, wi: Any, wo: Any) -> Any:
        """BSDF times the cosine of `wo`, both above the surface."""
        dr = self._dr
        normal = dr.normalize(wi + wo)
        met = self._mi.fresnel(dr.dot(wi, normal), self._surface.refractive_index)[0]
        # F D G/(4 c_i c_o), times c_o.
        single = (
            self._facets.eval(normal)
            * self._facets.G(wi, wo, normal)
            * met
            / dr.maximum(4.0 * wi.z, 1e-12)
        )
        # k(i) k(o)/C, what facets lose to one another, times c_o.
        missing_in, missing_out = (self._columns(w.z)[1] for w in (wi, wo))
        return single + missing_in * missing_out / self._surface.lost * wo.z

    def _columns(self, cosine: Any) -> Any:
        """Numbers of the surface's table at a cosine in air; what lies below counts as grazing."""
        along = self._surface.coordinate(self._ops, self._ops.maximum(cosine, 1e-6))
        spot = lookup.place(self._ops, along, len(self._surface.table))
        return lookup.line_sum(self._ops, self._table, spot, 1)[0]
