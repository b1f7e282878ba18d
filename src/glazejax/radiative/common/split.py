"""Split by what the light seen from outside did last: the three parts of a reflectance factor."""

from typing import NamedTuple

from jaxtyping import Array, Float


class Split(NamedTuple):
    """Parts of the reflectance factor, each (...), in the same units; their sum is the whole.

    With omega-(mu, 0) the light that reaches the surface from below, every part is
    (pi/n^2) T(mu_F)/mu times its share of omega- (paper A, eqs (22), (32)-(33)):

    - ``ground``: (rho/pi) B mu exp(-h/mu), light that the ground reflected and nothing scattered
      after; it may have been scattered in the layers before it came to the ground.
    - ``single``: 1/2 int_0^h q(s) g(s) exp(-s/mu) ds, light of the beam scattered once, with
      g(s) = T(mu_I) exp(-s/mu_0)/(2 pi mu_0) (eq. (4)).
    - ``multiple``: 1/2 int_0^h q(s) f(s) exp(-s/mu) ds, diffuse light scattered once more; f (eq.
      (3)) includes what the ground and the surface sent back into the layers.
    """

    ground: Float[Array, "..."]
    single: Float[Array, "..."]
    multiple: Float[Array, "..."]
