r"""Phase functions of scattering by pigment, as Legendre moments.

    p(cos T) = sum_l (2l + 1) chi_l P_l(cos T),      chi_0 = 1,  mean of p over all directions 1,

T being the angle between the directions of travel before and after: chi_1 is the mean cosine g,
positive for forward scattering. All of `glazejax.radiative.manyflux` takes a phase function as the
array of its moments, (..., terms); leading axes are batch axes and may include one for the layers.
"""

from contextlib import AbstractContextManager, nullcontext

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from .inputs import Numbers, check_values, concrete, refuse

_NEGLIGIBLE = 1e-12
_MOST_TERMS = 2000


def isotropic() -> Float[np.ndarray, "1"]:
    """Moments of isotropic scattering: one term."""
    return np.ones(1)


def henyey_greenstein(g: Numbers, terms: int | None = None) -> Float[Array, "*batch terms"]:
    """Moments g^l of Henyey and Greenstein's function, p = (1 - g^2)/(1 - 2 g cos T + g^2)^(3/2).

    Args:
        g: mean cosine, (...), in (-1, 1).
        terms: number of moments; by default as many as are larger than 1e-12, for which g must be
            known.

    Raises:
        ValueError: g out of range, or traced by `jax.jit` without ``terms``.

    Source: Henyey and Greenstein (1941); paper C, equation (16) with its exponent put right.
    """
    terms = _terms({"g": g}, terms)
    with _known_under_jit(g):
        base = jnp.asarray(g, jnp.result_type(float))[..., None]
        # Products, not powers: these have no slope at zero and below.
        return jnp.cumprod(jnp.where(np.arange(terms) == 0, 1.0, base), axis=-1)


def two_term_henyey_greenstein(
    forward: Numbers,
    backward: Numbers,
    share: Numbers,
    terms: int | None = None,
) -> Float[Array, "*batch terms"]:
    """Moments of share HG(forward) + (1 - share) HG(backward): a forward and a backward lobe.

    Args:
        forward, backward: mean cosine of each lobe, (...), in (-1, 1); the second is negative for a
            backward lobe.
        share: of the first lobe, (...), in [0, 1].
        terms: as for `henyey_greenstein`.

    Raises:
        ValueError: a value out of range, or traced without ``terms``.
    """
    check_values({"share": share})
    terms = _terms({"forward": forward, "backward": backward}, terms)
    with _known_under_jit(forward, backward, share):
        weight = jnp.asarray(share, jnp.result_type(float))[..., None]
        return weight * henyey_greenstein(forward, terms) + (1.0 - weight) * henyey_greenstein(
            backward, terms
        )


def tabulated(cosines: Numbers, values: Numbers, terms: int = 64) -> Float[Array, "*batch terms"]:
    """Moments of a phase function given by its values, taken as linear in the cosine between them.

    Args:
        cosines: of the scattering angle, (points,), strictly monotonic, from -1 to 1 (or 1 to -1).
        values: p in any unit, (..., points), >= 0; the result is normalised.
        terms: number of moments.

    Raises:
        ValueError: cosines that do not span -1 to 1 in order, negative values, or a function that
            is zero.
    """
    x = np.asarray(cosines, float)
    p = np.asarray(values, float)
    if x.ndim != 1 or x.size < 2 or p.shape[-1:] != x.shape:
        raise ValueError(
            f"cosines {x.shape} and values {p.shape} must share a last axis of at least two points"
        )
    if x[0] > x[-1]:
        x = x[::-1]
        p = p[..., ::-1]
    if not (np.all(np.diff(x) > 0) and abs(x[0] + 1) < 1e-9 and abs(x[-1] - 1) < 1e-9):
        raise ValueError(
            f"cosines must run from -1 to 1 in order; they run from {x[0]:g} to {x[-1]:g}"
        )
    if not np.all(p >= 0):
        raise ValueError(f"values holds {p[~(p >= 0)].flat[0]}; a phase function is >= 0")
    # Each piece by its own Gauss nodes: exact for its polynomials of degree terms.
    y, w = np.polynomial.legendre.leggauss(terms // 2 + 2)
    at = 0.5 * (x[1:] + x[:-1])[:, None] + 0.5 * np.diff(x)[:, None] * y
    weight = 0.5 * np.diff(x)[:, None] * w
    # The function on the nodes, straight between its points.
    share = 0.5 * (1.0 + y)
    piece = p[..., :-1, None] * (1.0 - share) + p[..., 1:, None] * share
    # Its moments; the zeroth is all the light, which makes it one.
    polynomials = np.polynomial.legendre.legvander(at, terms - 1)
    moments = np.einsum("...pk,pk,pkl->...l", piece, weight, polynomials)
    if not np.all(moments[..., 0] > 0):
        raise ValueError(
            "values are zero everywhere; a phase function needs light in some direction"
        )
    return jnp.asarray(moments / moments[..., :1])


def check_moments(moments: Numbers) -> None:
    """Refuse known moments that no phase function has; of truncated ones, which may be those of a
    function that is somewhere negative (as [1, g] is for g above 1/3), each is looked at alone.

    Raises:
        ValueError: no last axis, a first moment that is not 1, or others beyond 1 in absolute
            value.
    """
    numbers = concrete(moments)
    if numbers is None:
        return
    if numbers.ndim == 0 or numbers.shape[-1] == 0:
        raise ValueError(
            "phase must have a last axis of Legendre moments; isotropic scattering is [1.0]"
        )
    if not np.allclose(numbers[..., 0], 1.0, atol=1e-6):
        raise ValueError(
            f"phase begins with {numbers[..., 0].flat[0]}; its first moment is 1 (the rest without "
            "2l + 1)"
        )
    if not np.all(np.abs(numbers) <= 1.0 + 1e-6):
        raise ValueError(
            f"phase holds {numbers[~(np.abs(numbers) <= 1 + 1e-6)].flat[0]}; moments lie between "
            "-1 and 1"
        )


def evaluate(moments: Numbers, cosine: Numbers) -> Float[Array, "*batch"]:
    """p(cos T) from its moments, by Clenshaw's recurrence.

    Args:
        moments: (..., terms); batch axes broadcast with those of ``cosine``.
        cosine: of the scattering angle, (...).
    """
    moments = jnp.asarray(moments)
    cosine = jnp.asarray(cosine)
    terms = moments.shape[-1]
    # (2l + 1) chi_l, from the highest degree down.
    coefficients = jnp.moveaxis(moments * (2.0 * np.arange(terms) + 1.0), -1, 0)
    zero = jnp.zeros(jnp.broadcast_shapes(moments.shape[:-1], cosine.shape), coefficients.dtype)

    def step(state: tuple[Array, Array], item: tuple[Array, Array]):
        following, second = state
        order, coefficient = item
        return (
            coefficient
            + (2 * order + 1) / (order + 1) * cosine * following
            - (order + 1) / (order + 2) * second,
            following,
        ), None

    orders = jnp.arange(terms, dtype=coefficients.dtype)
    (value, _), _ = jax.lax.scan(step, (zero, zero), (orders, coefficients), reverse=True)
    return value


def delta_m(
    albedo: Float[Array, "*batch"],
    thickness: Float[Array, "*batch"],
    moments: Float[Array, "*batch terms"],
    terms: int,
) -> tuple[Array, Array, Array]:
    """Albedo, optical thickness and moments without the forward peak that ``terms`` terms cannot
    follow.

    The share chi_terms of the scattered light is taken to go on as if nothing had happened. Nothing
    changes where the phase function has no more than ``terms`` terms.

    Source: Wiscombe, J. Atmos. Sci. 34 (1977) 1408.
    """
    if moments.shape[-1] <= terms:
        return albedo, thickness, moments
    peak = moments[..., terms]
    # The rest of the phase function, normalised to one again.
    narrow = (moments[..., :terms] - peak[..., None]) / (1.0 - peak[..., None])
    return albedo * (1.0 - peak) / (1.0 - albedo * peak), (1.0 - albedo * peak) * thickness, narrow


def _known_under_jit(*values: Numbers) -> AbstractContextManager:
    """Computes at once what `jax.jit` would trace although it is known: only known moments give how
    many matter.
    """
    traced = any(isinstance(value, Tracer) for value in values)
    return nullcontext() if traced else jax.ensure_compile_time_eval()


def _terms(cosines: dict[str, Numbers], terms: int | None) -> int:
    """Number of moments to keep of functions with these mean cosines."""
    largest = 0.0
    for name, g in cosines.items():
        numbers = concrete(g)
        refuse(name, numbers, "between -1 and 1", lambda g: abs(g) < 1)
        if numbers is None and terms is None:
            raise ValueError(
                f"{name} is traced by jax.jit: give the number of terms, such as terms=64"
            )
        largest = max(
            largest, 0.0 if numbers is None else float(np.max(np.abs(numbers), initial=0.0))
        )
    if terms is not None:
        return terms
    if largest == 0.0:
        return 1
    # Moments g^l are negligible from this degree on.
    return min(_MOST_TERMS, 1 + int(np.ceil(np.log(_NEGLIGIBLE) / np.log(largest))))
