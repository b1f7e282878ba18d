"""Films left out in turn, predicted from their weights with only the thickness free: this model and Kubelka-Munk's.

    python -m benchmarks.prediction [--out FOLDER]

Every tint and shade of the measured films (revigo) is left out of a joint fit of all the others and then predicted.
Both models go through the same fit, with the same instrument and expectations; only what one film reflects differs.
Then the mixing laws are compared the same way.
"""

import argparse
import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.measured import measured_data
from benchmarks.results import Results, add_option
from benchmarks.timing import environment
from glazefit.films import Films, Instrument
from glazefit.joint import recover_jointly
from glazefit.joint_result import JointRecovery
from glazefit.km import KubelkaMunk
from glazefit.mixing import MixingLaw
from glazefit.prediction import predict_films
from glazefit.readers import read_films, read_names
from glazejax.cli import start_jax
from glazejax.colour import delta_e_2000, lab

REFIT_STEPS = 15


@dataclasses.dataclass(frozen=True)
class Scores:
    """CIEDE2000 (D65, 10 degrees) over black and white of each film, fitted with all and predicted when left out."""

    films: tuple[str, ...]
    fitted: np.ndarray
    predicted: np.ndarray
    seconds: float
    warm: float


def difference(wavelengths: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """CIEDE2000 for D65 and the 10 degree observer."""
    of = [np.asarray(lab(wavelengths, spectra, illuminant="D65", observer=10)) for spectra in (first, second)]
    return np.asarray(delta_e_2000(*of))


def leave_out(
    films: Films, recipes: dict[str, dict[str, float]], progress: Callable[[str], None], **given: Any
) -> Scores:
    """Fit all films, then leave out every mixture in turn."""
    began = time.perf_counter()
    whole = recover_jointly(films, recipes, **given)
    seconds = time.perf_counter() - began
    began = time.perf_counter()
    recover_jointly(films, recipes, **given)
    warm = time.perf_counter() - began
    mixtures = [row for row, name in enumerate(films.names) if len(recipes[name]) > 1]
    predicted = []
    for row in mixtures:
        progress(films.names[row])
        rest = without(whole, films, recipes, row, **given)
        (found,) = predict_films(rest, films.take([row]), recipes, response=given.get("response"))
        spectra = np.stack([found.over_black, found.over_white])
        measured = np.stack([films.over_black[row], films.over_white[row]])
        predicted.append(difference(films.wavelengths, spectra, measured))
    names = tuple(films.names[row] for row in mixtures)
    return Scores(names, whole.delta_e()[mixtures], np.array(predicted), seconds, warm)


def without(
    whole: JointRecovery, films: Films, recipes: dict[str, dict[str, float]], row: int, **given: Any
) -> JointRecovery:
    """The fit without one film; it starts where the whole ended, but knows nothing of that film."""
    use = np.ones(len(films))
    use[row] = 0.0
    start = whole.unknowns._replace(films=whole.unknowns.films * use[:, None])
    return recover_jointly(films, recipes, use=use, start=start, max_steps=REFIT_STEPS, **given)


def table(scores: dict[str, Scores], recipes: dict[str, dict[str, float]]) -> str:
    """Means over films of several kinds, and every film."""
    some = next(iter(scores.values()))
    eosin = np.array(["Eosin" in " ".join(recipes[name]) for name in some.films])
    shade = np.array([min(recipes[name], key=lambda paint: recipes[name][paint]) == "BoneBlack" for name in some.films])
    kinds = {
        "all": np.ones(len(eosin), bool),
        "without eosins": ~eosin,
        "tints": ~shade,
        "shades": shade,
    }
    lines = ["mean Delta E00 (D65, 10 deg), both cards      " + "".join(f"{name:>24}" for name in scores)]
    lines.append(" " * 46 + f"{'fitted  left out':>24}" * len(scores))
    for kind, chosen in kinds.items():
        cells = (f"{s.fitted[chosen].mean():.2f}      {s.predicted[chosen].mean():.2f}" for s in scores.values())
        lines.append(f"{kind:<16} {chosen.sum():>3} films{'':<19}" + "".join(f"{cell:>24}" for cell in cells))
    cells = (f"{np.median(s.fitted):.2f}      {np.median(s.predicted):.2f}" for s in scores.values())
    lines.append(f"{'median, all':<45} " + "".join(f"{cell:>24}" for cell in cells))
    lines.append("")
    seconds = (f"{s.seconds:.1f}; {s.warm:.1f}" for s in scores.values())
    lines.append(f"{'fit of all films, seconds (first; compiled)':<46}" + "".join(f"{cell:>24}" for cell in seconds))
    lines.append("\neach film left out: over black, over white")
    for i, name in enumerate(some.films):
        recipe = " + ".join(f"{weight:g} {paint}" for paint, weight in recipes[name].items())
        cells = (f"{s.predicted[i, 0]:.2f}  {s.predicted[i, 1]:.2f}" for s in scores.values())
        lines.append(f"{name:<5}{recipe:<41}" + "".join(f"{cell:>24}" for cell in cells))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    options = parser.parse_args()
    start_jax()
    folder = measured_data("revigo")
    films, recipes = read_films(folder / "reflectance.tsv"), read_names(folder / "mixtures.tsv")
    instrument = Instrument()
    models: dict[str, dict[str, Any]] = {
        "glazejax": {},
        "Kubelka-Munk": {"response": KubelkaMunk(instrument)},
        "glazejax, strength law": {"law": MixingLaw("strength")},
    }
    scores = {}
    for name, given in models.items():
        scores[name] = leave_out(films, recipes, lambda film, name=name: print(f"\r{name}: {film}   ", end=""), **given)
    print("\r", end="")
    results = Results("prediction", options.out)
    for line in [environment(), "", *table(scores, recipes).splitlines()]:
        results(line)
    results.save()


if __name__ == "__main__":
    main()
