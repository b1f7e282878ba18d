"""Speed of identification, and what the usual search leaves out of the thorough one.

    python -m benchmarks.paint.identification [--device gpu] [--out FOLDER]

Films left out of a fit, with known truth, are in `benchmarks.paint.truth`, paints of other people in
`benchmarks.paintbench`.
"""

import functools

import numpy as np

from benchmarks import device
from benchmarks.results import Results, command_line, quantities, quantity
from benchmarks.rivals.baselines import spectra_of
from benchmarks.timing import time_call
from glazefit import Identification, Noise, identify
from glazefit.film.model.response import film_response
from glazejax import Hemispherical, Pigment, catalogue
from glazejax.commands.main import start_jax

UNIT = 25e-6


def family(recipe: dict[str, float]) -> dict[str, float]:
    """Fractions by pigment."""
    out: dict[str, float] = {}
    for paint, share in recipe.items():
        name = catalogue.family(paint)
        out[name] = out.get(name, 0.0) + share
    return out


def simulated(
    paints: list[Pigment],
    count: int,
    seed: int,
    rough: bool,
    cards: tuple[float, ...] = (0.025, 0.93),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Films of two paints over a black and a white card or over others, their grounds, and the
    paints.

    Noise as instruments have it; rough ones also have smooth errors of some percent, as films of
    real paint.
    """
    rng = np.random.default_rng(seed)
    k, s = np.moveaxis(spectra_of(paints), 1, 0) * UNIT
    weights = rng.dirichlet(np.ones(2), count)
    pair = np.array([rng.choice(len(paints), 2, replace=False) for _ in range(count)])
    kd, sd = (np.einsum("nm,nmb->nb", weights, a[pair]) for a in (k, s))
    grounds = np.array(cards)[:, None] * np.ones((len(cards), kd.shape[1]))
    body = film_response(Hemispherical()).body(kd[:, None], sd[:, None], grounds)
    noise = Noise()
    spectra = np.asarray(body) + 0.04
    spectra = spectra + noise.sd(spectra) * rng.standard_normal(spectra.shape)
    if rough:
        along = np.linspace(0.0, 1.0, kd.shape[1])
        level, bump = rng.standard_normal((2, count, 1))
        often, first = rng.random((2, count, 1))
        wave = np.sin(np.pi * (along * (1.0 + 2.0 * often) + first))
        spectra *= (1.0 + 0.05 * level + 0.06 * bump * wave)[:, None]
    return np.clip(spectra, 0.0, 1.0), grounds, pair


def speed(results: Results, count: int = 1000, compared: int = 400, triples: int = 200) -> None:
    """Compare the usual search with the thorough one: run time, and how often they agree."""
    paints = list(catalogue.load().values())
    grid = paints[0].wavelengths
    results(
        f"ALL SINGLES AND PAIRS OF {len(paints)} PAINTS, over two cards, 31 bands; the second "
        "run of two\n"
        f"{'':<26}{'spectra':>8} {'usual':>10} {'thorough':>10}  first set  probability off by > "
        ".02:\n"
        f"{'':<26}{'':>8} {'a second':>10} {'a second':>10}  the same   of a paint, of none; 99 "
        "% of them"
    )
    for key, words, rough in (
        ("noise", "noise only", False),
        ("errors", "and errors of 5 %", True),
    ):
        spectra, grounds, pair = simulated(paints, count, 1, rough)
        rate, found = {}, {}
        for thorough, number in ((False, count), (True, compared)):
            # The first call compiles.
            for _ in range(2):
                found[thorough], seconds = time_call(
                    lambda t=thorough, s=spectra[:number], g=grounds: identify(
                        grid, s, paints, ground=g, max_paints=2, thorough=t
                    )
                )
                rate[thorough] = number / seconds
        usual, full = found[False], found[True]
        same = np.mean([first_set(usual, row) == first_set(full, row) for row in range(compared)])
        paint = np.abs(usual.paint_probability[:compared] - full.paint_probability).max(axis=1)
        none = np.abs(usual.none[:compared] - full.none)
        results(
            f"{words:<26}{count:>8} {rate[False]:>10.0f} {rate[True]:>10.0f}  {same:6.1%}     "
            f"{np.mean(paint > 0.02):.1%}, {np.mean(none > 0.02):.1%}; "
            f"{np.quantile(paint, 0.99):.3f}, "
            f"{np.quantile(none, 0.99):.3f}"
        )
        right = [
            set(m[m >= 0].tolist()) == set(p.tolist())
            for m, p in zip(usual.members[:, 0], pair, strict=True)
        ]
        results(f"  both paints right: {np.mean(right):.1%} (fractions down to 0)")
        rates = {f"{key}_rate": rate[False], f"{key}_thorough_rate": rate[True]}
        alike = {f"{key}_same": 100 * same, f"{key}_off": 100 * np.mean(paint > 0.02)}
        results.record(
            **quantities(rates, digits=0),
            **quantities(alike, "%", 1, n=compared),
            **quantities({f"{key}_right": 100 * np.mean(right)}, "%", 1, n=count),
        )
    spectra, grounds, _ = simulated(paints, triples, 2, False)
    search = functools.partial(identify, grid, spectra, paints, ground=grounds, max_paints=3)
    search()
    rate_of_three = triples / time_call(search)[1]
    results(f"Sets of three too, noise only, {triples} spectra: {rate_of_three:.0f} a second")
    results.record(triples_rate=quantity(rate_of_three, digits=0, n=triples))


def first_set(found: Identification, row: int) -> tuple[frozenset[int], int]:
    """Paints of the first answer, and its condition."""
    members = found.members[row, 0]
    return frozenset(members[members >= 0].tolist()), int(found.condition[row, 0])


def main() -> None:
    parser = command_line(__doc__)
    device.add_option(parser)
    options = parser.parse_args()
    chosen = device.start(options.device)
    start_jax()
    results = Results(device.file_name("identification", options.device), options.out)
    results(device.words(chosen))
    results()
    if options.quick:
        speed(results, 60, 20, 20)
    else:
        speed(results)
    results.save()


if __name__ == "__main__":
    main()
