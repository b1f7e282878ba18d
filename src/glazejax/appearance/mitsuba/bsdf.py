"""The BSDF ``glaze`` of Mitsuba 3: a surface over a body of paint.

The body reflects what `table.Body` says, the surface as `lobes` has it. Directions are drawn from
one or the other by their albedos: from the surface's own lobe, or by the cosine for the body. Light
from behind meets black, as in Mitsuba's plastics; wrap the glaze in ``twosided`` for things that
are seen from both sides.
"""

from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import jax
import numpy as np

from ...paint.describe import names_file
from ..glaze.solve import check_layer, with_variables
from . import table
from .coats import index_of, read_coats
from .device import DrJit, renderer
from .lobes import Facets, Mirror
from .nodes import NodeSolver
from .parameters import read_parameters
from .rough import Rough
from .smooth import Smooth
from .table import Body, body_table

Extent: TypeAlias = float | tuple[float, float] | None
"""A number, the range of a texture, or None for what the coats have."""

_LEAST_COSINE = 1e-6


@lru_cache(maxsize=64)
def _table(
    coats: str,
    layer: int,
    thickness: Extent,
    fraction: Extent,
    ground: str | float | tuple[float, ...],
    mean_ground: float,
    refractive_index: float | None,
    roughness: float,
    tolerance: float,
) -> Body:
    """The table, made once for all equal glazes; always in double precision.

    `ground` is "own", "any", a number or one number a band.
    """
    with jax.enable_x64(True):
        glaze = read_coats(coats, refractive_index)
        given = {"thickness": thickness, "fraction": fraction}
        ranges = {name: x for name, x in given.items() if isinstance(x, tuple)}
        if thickness is not None or fraction is not None:
            # A fixed share of a mixture needs the two paints too.
            check_layer(glaze, layer, mixed=fraction is not None)
            fixed = [x if isinstance(x, float) else None for x in given.values()]
            glaze = with_variables(glaze, layer, *fixed)
        ground_spectrum = None
        if ground != "any":
            known = np.asarray(glaze.ground if ground == "own" else ground, float)
            ground_spectrum = np.broadcast_to(known, glaze.wavelengths.shape)
        index = index_of(glaze)
        surface = Rough(index, roughness) if roughness > 0 else Smooth(index)
        solver = NodeSolver(surface=surface, glaze=glaze, layer=layer, tolerance=tolerance)
        return body_table(solver, ranges, ground=ground_spectrum, mean_ground=mean_ground)


def bands_of(coats: str) -> np.ndarray:
    """Wavelengths of the table, nm."""
    with jax.enable_x64(True):
        return np.asarray(read_coats(coats).wavelengths, float)


class _Point(NamedTuple):
    """A point of the surface, seen from one direction."""

    lit: Any
    """Whether light comes from the front."""
    surface: bool
    body: bool
    """Which lobes are asked for."""
    share: Any
    """How often the surface's lobe is drawn."""
    weights: table.PointWeights | None
    """The body's table there."""


class GlazeBSDF:
    """Everything but the base class, which depends on the variant; `registration` joins the two."""

    def __init__(self, props: Any):
        self._mi, self._dr = mi, dr = renderer()
        mi.BSDF.__init__(self, props)
        parameters = read_parameters(mi, props)
        self._given = parameters
        numbers = {"thickness": parameters.thickness, "fraction": parameters.fraction}
        self._varying = {
            name: value for name, value in numbers.items() if not isinstance(value, float | None)
        }
        self._coats = _text_of(parameters.coats)
        self._ground = self._ground_texture()
        # Room for a texture of one value: a table needs a range.
        self.table: Body = _table(
            coats=self._coats,
            layer=parameters.layer,
            thickness=_span(parameters.thickness, max(parameters.thickness_max, 1e-9)),
            fraction=_span(parameters.fraction, 1.0),
            ground=self._ground_key(),
            mean_ground=self._mean_ground(),
            refractive_index=parameters.refractive_index,
            roughness=parameters.roughness,
            tolerance=parameters.tolerance,
        )
        self._body = DrJit(mi, dr).body(self.table)
        above = self.table.surface
        lobe: Facets | Mirror | None = None
        if parameters.gloss:
            lobe = Facets(mi, dr, above) if isinstance(above, Rough) else Mirror(mi, dr, above)
        self._surface: Any = lobe
        flags = mi.BSDFFlags
        # Mitsuba must know whether the glaze varies over a surface.
        textured = self._varying or self._ground is not None
        spatial = int(flags.SpatiallyVarying) if textured else 0
        self._diffuse = int(flags.DiffuseReflection)
        body = self._diffuse | int(flags.FrontSide) | spatial
        self.m_components: list[int] = (
            [body] if lobe is None else [int(lobe.kind) | int(flags.FrontSide), body]
        )
        self._last = len(self.m_components) - 1
        self.m_flags: int = int(np.bitwise_or.reduce(self.m_components))

    def traverse(self, callback: Any) -> None:
        """Names the textures, which may be optimised."""
        kind = self._mi.ParamFlags.Differentiable
        for name, texture in (self._varying | {"ground": self._ground}).items():
            if isinstance(texture, _Bands | None):
                continue
            if hasattr(callback, "put"):
                callback.put(name, texture, kind)
            else:
                callback.put_object(name, texture, int(kind))

    def sample(
        self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
    ) -> tuple[Any, Any]:
        """A direction from the surface's lobe or the body's, and value times cosine over
        density.
        """
        return self._sample(si, self._at(ctx, si, active), sample1, sample2)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """BSDF times the cosine of `wo`."""
        return self._value(si, self._at(ctx, si, active), wo)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Density of `sample` in solid angle."""
        return self._density(si, self._at(ctx, si, active, valued=False), wo)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        """Both of them."""
        point = self._at(ctx, si, active)
        return self._value(si, point, wo), self._density(si, point, wo)

    def eval_pdf_sample(
        self, ctx: Any, si: Any, wo: Any, sample1: Any, sample2: Any, active: Any = True
    ) -> tuple[Any, Any, Any, Any]:
        """All three, the table looked up once."""
        point = self._at(ctx, si, active)
        return (
            self._value(si, point, wo),
            self._density(si, point, wo),
            *self._sample(si, point, sample1, sample2),
        )

    def to_string(self) -> str:
        """One line."""
        return f"Glaze[{self._given.coats[:60]}, {self.table}]"

    def __repr__(self) -> str:
        return self.to_string()

    def _at(self, ctx: Any, si: Any, active: Any, *, valued: bool = True) -> "_Point":
        """State of a point whatever the second direction: the table's weights if values are wanted,
        and its lobes.
        """
        mi = self._mi
        dr = self._dr
        lit = active & (si.wi.z > 0.0)
        # An integrator may ask for one lobe alone.
        lobe: Any = self._surface
        surface = lobe is not None and ctx.is_enabled(lobe.kind, 0)
        body = ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, self._last)
        ops = DrJit(mi, dr, lit)
        varying = {name: texture.eval_1(si, lit) for name, texture in self._varying.items()}
        if "thickness" in varying:
            varying["thickness"] = varying["thickness"] * self._given.thickness_scale
        weights = None
        if body and valued:
            ground = None
            if self._ground is not None:
                # Below 1, as reflections between ground and body sum to 1/(1 - S ground).
                ground = [dr.clip(value, 0.0, 0.999) for value in self._ground.eval(si, lit)]
            weights = table.at_point(ops, self._body, varying, list(si.wavelengths), ground)
        share = mi.Float(1.0 if surface else 0.0)
        if lobe is not None and surface and body:
            # They are sampled by the light they send back, which no derivative passes.
            within = dr.maximum(dr.detach(si.wi.z), _LEAST_COSINE)
            below = table.mean_albedo(
                ops, self._body, within, {name: dr.detach(x) for name, x in varying.items()}
            )
            above = lobe.albedo(within)
            # Neither is left out for good.
            share = dr.clip(above / dr.maximum(above + below, 1e-6), 0.02, 0.98)
        return _Point(lit=lit, surface=surface, body=body, share=share, weights=weights)

    def _value(self, si: Any, at: "_Point", wo: Any) -> Any:
        mi = self._mi
        dr = self._dr
        lit = at.lit & (wo.z > 0.0)
        value = mi.UnpolarizedSpectrum(0.0)
        if at.weights is not None:
            cos_in = dr.maximum(si.wi.z, _LEAST_COSINE)
            cos_out = dr.maximum(wo.z, _LEAST_COSINE)
            factors = table.reflectance_factor(
                DrJit(mi, dr, lit), self._body, at.weights, cos_in, cos_out
            )
            # The BSDF is the reflectance factor over pi.
            for k, factor in enumerate(factors):
                value[k] = factor * (wo.z / dr.pi)
        # A mirror has a value in one direction only, which sampling gives.
        if at.surface and not self._surface.delta:
            value = value + self._surface.value(si.wi, wo)
        return dr.select(lit, value, 0.0)

    def _density(self, si: Any, at: "_Point", wo: Any) -> Any:
        mi = self._mi
        dr = self._dr
        density = mi.Float(0.0)
        if at.body:
            density = density + (1.0 - at.share) * mi.warp.square_to_cosine_hemisphere_pdf(wo)
        if at.surface and not self._surface.delta:
            density = density + at.share * self._surface.density(si.wi, wo)
        return dr.select(at.lit & (wo.z > 0.0), density, 0.0)

    def _sample(self, si: Any, at: "_Point", sample1: Any, sample2: Any) -> tuple[Any, Any]:
        mi = self._mi
        dr = self._dr
        bs = dr.zeros(mi.BSDFSample3f)
        if not (at.surface or at.body):
            return bs, mi.UnpolarizedSpectrum(0.0)
        # By the surface's share, or the cosine for the body.
        first = at.lit & (sample1 < at.share)
        number = mi.UInt32(self._last)
        bs.eta = mi.Float(1.0)
        bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        bs.sampled_type = mi.UInt32(self._diffuse)
        bs.sampled_component = number
        if at.surface:
            # Within its share the first number runs from 0 to 1 again, for the lobe's own choice.
            along = self._surface.sample(si.wi, sample1 / dr.maximum(at.share, 1e-6), sample2)
            bs.wo = dr.select(first, along, bs.wo)
            bs.sampled_type = dr.select(first, mi.UInt32(int(self._surface.kind)), bs.sampled_type)
            bs.sampled_component = dr.select(first, mi.UInt32(0), number)
        bs.pdf = self._density(si, at, bs.wo)
        # Both techniques share one density, but for a mirror, whose density is a peak.
        weight = self._value(si, at, bs.wo) / dr.maximum(bs.pdf, 1e-30)
        if at.surface and self._surface.delta:
            mirrored = mi.UnpolarizedSpectrum(
                self._surface.albedo(abs(si.wi.z)) / dr.maximum(at.share, 1e-6)
            )
            bs.pdf = dr.select(first, at.share, bs.pdf)
            weight = dr.select(first, mirrored, weight)
        bs.pdf = dr.select(at.lit, bs.pdf, 0.0)
        return bs, dr.select(bs.pdf > 0.0, weight, 0.0)

    def _ground_texture(self) -> Any:
        """Texture that gives the ground at each place; None where it is the same everywhere."""
        ground = self._given.ground
        if isinstance(ground, np.ndarray):
            return _Bands(self._mi, self._dr, ground, bands_of(self._coats))
        return (
            None
            if isinstance(ground, float | None) or not ground.is_spatially_varying()
            else ground
        )

    def _ground_key(self) -> str | float | tuple[float, ...]:
        """The ground as the table takes it."""
        if self._ground is not None:
            return "any"
        ground = self._given.ground
        if isinstance(ground, float | None):
            return "own" if ground is None else ground
        # The texture's spectrum at the table's own bands.
        where = self._dr.zeros(self._mi.SurfaceInteraction3f)
        reflectance = []
        for wavelength in bands_of(self._coats):
            where.wavelengths = self._mi.UnpolarizedSpectrum(float(wavelength))
            reflectance.append(float(np.array(ground.eval(where)).ravel()[0]))
        return tuple(np.clip(reflectance, 0.0, 1.0).tolist())

    def _mean_ground(self) -> float:
        if self._ground is None:
            return 0.5
        return float(np.clip(np.array(self._ground.mean()).ravel()[0], 0.0, 0.99))


class _Bands:
    """A ground whose spectrum is given at every place: an array (rows, columns, bands), its first
    row at v = 0.
    """

    def __init__(self, mi: Any, dr: Any, values: np.ndarray, wavelengths: np.ndarray):
        if values.shape[-1] != wavelengths.size:
            raise ValueError(
                f"the ground has {values.shape[-1]} bands, but the coats have {wavelengths.size} "
                f"({wavelengths[0]:g} to {wavelengths[-1]:g} nm): resample it to those"
            )
        self._mi = mi
        self._ends = float(wavelengths[0]), float(wavelengths[-1])
        self._mean = float(values.mean())
        # Bands are the depth of a volume texture.
        volume = np.ascontiguousarray(np.moveaxis(values, -1, 0)[..., None], np.float32)
        self._texture = mi.Texture3f(
            mi.TensorXf(volume), filter_mode=dr.FilterMode.Linear, wrap_mode=dr.WrapMode.Clamp
        )
        self._count = wavelengths.size

    def mean(self) -> float:
        return self._mean

    def eval(self, si: Any, active: Any) -> list[Any]:
        """At each wavelength, linear between bands."""
        low, high = self._ends
        values = []
        for wavelength in si.wavelengths:
            # Texels lie at the middle of their cells.
            band = (wavelength - low) / (high - low) * (self._count - 1)
            where = self._mi.Point3f(si.uv.x, si.uv.y, (band + 0.5) / self._count)
            values.append(self._texture.eval(where, active)[0])
        return values


def _span(value: Any, most: float) -> Extent:
    """A number, the range of a texture, or None."""
    return value if isinstance(value, float | None) else (0.0, most)


def _text_of(coats: str) -> str:
    """Coats, and for a file what it holds: another file of the same name is another glaze."""
    from pathlib import Path

    name = coats.strip()
    if name.startswith("{") or not names_file(name):
        return coats
    # What cannot be read is left to `read_coats`, whose errors name the file.
    with suppress(OSError, ValueError):
        return Path(name).read_text(encoding="utf-8")
    return coats
