"""The catalogue's acrylics: k and s for Kubelka-Munk's K and S of nineteen Golden paints, and how
closely they agree.

    python -m benchmarks.paint.acrylics [--out FOLDER] [--table FILE]

K and S say what masstones and tints reflect under the source's Saunderson constants. Here each
paint gets the k and s with which this program's opaque film reflects the same, as masstone and as
one part in ten of titanium white: two equations a band, which leave nothing open but the unit of
length. Writes `acrylics.csv` of the catalogue, and the table of how closely these and other
mixtures agree. Needs the folder golden of measured data.
"""

import csv
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

import glazejax
from benchmarks.measured import measured_data
from benchmarks.results import Results, command_line, quantities
from glazejax import colour, stack_hemispherical_reflectance
from glazejax.commands.main import start_jax
from glazejax.paint.pigment_table import read_pigments
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.twoflux import saunderson, two_flux_reflectance
from glazejax.spectra import Numbers

NEEDS = ("data/golden",)

TABLE = Path(glazejax.__file__).parent / "catalogue" / "acrylics.csv"
# Saunderson's constants of the source: the surface's part in a reading, and its reflectance from
# inside.
K1, K2 = 0.03, 0.65
TITLES = (
    *("pigment", "wavelength_nm", "absorption", "scattering"),
    *("absorption_sd", "scattering_sd", "identifiable"),
)
"""Columns of the catalogue's tables."""
WHITE = "TitaniumWhite"
PARTS_OF_WHITE = 10.0
# Assumed, since the source has no unit of length: s of titanium white in 1/m, at every wavelength.
WHITE_SCATTERING = 5e5
INDEX = 1.5
COSINE = float(np.cos(np.deg2rad(8.0)))
# What decides which bands count as identifiable: noise of a reading, base and share, as the first
# catalogue's; and how well k1 is known, of an instrument that takes the specular part "partly".
NOISE = (0.0005, 0.002)
SURFACE_ERROR = 0.005
THIN = 25e-6
# Bare card in air, as the instrument reads it.
CARD = 0.8
# Optical thickness that hides a film whose k is a billionth of its s.
_OPAQUE = 1e7

Bands = Float[np.ndarray, "paints bands"]
Values = Float[np.ndarray | Array, "*batch"]


class Source(NamedTuple):
    """Kubelka-Munk's two constants, relative to titanium white's S."""

    names: tuple[str, ...]
    wavelengths: Float[np.ndarray, "bands"]
    absorption: Bands
    scattering: Bands


class Paints(NamedTuple):
    """What the catalogue says of the same paints."""

    absorption: Bands
    """k in 1/m."""
    scattering: Bands
    """s in 1/m."""
    errors: Float[np.ndarray, "2 paints bands"]
    """Relative standard deviations of k and s that readings with `NOISE` and
    `SURFACE_ERROR` leave.
    """


def read_source(path: Path) -> Source:
    """Read the table: paint, colour index name, wavelength, K, S."""
    rows: dict[str, list[list[float]]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file, delimiter="\t"):
            rows.setdefault(row["paint"], []).append(
                [float(row[title]) for title in ("wavelength_nm", "K", "S")]
            )
    values = np.array(list(rows.values()))
    return Source(tuple(rows), values[0, :, 0], values[..., 1], values[..., 2])


def entering(reading: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Share of the light that enters the paint which comes out again, from a reading of the
    source's instrument.
    """
    return (reading - K1) / (1.0 - K1)


def kubelka_munk_reading(absorption: Bands, scattering: Bands) -> Bands:
    """Reading of an opaque film by K and S: Kubelka-Munk's infinite thickness under Saunderson's
    surface.
    """
    ratio = absorption / scattering
    inside = 1.0 / (1.0 + ratio + np.sqrt(ratio * (ratio + 2.0)))
    return K1 + np.asarray(saunderson(inside, K1, K2))


def radiative_reading(
    absorption: Values, scattering: Values, thickness: Numbers | None = None, ground: Numbers = 0.0
) -> Float[Array, "*batch"]:
    """Reading of a film by k and s, opaque without a thickness.

    The source lets 1 - k1 of the light into the paint, a smooth surface 1 - F. The reading is k1 +
    (1 - k1) R/(1 - F) with R the hemispherical reflectance at 8 degrees without the specular part,
    and F Fresnel's at that angle.
    """
    extinction = jnp.asarray(absorption + scattering)
    depth = (
        jnp.full_like(extinction, _OPAQUE)
        if thickness is None
        else extinction * jnp.asarray(thickness)
    )
    body = stack_hemispherical_reflectance(
        (scattering / extinction)[..., None],
        depth[..., None],
        ground,
        refractive_index=INDEX,
        cos_incidence=COSINE,
        tolerance=1e-8,
    )
    surface = dielectric_reflectance(jnp.asarray(COSINE), jnp.asarray(INDEX))
    return K1 + (1.0 - K1) * body / (1.0 - surface)


def _of_ratio(log_ratio: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Reading of an opaque film by ln(k/s), which is all that it depends on."""
    return radiative_reading(jax.nn.sigmoid(log_ratio), jax.nn.sigmoid(-log_ratio))


@jax.jit
@jax.vmap
def log_ratio_of(reading: Float[Array, ""]) -> Float[Array, ""]:
    """ln(k/s) of opaque films with these readings: the inverse of `_of_ratio`, all bands
    at once.
    """
    return optx.root_find(
        lambda x, _: _of_ratio(x) - reading,
        optx.Bisection(rtol=1e-12, atol=1e-12),
        jnp.asarray(-4.0),
        options={"lower": -25.0, "upper": 12.0},
        max_steps=80,
    ).value


def convert(source: Source) -> Paints:
    """k and s of all paints.

    With q = k/s of the white, the masstone and the tint (found from their readings one by one), the
    mixing law k_p + 10 k_w = q_t (s_p + 10 s_w) with k_p = q_p s_p gives s_p = 10 s_w (q_t -
    q_w)/(q_p - q_t).
    """
    white = source.names.index(WHITE)
    masstone = kubelka_munk_reading(source.absorption, source.scattering)
    tint = kubelka_munk_reading(*_tint(source.absorption, source.scattering, white, PARTS_OF_WHITE))
    readings = jnp.stack([jnp.broadcast_to(masstone[white], masstone.shape), masstone, tint])
    logs = log_ratio_of(readings.ravel()).reshape(readings.shape)

    def solve(logs: Float[Array, "3 paints bands"]) -> Float[Array, "2 paints bands"]:
        clear, pure, mixed = jnp.exp(logs)
        share = (mixed - clear) / (pure - mixed)
        scattering = WHITE_SCATTERING * PARTS_OF_WHITE * share.at[white].set(1.0 / PARTS_OF_WHITE)
        return jnp.stack([pure * scattering, scattering])

    absorption, scattering = np.asarray(solve(logs))
    # Readings -> ln(k/s) -> ln k, ln s: each entry depends on the readings of its own paint and
    # band only.
    slopes = jax.jvp(_of_ratio, (logs,), (jnp.ones_like(logs),))[1]
    noise = (NOISE[0] + NOISE[1] * readings) / slopes
    steps = [jnp.zeros_like(logs).at[i].set(noise[i]) for i in range(3)]
    steps.append(SURFACE_ERROR * (1.0 - entering(readings)) / slopes)
    errors = jnp.sqrt(
        sum(jax.jvp(lambda x: jnp.log(solve(x)), (logs,), (step,))[1] ** 2 for step in steps)
    )
    # The white is its own tint: its s is the scale and has no error, its k that of k/s.
    own = jnp.hypot(noise[1, white], steps[3][1, white])
    return Paints(
        absorption,
        scattering,
        np.asarray(errors.at[:, white].set(jnp.stack([own, jnp.zeros_like(own)]))),
    )


def _tint(absorption: Bands, scattering: Bands, white: int, parts: float) -> tuple[Bands, Bands]:
    """Coefficients of one part of each paint in so many of white, by weight; the law is linear in
    both theories.
    """
    return (
        (absorption + parts * absorption[white]) / (1.0 + parts),
        (scattering + parts * scattering[white]) / (1.0 + parts),
    )


def write_table(path: Path, source: Source, paints: Paints) -> None:
    """Write the catalogue's file: six digits, and no standard deviations, because the source's are
    not known.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(TITLES)
        known = identifiable(paints)
        for i, name in enumerate(source.names):
            for j, wavelength in enumerate(source.wavelengths):
                k, s = f"{paints.absorption[i, j]:.6g}", f"{paints.scattering[i, j]:.6g}"
                writer.writerow([name, f"{wavelength:g}", k, s, "", "", bool(known[i, j])])


def identifiable(paints: Paints) -> Bool[np.ndarray, "paints bands"]:
    """Where k and s both would follow within 50 % from readings of masstone and tint with `NOISE`,
    (paints, bands).
    """
    return np.all(paints.errors < 0.5, axis=0)


def closeness(source: Source, paints: Paints) -> dict[str, Float[np.ndarray, "paints"]]:
    """Delta E00 (D65, 2 degrees) between the two theories for each paint: masstone, tints, a thin
    film on two cards.
    """
    white = source.names.index(WHITE)
    given = (source.absorption, source.scattering)
    ours = (paints.absorption, paints.scattering)

    def apart(left: Values, right: Values) -> Float[np.ndarray, "paints"]:
        return colour.delta_e_2000(
            *(colour.lab(source.wavelengths, jnp.asarray(x)) for x in (left, right))
        )

    found = {}
    for title, parts in (("masstone", 0.0), ("1:1", 1.0), ("1:10", 10.0), ("1:100", 100.0)):
        theirs = kubelka_munk_reading(*_tint(*given, white, parts))
        mine = radiative_reading(*_tint(*ours, white, parts))
        found[title] = apart(theirs, mine)
        if title in ("masstone", "1:10"):
            # The same by the plain instrument: sphere at 8 degrees without the specular part, plus
            #     k1.
            surface = dielectric_reflectance(jnp.asarray(COSINE), jnp.asarray(INDEX))
            found[f"{title}, plain"] = apart(theirs, K1 + entering(mine) * (1.0 - surface))
    for title, card in (("on black", 0.0), ("on white", CARD)):
        found[title] = apart(
            _thin_kubelka_munk(source, card), radiative_reading(*ours, THIN, ground_of(card))
        )
    return found


def _thin_kubelka_munk(source: Source, card: float) -> Float[Array, "paints bands"]:
    """Reading of a thin film by Kubelka and Munk's hyperbolic solution; S d of the white is 3/4 of
    its s d.
    """
    depth = 0.75 * WHITE_SCATTERING * THIN
    body = entering(jnp.asarray(card)) if card else jnp.asarray(0.0)
    ground = body / (1.0 - K2 + K2 * body)
    inside = two_flux_reflectance(source.absorption * depth, source.scattering * depth, ground)
    return K1 + saunderson(inside, K1, K2)


def ground_of(card: float) -> float:
    """Reflectance from inside the paint of a card that reads so much when bare; black is 0."""
    if not card:
        return 0.0

    def off(ground: Float[Array, ""], _: None) -> Float[Array, ""]:
        return radiative_reading(jnp.zeros(()), jnp.ones(()), 0.0, ground) - card

    bisection = optx.Bisection(rtol=1e-10, atol=1e-10)
    return float(
        optx.root_find(off, bisection, jnp.asarray(0.5), options={"lower": 0.0, "upper": 1.0}).value
    )


def hiding_thickness(source: Source, paints: Paints, contrast: float) -> float:
    """Thickness in m at which titanium white reads over black that share of what it reads over the
    card (Y, D65).
    """
    white = source.names.index(WHITE)
    thickness = np.geomspace(1e-5, 3e-4, 40)
    bands = (paints.absorption[white], paints.scattering[white])
    light = [
        np.asarray(
            colour.xyz(
                source.wavelengths, radiative_reading(*bands, thickness[:, None], ground_of(card))
            )
        )[:, 1]
        for card in (0.0, CARD)
    ]
    return float(np.interp(contrast, light[0] / light[1], thickness))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument(
        "--table", type=Path, default=TABLE, help="file of the catalogue (default: %(default)s)"
    )
    options = parser.parse_args()
    if options.quick and options.table == TABLE:
        options.table = options.out / TABLE.name
        options.out.mkdir(parents=True, exist_ok=True)
    path = measured_data("golden") / "kubelka_munk.tsv"
    start_jax()
    results = Results("acrylics", options.out)
    source = read_source(path)
    paints = convert(source)
    write_table(options.table, source, paints)
    # What is stated is stated of the numbers as written.
    written = read_pigments(options.table)
    shelf = [written[name] for name in source.names]
    paints = paints._replace(
        absorption=np.stack([np.asarray(p.absorption) for p in shelf]),
        scattering=np.stack([np.asarray(p.scattering) for p in shelf]),
    )
    _report(results, source, paints)
    results.save()


HEAD = """\
Golden acrylics: Delta E00 (D65, 2 degrees) between Kubelka-Munk's K, S under Saunderson's surface (k1 = .03, k2 = .65)
and the catalogue's k, s by this program's solver (n = 1.5, isotropic scattering, sphere at 8 degrees). Readings are
k1 + (1 - k1) R/(1 - F); 'plain' is R + k1, what Hemispherical(8, specular=False) gives plus .03. Tints are parts of
paint : parts of titanium white by weight. Masstone and 1:10 are what k and s were made from; the others show how far
the two theories differ. Films are 25 um thick, over black and over a card that reads .8, against the hyperbolic
solution with S d = 3/4 s d for the white. 'sure': bands of 38 where readings (noise .0005 + .002 R, k1 known to .005)
would fix both k and s within 50 %.
"""


def _report(results: Results, source: Source, paints: Paints) -> None:
    """Print the table."""
    for line in HEAD.splitlines():
        results(line)
    results()
    apart = closeness(source, paints)
    results(f"{'':26}" + "".join(f"{title:>16}" for title in apart) + f"{'sure':>7}")
    sure = identifiable(paints).sum(axis=1)
    for i, name in enumerate(source.names):
        results(
            f"{name:26}"
            + "".join(f"{values[i]:16.3f}" for values in apart.values())
            + f"{sure[i]:7d}"
        )
    for title, summary in (("mean", np.mean), ("max", np.max)):
        results(f"{title:26}" + "".join(f"{summary(values):16.3f}" for values in apart.values()))
    columns = {"tints_1": "1:1", "tints_100": "1:100", "black": "on black", "white": "on white"}
    values = {name: apart[title].mean() for name, title in columns.items()}
    values["most"] = np.max(list(apart.values()))
    results.record(**quantities(values, digits=1, n=len(source.names)))
    results()
    ratio = paints.scattering / WHITE_SCATTERING / source.scattering
    low, middle, high = np.percentile(ratio, [0, 50, 100])
    results(f"s over S, both relative to the white: {low:.2f} to {high:.2f}, median {middle:.2f}")
    hides = ", ".join(
        f"{100 * c:g} % at {1e6 * hiding_thickness(source, paints, c):.0f} um" for c in (0.95, 0.98)
    )
    results(
        f"Assumed: titanium white's s is {WHITE_SCATTERING:g} 1/m at every wavelength. Then it "
        "hides (Y over black as a\n"
        f"share of Y over the card) {hides}."
    )


if __name__ == "__main__":
    main()
