"""The tables of one film for the instruments that `glazefit` takes when none is stated:
`glazefit/film/tables.npz`.

    python -m benchmarks.make.film_tables [--out FILE]

Black, gain and back of a film at all nodes, by the solver, which takes some seconds an instrument.
To be run again when the solver's own numbers change by more than `tests/fitting/test_response.py`
allows.
"""

from pathlib import Path

import numpy as np

import glazefit.film.model.response as response
from benchmarks.results import help_parser
from glazefit.film.model.optics import Optics
from glazejax.commands.main import start_jax

FILE = Path(response.__file__).parents[1] / "tables.npz"


def main() -> None:
    options = help_parser(__doc__, FILE).parse_args()
    start_jax()
    tables = {
        name: response.solved_table(Optics.of(instrument))
        for name, instrument in response.SHIPPED.items()
    }
    np.savez_compressed(options.out, **tables)  # pyright: ignore[reportArgumentType]
    print(f"written: {options.out} ({options.out.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
