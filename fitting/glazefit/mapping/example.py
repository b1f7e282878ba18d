"""The painting of `glazejax map --example`: small, and of known paints."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from glazejax import Glaze, Hemispherical, Layer, Mixture, reflectance
from glazejax.catalogue import load
from glazejax.spectra import Bands

from .store.layout import PLACES

FOREIGN = "ViridianGreen"
"""A paint of the oils that is in the painting, and is kept from those who map it."""

# Coats of each region from the top: shares of paints, least and largest thickness in m.
_REGIONS = (
    (({"CobaltBlue": 0.2, "ZincWhite": 0.8}, 18e-6, 60e-6),),
    (({"EmeraldGreen": 0.6, "ChromeYellowPoppyseed": 0.4}, 5e-6, 22e-6),),
    (({"Eosin": 1.0}, 3e-6, 45e-6), ({"LeadWhite": 1.0}, 12e-6, 32e-6)),
    (({"Minium": 0.3, "ChromeYellow": 0.7}, 6e-6, 30e-6),),
    (({FOREIGN: 1.0}, 5e-6, 35e-6),),
)


@dataclass(frozen=True)
class Painting:
    """A painting and its truth.

    Attributes:
        spectra: reflectance with noise, float32.
        wavelengths: nm.
        ground: its internal reflectance.
        members: paints of each pixel by number, in the catalogue's order but `FOREIGN` last; -1 for
            none.
    """

    spectra: Float[np.ndarray, "y x bands"]
    wavelengths: Bands
    ground: Bands
    members: Int[np.ndarray, "y x places"]


def painting(shape: tuple[int, int] = (48, 64), bands: int = 31, seed: int = 0) -> Painting:
    """Sky, meadow, a figure in a glazed robe with a halo, and a stroke of a foreign paint.

    Args:
        shape: (y, x) in pixels.
        bands: from 400 to 700 nm.
        seed: of the noise.
    """
    grid = np.linspace(400.0, 700.0, bands)
    paints = {name: paint.resample(grid) for name, paint in load().items()}
    paints[FOREIGN] = paints.pop(FOREIGN)
    number_of = {name: number for number, name in enumerate(paints)}
    y, x = np.meshgrid(*((np.arange(size) + 0.5) / size for size in shape), indexing="ij")
    # The first that holds lies on top.
    region = np.select(
        [
            np.abs(y - 0.85 - 0.1 * x) < 0.05,
            (np.abs(x - 0.6) < 0.3 * (y - 0.3)) & (y < 0.95),
            (x - 0.6) ** 2 + (y - 0.25) ** 2 < 0.015,
            y > 0.55 + 0.04 * np.sin(9 * x),
        ],
        [4, 2, 3, 1],
        0,
    )
    # How thick paint lies, from 0 to 1: slow waves, and the strokes of a brush.
    height = 0.5 + 0.35 * np.sin(5 * x + 3 * y) * np.cos(4 * y) + 0.15 * np.sin(60 * x + 25 * y)
    ground = 0.58 + 0.12 / (1.0 + np.exp(-(grid - 530.0) / 50.0))
    spectra = np.zeros((*shape, bands))
    members = np.full((*shape, PLACES), -1)
    for number, coats in enumerate(_REGIONS):
        layers = []
        for shares, least, largest in coats:
            mixture = Mixture([paints[name] for name in shares], list(shares.values()))
            layers.append(Layer(mixture, least * (largest / least) ** height.ravel()))
        # All pixels in each region, so that one program serves all regions of as many coats.
        readings = reflectance(Glaze(layers, ground, 1.5), Hemispherical(8.0), tolerance=1e-5)
        covered = region == number
        spectra[covered] = np.asarray(readings).reshape(spectra.shape)[covered]
        names = sorted(number_of[name] for shares, _, _ in coats for name in shares)
        members[covered, : len(names)] = names
    noise = np.random.default_rng(seed).standard_normal(spectra.shape)
    return Painting(
        spectra=(spectra + 0.003 * noise).astype(np.float32),
        wavelengths=grid,
        ground=ground,
        members=members,
    )


def write_painting(folder: Path, scene: Painting) -> Path:
    """Write painting.hdr and painting.dat (ENVI), ground.csv and the truth, members.npy.

    Returns:
        Path of the header.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines, samples, bands = scene.spectra.shape
    scene.spectra.astype("<f4").tofile(folder / "painting.dat")
    np.save(folder / "members.npy", scene.members)
    table = "".join(
        f"{nm:g},{value:.6f}\n" for nm, value in zip(scene.wavelengths, scene.ground, strict=True)
    )
    (folder / "ground.csv").write_text(f"wavelength,ground\n{table}", encoding="utf-8")
    # Last, so that a header stands for a whole image.
    header = folder / "painting.hdr"
    header.write_text(
        f"ENVI\nsamples = {samples}\nlines = {lines}\nbands = {bands}\nheader offset = 0\n"
        "file type = ENVI Standard\ndata type = 4\ninterleave = bip\nbyte order = 0\n"
        "wavelength units = Nanometers\n"
        f"wavelength = {{{', '.join(f'{nm:g}' for nm in scene.wavelengths)}}}\n",
        encoding="utf-8",
    )
    return header
