"""Probability of a spectrum: errors of the instrument and of the model, and the prior.

Measured minus computed reflectance of films that were left out of a fit is ten times what the
instrument's noise explains, smooth in the wavelength, and much the same over a black and a white
card. Three things are behind it, all Gaussian here: absorption and scattering of each paint are off
by a share that varies slowly with the wavelength (as far as the pigment says that it is not known,
and some more: another batch, an edge that is shifted), the model itself has a smooth error,
and the surface reflects more or less. A whole spectrum's misfit follows Student's t, which has the
tails that paint needs.

`Nothing in the catalogue` competes on the same terms: any smooth spectrum, without a paint behind
it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Array, Float

from glazejax import Pigment
from glazejax.spectra import Bands

SquareMatrices: TypeAlias = Float[np.ndarray, "*n r r"]
"""Matrices of as many rows as columns, batch first."""


@dataclass(frozen=True)
class ModelError:
    """Errors of the model, by default those that films showed.

    Its fields may change between versions. Their sizes are those of films that were left out of a
    joint fit (`benchmarks/paint/identification.py`), and are far from small.

    Attributes:
        coefficient: standard deviation of the log of a paint's k, and of its s, added to what the
            pigment states.
        coefficient_length: distance over which these errors, and those that the pigment states,
            stay similar, nm.
        level: standard deviation of a further error of log k, and of log s, that is the same at all
            wavelengths.
        most: a pigment's relative standard deviation counts as this much at most. Errors are
            propagated by first derivatives, which do not hold for larger ones.
        unstated: relative standard deviation of a pigment that states none.
        amplitude: standard deviation of the model's own smooth error at a reflectance of 0.
        share: by how much that grows for each unit of reflectance.
        length: distance over which the smooth error stays similar, nm.
        shared: correlation of the smooth error between grounds, in [0, 1].
        gloss, gloss_sd: share of the surface's reflection that is seen, and how it varies between
            films.
        haze: least standard deviation of what a surface adds to all readings. It is not 0
            even where the instrument leaves out the mirror reflection, for it sees some of a matt
            film's.
        freedom: degrees of freedom of Student's t, which a whole spectrum's misfit follows when
            candidates are weighed, since some films are met far worse than others.
        apart: wavelengths nearer than this count as one reading when candidates are weighed, nm.
            Residuals at neighbouring bands are correlated in ways that no covariance
            describes, so that a finer grid has no more information.
        screening: amplitude that stands for all errors while candidates are looked for.

    Raises:
        ValueError: a value out of range.
    """

    coefficient: float = 0.03
    coefficient_length: float = 100.0
    level: float = 0.0
    most: float = 0.5
    unstated: float = 0.25
    amplitude: float = 0.001
    share: float = 0.01
    length: float = 60.0
    shared: float = 0.6
    gloss: float = 1.0
    gloss_sd: float = 0.35
    haze: float = 0.01
    freedom: float = 5.0
    apart: float = 30.0
    screening: float = 0.035

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            needed = name in ("freedom", "apart") or "length" in name
            if not (0 <= value < np.inf and (value > 0 or not needed)):
                raise ValueError(
                    f"the discrepancy's {name} is {value:g}; it must be "
                    f"{'above 0' if needed else '0 or more'}"
                )
        if not 0 <= self.shared <= 1:
            raise ValueError(
                f"the discrepancy's shared is {self.shared:g}; a correlation lies in [0, 1]"
            )

    def model_sd(self, reflectance: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Standard deviation of the model's own smooth error at a reflectance."""
        return self.amplitude + self.share * reflectance

    def surface_sd(self, surface: float) -> float:
        """Standard deviation of what the surface adds to a reading.

        Args:
            surface: what a smooth one adds, as the instrument sees it.
        """
        return max(self.gloss_sd * surface, self.haze)


@dataclass(frozen=True)
class Prior:
    """Prior of a film.

    The size of a set, a second coat, extenders and unknown paints matter where paints are searched;
    the error where they are known.

    Attributes:
        thickness: median, m; the catalogue's own unit if its paints assume one.
        spread: standard deviation of its logarithm, 5 at most.
        concentration: of the fractions' Dirichlet distribution; 1 is uniform, less prefers unequal
            ones. By default .4 where paints are searched, 1 where they are known.
        sizes: how probable films of one, two, three paints are.
        stacked: probability of two coats, where they are tried.
        extender: how probable a set is relative to others for each paint in it that a film of usual
            thickness hardly shows: such paints meet what others cannot at no cost.
        unknown: probability that paints of the catalogue do not explain the film.
        error: median relative error of the mixture's k and s.
        error_spread: standard deviation of its logarithm.
        error_length: distance over which that error stays similar, nm; by default that of a search.

    Raises:
        ValueError: a value out of range.
    """

    thickness: float = 25e-6
    spread: float = 0.7
    concentration: float | None = None
    sizes: tuple[float, ...] = (0.4, 0.57, 0.03)
    stacked: float = 0.5
    extender: float = 0.1
    unknown: float = 0.4
    error: float = 0.05
    error_spread: float = 1.0
    error_length: float = ModelError.coefficient_length

    def __post_init__(self) -> None:
        if not 0 < self.thickness <= 0.01:
            raise ValueError(
                f"a usual thickness of {self.thickness:g} m is not in (0, 0.01]; it is in metres"
            )
        for name in ("spread", "concentration", "error", "error_spread", "error_length"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise ValueError(f"the prior's {name} is {value:g}; it must be positive")
        if self.spread > 5:
            raise ValueError(
                f"the prior's spread is {self.spread:g}; it is of the log of thickness, and 5 at "
                "most: a factor of 150"
            )
        if len(self.sizes) != 3 or not all(0 < size < np.inf for size in self.sizes):
            raise ValueError(
                f"the prior's sizes are {self.sizes}; they must be three positive numbers: how "
                "probable films of one, two and three paints are"
            )
        if not (0 < self.unknown < 1 and 0 < self.stacked < 1 and 0 < self.extender <= 1):
            raise ValueError(
                "the probabilities `unknown`, `stacked` and `extender` lie between 0 and 1"
            )

    @property
    def concentration_sought(self) -> float:
        """Of a film whose paints are searched."""
        return 0.4 if self.concentration is None else self.concentration

    @property
    def concentration_known(self) -> float:
        """Of a film whose paints are known."""
        return 1.0 if self.concentration is None else self.concentration


def smooth_kernel(wavelengths: Bands, length: float) -> Float[np.ndarray, "bands bands"]:
    """Correlation (1 + d) exp(-d), d = sqrt(3) |l - l'| / length, of errors at two wavelengths:
    Matern's of order 3/2.

    Once differentiable, no more: an infinitely smooth one would believe every kink, and fit kinks
    at any price.
    """
    distance = np.sqrt(3.0) * np.abs(wavelengths[:, None] - wavelengths) / length
    return (1.0 + distance) * np.exp(-distance)


def smooth_modes(wavelengths: Bands, length: float, count: int) -> Float[np.ndarray, "modes bands"]:
    """The largest modes, so many at most, of an error of size one that is smooth over some nm
    (`smooth_kernel`).
    """
    return principal_modes(smooth_kernel(wavelengths, length))[-count:]


def principal_modes(covariance: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "modes n"]:
    """Modes of errors of this covariance, each as large as its standard deviation, smallest first:
    eigenvectors times the roots of their eigenvalues, of which the first large number is positive.
    """
    values, vectors = np.linalg.eigh(covariance)
    # An eigenvector has no sign of its own, and libraries differ: draws by modes would differ, too.
    large = np.abs(vectors) > 0.5 * np.abs(vectors).max(axis=0)
    signs = np.sign(np.take_along_axis(vectors, large.argmax(axis=0)[None], axis=0))
    return (vectors * signs * np.sqrt(np.maximum(values, 0.0))).T


def model_correlation(
    wavelengths: Bands, grounds: int, length: float, shared: float
) -> Float[np.ndarray, "readings readings"]:
    """Correlation of the model's own smooth error, ground by ground.

    Args:
        wavelengths: (bands,), nm.
        grounds: how many there are.
        length: distance over which the error stays similar, nm.
        shared: its correlation between grounds.
    """
    cards = shared + (1.0 - shared) * np.eye(grounds)
    return np.kron(cards, smooth_kernel(wavelengths, length))


def relative_errors(
    pigments: Sequence[Pigment], discrepancy: ModelError
) -> Float[np.ndarray, "paints 2 bands"]:
    """Standard deviations of log k and log s that pigments state, `most` of the discrepancy at
    most, without the part that their error modes hold.
    """

    def share(value: Array, sd: Array | None, unstated: float) -> np.ndarray:
        values = np.asarray(value, dtype=np.float64)
        if sd is None:
            return np.full(values.shape, unstated)
        # Without any absorption its relative error does not matter: the readings' slope is 0.
        return np.divide(np.asarray(sd), values, out=np.zeros_like(values), where=values > 0)

    def both(pigment: Pigment) -> np.ndarray:
        modes = _limit_modes(pigment, discrepancy)
        in_modes, unstated = (
            (0.0, discrepancy.unstated) if modes is None else (np.sum(modes**2, axis=0), 0.0)
        )
        pairs = (
            (pigment.absorption, pigment.absorption_sd),
            (pigment.scattering, pigment.scattering_sd),
        )
        stated = np.minimum([share(value, sd, unstated) for value, sd in pairs], discrepancy.most)
        return np.sqrt(np.maximum(stated**2 - in_modes, 0.0))

    return np.asarray([both(pigment) for pigment in pigments])


def _limit_modes(
    pigment: Pigment, discrepancy: ModelError
) -> Float[np.ndarray, "modes 2 bands"] | None:
    """A pigment's error modes, made smaller where together they exceed the discrepancy's `most`."""
    if pigment.error_modes is None:
        return None
    modes = np.asarray(pigment.error_modes, dtype=np.float64)
    size = np.sqrt(np.sum(modes**2, axis=0))
    return modes * np.minimum(1.0, discrepancy.most / np.maximum(size, 1e-12))


def error_modes(
    pigments: Sequence[Pigment], discrepancy: ModelError
) -> Float[np.ndarray, "paints 2 bands modes"]:
    """Error modes of log k and log s of all pigments: those of one provenance share their modes.

    A pigment's modes are made smaller where together they exceed the discrepancy's `most`.
    """
    sources: dict[str, int] = {}
    for pigment in pigments:
        if pigment.error_modes is not None:
            sources[pigment.provenance] = max(
                sources.get(pigment.provenance, 0), len(pigment.error_modes)
            )
    first = dict(zip(sources, np.cumsum([0, *sources.values()]), strict=False))
    bands = pigments[0].wavelengths.size
    out = np.zeros((len(pigments), 2, bands, sum(sources.values())))
    for row, pigment in enumerate(pigments):
        if (modes := _limit_modes(pigment, discrepancy)) is not None:
            start = first[pigment.provenance]
            out[row, :, :, start : start + len(modes)] = np.moveaxis(modes, 0, -1)
    return out


def stated_modes(
    pigments: Sequence[Pigment], discrepancy: ModelError, shapes: int = 12
) -> Float[np.ndarray, "modes paints 2 bands"]:
    """Independent errors of size one of log k and log s, all that pigments state: their error
    modes, and what their standard deviations say beyond these, smooth, of each k and s by itself in
    so many shapes.
    """
    count, grid = len(pigments), pigments[0].wavelengths
    shared = np.moveaxis(error_modes(pigments, discrepancy), -1, 0)
    smooth = smooth_modes(grid, discrepancy.coefficient_length, shapes)
    sizes = relative_errors(pigments, discrepancy)
    each = np.einsum("pq,cd,mb,pcb->mpcqdb", np.eye(count), np.eye(2), smooth, sizes)
    modes = np.concatenate([shared, each.reshape(-1, *shared.shape[1:])])
    return modes[modes.any(axis=(1, 2, 3))]


def modes_covariance(
    slopes: Float[np.ndarray, "*n errors readings"],
    modes: Float[np.ndarray, "*n errors bands modes"],
) -> Float[np.ndarray, "*n readings readings"]:
    """Covariance of the readings that error modes of the coefficients cause; slopes as for
    `paints_covariance` of a search.
    """
    # In the modes' own precision: single does, and takes half the time.
    by_ground = slopes.astype(modes.dtype).reshape(*slopes.shape[:-1], -1, modes.shape[-2])
    # Band by band a product of matrices, which takes a tenth of a sum over indices.
    by_band = np.ascontiguousarray(np.swapaxes(by_ground, -1, -3))
    caused = by_band @ np.swapaxes(modes, -2, -3)
    caused = np.swapaxes(caused, -2, -3).reshape(*slopes.shape[:-2], -1, modes.shape[-1])
    return caused @ np.swapaxes(caused, -1, -2)


def paint_covariance(
    by_log: Any, smooth: Float[Array | np.ndarray, "readings readings"] | float
) -> Any:
    """Covariance J K J^T of readings that errors of log k and log s cause, each independent of the
    others; arrays of NumPy or of JAX.

    Args:
        by_log: slopes of the readings by each error, times its standard deviation, (..., errors,
            readings).
        smooth: correlation of an error at the readings' wavelengths.
    """
    return (by_log.swapaxes(-1, -2) @ by_log) * smooth


def draw_coefficient_errors(
    rng: np.random.Generator,
    shape: tuple[int, ...],
    wavelengths: Bands,
    discrepancy: ModelError,
) -> Float[np.ndarray, "*shape bands"]:
    """Random errors of the log of coefficients: smooth, with a level."""
    kernel = smooth_kernel(wavelengths, discrepancy.coefficient_length)
    smooth = discrepancy.coefficient * _draw_gaussian(rng, shape, kernel)
    return smooth + discrepancy.level * rng.standard_normal((*shape, 1))


def draw_model_errors(
    rng: np.random.Generator,
    count: int,
    grounds: int,
    wavelengths: Bands,
    discrepancy: ModelError,
) -> Float[np.ndarray, "count grounds bands"]:
    """Random errors of the model itself, at a reflectance of 0."""
    correlation = model_correlation(wavelengths, grounds, discrepancy.length, discrepancy.shared)
    errors = discrepancy.amplitude * _draw_gaussian(rng, (count,), correlation)
    return errors.reshape(count, grounds, -1)


def _draw_gaussian(
    rng: np.random.Generator, shape: tuple[int, ...], covariance: Float[np.ndarray, "n n"]
) -> Float[np.ndarray, "*shape n"]:
    """Random Gaussian vectors of this covariance."""
    root = np.linalg.cholesky(covariance + 1e-9 * np.eye(len(covariance)))
    return rng.standard_normal((*shape, len(covariance))) @ root.T


def _inverse_of_lower(factor: SquareMatrices) -> SquareMatrices:
    """Inverse of lower triangles, by halves: [A 0; C B]^-1 = [A^-1 0; -B^-1 C A^-1 B^-1].

    A quarter of the time of NumPy's inverse, and as fast as LAPACK's `dtrtri`, for which scipy
    would be imported: longer than a search of some films.
    """
    rows = factor.shape[-1]
    # Triangles of this many rows are inverted as any matrix is.
    if rows <= 8:
        return np.tril(np.linalg.inv(factor))
    half = rows // 2
    upper, lower = slice(None, half), slice(half, None)
    out = np.zeros_like(factor)
    out[..., upper, upper] = _inverse_of_lower(factor[..., upper, upper])
    out[..., lower, lower] = _inverse_of_lower(factor[..., lower, lower])
    below = factor[..., lower, upper] @ out[..., upper, upper]
    out[..., lower, upper] = -out[..., lower, lower] @ below
    return out


class Whitening(NamedTuple):
    """Gaussian errors: height - |B r|^2 / 2 is the log density of residuals r.

    Attributes:
        basis: B, (..., readings, readings), with B^T B the inverse of their covariance.
        height: log of the Gaussian's height, (...).
    """

    basis: SquareMatrices
    height: Float[np.ndarray, "*n"]


def whitening(matrix: SquareMatrices) -> Whitening:
    """Whitening of errors of this covariance."""
    factor = np.linalg.cholesky(matrix)
    height = -np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return Whitening(
        basis=_inverse_of_lower(factor),
        height=height - 0.5 * matrix.shape[-1] * np.log(2.0 * np.pi),
    )
