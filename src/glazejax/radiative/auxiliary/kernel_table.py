"""Tables of the kernels of the auxiliary function method on a uniform grid of optical depth.

With one step dh for all wavelengths the kernels' matrices depend on neither the paint nor the
wavelength: H is symmetric Toeplitz (Q numbers), U is Hankel (2Q - 1 numbers), and the Q x Q matrix
of a thinner glaze is the leading part of a thicker one's (paper A, section 4). A table is computed
once, in double precision whatever JAX is set to, grows when a thicker glaze comes, and can be kept
in a file.
"""

import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..common.exponential_integrals import cone_nodes
from ..common.fresnel import cos_refracted

_FORMAT = "glazejax kernel table 1"
_ARRAYS = ("e2", "e3", "j1", "j2")

MOST_SEGMENTS = 8192
"""Longest table, in segments: its Q x Q matrix takes half a gigabyte in double precision."""


class KernelTable:
    """Kernels for one refractive index and one step, up to some number of segments.

    Not `glazejax.interpolated`: the method asks for the nodes of one even grid, and for nothing
    between, so that 3 Q - 1 evaluations give Q x Q matrices to the last digit. `interpolated` stops
    at 129 nodes of its own.

    Attributes:
        refractive_index: n of the medium, >= 1.
        step: dh, the optical thickness of a segment.
        segments: Q_max, how many segments the table reaches now.
        e2: E_2((k + 1/2) dh), (Q_max,).
        e3: E_3(k dh), (Q_max + 1,).
        j1: J_1((k + 1/2) dh), (2 Q_max,), with J_p(x) = int_0^1 R(mu) mu^(p-1) exp(-x/mu) dmu.
        j2: J_2(k dh), (2 Q_max + 1,).

    All that the paper tabulates follows from these by differences: eqs (9), (17), (18), (20), (25),
    exact.

    Raises:
        ValueError: an index outside [1, 2.5], a step that is not positive, or more than
            `MOST_SEGMENTS` segments.
    """

    refractive_index: float
    step: float
    segments: int
    e2: np.ndarray
    e3: np.ndarray
    j1: np.ndarray
    j2: np.ndarray

    def __init__(self, refractive_index: float = 1.5, step: float = 0.01, segments: int = 0):
        if not (np.ndim(refractive_index) == 0 and 1.0 <= refractive_index <= 2.5):
            raise ValueError(
                f"refractive_index is {refractive_index}; a table is for one number in [1, 2.5]"
            )
        if not (np.ndim(step) == 0 and 0.0 < step < np.inf):
            raise ValueError(
                f"step is {step}; it must be a positive optical thickness, such as 0.01"
            )
        self.refractive_index = float(refractive_index)
        self.step = float(step)
        self.segments = 0
        self.e2, self.e3, self.j1, self.j2 = (np.zeros(0) for _ in _ARRAYS)
        self.grow(segments)

    def grow(self, segments: int) -> int:
        """Make the table reach at least so many segments; what is there already is kept.

        Returns:
            How many numbers of H and U (Q and 2Q - 1 of them) were new.

        Raises:
            ValueError: more than `MOST_SEGMENTS` are asked for.
        """
        if segments > MOST_SEGMENTS:
            raise ValueError(
                f"{segments} segments of step {self.step:g} are more than {MOST_SEGMENTS}; use a "
                "larger step"
            )
        if segments <= self.segments:
            return 0
        from scipy.special import expn

        before = self.terms
        # U needs tau + s up to twice the depth that H needs.
        midpoints = np.arange(2 * segments) + 0.5
        edges = np.arange(2.0 * segments + 1)
        n = self.refractive_index

        # Only depths beyond the present end are computed.
        def grown(old: np.ndarray, depths: np.ndarray, kernel) -> np.ndarray:
            return np.concatenate([old, kernel(self.step * depths[old.size :])])

        self.e2 = grown(self.e2, midpoints[:segments], lambda x: expn(2, x))
        self.e3 = grown(self.e3, edges[: segments + 1], lambda x: expn(3, x))
        self.j1 = grown(self.j1, midpoints, lambda x: _reflection_integral(1, x, n))
        self.j2 = grown(self.j2, edges, lambda x: _reflection_integral(2, x, n))
        self.segments = segments
        return self.terms - before

    @property
    def terms(self) -> int:
        """Numbers of H and U in the table: 3 Q_max - 1, or 0 while it is empty."""
        return max(3 * self.segments - 1, 0)

    @property
    def toeplitz(self) -> Float[np.ndarray, "segments"]:
        """First row of H (eq. (25)): ``H_ij = toeplitz[|i - j|]``, the kernel E_1 integrated over
        segment j.
        """
        # The segment's own integral is that of E_1 on both sides of its midpoint.
        return np.concatenate([2.0 * (1.0 - self.e2[:1]), self.e2[:-1] - self.e2[1:]])

    @property
    def hankel(self) -> Float[np.ndarray, "terms"]:
        """Numbers of U (eq. (25)): U_ij = hankel[i + j], i and j from zero."""
        return self.j1[:-1] - self.j1[1:]

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the table to a file (NumPy's .npz).

        Raises:
            FileExistsError: there is such a file and `overwrite` is not set.
        """
        from ...whole_file import whole_file

        path = Path(path)
        if path.exists() and not overwrite:
            raise FileExistsError(f"{path} exists; pass overwrite=True to replace it")
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        # An interrupted run leaves no half table.
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                format=_FORMAT,
                refractive_index=self.refractive_index,
                step=self.step,
                **arrays,
            )
        return path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "KernelTable":
        """Read a table that `save` wrote.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is no kernel table, or a damaged one.
        """
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(
                f"no kernel table at {path}; KernelTable(...).save(path) writes one"
            )
        try:
            with np.load(path, allow_pickle=False) as file:
                content = {
                    name: file[name] for name in ("format", "refractive_index", "step", *_ARRAYS)
                }
        except Exception as error:  # whatever zip and NumPy raise for a file of another kind
            raise ValueError(
                f"{path} is no kernel table ({error}); KernelTable(...).save(path) writes one"
            ) from None
        if str(content["format"]) != _FORMAT:
            raise ValueError(
                f"{path} holds {str(content['format'])!r}; this version reads {_FORMAT!r}"
            )
        segments = content["e2"].size
        # In the order of `_ARRAYS`; an empty table has no edges either.
        sizes = (segments, segments + 1, 2 * segments, 2 * segments + 1)
        if not segments:
            sizes = (0, 0, 0, 0)
        table = cls(float(content["refractive_index"]), float(content["step"]))
        table.segments = segments
        for name, size in zip(_ARRAYS, sizes, strict=True):
            array = content[name]
            if (
                array.shape != (size,)
                or array.dtype != np.float64
                or not np.all(np.isfinite(array))
            ):
                raise ValueError(
                    f"{path} is damaged: {name} has shape {array.shape}, type {array.dtype}, or "
                    "no number"
                )
            setattr(table, name, array)
        return table

    def __repr__(self) -> str:
        return (
            f"KernelTable(refractive_index={self.refractive_index:g}, step={self.step:g}, "
            f"segments={self.segments})"
        )


def _reflection_integral(
    power: int, x: Float[np.ndarray, "k"], refractive_index: float
) -> Float[np.ndarray, "k"]:
    """J_p(x) in double precision: total reflection in closed form, the cone by Gauss nodes."""
    from scipy.special import expn

    if refractive_index == 1.0:
        return np.zeros_like(x)
    mu, weights, reflectance = cone_nodes(refractive_index)
    cone = np.exp(-x[:, None] / mu) @ (weights * reflectance * mu ** (power - 1))
    critical = cos_refracted(0.0, refractive_index)
    return cone + critical**power * expn(power + 1, x / critical)
