"""Colours of a glaze that changes from pixel to pixel, as OpenPBR takes them: of the body, and of a
coat above it.

The body that matches best has one number a wavelength: a weighted mean of the reflectance factor
over all angles. A mean is linear, so that XYZ may be averaged in place of spectra. These means
depend on the few numbers that differ between pixels. They are computed for some values of these,
and interpolated for all pixels, as in `glazejax.picture`.
"""

import itertools
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from ...colour import colour_weights, delta_e_2000, white_point, xyz_to_lab
from ...interpolated import at_points
from ...paint.media import Glaze
from ...progress import Progress
from ...radiative.common.chunks import by_blocks
from ...radiative.common.fresnel import cos_refracted
from ...radiative.common.quadrature import gauss
from ...radiative.rough.lobes import lobe_albedo
from ...spectra import validate_wavelengths
from ..glaze.solve import check_layer, on_grid, with_variables
from .angles import Viewing, pair_spectra
from .rgb import Triples, rgb_of_xyz
from .spaces import Space

MeanColours: TypeAlias = Float[np.ndarray, "some means 3"]
"""XYZ of the means of some glazes."""

# Tints of a coat that are tried; between them their error is a parabola.
_TINTS = np.exp(np.linspace(0.0, np.log(2e-3), 41))
# Glazes of a table that are computed side by side, so that one program serves all.
_GLAZES = 64


class Colours(NamedTuple):
    """Colours that a map becomes.

    Attributes:
        plain: (points, 3), linear RGB of the body that matches best without a coat; not clipped.
        base: (points, 3), linear RGB of the body, in [0, 1]; one colour where there is a coat.
        coat: (points, 3), linear RGB in (0, 1], or None without a coat.
        delta_e: estimated largest CIEDE2000 of the interpolation.
        computed: number of glazes that were computed.
    """

    plain: Triples
    base: Triples
    coat: Triples | None
    delta_e: float
    computed: int


@dataclass(frozen=True)
class MappedGlaze:
    """A glaze some of whose numbers are maps; checked.

    Attributes:
        glaze: all else of it, without batch axes.
        layer: number of the layer whose thickness or fraction changes, 0 the top one.
        kinds: what changes: "thickness" of the layer in m, "fraction", the share of its second
            paint, "ground", the reflectance of the ground.
    """

    glaze: Glaze
    layer: int
    kinds: tuple[str, ...]

    def __post_init__(self) -> None:
        check_layer(self.glaze, self.layer, mixed="fraction" in self.kinds)

    def at(self, points: Float[np.ndarray, "*points kinds"]) -> Glaze:
        """The glaze at a point with its values of `kinds`, or at many: a batch."""
        values = dict(zip(self.kinds, np.asarray(points, float).T, strict=True))
        glaze = with_variables(
            self.glaze, self.layer, values.get("thickness"), values.get("fraction")
        )
        ground = values["ground"][..., None] if "ground" in values else glaze.ground
        return Glaze(glaze.coats, ground, glaze.refractive_index)


def mapped_colours(
    mapped: MappedGlaze,
    points: Float[np.ndarray, "points kinds"],
    *,
    roughness: float,
    space: Space,
    light: Viewing,
    coat: bool,
    delta_e: float,
    progress: Progress,
) -> Colours:
    """Colours of OpenPBR's body, and of a coat, at points.

    Args:
        mapped: the glaze.
        points: values of its `kinds`.
        roughness: alpha of the surface.
        space: linear RGB.
        light: illuminant and observer.
        coat: with a coat, which absorbs along refracted paths and does not darken.
        delta_e: largest CIEDE2000 wanted of the interpolation.
        progress: called with the glazes that are done, in rounds until the interpolation is good
            enough.
    """
    grid = validate_wavelengths(mapped.glaze.wavelengths)
    weights = colour_weights(grid, *light)
    white = white_point(grid, *light)
    inner = replace(mapped, glaze=on_grid(mapped.glaze, grid))
    index = float(np.mean(np.asarray(inner.glaze.refractive_index)))
    means = _Means(index, roughness, coat)
    # Of reflectance factors: far below what a Delta E is made of.
    tolerance = min(1e-3, 1e-5 * delta_e)
    computed = 0
    rounds = itertools.count(1)

    def mean_xyz(batch: Float[np.ndarray, "some kinds"], size: int = _GLAZES) -> MeanColours:
        """XYZ of all means, so many glazes side by side."""
        stage = f"computing glazes, round {next(rounds)},"

        def run(rows: Int[np.ndarray, "block"]) -> Float[np.ndarray, "block means xyz"]:
            nonlocal computed
            progress(int(rows[0]), len(batch), stage)
            some = inner.at(batch[rows])
            spectra = pair_spectra(some, means.cos_in, means.cos_out, roughness, tolerance)
            computed += size
            return np.einsum("pab,kp,bc->akc", spectra, means.weights, weights, optimize=True)

        return by_blocks(len(batch), size, run)

    def distance(first: MeanColours, second: MeanColours):
        return delta_e_2000(xyz_to_lab(first, white), xyz_to_lab(second, white)).max(axis=-1)

    # Points that are equal are computed once.
    distinct, where = np.unique(points, axis=0, return_inverse=True)
    varied = distinct.max(axis=0) > distinct.min(axis=0)
    error = 0.0
    # Few points are computed each; many by a table over the kinds that vary.
    if len(distinct) <= 64:
        values = mean_xyz(distinct, len(distinct))
    else:

        def of_varied(batch: Float[np.ndarray, "some axes"]) -> MeanColours:
            complete = np.repeat(distinct[:1], len(batch), axis=0)
            complete[:, varied] = batch
            return mean_xyz(complete)

        values, table = at_points(
            of_varied, distinct[:, varied], tolerance=0.9 * delta_e, distance=distance
        )
        error = table.error
    # Colours of the distinct points, and back to all points.
    plain, base, tint = means.colours(rgb_of_xyz(values, white, space))
    where = where.reshape(-1)
    return Colours(
        plain=plain[where],
        base=base[where],
        coat=None if tint is None else tint[where],
        delta_e=error,
        computed=computed,
    )


class _Means:
    """Weighted means over angles from which body and coat are fitted by least squares.

    Let R be the glaze's reflectance factor, m_t that of a white body under a coat of tint t, and
    <.> the sum over pairs of angles of light and eye, weighted by 4 mu mu' w w'. Body b and tint t
    are those of the least

        <(b m_t - R)^2> = b^2 <m_t^2> - 2 b <m_t R> + <R^2>

    of all tints in a table. Of R this takes only its means <m_t R>/<m_t>.
    """

    def __init__(self, index: float, roughness: float, coat: bool):
        # With 8 cosines in place of 5 the means change by less than 1e-3 of themselves.
        mu, weights = gauss(5)
        lit = 2.0 * mu * weights
        self.coat = coat
        # Paint is the same with light and eye exchanged: half of the pairs are enough.
        first, second = np.triu_indices(mu.size)
        self.cos_in = mu[first]
        self.cos_out = mu[second]
        # m_t, (tints, light, eye): the tint along both refracted paths.
        let_out = 1.0 - lobe_albedo(mu, roughness, index)
        path = 0.5 / cos_refracted(mu, index)
        tints = _TINTS if coat else np.ones(1)
        models = let_out * tints[:, None, None] ** (path[:, None] + path)
        weighted = models * (lit[:, None] * lit)
        self.total = weighted.sum(axis=(1, 2))  # <m_t>
        self.squares = (weighted * models).sum(axis=(1, 2)) / self.total  # <m_t^2>/<m_t>
        # Weights of R's means: of a pair and of the exchanged pair together, the diagonal once.
        folded = weighted + np.swapaxes(weighted, 1, 2)
        folded[:, range(mu.size), range(mu.size)] *= 0.5
        self.weights = folded[:, first, second] / self.total[:, None]

    def colours(
        self, means: Float[np.ndarray, "points means 3"]
    ) -> tuple[Triples, Triples, Triples | None]:
        """Colours of the body alone, and of body and coat, from the means in linear RGB.

        With a coat the body is the same everywhere, as light as the lightest point: bodies and
        coats that are free at every point jump where one gives way to the other, and pictures of
        them may not be blended.
        """
        # Without a coat (t = 1) the sum is least at b = <m R>/<m^2>.
        plain = means[:, 0] / self.squares[0]
        if not self.coat:
            return plain, np.clip(plain, 0.0, 1.0), None
        base = np.clip(plain.max(axis=0), 1e-3, 1.0)
        # With the body fixed: the sum of squares of each tint, less <R^2>, (points, tints, 3).
        cost = self.total[:, None] * (base**2 * self.squares[:, None] - 2.0 * base * means)
        # Between tints of the table: the vertex of the parabola through the least three.
        least = np.clip(np.argmin(cost, axis=1), 1, _TINTS.size - 2)[:, None]
        low, middle, high = (np.take_along_axis(cost, least + k, axis=1)[:, 0] for k in (-1, 0, 1))
        bend = low - 2.0 * middle + high
        step = np.where(bend > 0, 0.5 * (low - high) / np.where(bend > 0, bend, 1.0), 0.0)
        # Where the least is at an end of the table the parabola would leave it.
        index = np.clip(least[:, 0] + np.clip(step, -1.0, 1.0), 0.0, _TINTS.size - 1.0)
        # Tints are powers of the second one, so that the index counts its exponent.
        return plain, np.broadcast_to(base, plain.shape), np.exp(np.log(_TINTS[1]) * index)
