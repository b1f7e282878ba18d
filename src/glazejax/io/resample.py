"""A table on other wavelengths, by colour-science's interpolators."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from ..spectra import Bands, Grid
    from .spectra_table import SpectraTable


def resample(table: "SpectraTable", wavelengths: "Grid") -> "SpectraTable":
    """Spectra on other wavelengths, as CIE 167:2005 recommends: Sprague's where even, else cubic
    splines.

    Fewer than six bands are interpolated linearly. Nothing is extrapolated and nothing averaged:
    `notes` say so where the new step is more than twice the old one. Overshoot below 0 or above a
    spectrum's own maximum is cut. (`glazejax.spectra.resample` is the linear one for spectra that
    are differentiated.)

    Args:
        table: spectra.
        wavelengths: (new,), nm, ascending, within the table's range.

    Raises:
        ValueError: the grid is not legal or reaches beyond the table's.
    """
    from ..spectra import describe_grid, validate_wavelengths

    new = validate_wavelengths(wavelengths)
    old = table.wavelengths
    matrix, how = _interpolation(old, new)
    # Sums of products end in digits that mean nothing.
    values = np.round(table.reflectance @ matrix, 12)
    values = np.clip(values, 0.0, table.reflectance.max(axis=1, keepdims=True))
    notes = [*table.notes, f"resampled from {describe_grid(old)} to {describe_grid(new)} by {how}"]
    if new.size > 1 and old.size > 1 and np.diff(new).min() > 2 * np.median(np.diff(old)):
        notes.append("the new step is much wider than the old one: bands were picked, not averaged")
    return replace(table, wavelengths=new, reflectance=values, notes=notes)


def _interpolation(
    old: "Bands", new: Float[np.ndarray, "new"]
) -> tuple[Float[np.ndarray, "bands new"], str]:
    """Matrix from values at the old bands to the new ones, and the method's name."""
    from ..spectra import interpolation_matrix

    # It refuses what lies outside, by one rule for all.
    linear = interpolation_matrix(old, new)
    if old.size < 6:
        return linear, "linear interpolation"
    import colour

    steps = np.diff(old)
    even = np.allclose(steps, steps[0], rtol=1e-6, atol=0)
    kind = colour.SpragueInterpolator if even else colour.CubicSplineInterpolator
    inside = np.clip(new, old[0], old[-1])
    # Both are linear in the values: the images of the unit vectors serve all spectra.
    matrix = np.stack([np.atleast_1d(kind(old, unit)(inside)) for unit in np.eye(old.size)])
    return matrix, "Sprague interpolation" if even else "cubic splines"
