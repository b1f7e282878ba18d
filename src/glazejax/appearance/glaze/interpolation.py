"""A table of a glaze's reflectance factor between angles, and what lies between its nodes.

The reflectance factor changes fast only in ways that are known: the surface lets T(theta_I) of the
light in and T(theta_F) out, and a shallow path inside makes it grow as 1/(mu_I + mu_F), the cosines
inside the paint. What is left, rho (mu_I + mu_F)/(T T), is analytic in these cosines, which span
little (0.75 to 1 for n = 1.5), so that few nodes do.
"""

from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ...chebyshev_table import Axis, coefficients_from_nodes, polynomials, roots
from ...paint.media import Glaze
from ...radiative.common.chunks import in_chunks
from ...radiative.common.fresnel import cos_refracted, dielectric_reflectance
from ...spectra import Grid, Numbers, as_float_array, matmul
from .solve import fixed_thickness, indices, on_grid, on_nodes

# Numbers held at once by the interpolation.
_CHUNK_NUMBERS = 2**22
# Without a surface the factor has no bound where both directions graze; there it is this sum of
# cosines' value.
LEAST_SUM = 1e-6


class GlazeTable(NamedTuple):
    """Reflectance factor of a glaze between angles; made by
    `glazejax.appearance.glaze.table.glaze_table`.

    A pytree of arrays: it passes through jit, vmap and grad.
    """

    cos_in: Float[Array | np.ndarray, "in"]
    """Nodes, cosines of incidence in air."""
    cos_out: Float[Array | np.ndarray, "out"]
    """Nodes, cosines of viewing in air."""
    table: Float[Array | np.ndarray, "bands in out thickness"]
    """Reflectance factor pi L_out / E_in at the nodes, without the specular part. The last axis has
    one entry if the thickness does not vary."""
    refractive_index: Float[Array | np.ndarray, "bands"]
    """Of the surface, band by band."""
    thickness: Float[Array | np.ndarray, "thickness"]
    """Nodes, m; one entry, the layer's thickness (0 for a glaze without coats), if it does not
    vary.
    """
    ranges: tuple[Axis, Axis, Axis]
    """Angles (as cosines in air) and thicknesses that the table is for."""
    coordinate_index: Array | float
    """Index whose cosines inside are the coordinates of the angles."""
    error: Array | float
    """Estimated largest absolute error of the reflectance factor within the ranges; where mu_I +
    mu_F is below 1, which an index near 1 allows, of the factor times that sum."""

    @property
    def varies(self) -> bool:
        """Test whether it has thicknesses."""
        return self.thickness.shape[0] > 1

    def reflectance_factor(
        self, cos_in: Numbers, cos_out: Numbers, thickness: Numbers | None = None
    ) -> Float[Array, "*batch bands"]:
        """Reflectance factor pi L_out / E_in, without the specular part.

        Args:
            cos_in, cos_out: cosines of the angles of incidence and viewing in air, (...).
            thickness: of the layer that varies, m, (...); only for a table with thicknesses.

        Returns:
            (..., bands), to `error`, and smooth. What lies outside the ranges is moved to their
            ends. Work goes through the processor in pieces, so that memory stays bounded.

        Raises:
            ValueError: a thickness is missing, or given for a table without.
        """
        if self.varies and thickness is None:
            raise ValueError(
                "this glaze's thickness varies: give thickness, in metres, for every point"
            )
        if not self.varies and thickness is not None:
            raise ValueError(
                "this glaze's thickness is fixed: leave thickness out, or give glaze_table the "
                "thicknesses too"
            )
        depth = self.thickness[0] if thickness is None else thickness
        points = jnp.broadcast_arrays(
            *(as_float_array(values) for values in (cos_in, cos_out, depth))
        )
        return _evaluate(self, *points)

    def mirror(self, cos_in: Numbers) -> Float[Array, "*batch bands"]:
        """Fresnel reflectance of the outer surface, (..., bands): what a mirror reflection carries.

        Args:
            cos_in: cosine of the angle of incidence in air, (...); below 0 it counts as 0.
        """
        cosine = jnp.clip(as_float_array(cos_in), 0.0, 1.0)
        return dielectric_reflectance(cosine[..., None], self.refractive_index)

    def for_glaze(
        self, glaze: Glaze, wavelengths_nm: Grid, *, layer: int = 0, tolerance: float = 1e-6
    ) -> "GlazeTable":
        """The same nodes for another glaze, which JAX may trace: gradients by its paints and
        thicknesses.

        The error is not estimated again, so keep to glazes near the one the table was made for.

        Args:
            glaze, wavelengths_nm, layer: as for `glaze_table`. Where the thickness does not vary,
                it is the glaze's.
            tolerance: of the solver.
        """
        glaze = on_grid(glaze, wavelengths_nm)
        depths = self.thickness if self.varies else fixed_thickness(glaze, layer)
        return self._replace(
            table=on_nodes(
                glaze, self.cos_in, self.cos_out, depths if self.varies else None, layer, tolerance
            ),
            thickness=depths,
            ranges=self.ranges if self.varies else (*self.ranges[:2], Axis(depths[0], depths[0])),
            refractive_index=indices(glaze, self.refractive_index.shape[0]),
        )

    def __repr__(self) -> str:
        bands, incidence, viewing, depths = self.table.shape
        sizes = f"{incidence} x {viewing} angles" + (
            f" x {depths} thicknesses" if depths > 1 else ""
        )
        error = "traced" if isinstance(self.error, Tracer) else f"{float(self.error):.1g}"
        return f"GlazeTable({bands} bands, {sizes}, estimated error {error})"


def interior(table: GlazeTable, xp: ModuleType) -> Any:
    """Interpolated values: the table without what is known, (bands, in, out, thickness)."""
    a, b = (xp.clip(c, 0.0, 1.0) for c in (table.cos_in, table.cos_out))
    known = _analytic_factor(a[:, None], b, table.refractive_index[:, None, None], xp)
    return table.table / known[..., None]


def _analytic_factor(cos_in: Any, cos_out: Any, index: Any, xp: ModuleType) -> Any:
    """What is known of the angles, T T/(mu_I + mu_F)."""
    total = cos_refracted(cos_in, index) + cos_refracted(cos_out, index)
    let_in = 1.0 - dielectric_reflectance(cos_in, index)
    let_out = 1.0 - dielectric_reflectance(cos_out, index)
    return let_in * let_out / xp.maximum(total, LEAST_SUM)


def evaluate(table: GlazeTable, flat: Any, points: Any, xp: ModuleType) -> Any:
    """Reflectance factor, (points, bands), at cosines and thicknesses (3, points).

    Args:
        table: ranges and nodes.
        flat: `interior` as (nodes, bands).
        points: cosines of incidence and viewing in air, and thickness in m.
        xp: numpy or jax.numpy, as the arrays are.
    """
    a, b = (span.clamp(points[k], xp) for k, span in enumerate(table.ranges[:2]))
    weights = _angle_weights(table, 0, a, xp)
    further_weights = [_angle_weights(table, 1, b, xp)]
    if table.varies:
        span = table.ranges[2]
        further_weights.append(
            lagrange(span.coordinate(span.clamp(points[2], xp), xp), table.thickness.shape[0], xp)
        )
    # All products at once, and one product of matrices: quicker than axis after axis where there
    # are many bands.
    for along in further_weights:
        weights = (weights[:, :, None] * along[:, None, :]).reshape(points.shape[1], -1)
    known = _analytic_factor(a[:, None], b[:, None], table.refractive_index, xp)
    return matmul(xp, weights, flat) * known


@jax.jit
def _evaluate(
    table: GlazeTable, cos_in: Array, cos_out: Array, depth: Array
) -> Float[Array, "*batch bands"]:
    """`evaluate`, a bounded number of points at a time."""
    bands = table.table.shape[0]
    nodes = int(np.prod(table.table.shape[1:]))
    flat = interior(table, jnp).reshape(bands, nodes).T
    points = jnp.stack([cos_in.ravel(), cos_out.ravel(), depth.ravel()], axis=1)
    # A point holds its weights over all nodes and some spectra.
    size = _CHUNK_NUMBERS // (nodes + 4 * bands)
    values = in_chunks(lambda some: evaluate(table, flat, some.T, jnp), points, max(64, size))
    return values.reshape(*cos_in.shape, bands)


def _angle_weights(table: GlazeTable, axis: int, cosine: Any, xp: ModuleType) -> Any:
    """Lagrange's polynomials of the nodes, (points, nodes), at cosines within the range."""
    count = table.table.shape[1 + axis]
    if count == 1:
        return xp.ones((*cosine.shape, 1), cosine.dtype)
    # The coordinate is the cosine inside, in which the rest is smooth.
    ends = (
        cos_refracted(xp.asarray(end), table.coordinate_index) for end in table.ranges[axis][:2]
    )
    return lagrange(
        Axis(*ends).coordinate(cos_refracted(cosine, table.coordinate_index), xp), count, xp
    )


def error_weight(
    cos_in: Float[np.ndarray, "*#batch"],
    cos_out: Float[np.ndarray, "*#batch"],
    index: float | Float[np.ndarray, "*#batch"],
) -> Float[np.ndarray, "*batch"]:
    """Weight of an error: 1, or the sum of the cosines inside where that is less, as the factor has
    no bound where both directions graze (an index near 1).
    """
    return np.minimum(cos_refracted(cos_in, index) + cos_refracted(cos_out, index), 1.0)


def lagrange(x: Any, count: int, xp: ModuleType = np) -> Any:
    """Lagrange's polynomials of the roots at x in [-1, 1], (points,): (points, nodes)."""
    # By sums of Chebyshev polynomials: no division, so slopes are right at the nodes as well.
    return matmul(
        xp, polynomials(x, count, xp), xp.asarray(coefficients_from_nodes(roots, count), x.dtype)
    )
