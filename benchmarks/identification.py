"""Identification of other people's paints and across shades and cards; and its speed.

    python -m benchmarks.identification [--device gpu] [--out FOLDER]

Films left out of a fit, with known truth, are in `benchmarks.truth`. Kimera masstones and the RRT panel are
other paints, measured with other instruments. HypPigments: three shades of each of 398 patches are known, the fourth is
sought; and the same pigment on another card. The bar is the nearest spectral angle.
"""

import argparse
import time

import numpy as np

from benchmarks import device
from benchmarks.identification_sets import hyppigments, hyppigments_across_cards, kimera, rrt
from benchmarks.results import Results, add_option
from benchmarks.timing import environment
from glazefit import Noise, identify
from glazefit.film.response import film_response
from glazejax import Hemispherical, catalogue
from glazejax.commands.main import start_jax

UNIT = 25e-6


def family(recipe: dict[str, float]) -> dict[str, float]:
    """Fractions by pigment."""
    out: dict[str, float] = {}
    for paint, share in recipe.items():
        name = catalogue.family(paint)
        out[name] = out.get(name, 0.0) + share
    return out


def speed(results: Results, count: int = 1000) -> None:
    """A thousand spectra against all pairs of twenty paints."""
    paints = list(catalogue.load().values())
    rng = np.random.default_rng(1)
    k, s = (np.stack([np.asarray(getattr(p, what)) for p in paints]) * UNIT for what in ("absorption", "scattering"))
    weights = rng.dirichlet(np.ones(2), count)
    pair = np.array([rng.choice(len(paints), 2, replace=False) for _ in range(count)])
    kd, sd = (np.einsum("nm,nmb->nb", weights, a[pair]) for a in (k, s))
    grounds = np.array([[0.025], [0.93]]) * np.ones((2, kd.shape[1]))
    body = film_response(Hemispherical()).body(kd[:, None], sd[:, None], grounds)
    noise = Noise()
    spectra = np.asarray(body) + 0.04
    spectra = np.clip(spectra + noise.sd(spectra) * rng.standard_normal(spectra.shape), 0, 1)
    for words in ("compilation included", "again"):
        began = time.perf_counter()
        found = identify(spectra, paints[0].wavelengths, paints, grounds=grounds, max_paints=2)
        results(f"{count} spectra, pairs of {len(paints)} paints: {time.perf_counter() - began:.1f} s ({words})")
    right = [set(m[m >= 0].tolist()) == set(p.tolist()) for m, p in zip(found.members[:, 0], pair, strict=True)]
    results(f"  both paints right: {np.mean(right):.1%} (no error of the model; fractions down to 0)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    device.add_option(parser)
    options = parser.parse_args()
    chosen = device.start(options.device)
    start_jax()
    results = Results(device.file_name("identification", options.device), options.out)
    results(environment())
    results(device.words(chosen))
    results()
    for part in (speed, kimera, rrt, hyppigments, hyppigments_across_cards):
        part(results)
        results()
    results.save()


if __name__ == "__main__":
    main()
