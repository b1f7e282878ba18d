"""The equations of docs/physics.md, solved here as they are printed by textbook means, give what
the program gives.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

import glazefit
from glazejax import (
    Instrument,
    stack_hemispherical_reflectance,
    stack_reflectance_factor,
)

PAGE = (Path(__file__).parents[1] / "docs" / "physics.md").read_text("utf-8")
INDEX = 1.5
# As printed. Who changes one on the page changes what `solved` and the tests below do, and then
# this list.
PRINTED = {
    "depth": r"D = (k + s)\, d, \qquad q = \frac{s}{k + s}.",
    "mixing": r"k = \sum_i c_i k_i, \qquad s = \sum_i c_i s_i.",
    "transfer": r"\mu \frac{\partial L}{\partial \tau} = L(\tau, \mu) - "
    r"\frac{q}{2} \int_{-1}^{1} L(\tau, \mu')\, d\mu' - \frac{q E}{4 \pi \mu_0} e^{-\tau / \mu_0}.",
    "critical": r"R(\mu) = 1 \quad \text{for} \quad \mu \le \mu_c = \sqrt{1 - 1/n^2}.",
    "top": r"L(0, -\mu) = R(\mu)\, L(0, \mu),",
    "out": r"L_{out}(\theta) = \frac{1 - R(\mu)}{n^2}\, L(0, \mu).",
    "ground": r"L(\tau_b, \mu) = \frac{\rho}{\pi} F, \qquad "
    r"F = 2\pi \int_0^1 L(\tau_b, -\mu')\, \mu'\, d\mu' + E\, e^{-\tau_b / \mu_0}.",
    "card": r"R_{bare} = R_s + (1 - R_s) \frac{(1 - r)\, \rho}{1 - r \rho}.",
    "readings": r"R_F = \frac{\pi L_{out}}{E_{in}}, \qquad R_H = \frac{F_{out}}{F_{in}}.",
}


def test_the_page_prints_these():
    found = re.findall(r"\$\$\n(.*?)\$\$ \((\w+)\)", PAGE, re.DOTALL)
    assert {label: " ".join(words.split()) for words, label in found} == PRINTED


def fresnel(mu):
    """R(mu) from inside, unpolarised; 1 beyond the critical angle."""
    outside = INDEX * np.sqrt(1 - mu**2)
    air = np.sqrt(1 - np.clip(outside, 0, 1) ** 2)
    across = ((INDEX * mu - air) / (INDEX * mu + air)) ** 2
    along = ((mu - INDEX * air) / (mu + INDEX * air)) ** 2
    return np.where(outside < 1, (across + along) / 2, 1.0)


def half_range(count: int):
    """Cosines and weights on both sides of the critical angle; on the inner one even in the cosine
    outside.
    """
    x, w = (values / 2 for values in leggauss(count))
    x = x + 0.5
    critical = np.sqrt(1 - 1 / INDEX**2)
    within = np.sqrt(1 - (1 - x**2) / INDEX**2)
    return np.r_[critical * x**2, within], np.r_[2 * w * critical * x, w * x / (INDEX**2 * within)]


def solved(q: float, depth: float, ground: float, light: float, view: float) -> tuple[float, float]:
    """Reflectance factor and hemispherical reflectance of one layer: equations transfer to
    readings, dense.
    """
    mu, w = half_range(20)
    inside, seen = (np.sqrt(1 - (1 - cosine**2) / INDEX**2) for cosine in (light, view))
    mu, w = np.r_[mu, seen], np.r_[w, 0.0]  # the view is a direction of no weight
    n, reflected = len(mu), fresnel(mu)
    both, weights = np.r_[mu, -mu], np.r_[w, w]
    beam = 1 - float(fresnel(np.array(inside)))  # E, of E_in = 1
    # Transfer: dL/dtau = A L - b exp(-tau/mu_0).
    matrix = (np.eye(2 * n) - q / 2 * weights) / both[:, None]
    own = np.linalg.solve(-np.eye(2 * n) / inside - matrix, -q * beam / (4 * np.pi * inside) / both)
    rates, vectors = (np.real(values) for values in np.linalg.eig(matrix))
    above, below = (
        vectors * np.exp(rates * (t - np.where(rates > 0, depth, 0.0))) for t in (0.0, depth)
    )
    left = np.exp(-depth / inside)
    # Top and ground.
    flux = 2 * np.pi * mu * w
    rows = np.r_[
        above[n:] - reflected[:, None] * above[:n], below[:n] - ground / np.pi * (flux @ below[n:])
    ]
    known = np.r_[
        reflected * own[:n] - own[n:],
        ground / np.pi * (flux @ own[n:] * left + beam * left) - own[:n] * left,
    ]
    up = (above @ np.linalg.solve(rows, known) + own)[:n]
    out = (1 - reflected) / INDEX**2 * up
    return np.pi * out[-1], float(flux @ ((1 - reflected) * up))


@pytest.mark.parametrize(
    "case", [(0.9, 1.3, 0.8, 0.7, 1.0), (0.5, 0.4, 0.2, 1.0, 0.5), (0.99, 5.0, 0.93, 0.9, 0.3)]
)
def test_the_program_solves_them(case):
    q, depth, ground, light, view = case
    factor = stack_reflectance_factor(
        [q], [depth], ground, cos_incidence=light, cos_viewing=view, tolerance=1e-9
    )
    flux = stack_hemispherical_reflectance(
        [q], [depth], ground, cos_incidence=light, tolerance=1e-9
    )
    assert (float(factor), float(flux)) == pytest.approx(solved(*case), abs=2e-9)


def said(words: str) -> float:
    """The number in the one group of a pattern, which the page must hold."""
    found = re.search(words, " ".join(PAGE.split()))
    assert found, f"the page no longer says {words}"
    return float(found[1])


def test_numbers_of_the_surface_and_the_card():
    critical = np.sqrt(1 - 1 / INDEX**2)
    mu, w = half_range(200)
    back = 2 * np.sum(w * mu * fresnel(mu))
    assert said(r"\\mu_c = ([\d.]+)\$") == pytest.approx(critical, abs=5e-4)
    assert said(r"(\d+) % of diffuse light is reflected back") == pytest.approx(100 * back, abs=0.5)
    assert said(r"\$r\$ is ([\d.]+),") == pytest.approx(back, abs=5e-4)
    outer = Instrument.parse("d:8").seen_surface
    assert said(r"\$R_s\$ at 8° is ([\d.]+)\.") == pytest.approx(outer, abs=5e-4)
    inside = float(glazefit.ground_from_air(np.array(0.84)))
    assert outer + (1 - outer) * (1 - back) * inside / (1 - back * inside) == pytest.approx(
        0.84, abs=1e-6
    )
    assert said(r"A bare reading of 84 % \(`d:8`\) is \$\\rho\$ = ([\d.]+)") == pytest.approx(
        inside, abs=0.005
    )


def test_kubelka_munks_numbers():
    """That the program follows them, `tests/radiative/test_twoflux.py` says."""
    assert r"$K = 2k$ and $S \approx 3s(1 - g)/4$" in " ".join(PAGE.split())
