"""The package's sample films: twelve of the revigo readings as fractions, with their recipes.

    python -m benchmarks.make.samples [--out FOLDER]

Writes films.csv and mixtures.tsv. Needs the folder revigo of measured data.
"""

from pathlib import Path

import glazejax
from benchmarks.measured import measured_data
from benchmarks.results import help_parser
from glazefit.film.readers import NAMES_FILE, ROWS, read_recipes
from glazejax.io import read_spectra
from glazejax.io.files.write import WIDE_TITLE

# Pure paints (06A hides, 02A is a clear lake), tints with zinc white (13G a trace of blue), a
# shade, and near-black.
FILMS = ("06A", "12A", "10A", "08A", "02A", "15C", "05B", "09B", "13G", "04B", "14E", "07F")


def main() -> None:
    folder = help_parser(__doc__, Path(glazejax.__file__).parent / "samples").parse_args().out
    source = measured_data("revigo")
    table = read_spectra(source / "reflectance.tsv")
    recipes = read_recipes(source / NAMES_FILE)
    grid = ",".join(f"{wavelength:g}" for wavelength in table.wavelengths)
    spectra = [f'"{WIDE_TITLE}",{grid}']
    mixtures = []
    for film in FILMS:
        for row in ROWS:
            # Percent with two decimals in the source, so that four decimals lose nothing.
            spectra.append(
                f"{film}_{row}," + ",".join(f"{value:.4f}" for value in table[f"{film}_{row}"])
            )
        paints = recipes[film]
        mixtures.append(
            f"{film}\t{'-'.join(paints)}|{'-'.join(f'{weight:g}' for weight in paints.values())}"
        )
    (folder / "films.csv").write_text("\n".join(spectra) + "\n")
    (folder / NAMES_FILE).write_text("\n".join(mixtures) + "\n")
    print(f"{len(FILMS)} films written to {folder}")


if __name__ == "__main__":
    main()
