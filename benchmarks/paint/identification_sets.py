"""Identification of other people's paints: Kimera masstones, the RRT panel, and HypPigments across
shades.
"""

import csv

import numpy as np

from benchmarks.measured import measured_data
from benchmarks.paint.shades import ShadeLibrary
from benchmarks.results import Results, quantity
from glazefit import Noise, identify
from glazejax import catalogue
from glazejax.io import read_spectra

# What the catalogue has of the same pigment; the others have no counterpart in it.
RRT_TRUTH = {
    "Carmine": "Cochineal",
    "Vermilion": "Vermillion",
    "LeadWhite": "LeadWhite",
    "IvoryBlack": "BoneBlack",
}
RRT_PAINTS = ("BurntUmber", "Carmine", "Vermilion", "Malachite", "Azurite")
RRT_COLUMNS = (
    *(f"{paint} {coat}" for paint in RRT_PAINTS for coat in ("thin", "thick")),
    "LeadWhite",
    "IvoryBlack",
    "Gypsum",
)
# What is recorded of HypPigments: name and digits.
SHADES = {
    ("as measured", "offset and strength free"): ("shades", 1),
    ("as measured", "nearest spectral angle"): ("shades_angle", 0),
    ("smoothed to 60 nm", "offset and strength free"): ("shades_smoothed", 0),
}


def kimera(results: Results) -> None:
    """Masstones of acrylics, opaque: the catalogue has none of them for certain."""
    table = read_spectra(measured_data("kimera") / "masstone.json")
    grid = np.arange(410.0, 681.0, 10.0)
    found = _opaque(grid, _smoothed(table.wavelengths, table.reflectance, grid))
    results(
        "Kimera masstones (45:0 assumed, opaque; no pigment is stated, so nothing here is right "
        "or wrong)"
    )
    for row, name in enumerate(table.names):
        if row % 3 == 0:
            results(f"  {name:<22} {_line(found, row)}")


def rrt(results: Results) -> None:
    """Panel of tempera paints over gypsum: four pigments that the catalogue has, three that it has
    not.
    """
    rows = np.loadtxt(measured_data("rrt") / "pigment_panel_reference.csv")
    grid = np.arange(400.0, 701.0, 10.0)
    spectra = _smoothed(rows[:, 0], rows[:, 1:].T, grid)
    chosen = [i for i, name in enumerate(RRT_COLUMNS[:-1]) if not name.endswith("thin")]
    found = _opaque(grid, spectra[chosen])
    results("RRT panel, thick paints (45:0 and opaque assumed)")
    right: list[float] = []
    for row, column in enumerate(chosen):
        paint = RRT_COLUMNS[column].split()[0]
        truth = RRT_TRUTH.get(paint)
        if truth is not None:
            ranks = [
                rank
                for rank, candidate in enumerate(found.ranked(row))
                if truth in candidate.paints
            ]
            right.append(min(ranks, default=np.inf))
        results(
            f"  {RRT_COLUMNS[column]:<22} {_line(found, row)}"
            + ("" if truth else "   [not in the catalogue]")
        )
    first, three = (sum(rank < count for rank in right) for count in (1, 3))
    results(
        f"  the pigment, where the catalogue has it, is in the first explanation: {first} of "
        f"{len(right)}; "
        f"in one of the first three: {three}"
    )


def _line(found, row: int) -> str:
    first = found.ranked(row)[0]
    start = "" if found.explained[row] else "nothing; first "
    return f"{start}{first.words} (P {first.probability:.2f}, RMSE {first.rmse:.3f})"


def _smoothed(wavelengths: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Means over 10 nm, which a fine noisy spectrum needs before it is thinned out."""
    windows = np.abs(wavelengths - grid[:, None]) <= 5.0
    return np.clip((values @ windows.T) / windows.sum(axis=1), 0.0, 1.0)


def _opaque(grid: np.ndarray, spectra: np.ndarray):
    paints = list(catalogue.load().values())
    noise = Noise(0.003, 0.01)  # other instruments
    return identify(
        grid,
        spectra,
        paints,
        opaque=True,
        instrument="45:0",
        noise=noise,
        max_paints=2,
    )


def hyppigments(results: Results) -> None:
    """398 patches, four shades each: every shade in turn is sought with the other three known."""
    table = read_spectra(measured_data("hyppigments") / "speclib_averages.hdr")
    spectra = table.reflectance.reshape(398, 4, -1)
    names = [name.rpartition("_")[0] for name in table.names[::4]]
    card = np.array([name.rpartition("_")[0] for name in names])
    results(
        "HypPigments: three shades of 398 patches known, the fourth sought; share right, shade 1 "
        "to 4 and mean"
    )
    for words, smoothed in (("as measured", 0), ("smoothed to 30 nm", 4), ("smoothed to 60 nm", 8)):
        values = _blurred(spectra, smoothed) if smoothed else spectra
        grid, values = table.wavelengths[:: max(smoothed, 1)], values[..., :: max(smoothed, 1)]
        rates = [_rates(names, card, grid, values, held) for held in range(4)]
        for row, what in enumerate(
            ("nearest spectral angle", "offset and strength free", "the same, within its card")
        ):
            cells = [rate[row] for rate in rates]
            results(
                f"  {words:<18} {what:<26} "
                + " ".join(f"{c:.3f}" for c in cells)
                + f"   {np.mean(cells):.3f}"
            )
            if (words, what) in SHADES:
                name, digits = SHADES[words, what]
                results.record(**{name: quantity(100 * np.mean(cells), "%", digits, n=len(names))})
    results(
        "  Patches of one card share a ripple of their scan: part of the first lines rests on it,"
    )
    results("  less of the smoothed.")
    results(
        "  'Within its card' seeks among the patches of the same card only, where the ripple "
        "says nothing."
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
        "HypPigments across cards: each shade is sought among the patches of all other cards, "
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
        results.record(**{key: quantity(100 * np.mean(rates), "%", digits=0, n=len(known))})


def _cosine(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest cosine between spectra and any shade of the patches, (spectra, patches)."""
    unit = one / np.linalg.norm(one, axis=-1, keepdims=True)
    known = other / np.linalg.norm(other, axis=-1, keepdims=True)
    return np.max(np.einsum("nb,psb->nps", unit, known), axis=-1)


def _blurred(spectra: np.ndarray, bands: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(np.maximum(spectra, 0.0), bands, axis=-1)


def _rates(
    names: list[str], card: np.ndarray, grid: np.ndarray, values: np.ndarray, held: int
) -> tuple[float, ...]:
    """Share right by spectral angle, by the library, and by the library within the card."""
    others = [shade for shade in range(values.shape[1]) if shade != held]
    unit = values / np.linalg.norm(values, axis=-1, keepdims=True)
    cosine = np.max([unit[:, held] @ unit[:, shade].T for shade in others], axis=0)
    match = ShadeLibrary(names, grid, values[:, others]).match(values[:, held])
    own = np.arange(len(names))
    near = np.where(card[:, None] == card, match.probability, -1.0)
    return tuple(
        float(np.mean(score.argmax(axis=1) == own)) for score in (cosine, match.probability, near)
    )
