"""Both reflectances against values and closed forms that this program had no part in."""

import itertools
import json

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expn

from glazejax import stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.stack import split_hemispherical_reflectance, split_reflectance_factor
from tests.reference import isotropic_stacks
from tests.tolerances import BETWEEN_METHODS, CONSERVED, DTYPE, LAST_DIGITS, ROUNDING, within_reach

from ..checks import largest_difference
from ..slow import slow
from .cases import LAYERS, factor, flux, from_inside, random_cases, reference_cases

pytestmark = pytest.mark.optimised

NOTHING = 1e-15 if np.float64 == DTYPE else ROUNDING


def reference_runs():
    """Each method at its tolerances and indices; the usual index at one tolerance, the rest slow."""
    tolerances = {
        "ordinates": (1e-3, 1e-4, 1e-6, 1e-8),
        "auxiliary": (1e-3, 1e-4, 1e-6),
        "manyflux": (1e-3, 1e-8),
    }
    quick = ("ordinates", 1e-6, 1.5), ("auxiliary", 1e-3, 1.5), ("manyflux", 1e-8, 1.5)
    for method in tolerances:
        for tolerance, index in itertools.product(tolerances[method], (1.0, 1.33, 1.5, 1.7)):
            run = method, tolerance, index
            marks = [] if run in quick else [pytest.mark.slow]
            if tolerance >= 1e-6 and (method == "ordinates" or index == 1.5):
                marks.append(pytest.mark.single)
            yield pytest.param(*run, marks=marks)


def test_reference_values_were_carried_over_number_for_number(shared_reference):
    assert isotropic_stacks() == json.loads(
        (shared_reference / "isotropic_stacks.json").read_text()
    )


@pytest.mark.parametrize(("method", "tolerance", "index"), list(reference_runs()))
def test_reference_values_within_the_tolerance(method, tolerance, index):
    c = reference_cases()[index]
    # The slowest method is tried on at most three layers where it is quick.
    layers = 3 if (method, tolerance) == ("auxiliary", 1e-3) else LAYERS
    kept = np.all(c.optical_thickness[:, layers:] == 0, axis=1)
    tolerance = within_reach(tolerance)
    options: dict = {"refractive_index": index, "tolerance": tolerance, "method": method}
    stack = (
        c.albedo[:, :layers],
        c.optical_thickness[:, :layers],
        c.substrate_reflectance,
        c.cos_incidence,
    )
    least = (tolerance + c.uncertainty)[kept]
    for values, exact in (
        (factor(*stack, c.cos_viewing, **options), c.reflectance_factor),
        (flux(*stack, **options), c.hemispherical_reflectance),
    ):
        assert values.dtype == DTYPE
        assert np.all(np.abs(values - exact)[kept] <= least)


@pytest.mark.single
@pytest.mark.parametrize("hemispherical", [False, slow(True)])
def test_split_adds_up_and_agrees_between_methods(hemispherical):
    c = reference_cases()[1.5]
    thin = np.sum(c.optical_thickness > 0, axis=1) <= 2
    stack = c.albedo[thin, :2], c.optical_thickness[thin, :2], c.substrate_reflectance[thin]
    given: dict = {"cos_incidence": c.cos_incidence[thin], "tolerance": 1e-4}
    if not hemispherical:
        given["cos_viewing"] = c.cos_viewing[thin]
    whole = (stack_hemispherical_reflectance if hemispherical else stack_reflectance_factor)(
        *stack, **given
    )
    split = split_hemispherical_reflectance if hemispherical else split_reflectance_factor
    ours, theirs = split(*stack, **given), split(*stack, method="auxiliary", **given)
    assert largest_difference(sum(ours), whole) < ROUNDING
    for one, other in zip(ours, theirs, strict=True):
        assert largest_difference(one, other) < BETWEEN_METHODS
        assert np.all(one >= -NOTHING)


def h_function(mu, q):
    """Chandrasekhar's H: explicit integral for isotropic scattering (Stibbs & Weir, MNRAS 119,
    1959).
    """

    def integrand(t):
        return np.log1p(-q * t / np.tan(t)) / (np.cos(t) ** 2 + (mu * np.sin(t)) ** 2)

    return np.exp(
        -mu / np.pi * quad(integrand, 0, np.pi / 2, epsabs=1e-13, epsrel=1e-13, limit=200)[0]
    )


@pytest.mark.slow
@pytest.mark.single
def test_thick_layer_is_the_half_space_of_chandrasekhar():
    for q in (0.1, 0.6, 0.95, 0.999):
        for mu_i, mu_v in ((1.0, 0.3), (0.2, 0.7)):
            h_i, h_v = h_function(mu_i, q), h_function(mu_v, q)
            options: dict = {"refractive_index": 1.0, "tolerance": within_reach(1e-9)}
            stack = [q], [1e5], 0.7, mu_i
            exact = [q / 4 * h_i * h_v / (mu_i + mu_v), 1 - h_i * np.sqrt(1 - q)]
            values = [float(factor(*stack, mu_v, **options)), float(flux(*stack, **options))]
            assert values == pytest.approx(exact, abs=within_reach(2e-9))


@pytest.mark.single
@pytest.mark.parametrize(
    "index",
    [
        1.0,
        slow(1.33),
        1.5,
        slow(2.5),
    ],
)
def test_without_scattering_the_closed_form(index):
    for depth in (0.0, 0.03, 0.7, 4.0):
        for ground in (0.2, 1.0):
            mu_i, mu_v = 0.9, 0.4
            critical = np.sqrt(1 - 1 / index**2)

            def cone(mu, index=index, depth=depth):
                return mu * from_inside(mu, index) * np.exp(-2 * depth / mu)

            beyond = critical**2 * expn(3, 2 * depth / critical) if critical > 0 else 0.0
            again = 2 * (quad(cone, critical, 1, epsabs=1e-12, limit=200)[0] + beyond)
            inside = [np.sqrt(1 - (1 - mu**2) / index**2) for mu in (mu_i, mu_v)]
            enter = [1 - float(dielectric_reflectance(mu, index)) for mu in (mu_i, mu_v)]
            down = enter[0] * np.exp(-depth / inside[0]) * ground / (1 - ground * again)
            exact = down * enter[1] / index**2 * np.exp(-depth / inside[1])
            given = {"refractive_index": index, "cos_incidence": mu_i, "cos_viewing": mu_v}
            # Three layers that only absorb, one of them empty.
            split = [0.25 * depth, 0.0, 0.75 * depth]
            tolerance = within_reach(1e-8)
            found = stack_reflectance_factor(
                [0.0, 0.0, 0.0], split, ground, tolerance=tolerance, **given
            )
            assert found == pytest.approx(exact, abs=tolerance)


@pytest.mark.single
@pytest.mark.parametrize("index", [1.5, *(slow(n) for n in (1.0, 2.5))])
def test_nothing_is_lost_without_absorption(index):
    for depth in (0.0, 1e-12, 0.3, 5.0, 1e3, 1e6):
        for cos in (1e-4, 0.3, 1.0):
            given = {"refractive_index": index, "cos_incidence": cos, "tolerance": 1e-4}
            flux = stack_hemispherical_reflectance([1.0, 1.0], [depth, 0.5], 1.0, **given)
            assert flux + dielectric_reflectance(cos, index) == pytest.approx(1.0, abs=CONSERVED)


def conservative_stacks(layers: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light that is only scattered, over four grounds, in layers of equal parts of a thickness up
    to 1e6.
    """
    thickness, ground = np.meshgrid([1e-3, 1.0, 1e2, 1e3, 1e4, 1e6], [0.0, 0.2, 0.9, 1.0])
    parts = np.repeat(thickness.reshape(-1, 1) / layers, layers, axis=1)
    return np.ones_like(parts), parts, ground.ravel()


@pytest.mark.single
@pytest.mark.slow
@pytest.mark.parametrize("layers", [2, 3])
def test_opaque_layers_that_absorb_nothing_are_as_one(layers):
    """Nothing of the size of the thickness cancels, which no rounding would survive."""
    given: dict = {"cos_incidence": 0.7, "tolerance": 1e-4}
    whole, cut = (stack_reflectance_factor(*conservative_stacks(n), **given) for n in (1, layers))
    assert largest_difference(cut, whole) < ROUNDING
    # Without a ground that takes light, no surface and a half space: H at an albedo of one.
    mu = 0.7
    found = stack_reflectance_factor(
        np.ones(layers),
        np.full(layers, 1e6),
        1.0,
        refractive_index=1.0,
        cos_incidence=mu,
        cos_viewing=mu,
    )
    assert found == pytest.approx(h_function(mu, 1.0) ** 2 / (8 * mu), abs=1e-5)


@pytest.mark.slow
@pytest.mark.single
def test_reciprocity():
    q, d, ground, ci, cv = random_cases(200, seed=1)
    for tolerance in (1e-3, within_reach(1e-8)):
        there = factor(q, d, ground, ci, cv, tolerance=tolerance)
        back = factor(q, d, ground, cv, ci, tolerance=tolerance)
        assert largest_difference(there, back) < ROUNDING


@pytest.mark.single
def test_splitting_a_layer_or_inserting_an_empty_one_changes_nothing():
    rng = np.random.default_rng(2)
    q, d = rng.uniform(0, 1, (100, 2)), 10 ** rng.uniform(-2, 1, (100, 2))
    ground, cos = rng.uniform(0, 1, 100), rng.uniform(0.05, 1, 100)
    share = rng.uniform(0, 1, 100)
    (upper, lower), (above, below) = q.T, d.T
    split = [upper, upper, lower], [share * above, (1 - share) * above, below]
    empty = [upper, share, lower], [above, 0 * above, below]
    given = {"cos_incidence": cos, "tolerance": 1e-4}
    for solve in (stack_reflectance_factor, stack_hemispherical_reflectance):
        whole = solve(q, d, ground, **given)
        for albedos, depths in (split, empty):
            found = solve(np.transpose(albedos), np.transpose(depths), ground, **given)
            assert largest_difference(found, whole) < ROUNDING


@pytest.mark.single
def test_thin_layer_keeps_its_relative_accuracy():
    # Single scattering of a thin layer over black: T T q D a b/(4 n^2), a and b the slant factors
    # inside.
    for depth in (1e-4, 1e-10, 1e-14):
        found = stack_reflectance_factor([0.8], [depth], 0.0, refractive_index=1.5)
        exact = 0.96**2 * 0.8 * depth / (4 * 1.5**2)
        assert found == pytest.approx(exact, rel=max(within_reach(1e-9), 20 * depth))


@pytest.mark.single
def test_no_layers_is_the_bare_ground():
    ground = np.array([0.0, 0.5, 1.0])
    bare = stack_reflectance_factor(np.zeros((3, 0)), np.zeros((3, 0)), ground)
    thin = stack_reflectance_factor([0.5], [0.0], ground)
    assert bare[0] == 0
    # Two programs: in single precision a processor may round the sums of one in another order.
    two_programs = LAST_DIGITS if np.float64 == DTYPE else ROUNDING
    assert largest_difference(bare, thin) < two_programs
    assert stack_reflectance_factor(np.zeros((3, 0)), np.zeros((3, 0)), 0.5).shape == (3,)
