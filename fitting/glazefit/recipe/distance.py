"""Distances of readings from targets: colour under all lights by CIEDE2000, and the spectrum."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax.colour import delta_e_2000
from glazejax.spectra import resample

from ..film.colour_metric import lab_metric
from .model import Readings, StackModel, lab_of
from .targets import Target


class TargetArrays(NamedTuple):
    """Targets of a search as arrays."""

    lab: Float[Any, "targets lights 3"]
    metric: Float[Any, "targets lights 3 3"]
    """metric @ (Lab - lab) is as long as a small colour difference."""
    spectrum: Float[Any, "targets bands"]
    spectral: Float[Any, "targets"]
    """Weight of the squared difference in reflectance, summed over the bands."""

    @classmethod
    def of(
        cls,
        targets: Sequence[Target],
        wavelengths: Float[np.ndarray, "bands"],
        illuminants: Sequence[str],
        observer: str,
        metamerism: float,
    ) -> "TargetArrays":
        """Targets under some lights; one without a spectrum has none to miss.

        Args:
            targets: each with a colour under every light.
            wavelengths: nm, which spectra cover.
            illuminants, observer: full names.
            metamerism: Delta E that a root mean squared difference of 0.01 weighs.
        """
        labs = np.stack([[t.lab(name, observer) for name in illuminants] for t in targets])
        spectra = np.zeros((len(targets), wavelengths.size))
        weights = np.zeros(len(targets))
        for row, target in enumerate(targets):
            if target.wavelengths is not None and target.reflectance is not None:
                spectra[row] = resample(target.wavelengths, target.reflectance, wavelengths)
                weights[row] = (100.0 * metamerism) ** 2 / wavelengths.size
        return cls(labs, lab_metric(labs), spectra, weights)

    def distances(
        self,
        rows: Int[np.ndarray, "n"],
        spectra: Float[np.ndarray, "n bands"],
        labs: Float[np.ndarray, "n lights 3"],
    ) -> tuple[Float[np.ndarray, "n lights"], Float[np.ndarray, "n"]]:
        """Delta E 2000 of readings from one target each, and their cost: the mean square, and the
        penalty for another spectrum.
        """
        delta_e = np.asarray(delta_e_2000(labs, self.lab[rows]))
        miss = np.sum((spectra - self.spectrum[rows]) ** 2, axis=1)
        return delta_e, np.mean(delta_e**2, axis=1) + self.spectral[rows] * miss

    def residuals(
        self,
        rows: Int[np.ndarray, "n"],
        readings: Readings,
        by_point: Float[np.ndarray, "n m bands"],
    ) -> tuple[
        Float[np.ndarray, "n residuals"],
        Float[np.ndarray, "n residuals m"],
        Float[np.ndarray, "n lights"],
    ]:
        """Residuals whose squares add up to the cost, their slopes by the unknowns of which
        readings have the slopes `by_point`, and Delta E 2000.
        """
        count, lights, _ = readings.lab.shape
        colours, moves = colour_misfit(readings.lab, self.lab[rows])
        weight = np.sqrt(self.spectral[rows])[:, None]
        by_point = np.swapaxes(by_point, 1, 2)
        by_lab = (moves @ readings.lab_by_spectrum).reshape(count, 3 * lights, -1) @ by_point
        residual = [
            colours.reshape(count, -1) / np.sqrt(lights),
            weight * (readings.spectrum - self.spectrum[rows]),
        ]
        slopes = [by_lab / np.sqrt(lights), weight[..., None] * by_point]
        return (
            np.concatenate(residual, axis=1),
            np.concatenate(slopes, axis=1),
            np.linalg.norm(colours, axis=-1),
        )


def colour_misfit(
    lab: Float[np.ndarray, "*batch 3"], target: Float[np.ndarray, "*batch 3"]
) -> tuple[Float[np.ndarray, "*batch 3"], Float[np.ndarray, "*batch 3 3"]]:
    """Vectors as long as the CIEDE2000 differences of colours from their targets, and their slopes
    by the colours.

    The vector points as the metric half-way between both has it, where the formula takes its
    weights.
    """
    # Of a difference quotient.
    step = 0.01
    moves = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    near = lab + moves.reshape(7, *(1,) * (lab.ndim - 1), 3)
    vector = np.einsum("...ij,...j->...i", lab_metric((near + target) / 2), near - target)
    length = np.linalg.norm(vector, axis=-1)
    far = length > 1e-4
    longer = delta_e_2000(near, target + 0.0 * near) / np.where(far, length, 1.0)
    vector = vector * np.where(far, longer, 1.0)[..., None]
    slopes = (vector[1:4] - vector[4:]) / (2.0 * step)
    return vector[0], np.moveaxis(slopes, 0, -1)


def small_distances(
    model: StackModel, targets: TargetArrays, reading: Float[Array, "*batch bands"]
) -> Float[Array, "*batch targets"]:
    """Cost of readings for every target, by the colour difference of small steps."""
    miss = lab_of(model, reading)[..., None, :, :] - targets.lab
    differences = jnp.einsum("tlij,...tlj->...tli", targets.metric, miss)
    colour = jnp.sum(differences**2, axis=(-1, -2)) / targets.lab.shape[1]
    cross = jnp.tensordot(reading, targets.spectrum.T, axes=1)
    spectral = (
        jnp.sum(reading**2, axis=-1)[..., None]
        - 2.0 * cross
        + jnp.sum(targets.spectrum**2, axis=-1)
    )
    return colour + targets.spectral * jnp.maximum(spectral, 0.0)
