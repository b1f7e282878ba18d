"""What identification loses by gathering spectra of many bands at few, compared with all bands.

    python -m benchmarks.paint.few_bands [--spectra N] [--out FOLDER]

Simulated films of two paints over a white card, 121 bands, with an instrument's noise, sought among
all single paints and pairs of the 20 oils.
"""

import time
from unittest import mock

import numpy as np

from benchmarks.paint.identification import first_set, simulated
from benchmarks.results import Results, command_line, quantities, quantity
from glazefit import Identification, identify
from glazefit.identify.search import few_bands
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazejax import catalogue
from glazejax.commands.main import start_jax

BANDS = 121


def main() -> None:
    """Seek the same spectra both ways, and write what differs."""
    options = command_line(__doc__, spectra=(180, 4, "simulated films")).parse_args()
    start_jax()
    say = Results("few_bands", options.out)
    paints = list(catalogue.load().values())
    grid = np.linspace(400.0, 700.0, BANDS)
    fine = [paint.resample(grid) for paint in paints]
    spectra, grounds, _ = simulated(fine, options.spectra, 1, False, (0.93,))

    def seek() -> tuple[Identification, float]:
        identify(grid, spectra[:2], paints, ground=grounds, max_paints=2)
        began = time.process_time()
        found = identify(grid, spectra, paints, ground=grounds, max_paints=2)
        return found, 1e3 * (time.process_time() - began) / len(spectra)

    few, quick = seek()
    with mock.patch.object(few_bands, "_MANY", BANDS):
        every, slow = seek()
    on_few = few_bands.few_bands_of(
        Searcher.of(grid, paints, IdentificationOptions(max_paints=2)).task
    )
    assert on_few is not None
    rows = range(options.spectra)
    same = np.mean([first_set(few, row) == first_set(every, row) for row in rows])
    off = np.abs(few.paint_probability - every.paint_probability).max(axis=1)
    say(
        f"{options.spectra} SPECTRA OF {BANDS} BANDS, at few bands, compared with all\n"
        f"bands that are taken            {len(on_few[0].index)}\n"
        f"ms of the processor, few, all   {quick:.1f} {slow:.1f}\n"
        f"the same first set              {same:.1%}\n"
        f"a paint's probability off by more than .02, at most   {np.mean(off > 0.02):.1%} {off.max():.2f}\n"
        f"that of none off at most        {np.abs(few.none - every.none).max():.2f}"
    )
    say.record(
        taken=quantity(len(on_few[0].index), digits=0),
        **quantities(
            {"same": 100 * same, "off": 100 * np.mean(off > 0.02)}, "%", 0, n=options.spectra
        ),
        largest=quantity(off.max(), n=options.spectra),
    )
    say.save()


if __name__ == "__main__":
    main()
