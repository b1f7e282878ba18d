"""Blind identification of films left out of the fit, of other people's paints, and across shades; and its speed.

    python -m benchmarks.identification [--out FOLDER]

Every film of the revigo set whose paints remain known without it is left out of a joint fit of all the others; its
paints are then sought among all singles, pairs and triples of that fit's twenty. A second look at all films uses the
catalogue that ships, in which they take part. Kimera masstones and the RRT panel are
other paints, measured with other instruments. HypPigments: three shades of each of 398 patches are known, the fourth is
sought; the bar is the nearest spectral angle.
"""

import argparse
import itertools
import time
from typing import NamedTuple

import numpy as np

from benchmarks.identification_sets import hyppigments, kimera, rrt
from benchmarks.measured import measured_data
from benchmarks.results import Results, add_option
from benchmarks.timing import environment
from glazefit import Noise, identify, identify_films
from glazefit.film.readers import read_films, read_names
from glazefit.film.response import film_response
from glazefit.recover.crossvalidation import without
from glazefit.recover.joint import recover_jointly
from glazejax import Hemispherical, catalogue
from glazejax.commands.main import start_jax

UNIT = 25e-6
BINS = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0001)


class Found(NamedTuple):
    """One film."""

    name: str
    truth: dict[str, float]
    best: dict[str, float]
    words: str
    probability: float
    true_probability: float
    rmse: float
    none: float
    rank: float  # of the first explanation by the right pigments, from 0; infinite if there is none
    right_rmse: float  # the least of theirs
    chances: np.ndarray  # (paints, 2): probability, and whether it is there


def family(recipe: dict[str, float]) -> dict[str, float]:
    """Fractions by pigment."""
    out: dict[str, float] = {}
    for paint, share in recipe.items():
        name = catalogue.family(paint)
        out[name] = out.get(name, 0.0) + share
    return out


def left_out(results: Results, out: list[Found]) -> None:
    """Every film of the revigo set, unless it is the only one of a paint, added to `out`."""
    folder = measured_data("revigo")
    films, recipes = read_films(folder / "reflectance.tsv"), read_names(folder / "mixtures.tsv")
    whole = recover_jointly(films, recipes)
    count = (whole.shares > 0).sum(axis=0)
    for row, name in enumerate(films.names):
        if (count[whole.shares[row] > 0] < 2).any():
            continue
        rest = without(whole, films, recipes, row)
        pigments = [rest.pigment(paint, UNIT) for paint in rest.paints]
        out.append(_look(name, identify_films(films.take([row]), pigments), recipes[name]))
        found = out[-1]
        results(
            f"{name}  {_text(found.truth):<44} -> {found.words}  (P {found.probability:.2f}, RMSE {found.rmse:.4f})"
        )


def known() -> list[Found]:
    """The same films with the catalogue that ships, which was fitted to them: what errors of the fit do not explain."""
    folder = measured_data("revigo")
    films, recipes = read_films(folder / "reflectance.tsv"), read_names(folder / "mixtures.tsv")
    together = identify_films(films, list(catalogue.load().values()))
    return [_look(name, together, recipes[name], row) for row, name in enumerate(films.names)]


def _look(name: str, found, recipe: dict[str, float], row: int = 0) -> Found:
    truth = {paint: share / sum(recipe.values()) for paint, share in recipe.items() if share > 0}
    ranked = found.ranked(row)
    first = ranked[0]
    pigments = set(family(truth))
    right = [rank for rank, c in enumerate(ranked) if set(family(dict.fromkeys(c.paints, 1.0))) == pigments]
    return Found(
        name,
        truth,
        dict(zip(first.paints, first.fractions.tolist(), strict=True)),
        first.words if found.explained[row] else f"nothing; first {first.words}",
        first.probability,
        sum(c.probability for c in ranked if set(c.paints) == set(truth)),
        first.rmse,
        float(found.none[row]),
        min(right, default=np.inf),
        min((ranked[rank].rmse for rank in right), default=float("nan")),
        np.array([[p, paint in truth] for p, paint in zip(found.paint_probability[row], found.paints, strict=True)]),
    )


def _text(recipe: dict[str, float]) -> str:
    return " + ".join(f"{100 * share:.3g} {paint}" for paint, share in recipe.items())


def summary(found: list[Found], results: Results, words: str) -> None:
    """Shares of films that are right, errors of fractions, and the reliability of the probabilities."""

    def share(right: list[bool]) -> str:
        return f"{np.mean(right):.1%} of {len(right)}"

    def big(recipe: dict[str, float]) -> set[str]:
        return {paint for paint, part in family(recipe).items() if part >= 0.05}

    results()
    results(words)
    results(f"exactly these paints              {share([set(f.best) == set(f.truth) for f in found])}")
    results(f"these pigments, media aside       {share([set(family(f.best)) == set(family(f.truth)) for f in found])}")
    results(f"pigments of 5 % or more           {share([big(f.best) == big(f.truth) for f in found])}")
    results(f"these among the first three       {share([f.rank < 3 for f in found])}")
    off = [abs(family(f.best).get(p, 0.0) - part) for f in found for p, part in family(f.truth).items()]
    results(f"error of a weight fraction, mean  {np.mean(off):.3f} (median {np.median(off):.3f})")
    rmse = np.nanquantile([f.right_rmse for f in found], [0.5, 0.95])
    results(f"RMSE of the right pigments        {rmse[0]:.4f} in the median, {rmse[1]:.4f} for 19 in 20")
    results(f"mean probability of the first     {np.mean([f.probability for f in found]):.2f}")
    results("probability of a paint, stated -> found (count):")
    for low, high, stated, seen, n in reliability(found):
        results(f"  {low:.2f}-{min(high, 1.0):.2f}   {stated:.3f} -> {seen:.3f}  ({n})")


def reliability(found: list[Found]) -> list[tuple[float, float, float, float, int]]:
    """Stated and found frequency of paints, in bins of what was stated."""
    chances = np.concatenate([f.chances for f in found])
    out = []
    for low, high in itertools.pairwise(BINS):
        here = (chances[:, 0] >= low) & (chances[:, 0] < high)
        if here.any():
            out.append((low, high, float(chances[here, 0].mean()), float(chances[here, 1].mean()), int(here.sum())))
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


def draw(found: list[Found]):
    """Reliability of the probabilities."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 5), layout="constrained")
    axis = figure.subplots()
    rows = reliability(found)
    stated, seen, n = (np.array([row[i] for row in rows]) for i in (2, 3, 4))
    error = np.sqrt(np.maximum(seen * (1 - seen), 0.25 / n) / n)
    axis.plot([0, 1], [0, 1], ":", color="0.6")
    axis.errorbar(stated, seen, error, fmt="o-", color="#08519c", capsize=3)
    for x, y, count in zip(stated, seen, n, strict=True):
        axis.annotate(f"{count:.0f}", (x, y), xytext=(5, -10), textcoords="offset points", fontsize=8)
    axis.set(xlabel="stated probability of a paint", ylabel="share of cases in which it is there", xlim=(-0.03, 1.03))
    axis.set(ylim=(-0.03, 1.03), title="films left out of the fit", aspect="equal")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    options = parser.parse_args()
    start_jax()
    results = Results("identification", options.out)
    results(environment())
    results()
    for part in (speed, kimera, rrt, hyppigments):
        part(results)
        results()
    found: list[Found] = []
    try:
        left_out(results, found)
    except KeyboardInterrupt:
        results("interrupted: the films above are all")
    summary(found, results, "FILMS LEFT OUT")
    summary([f for f in found if len(f.truth) > 1], results, "TINTS AND SHADES AMONG THEM")
    summary(known(), results, "ALL FILMS WITH THE CATALOGUE, which was fitted to them")
    results.save(draw(found))


if __name__ == "__main__":
    main()
