"""The catalogue of pigments by family: k and s of paints of many hands, each fitted to its own
source's readings.

    python -m benchmarks.paint.pigments [--out FOLDER] [--tables FOLDER]

Writes `exemplars.csv` (k and s in 1/m) and `exemplars.tsv` (family, source, binder, how k was
separated from s) of the catalogue, and a table of how closely each source's readings are met. What
separates k from s: tints with a white, a coat over several grounds, or coats of several thicknesses
over one that is seen through them. Where nothing does, only k/s is known: s is then that of the
paint's family, or of all families, with its spread as the error. Each source has a unit of length
of its own; they are brought together by the median of s over its paints. Needs all folders of
measured data.
"""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

import glazejax
from benchmarks.measured import data_folder
from benchmarks.paint.acrylics import TITLES
from benchmarks.paintbench.library import grid_readings
from benchmarks.paintbench.sources import FOREIGN, UNCLEAR, Source, read_sources
from benchmarks.results import Results, command_line, progress
from glazefit import Films, recover_jointly
from glazefit.identify.families.references import log_scattering
from glazefit.recover.joint.joint import UNIT
from glazefit.recover.joint.problem import Expectations
from glazefit.recover.joint.result import JointRecovery
from glazejax.commands.main import start_jax

NEEDS = (
    "data/bath",
    "data/grillini",
    "data/hyperdoc",
    "data/hyppigments",
    "data/kimera",
    "data/usgs",
)

FOLDER = Path(glazejax.__file__).parent / "catalogue"
INSTRUMENT = "45:0"

# Coats of one paint by several recipes differ in thickness by more than films that are to be alike.
_LADDER = Expectations(thickness=1.0)
_COATS = Expectations(thickness=0.5)
_ONE_COAT = Expectations(thickness=0.02)
# A reading above this is a level that a probe or a chart's calibration got wrong.
_BRIGHTEST, _DARKEST = 0.985, 0.001
# Standard deviation of log k and log s beyond which they are not separated, as in a recovery.
_OPEN = 0.5


@dataclass(frozen=True, kw_only=True)
class Exemplar:
    """One paint of one source and binder.

    k and s are in 1/m; `log_sd` are standard deviations of log k and log s, (2, bands).
    """

    name: str
    family: str
    source: str
    binder: str
    paint: str
    told_by: str
    wavelengths: Float[np.ndarray, "bands"]
    absorption: Float[np.ndarray, "bands"]
    scattering: Float[np.ndarray, "bands"]
    log_sd: Float[np.ndarray, "2 bands"]
    rms: float

    @property
    def separated(self) -> bool:
        """Whether its readings separate k from s at most bands."""
        return bool(np.median(self.log_sd) < _OPEN)


def main() -> None:
    """Fit all sources and write the tables."""
    parser = command_line(__doc__, every=(1, 40, "patch of a chart of hundreds is taken"))
    parser.add_argument("--tables", type=Path, help="folder to write the catalogue's tables to")
    options = parser.parse_args()
    start_jax()
    found: list[Exemplar] = []
    for source in read_sources(data_folder()):
        found += fit_source(source, options.every)
    found = with_usual_scattering(on_one_scale(found))
    results = Results("pigments", options.out)
    for line in lines_of(found):
        results(line)
    results.save()
    if options.tables:
        write_tables(options.tables, found)


# ---- one source ----------------------------------------------------------------------------------


def fit_source(source: Source, every: int = 1) -> list[Exemplar]:
    """Exemplars of a source whose readings are at hand; revigo's and Golden's paints are in the
    catalogues of oils and acrylics.
    """
    if source.name == "hyppigments":
        return list(_chart(source, every))
    if source.name == "hyperdoc":
        # Its mixtures are not fitted with the pure coats: these would then differ in thickness by a
        # factor of a hundred thousand, though all were put on by one recipe.
        return [
            *_coats(source, "64A", "Gum arabic", _COATS),
            *_coats(source, "65A", "Egg glair", _COATS),
        ]
    if source.name in ("bath", "grillini"):
        return _opaque_mixtures(source)
    if source.name == "kimera":
        # The author's instrument is weak at its ends.
        return list(_masstones(source, np.arange(410.0, 691.0, 10.0), "acrylic", "Kimera "))
    if source.name == "usgs":
        return list(_masstones(source, grid_of(source), "none: powder or mineral", ""))
    if source.name == "rrt":
        return list(_coats(source, "Gypsum ground", "", _LADDER))
    return []


def grid_of(source: Source, step: float = 10.0) -> Float[np.ndarray, "bands"]:
    """Wavelengths of a source's exemplars, nm."""
    first = min(camera.wavelengths[0] for camera in source.cameras)
    last = max(camera.wavelengths[-1] for camera in source.cameras)
    # The ends of an instrument's range are its noisiest.
    return np.arange(np.ceil(max(first, 380.0) / step) * step, min(last, 2400.0) + 1e-6, step)


def fit(
    names: Sequence[str],
    wavelengths: Float[np.ndarray, "bands"],
    readings: Float[np.ndarray, "films bands"],
    recipes: Mapping[str, Mapping[str, float]],
    *,
    bare: Float[np.ndarray, "bands"] | None = None,
    expectations: Expectations | None = None,
) -> JointRecovery:
    """Joint recovery of films over one ground, read bare, or of films that hide it."""
    count = len(names)
    seen = np.clip(readings, _DARKEST, _BRIGHTEST)
    ground = np.full(wavelengths.size, 0.9) if bare is None else bare
    films = Films(
        names=tuple(names),
        wavelengths=wavelengths,
        bare_black=np.full(seen.shape, 0.05),
        bare_white=np.tile(np.clip(ground, 0.06, _BRIGHTEST), (count, 1)),
        over_black=seen,
        over_white=seen,
        seen=np.tile([False, True], (count, 1)),
        assumed=np.full((count, 2), bare is None),
        opaque=np.full(count, bare is None),
    )
    return recover_jointly(films, recipes, instrument=INSTRUMENT, expectations=expectations)


def exemplar(
    recovery: JointRecovery,
    row: int,
    source: Source,
    code: str,
    *,
    mark: str = "",
    binder: str = "",
    told_by: str = "",
) -> Exemplar:
    """A paint of a recovery in the catalogue's unit of length.

    Args:
        recovery: of films of the source.
        row: of the paint in it.
        source, code: of the paint.
        mark: what distinguishes it from others of its family and source; by default its code.
        binder: in words.
        told_by: what separated k from s; empty where nothing did.
    """
    family = source.paints[code].family
    films = recovery.films
    own = films.seen & (recovery.shares[:, row] > 0)[:, None]
    return Exemplar(
        name=f"{family}/{source.group}-{mark or code}",
        family=family,
        source=source.group,
        binder=binder,
        paint=source.paints[code].name,
        told_by=told_by,
        wavelengths=np.asarray(recovery.wavelengths),
        absorption=np.asarray(recovery.absorption[row]) / UNIT,
        scattering=np.asarray(recovery.scattering[row]) / UNIT,
        log_sd=recovery.relative_log_sd[:, row] + (0.0 if told_by else np.inf),
        rms=float(np.sqrt(np.mean(recovery.residual[own] ** 2))),
    )


def _chart(source: Source, every: int) -> Iterator[Exemplar]:
    """Each patch of a chart: one coat over a black, a dark grey, a light grey and a white ground.

    So its data show, which state no ground: a paint that hides reads the same four times, and all
    that are clear in the near infrared read the same four levels there.
    """
    grid = grid_of(source)
    rows = range(len(source.samples))
    readings = grid_readings(source, rows, grid).reshape(-1, 4, grid.size)
    # What its darkest films read over all grounds is the matte surface's reflection.
    readings = readings - np.quantile(readings, 0.001)
    black, dark, light, white = _grounds(grid, readings)
    for patch in range(0, len(readings), every):
        sample = source.samples[4 * patch]
        (code,) = sample.paints
        paint = source.paints[code]
        if paint.family in (*UNCLEAR, FOREIGN):
            continue
        progress(f"chart: {paint.name}")
        over = np.clip(readings[patch], _DARKEST, _BRIGHTEST)
        # As two films of one thickness, each over two grounds.
        films = Films(
            names=("over black and white", "over greys"),
            wavelengths=grid,
            bare_black=np.stack([black, dark]),
            bare_white=np.stack([white, light]),
            over_black=over[[0, 1]],
            over_white=over[[3, 2]],
        )
        recovery = recover_jointly(
            films,
            {name: {code: 1.0} for name in films.names},
            instrument=INSTRUMENT,
            expectations=_ONE_COAT,
        )
        number = sample.name.split()[0].removesuffix("-1")
        yield exemplar(
            recovery, 0, source, code, mark=number, told_by="a coat over black, greys and white"
        )


def _grounds(
    grid: Float[np.ndarray, "bands"], readings: Float[np.ndarray, "patches 4 bands"]
) -> Float[np.ndarray, "4 bands"]:
    """Grounds of a chart, as read bare: what the ten coats that hide least from 580 nm on read
    there, and the same below.
    """
    clear = grid >= 580.0
    # Paint that fluoresces reads more than white.
    contrast = (readings[:, 3] - readings[:, 0])[:, clear].mean(axis=1)
    contrast[readings.max(axis=(1, 2)) > 1.0] = 0.0
    levels = np.median(readings[np.argsort(-contrast)[:10]], axis=0)
    levels[:, ~clear] = levels[:, clear][:, :1]
    return levels


def _opaque_mixtures(source: Source) -> list[Exemplar]:
    """Films that hide what is below, pure and mixed by mass; repeats are averaged, at one level."""
    grid = grid_of(source)
    by_recipe: dict[tuple[tuple[str, ...], tuple[float, ...]], list[int]] = {}
    for row, sample in enumerate(source.samples):
        if sample.kind in ("pure", "mixture"):
            fractions = sample.fractions or (1.0,)
            by_recipe.setdefault((sample.paints, fractions), []).append(row)
    readings = []
    recipes = {}
    for (codes, fractions), rows in by_recipe.items():
        several = grid_readings(source, rows, grid)
        # A probe held by hand: repeats differ in level, not in shape.
        level = several.mean(axis=1, keepdims=True)
        several = several * np.median(level) / level
        mean = several.mean(axis=0)
        readings.append(mean * min(1.0, _BRIGHTEST / mean.max()))
        recipes[source.samples[rows[0]].name] = dict(zip(codes, fractions, strict=True))
    progress(source.name)
    recovery = fit(list(recipes), grid, np.array(readings), recipes)
    binder = "oil" if source.group == "grillini" else ""
    return [
        exemplar(recovery, number, source, code, binder=binder, told_by="mixtures")
        for number, code in enumerate(recovery.paints)
        if any(codes == (code,) for codes, _ in by_recipe)
    ]


def _masstones(
    source: Source, grid: Float[np.ndarray, "bands"], binder: str, maker: str
) -> Iterator[Exemplar]:
    """Opaque pure paints of known families, repeats averaged: k/s alone."""
    for code, paint in source.paints.items():
        if paint.family in (*UNCLEAR, FOREIGN):
            continue
        rows = [row for row, sample in enumerate(source.samples) if sample.paints == (code,)]
        progress(f"{source.name}: {code}")
        mean = grid_readings(source, rows, grid).mean(axis=0, keepdims=True)
        recovery = fit([code], grid, mean, {code: {code: 1.0}})
        found = exemplar(recovery, 0, source, code, mark=code.replace(" ", "-"), binder=binder)
        yield replace(found, paint=f"{maker}{found.paint}")


def _coats(
    source: Source, control: str, binder: str, expectations: Expectations
) -> Iterator[Exemplar]:
    """Coats of each pure paint over a ground that was read alone: a thin and a thick one, or one.

    Args:
        source: its readings.
        control: sample that is the bare ground.
        binder: of the paints that are taken, as the source has it; empty where it states none.
        expectations: of thickness.
    """
    grid = grid_of(source)
    ground = next(row for row, sample in enumerate(source.samples) if sample.name == control)
    bare = grid_readings(source, [ground], grid)[0]
    word = binder.lower().replace(" ", "-")
    for code, paint in source.paints.items():
        rows = [
            row
            for row in source.chosen("pure")
            if source.samples[row].paints == (code,) and binder in source.samples[row].binder
        ]
        if not rows or paint.family in UNCLEAR:
            continue
        progress(f"{source.name}: {code}")
        names = [source.samples[row].name for row in rows]
        recovery = fit(
            names,
            grid,
            grid_readings(source, rows, grid),
            {name: {code: 1.0} for name in names},
            bare=bare,
            expectations=expectations,
        )
        yield exemplar(
            recovery,
            0,
            source,
            code,
            mark=f"{word}-{code}" if binder else "",
            binder=binder.lower(),
            told_by="a thin and a thick coat over gypsum" if len(rows) > 1 else "",
        )


# ---- all sources ---------------------------------------------------------------------------------


def on_one_scale(exemplars: Sequence[Exemplar]) -> list[Exemplar]:
    """k and s of each source times one factor, so that the median of its paints' s is that of
    the oils that ship.
    """
    oils = glazejax.catalogue.load("oils")
    wanted = np.median([np.median(np.asarray(paint.scattering)) for paint in oils.values()])
    out = []
    for source in dict.fromkeys(found.source for found in exemplars):
        own = [found for found in exemplars if found.source == source]
        typical = np.median([np.median(found.scattering) for found in own])
        factor = float(wanted / typical)
        out += [
            replace(
                found, absorption=factor * found.absorption, scattering=factor * found.scattering
            )
            for found in own
        ]
    return out


def with_usual_scattering(exemplars: Sequence[Exemplar]) -> list[Exemplar]:
    """Exemplars whose readings show k/s alone get the s of their family's others, or of all, at
    each band; its spread is their error.
    """
    separated = [found for found in exemplars if found.separated]
    out = []
    for found in exemplars:
        if found.separated:
            out.append(found)
            continue
        own = [other for other in separated if other.family == found.family]
        logs = log_scattering(own or separated, found.wavelengths)
        log_s = np.median(logs, axis=0)
        spread = np.maximum(logs.std(axis=0), 0.5) if len(own) > 1 else np.full(log_s.size, 1.0)
        scattering = np.exp(log_s)
        out.append(
            replace(
                found,
                absorption=found.absorption / found.scattering * scattering,
                scattering=scattering,
                log_sd=np.stack([spread, spread]),
                told_by="k/s alone; s is that of "
                + (f"{len(own)} other paints of its family" if own else "other families"),
            )
        )
    return out


def lines_of(exemplars: Sequence[Exemplar]) -> list[str]:
    """How closely readings are met, source by source, and how many paints have k separated from s."""
    lines = ["source        exemplars  families  k and s known  rms of readings: median     worst"]
    for source in dict.fromkeys(found.source for found in exemplars):
        own = [found for found in exemplars if found.source == source]
        rms = [found.rms for found in own]
        lines.append(
            f"{source:<14}{len(own):>9}{len({found.family for found in own}):>10}"
            f"{sum(not found.told_by.startswith('k/s') for found in own):>15}"
            f"{np.median(rms):>25.4f}{max(rms):>10.4f}"
        )
    lines.append(f"{'all':<14}{len(exemplars):>9}{len({found.family for found in exemplars}):>10}")
    return lines


def write_tables(folder: Path, exemplars: Sequence[Exemplar]) -> None:
    """`exemplars.csv` and `exemplars.tsv`."""
    ordered = sorted(exemplars, key=lambda found: found.name.casefold())
    with (folder / "exemplars.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(TITLES)
        for found in ordered:
            sd = np.minimum(found.log_sd, 1.0)
            for band, wavelength in enumerate(found.wavelengths):
                k = found.absorption[band]
                s = found.scattering[band]
                writer.writerow(
                    [
                        found.name,
                        f"{wavelength:g}",
                        f"{k:.4g}",
                        f"{s:.4g}",
                        f"{k * sd[0, band]:.2g}",
                        f"{s * sd[1, band]:.2g}",
                        str(bool(sd[:, band].max() < _OPEN)).lower(),
                    ]
                )
    with (folder / "exemplars.tsv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter="\t", lineterminator="\n")
        writer.writerow(
            ["exemplar", "family", "source", "binder", "paint", "first_nm", "last_nm", "told_by"]
        )
        for found in ordered:
            writer.writerow(
                [
                    found.name,
                    found.family,
                    found.source,
                    found.binder,
                    found.paint,
                    f"{found.wavelengths[0]:g}",
                    f"{found.wavelengths[-1]:g}",
                    found.told_by,
                ]
            )


if __name__ == "__main__":
    main()
