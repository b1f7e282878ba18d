"""HypPigments across shades and cards."""

import csv

import numpy as np

from benchmarks.measured import measured_data
from benchmarks.paint.shades import ShadeLibrary
from benchmarks.paintbench.spectra import cosine_distance
from benchmarks.results import Results, percent
from glazejax.io import read_spectra

# What is recorded of HypPigments: name and digits.
SHADES = {
    ("as measured", "offset and strength free"): ("shades", 1),
    ("as measured", "nearest spectral angle"): ("shades_angle", 0),
    ("smoothed to 60 nm", "offset and strength free"): ("shades_smoothed", 0),
}


def hyppigments(results: Results) -> None:
    """398 patches, four shades each: every shade in turn is searched with the other three known."""
    table = read_spectra(measured_data("hyppigments") / "speclib_averages.hdr")
    spectra = table.reflectance.reshape(398, 4, -1)
    names = [name.rpartition("_")[0] for name in table.names[::4]]
    results(
        "HypPigments: three shades of 398 patches known, the fourth searched; share right, shade 1 "
        "to 4 and mean"
    )
    for words, smoothed in (("as measured", 0), ("smoothed to 60 nm", 8)):
        values = _blurred(spectra, smoothed) if smoothed else spectra
        grid, values = table.wavelengths[:: max(smoothed, 1)], values[..., :: max(smoothed, 1)]
        rates = [_rates(names, grid, values, held) for held in range(4)]
        for row, what in enumerate(("nearest spectral angle", "offset and strength free")):
            cells = [rate[row] for rate in rates]
            results(
                f"  {words:<18} {what:<26} "
                + " ".join(f"{c:.3f}" for c in cells)
                + f"   {np.mean(cells):.3f}"
            )
            if (words, what) in SHADES:
                name, digits = SHADES[words, what]
                results.record(**{name: percent(np.mean(cells), digits, n=len(names))})
    results(
        "  Patches of one card share a ripple of their scan: part of the first lines rests on it,\n"
        "  less of the smoothed."
    )


def hyppigments_across_cards(results: Results) -> None:
    """The same pigment number on another card, with all patches of the own card taken away: its
    ripple says nothing.
    """
    folder = measured_data("hyppigments")
    table = read_spectra(folder / "speclib_averages.hdr")
    spectra = table.reflectance.reshape(398, 4, -1)
    names = [name.rpartition("_")[0] for name in table.names[::4]]
    with (folder / "pigmentlist.csv").open(newline="", encoding="utf-8") as file:
        numbers = {row["fid"]: row["pnum"] for row in csv.DictReader(file)}
    pigment = np.array([numbers[name] for name in names])
    card = np.array([name.rpartition("_")[0] for name in names])
    elsewhere = card[:, None] != card
    known = np.flatnonzero(((pigment[:, None] == pigment) & elsewhere).any(axis=1))
    results(
        "HypPigments across cards: each shade is searched among the patches of all other cards, "
        "shade 1 to 4 and mean"
    )
    slopes = np.diff(-np.log(np.maximum(spectra, 4e-3)), axis=-1)
    library = ShadeLibrary(names, table.wavelengths, spectra)
    ways = {
        "cards_angle": lambda shade: _cosine(spectra[known, shade], spectra),
        "cards_slope": lambda shade: _cosine(slopes[known, shade], slopes),
        "cards": lambda shade: -library.match(spectra[known, shade]).misfit,
    }
    titles = (
        "nearest spectral angle",
        "angle of the slope of -log R",
        "offset and strength free",
    )
    for (key, score), words in zip(ways.items(), titles, strict=True):
        rates = []
        for shade in range(4):
            best = np.where(elsewhere[known], score(shade), -np.inf).argmax(axis=1)
            rates.append(float(np.mean(pigment[best] == pigment[known])))
        cells = " ".join(f"{rate:.3f}" for rate in rates)
        results(
            f"  {words:<30} {cells}   {np.mean(rates):.3f}  ({len(known)} patches with their "
            "number elsewhere)"
        )
        results.record(**{key: percent(np.mean(rates), n=len(known))})


def _cosine(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest cosine between spectra and any shade of the patches, (spectra, patches)."""
    shades = np.moveaxis(other, 1, 0)
    return 1.0 - np.min([cosine_distance(one, shade, least=1) for shade in shades], axis=0)


def _blurred(spectra: np.ndarray, bands: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(np.maximum(spectra, 0.0), bands, axis=-1)


def _rates(names: list[str], grid: np.ndarray, values: np.ndarray, held: int) -> tuple[float, ...]:
    """Share right by spectral angle, and by the library."""
    others = [shade for shade in range(values.shape[1]) if shade != held]
    cosine = _cosine(values[:, held], values[:, others])
    match = ShadeLibrary(names, grid, values[:, others]).match(values[:, held])
    own = np.arange(len(names))
    return tuple(
        float(np.mean(score.argmax(axis=1) == own)) for score in (cosine, match.probability)
    )
