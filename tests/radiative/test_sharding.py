"""A batch that is split over devices stays split, value and gradient, and devices say nothing to
each other; four of them are made of one processor.
"""

import pytest

from ..fresh import run_python
from ..slow import slow

_RUN = """
import sys
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec
import glazejax as gj

jax.config.update("jax_enable_x64", True)
axes = getattr(AxisType, sys.argv[1])
mesh = jax.make_mesh((4,), ("stacks",), axis_types=(axes,))

def split(array):
    return jax.device_put(array, NamedSharding(mesh, PartitionSpec("stacks")))

def check(function, arrays):
    program = jax.jit(function).lower(*map(split, arrays)).compile()
    found = program(*map(split, arrays))
    for one, other in zip(*map(jax.tree.leaves, (found, function(*arrays))), strict=True):
        assert one.sharding.spec[0] == "stacks", one.sharding
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    words = program.as_text()
    for told in ("all-gather", "all-reduce", "all-to-all", "collective-permute"):
        assert told not in words, told

rng = np.random.default_rng(0)
count = 8 if sys.argv[2] == "glaze" else 1024  # more than a chunk
if sys.argv[2] == "glaze":
    paints = gj.catalogue.load()
    blue, white = paints["CobaltBlue"], paints["ZincWhite"]

    def function(thickness):
        glaze = gj.Glaze([gj.Layer(blue, thickness), gj.Layer(white, 1e-5)], 0.6)
        return gj.reflectance(glaze, "d:8")

    arrays = [jnp.asarray(rng.uniform(1e-6, 1e-5, count))]
else:
    function = gj.stack_reflectance_factor
    layers = rng.uniform(0.1, 0.9, (2, count, 2))
    arrays = [*map(jnp.asarray, layers), jnp.asarray(rng.uniform(0, 1, count))]
if sys.argv[3] == "value":
    check(function, arrays)
elif sys.argv[3] == "closed over":
    first, *arrays = arrays
    lies_there = split(first)

    def rest(depth, ground):
        traced = isinstance(depth, jax.core.Tracer)
        return function(lies_there if traced else first, depth, ground)

    check(rest, arrays)
else:
    check(jax.grad(lambda *a: jnp.sum(function(*a)), argnums=tuple(range(len(arrays)))), arrays)
print("done")
"""


@pytest.mark.parametrize("axes", ["Explicit", "Auto"])
@pytest.mark.parametrize(
    ("what", "asked"),
    [
        ("stacks", "value"),
        ("glaze", "value"),
        ("stacks", "closed over"),
        slow("stacks", "gradient"),
        slow("glaze", "gradient"),
    ],
)
def test_a_batch_split_over_devices_stays_split(axes, what, asked):
    flags = (
        "--xla_force_host_platform_device_count=4 --xla_cpu_use_fusion_emitters=false "
        "--xla_backend_optimization_level=0"
    )
    given = {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    assert run_python(_RUN, axes, what, asked, env=given).stdout == "done\n"
