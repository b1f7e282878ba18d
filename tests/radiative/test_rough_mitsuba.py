"""Single facets against Mitsuba's `roughdielectric`: pointwise what is reflected, in moments what
goes through.

The moments are integrals over directions of what Mitsuba's `eval` says, in a process of its own: a
variant of Mitsuba is set once for all.
"""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from glazejax.radiative import rough
from glazejax.radiative.rough.facets import scatter

from ..fresh import run_python
from ..slow import slow

pytestmark = pytest.mark.skipif(find_spec("mitsuba") is None, reason="needs mitsuba")

ASKED = """
import json, sys
import numpy as np
import mitsuba as mi
mi.set_variant("scalar_rgb")
roughness, index, cosine = json.loads(sys.argv[1])
bsdf = mi.load_dict({"type": "roughdielectric", "distribution": "ggx", "alpha": roughness, "int_ior": index,
                     "ext_ior": 1.0})
context = mi.BSDFContext()
context.mode = mi.TransportMode.Importance
si = mi.SurfaceInteraction3f()
y, w = np.polynomial.legendre.leggauss(48)
z, zw = np.polynomial.legendre.leggauss(24)
azimuths, aw = np.pi * 0.5 * (z + 1), np.pi * zw  # both halves
cosines, cw = 0.5 * (y + 1), 0.5 * w
out = {}
for side in (1.0, -1.0):
    si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, side * cosine)
    for up in (1.0, -1.0):
        moments = np.zeros(3)
        for c, weight in zip(cosines, cw):
            s = np.sqrt(1 - c * c)
            values = [bsdf.eval(context, si, mi.Vector3f(float(-s * np.cos(a)), float(s * np.sin(a)), up * float(c)))[0]
                      for a in azimuths]
            moments += weight * float(aw @ np.array(values)) * c ** np.arange(3)
        out[f"{side:g} {up:g}"] = moments.tolist()
si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, cosine)
points = [(c, a) for c in (0.1, 0.5, 0.95) for a in (0.0, 60.0, 180.0)]
out["points"] = []
for c, a in points:
    s, t = np.sqrt(1 - c * c), np.deg2rad(a)
    value = bsdf.eval(context, si, mi.Vector3f(float(-s * np.cos(t)), float(s * np.sin(t)), c))[0]
    out["points"].append([c, a, np.pi * value / c])
print(json.dumps(out))
"""


@pytest.mark.parametrize(
    ("roughness", "index", "cosine"),
    [(0.3, 1.5, 0.7), slow(0.2, 1.7, 0.5)],
)
def test_single_facets_are_those_of_mitsuba(roughness, index, cosine):
    run = run_python(ASKED, json.dumps([roughness, index, cosine]))
    theirs = json.loads(run.stdout.splitlines()[-1])
    for side, name in ((False, "1"), (True, "-1")):
        found = scatter(np.array([cosine]), roughness, index, (16, 16), from_paint=side)
        events = {name: (found.reflected, found.reflected_share)}
        events[{"1": "-1", "-1": "1"}[name]] = (found.refracted, found.refracted_share)
        for to, (cosines, shares) in events.items():
            ours = [float(np.sum(shares * np.maximum(cosines, 0.0) ** k)) for k in range(3)]
            # What goes through ends abruptly where facets would have to stand upright, and from
            # inside there is a root at the critical angle: this plain rule over directions meets
            # both.
            smooth = not side and cosines is found.reflected
            assert np.allclose(ours, theirs[f"{name} {to}"], atol=2e-4 if smooth else 2e-3), (
                name,
                to,
            )
    given = {"roughness": roughness, "refractive_index": index}
    for viewing, azimuth, factor in theirs["points"]:
        ours = rough.surface_reflectance_factor(cosine, viewing, azimuth, **given)
        lost = rough.surface_loss(cosine, **given) * rough.surface_loss(viewing, **given)
        single = float(ours - np.pi * lost / rough.loss_constant(**given))
        assert abs(single - factor) < 1e-5 * max(1.0, factor)
