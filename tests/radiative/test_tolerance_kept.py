"""The error is below the tolerance that was asked for: by each method, in both precisions, with few
layers and many, over the range of the index and of the phase function.

Each test is of the worst of stacks of all kinds. A method is measured against another one that
shares no approximation with it, or against its own finer runs where no other can follow.
"""

import jax
import numpy as np
import pytest
from benchmarks.peers.ours import CONVERGED

from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.common.rounding import FINEST_SINGLE
from glazejax.radiative.common.stack_arrays import StackArrays
from glazejax.radiative.manyflux.reflectance import manyflux_reflectance_factor
from glazejax.radiative.ordinates import solver

from ..checks import largest_difference
from .cases import factor, stacks_of_all_kinds

pytestmark = [pytest.mark.optimised, pytest.mark.slow]

INDICES = [1.0, 1.02, 1.5, 2.0, 2.5]


@pytest.mark.parametrize("index", [1.0, 1.5])
def test_the_finest_tolerance_against_more_directions(index):
    stacks = stacks_of_all_kinds(200, 0.05)

    @jax.jit
    def converged(albedo, depth, ground, light, view):
        stack = StackArrays(
            albedo=albedo,
            optical_thickness=depth,
            ground=ground,
            refractive_index=index,
            cos_incidence=light,
            cos_viewing=view,
        )
        return solver.reflectance(stack, CONVERGED[index])

    found = factor(*stacks, refractive_index=index, tolerance=1e-10)
    assert largest_difference(found, converged(*stacks)) < 1e-10


@pytest.mark.parametrize(
    ("count", "how", "stacks", "finer"),
    [
        (24, {}, {"layers": 40, "thickest": 1.0}, 1e-6),
        (24, {}, {"layers": 200, "thickest": 1.0}, 1e-6),
        # Thin layers that absorb, over one that does not and is opaque, are the worst here too.
        (60, {"method": "auxiliary"}, {}, 1e-5),
        (60, {"method": "manyflux"}, {}, 1e-5),
    ],
    ids=["40 layers", "200 layers", "auxiliary", "manyflux"],
)
@pytest.mark.parametrize("index", [1.0, 1.5, 2.5])
def test_many_layers_and_other_methods_against_the_default(index, count, how, stacks, finer):
    cases = stacks_of_all_kinds(count, 0.05, **stacks)
    exact = factor(*cases, refractive_index=index, tolerance=1e-10)
    for tolerance in (1e-3, finer):
        found = factor(*cases, refractive_index=index, tolerance=tolerance, **how)
        assert largest_difference(found, exact) < tolerance


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("tolerance", [1e-3, FINEST_SINGLE])
def test_single_precision(index, tolerance):
    """Against double precision for the same numbers: what rounding a number of the input to single
    precision changes is no error of the solver.
    """
    rounded = [np.float32(part) for part in stacks_of_all_kinds(200, 0.05)]
    with jax.enable_x64(False):
        found = np.asarray(factor(*rounded, refractive_index=index, tolerance=tolerance))
    assert found.dtype == np.float32
    with jax.enable_x64(True):
        exact = factor(*map(np.float64, rounded), refractive_index=index, tolerance=1e-10)
    assert largest_difference(found, exact) < tolerance


@pytest.mark.parametrize("g", [-0.9, -0.5, 0.5, 0.8])
@pytest.mark.parametrize("index", [1.0, 1.5])
def test_phase_functions_against_a_finer_run(index, g):
    *stack, light, view = stacks_of_all_kinds(12, 0.3)
    # A finer run of a sharp peak takes a minute; nearer to one there are not enough directions.
    finer = 1e-4 if abs(g) > 0.8 else 1e-5
    given = {
        "phase": henyey_greenstein(g),
        "refractive_index": index,
        "cos_incidence": light,
        "cos_viewing": view,
        "azimuth": np.linspace(0.0, 180.0, 12),
    }
    exact = manyflux_reflectance_factor(*stack, tolerance=finer, **given)
    found = manyflux_reflectance_factor(*stack, tolerance=1e-3, **given)
    assert largest_difference(found, exact) < 1e-3 - finer
