"""Sources of measured paint in one form: samples, what they are made of, and readings of one or
more cameras.

A source in that form is a folder of four tables (`README.md` next to this file has them); the other
sources of the measured data are brought to it here, one function each.
"""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from benchmarks.paintbench.spectra import thick_film_reading
from glazefit.identify.result.groups import GROUPS
from glazejax import catalogue

HERE = Path(__file__).parent
SPLITS = HERE / "splits"

KINDS = ("pure", "mixture", "layers", "control")
FOREIGN = "foreign"
"""Family of a pigment that is in no family of the list."""
UNCLEAR = ("", "unclear")
"""Families of what is left out of all tasks that ask for a family."""
COLOURLESS = frozenset((*GROUPS["a white"], *GROUPS["a black"]))
"""Whites, extenders and blacks: of a mixture only the other families are asked for."""

WHITE_CARD, BLACK_CARD = "white card", "black card"
"""Supports of films that were read over both."""

# Further readings than this above 1 are a mistake, such as percent.
_TOO_BRIGHT = 2.0


@dataclass(frozen=True, kw_only=True)
class Paint:
    """One paint of a source."""

    code: str
    family: str
    name: str


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One sample: what it is made of and where it lies.

    Attributes:
        name: as in the tables.
        kind: one of `KINDS`.
        paints: codes of its paints; of layers the lower one first, where that is known.
        fractions: of each, summing to one; empty where they are not known.
        binder, support: in words; empty where they are not known.
        test: whether it is to be named or predicted, and never learnt from.
    """

    name: str
    kind: str
    paints: tuple[str, ...]
    fractions: tuple[float, ...] = ()
    binder: str = ""
    support: str = ""
    test: bool = True


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Readings of all samples of a source by one instrument, reflectance factors.

    A sample that this camera has not read is a row of NaN.
    """

    wavelengths: Float[np.ndarray, "bands"]
    readings: Float[np.ndarray, "samples bands"]


@dataclass(frozen=True, kw_only=True)
class Source:
    """Samples of one hand or laboratory.

    Attributes:
        name: of the folder.
        paints: by code.
        samples: in the order of the cameras' rows.
        cameras: one or more.
        bare: readings of the bare cards below the samples, where films were read over two cards.
        extra: whether it was added from outside: all of its samples are tests.
        measured_only: whether its licence lets it be asked, and nothing be learnt from it.
    """

    name: str
    paints: Mapping[str, Paint]
    samples: tuple[Sample, ...]
    cameras: tuple[Camera, ...]
    bare: Float[np.ndarray, "samples bands"] | None = None
    extra: bool = False
    measured_only: bool = False

    @property
    def learnable(self) -> bool:
        """Whether methods may learn from its samples."""
        return not (self.extra or self.measured_only)

    @property
    def group(self) -> str:
        """The name up to its first hyphen: sources of one group were made by one hand."""
        return self.name.split("-")[0]

    def families(self, sample: Sample) -> tuple[str, ...]:
        """Families of a sample's paints, each once."""
        return tuple(dict.fromkeys(self.paints[code].family for code in sample.paints))

    def clear(self, sample: Sample) -> bool:
        """Whether the family of each of its paints is known, or known to be none of the list."""
        return not any(family in UNCLEAR for family in self.families(sample))

    def take(self, rows: Sequence[int]) -> "Source":
        """The same with some of its samples."""
        index = list(rows)
        return replace(
            self,
            samples=tuple(self.samples[row] for row in index),
            cameras=tuple(replace(c, readings=c.readings[index]) for c in self.cameras),
            bare=None if self.bare is None else self.bare[index],
        )

    def chosen(self, kind: str) -> list[int]:
        """Rows of one kind; of films that were read over two cards, those over the white one: every
        task that chooses takes a film as hiding what is below, and chalk over a black card is black.
        """
        return [
            row
            for row, sample in enumerate(self.samples)
            if sample.kind == kind and sample.support != BLACK_CARD
        ]


# ---- the form in which sources are entered -------------------------------------------------------


def read_source(folder: Path, split: Path | None = None, extra: bool = False) -> Source:
    """A source from a folder in the form that `README.md` describes.

    Args:
        folder: with `reflectance*.tsv`, `samples.tsv` and `paints.tsv`.
        split: table of samples that are tests and samples that may be learnt from; by default the
            folder's own `split.tsv`, and without one all are tests.
        extra: whether all are tests, whatever a split says.

    Raises:
        SystemExit: a table is missing or does not fit the others; names the file and the fix.
    """
    tables = sorted(folder.glob("reflectance*.tsv"))
    if not tables:
        raise SystemExit(f"{folder}: no reflectance*.tsv; a source needs one for each camera")
    paints = {
        row["code"]: Paint(code=row["code"], family=row["family"].strip(), name=row["name"])
        for row in _rows(folder / "paints.tsv", ("code", "family", "name"))
    }
    samples = tuple(_sample(row, paints, folder) for row in _rows(folder / "samples.tsv", _COLUMNS))
    if not samples:
        raise SystemExit(f"{folder / 'samples.tsv'}: no samples")
    names = [sample.name for sample in samples]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SystemExit(f"{folder / 'samples.tsv'}: {min(twice)!r} stands there twice")
    split = split or folder / "split.tsv"
    if not extra and split.is_file():
        samples = split_samples(samples, split)
    cameras = tuple(_camera(table, names) for table in tables)
    unread = [
        name
        for row, name in enumerate(names)
        if all(np.isnan(camera.readings[row]).all() for camera in cameras)
    ]
    if unread:
        raise SystemExit(f"{folder}: no camera has read sample {unread[0]!r} of samples.tsv")
    return Source(name=folder.name, paints=paints, samples=samples, cameras=cameras, extra=extra)


_COLUMNS = ("sample", "kind", "paints", "fractions", "binder", "support")


def _rows(path: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    if not path.is_file():
        raise SystemExit(f"{path}: no such file")
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file, delimiter="\t")
        missing = [name for name in columns if name not in (reader.fieldnames or ())]
        if missing:
            raise SystemExit(f"{path}: no column {missing[0]!r}; it has {reader.fieldnames}")
        return [{key: value or "" for key, value in row.items() if key} for row in reader]


def _sample(row: dict[str, str], paints: Mapping[str, Paint], folder: Path) -> Sample:
    where = f"{folder / 'samples.tsv'}: sample {row['sample']!r}"
    if row["kind"] not in KINDS:
        raise SystemExit(f"{where} is of kind {row['kind']!r}; kinds are {', '.join(KINDS)}")
    codes = tuple(code.strip() for code in row["paints"].split(" + ") if code.strip())
    unknown = [code for code in codes if code not in paints]
    if unknown or not codes:
        raise SystemExit(f"{where} has the paint {(unknown or [''])[0]!r}, not in paints.tsv")
    try:
        fractions = tuple(float(part) for part in row["fractions"].split(" + ") if part.strip())
    except ValueError:
        raise SystemExit(f"{where} has the fractions {row['fractions']!r}") from None
    if fractions and (len(fractions) != len(codes) or not min(fractions) >= 0 < sum(fractions)):
        raise SystemExit(f"{where} has {len(codes)} paints and the fractions {row['fractions']!r}")
    total = sum(fractions)
    return Sample(
        name=row["sample"],
        kind=row["kind"],
        paints=codes,
        fractions=tuple(part / total for part in fractions),
        binder=row["binder"],
        support=row["support"],
    )


def split_samples(samples: tuple[Sample, ...], path: Path) -> tuple[Sample, ...]:
    """Samples marked as tests or as learnt from, by a table of both.

    Raises:
        SystemExit: a sample is not in the table, or is neither 'train' nor 'test'.
    """
    marks = {row["sample"]: row["split"] for row in _rows(path, ("sample", "split"))}
    for sample in samples:
        if marks.get(sample.name) not in ("train", "test"):
            raise SystemExit(
                f"{path}: sample {sample.name!r} is {marks.get(sample.name)!r}; write train or test"
            )
    return tuple(replace(sample, test=marks[sample.name] == "test") for sample in samples)


def _camera(path: Path, names: list[str]) -> Camera:
    with path.open(encoding="utf-8") as file:
        head = file.readline().rstrip("\r\n").split("\t")
        try:
            table = np.loadtxt(file, delimiter="\t", ndmin=2)
        except ValueError as error:
            raise SystemExit(f"{path}: {error}") from None
    if head[0] != "wavelength_nm" or table.shape[1] != len(head) or len(table) < 3:
        raise SystemExit(
            f"{path}: needs a first column wavelength_nm, then one for each sample, and three bands"
        )
    column = {name: number for number, name in enumerate(head)}
    unknown = [name for name in head[1:] if name not in names]
    if unknown:
        raise SystemExit(f"{path}: sample {unknown[0]!r} is not in samples.tsv")
    readings = np.full((len(names), len(table)), np.nan)
    for row, name in enumerate(names):
        if name in column:
            readings[row] = table[:, column[name]]
    return checked(Camera(wavelengths=table[:, 0], readings=readings), str(path))


def checked(camera: Camera, where: str) -> Camera:
    """A camera whose wavelengths ascend and whose readings are reflectance factors, as fractions.

    Raises:
        SystemExit: they are not.
    """
    if not (np.diff(camera.wavelengths) > 0).all():
        raise SystemExit(f"{where}: wavelengths must ascend")
    known = camera.readings[np.isfinite(camera.readings)]
    if known.size and np.percentile(known, 99.9) > _TOO_BRIGHT:
        raise SystemExit(f"{where}: reflectance {known.max():g}; write fractions, not percent")
    return camera


# ---- sources in other forms ----------------------------------------------------------------------

_KIMERA = {
    "white": "titanium white",
    "cold yellow": "azo yellow",
    "warm yellow": "azo yellow",
    "yellow oxide": "yellow ochre",
    "orange": "azo red",
    "red": "azo red",
    "red oxide": "red ochre",
    "magenta": "azo red",
    "violet": "azo red",
    "blue red shade": "phthalocyanine blue",
    "blue green shade": "phthalocyanine blue",
    "green": "phthalocyanine green",
    "black": "carbon black",
}
_RRT = (
    ("BurntUmber", "burnt umber", "thin"),
    ("BurntUmber", "burnt umber", "thick"),
    ("Carmine", "carmine", "thin"),
    ("Carmine", "carmine", "thick"),
    ("Vermilion", "vermilion", "thin"),
    ("Vermilion", "vermilion", "thick"),
    ("Malachite", "malachite", "thin"),
    ("Malachite", "malachite", "thick"),
    ("Azurite", "azurite", "thin"),
    ("Azurite", "azurite", "thick"),
    ("LeadWhite", "lead white", ""),
    ("IvoryBlack", "carbon black", ""),
    ("Gypsum", "gypsum", "ground"),
)


def read_revigo(folder: Path) -> Source:
    """Oils over a white and a black card: each film is two samples, `01A over white` and over
    black.
    """
    rows = _rows(folder / "reflectance.tsv", ("Name",))
    bands = [name for name in rows[0] if name != "Name"]
    spectra = {row["Name"]: [float(row[band]) / 100.0 for band in bands] for row in rows}
    samples = []
    readings = []
    bare = []
    for line in (folder / "mixtures.tsv").read_text(encoding="utf-8").splitlines():
        name, recipe = line.split("\t")
        if f"{name}_ow" not in spectra:
            continue
        codes, weights = (part.split("-") for part in recipe.split("|"))
        parts = {c: float(w) for c, w in zip(codes, weights, strict=True) if float(w) > 0}
        for card, letter in ((WHITE_CARD, "w"), (BLACK_CARD, "b")):
            samples.append(
                Sample(
                    name=f"{name} over {card.removesuffix(' card')}",
                    kind="pure" if len(parts) == 1 else "mixture",
                    paints=tuple(parts),
                    fractions=tuple(part / sum(parts.values()) for part in parts.values()),
                    binder="oil",
                    support=card,
                )
            )
            readings.append(spectra[f"{name}_o{letter}"])
            bare.append(spectra[f"{name}_{letter}"])
    families = catalogue.families_of("oils")
    paints = {code: Paint(code=code, family=families[code], name=code) for code in families}
    source = _source("revigo", paints, samples, np.array([float(b) for b in bands]), readings)
    return replace(source, bare=np.array(bare))


def read_kimera(folder: Path) -> Source:
    """Acrylics in masstone and as tints with white, three readings each."""
    listed = json.loads((folder / "masstone.json").read_text(encoding="utf-8"))
    wavelengths = np.asarray(listed[0]["values"])
    samples = []
    readings = []
    seen: dict[str, int] = {}
    for entry in listed[1:]:
        seen[entry["name"]] = seen.get(entry["name"], 0) + 1
        samples.append(
            Sample(
                name=f"{entry['name']}-r{seen[entry['name']]}",
                kind="pure",
                paints=(entry["name"],),
                fractions=(1.0,),
                binder="acrylic",
                support="black-primed plywood",
            )
        )
        readings.append(np.asarray(entry["reflectance"]) / 100.0)
    paints = {code: Paint(code=code, family=_KIMERA[code], name=code) for code in _KIMERA}
    return _source("kimera", paints, samples, wavelengths, readings)


def read_rrt(folder: Path) -> Source:
    """The reference instrument's readings of a panel: six paints on gypsum, thin and thick."""
    table = np.loadtxt(folder / "pigment_panel_reference.csv")
    samples = []
    for code, _, coat in _RRT:
        samples.append(
            Sample(
                name=f"{code} {coat}".strip(),
                kind="control" if code == "Gypsum" else "pure",
                paints=(code,),
                fractions=(1.0,),
                support="gypsum ground",
            )
        )
    paints = {code: Paint(code=code, family=family, name=code) for code, family, _ in _RRT}
    # From where the detector sees more than its noise; a reading of 0 there is a lost one.
    bands = (table[:, 0] >= 380.0) & (table[:, 0] <= 2200.0)
    return _source("rrt", paints, samples, table[bands, 0], table[bands, 1:].T)


def read_hyppigments(folder: Path) -> Source:
    """A chart of Kremer's pigments, each coat over four grounds: shade 1 is over the darkest.

    Families by Kremer's numbers are in `kremer_families.tsv` next to this file.
    """
    families = {row["number"]: row for row in _rows(HERE / "kremer_families.tsv", ("number",))}
    head = (folder / "speclib_averages.hdr").read_text(encoding="utf-8")
    numbers = _header_list(head, "pnumber")
    wavelengths = np.array([float(value) for value in _header_list(head, "wavelength")])
    readings = np.fromfile(folder / "speclib_averages.sli", dtype="<f4").astype(np.float64)
    readings = readings.reshape(len(numbers), len(wavelengths))
    samples = []
    patches: dict[str, int] = {}
    for row, number in enumerate(numbers):
        if row % 4 == 0:
            patches[number] = patches.get(number, 0) + 1
        samples.append(
            Sample(
                name=f"{number}-{patches[number]} shade {row % 4 + 1}",
                kind="pure",
                paints=(number,),
                fractions=(1.0,),
                support="chart",
            )
        )
    paints = {
        number: Paint(code=number, family=row["family"], name=f"{row['name']}, Kremer {number}")
        for number, row in families.items()
    }
    return _source("hyppigments", paints, samples, wavelengths, readings)


def _header_list(head: str, name: str) -> list[str]:
    """A list of an ENVI header, by its key."""
    start = head.index(f"\n{name} = {{") + len(name) + 5
    return [item.strip() for item in head[start : head.index("}", start)].split(",")]


def read_golden(folder: Path) -> Source:
    """Acrylics as K and S: what a thick film reflects under the source's own surface correction.

    These are no readings: they are learnt from, and never a test.
    """
    rows = _rows(folder / "kubelka_munk.tsv", ("paint", "wavelength_nm", "K", "S"))
    codes = list(dict.fromkeys(row["paint"] for row in rows))
    by_paint = {code: [row for row in rows if row["paint"] == code] for code in codes}
    wavelengths = np.array([float(row["wavelength_nm"]) for row in by_paint[codes[0]]])
    samples = []
    readings = []
    for code in codes:
        absorption = np.array([float(row["K"]) for row in by_paint[code]])
        scattering = np.array([float(row["S"]) for row in by_paint[code]])
        samples.append(
            Sample(name=code, kind="pure", paints=(code,), fractions=(1.0,), binder="acrylic")
        )
        readings.append(thick_film_reading(absorption, scattering))
    families = catalogue.families_of("acrylics")
    paints = {code: Paint(code=code, family=families[code] or FOREIGN, name=code) for code in codes}
    source = _source("golden", paints, samples, wavelengths, readings)
    return replace(source, samples=tuple(replace(s, test=False) for s in source.samples))


def _source(
    name: str,
    paints: Mapping[str, Paint],
    samples: list[Sample],
    wavelengths: Float[np.ndarray, "bands"],
    readings: object,
) -> Source:
    camera = Camera(wavelengths=wavelengths, readings=np.asarray(readings, dtype=np.float64))
    split = SPLITS / f"{name}.tsv"
    listed = tuple(samples)
    if split.is_file():
        listed = split_samples(listed, split)
    return Source(name=name, paints=paints, samples=listed, cameras=(checked(camera, name),))


# ---- all of them ---------------------------------------------------------------------------------

_OTHERS: Mapping[str, Callable[[Path], Source]] = {
    "revigo": read_revigo,
    "kimera": read_kimera,
    "rrt": read_rrt,
    "hyppigments": read_hyppigments,
    "golden": read_golden,
}
_SLIPS = {"hyperdoc": ("74A",)}
"""Samples that their source's own notes say are mistakes."""
_MEASURED_ONLY = ("makers",)
"""Sources whose licence is not clear: asked, and never learnt from."""


def read_sources(data: Path, extra: Path | None = None) -> list[Source]:
    """All sources of a folder of measured data, and those of a further folder.

    Args:
        data: with a folder for each source.
        extra: with a folder for each further source, in the bench's form, all of them tests; or
            one such folder itself.

    Raises:
        SystemExit: a folder is missing, or a table is wrong.
    """
    if not data.is_dir():
        raise SystemExit(f"{data}: no such folder; set GLAZEJAX_DATA or give --data")
    out = []
    for folder in sorted(path for path in data.iterdir() if path.is_dir()):
        if folder.name in _OTHERS:
            out.append(_OTHERS[folder.name](folder))
        elif (folder / "samples.tsv").is_file():
            source = read_source(folder, SPLITS / f"{folder.name}.tsv")
            out.append(replace(source, measured_only=folder.name in _MEASURED_ONLY))
    if not out:
        raise SystemExit(f"{data}: no source of measured paint in it")
    if extra is not None:
        out.extend(_read_extra(extra))
    return [_without_slips(source) for source in out]


def _read_extra(extra: Path) -> list[Source]:
    if not extra.is_dir():
        raise SystemExit(f"--extra {extra}: no such folder")
    if (extra / "samples.tsv").is_file():
        return [read_source(extra, extra=True)]
    folders = sorted(path for path in extra.iterdir() if (path / "samples.tsv").is_file())
    if not folders:
        raise SystemExit(f"--extra {extra}: no folder in it has a samples.tsv")
    return [read_source(folder, extra=True) for folder in folders]


def _without_slips(source: Source) -> Source:
    slips = _SLIPS.get(source.group, ())
    return source.take([row for row, s in enumerate(source.samples) if s.name not in slips])
