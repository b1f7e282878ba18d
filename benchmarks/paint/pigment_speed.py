"""How long it takes to name pigments: first use, many spectra, fine spectra.

    python -m benchmarks.paint.pigment_speed [--out FOLDER]

Spectra are films of mixtures of exemplars, with noise, said to hide their ground. The first use is
in a process of its own, with the import of the program and all that is set up and compiled.
"""

import numpy as np
from jaxtyping import Float

from benchmarks.results import Results, command_line, progress, quantity
from benchmarks.timing import in_a_process, time_call

_SEED = 33


def spectra(wavelengths: Float[np.ndarray, "bands"], count: int) -> Float[np.ndarray, "n bands"]:
    """Readings of mixtures of two exemplars each, that hide their ground, at 45:0."""
    from glazefit.film.model.response import film_response
    from glazefit.identify.families.templates import coefficients, hiding_body
    from glazejax import catalogue

    exemplars = list(catalogue.load("pigments").values())
    rng = np.random.default_rng(_SEED)
    known = coefficients(exemplars, wavelengths)
    # Beyond what an exemplar knows it goes on as it ends.
    for line in known.reshape(-1, wavelengths.size):
        there = np.isfinite(line)
        line[:] = np.interp(wavelengths, wavelengths[there], line[there]) if there.any() else 1e4
    pairs = rng.choice(len(exemplars), (count, 2))
    share = rng.uniform(0.2, 1.0, (count, 1))
    k, s = (share * part[pairs[:, 0]] + (1.0 - share) * part[pairs[:, 1]] for part in known)
    body = hiding_body(film_response("45:0"), k / s)
    return np.clip(body + rng.normal(0.0, 0.002, body.shape), 0.005, 1.0)


def search(wavelengths: Float[np.ndarray, "bands"], readings: Float[np.ndarray, "n bands"]) -> None:
    """All pigments, singles and pairs."""
    from glazefit import identify
    from glazejax import catalogue

    pigments = catalogue.load("pigments")
    identify(wavelengths, readings, pigments, opaque=True, instrument="45:0")


def first_use() -> float:
    """Seconds of a new process that names the pigments of one spectrum of 31 bands."""
    code = (
        "import numpy as np; from benchmarks.paint import pigment_speed as p; "
        "grid = np.arange(400.0, 701.0, 10.0); "
        "p.search(grid, np.full((1, 31), 0.4) + 0.2 * (grid > 550))"
    )
    return time_call(lambda: in_a_process("-c", code))[1]


def main() -> None:
    """Time each, and write the table."""
    options = command_line(
        __doc__,
        count=(1000, 20, "spectra of 61 bands"),
        fine=(10, 2, "spectra of 2151 bands"),
    ).parse_args()
    results = Results("pigment_speed", options.out, "numpy")
    results("SECONDS, one run each")

    progress("first use")
    took = first_use()
    results(f"first use, one spectrum of 31 bands, all pigments {took:8.1f}")
    results.record(first_use=quantity(took, "s", digits=1))

    visible = np.linspace(400.0, 1000.0, 61)
    fine = np.arange(350.0, 2501.0)
    for key, words, grid, count in (
        ("thousand", "61 bands", visible, options.count),
        ("fine", "2151 bands", fine, options.fine),
    ):
        progress(words)
        readings = spectra(grid, count)
        (_, cold), (_, warm) = (
            time_call(lambda g=grid, r=readings: search(g, r)) for _ in range(2)
        )
        results(
            f"{count} spectra of {words}, all pigments, singles and pairs:"
            f"{cold:8.1f} set up and compiled, {warm:6.1f} again"
        )
        results.record(**{key: quantity(cold, "s", digits=1, n=count)})

    progress()
    results.save()


if __name__ == "__main__":
    main()
