"""The report of a map: one HTML file without anything from elsewhere, and its pictures as PNG
files.
"""

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.io.write import write_files

from ...page.frame import END, facts_html, page_start
from ..store.chunk import Members, SetSum
from ..store.layout import STATUS_WORDS, Status, Way
from .overview import Overview, overview
from .page_sets import paints_table, sets_table, share_html
from .page_spots import spots_html
from .pictures import (
    RGB,
    MapPicture,
    colour_numbers,
    enlarge,
    false_colour,
    found_paints,
    legend_map,
    legend_places,
    legend_sets,
    numbers_of,
    own_colours,
    paint_pictures,
    png,
    write_pictures,
)

if TYPE_CHECKING:
    import xarray as xr

_WAYS = {
    Way.NONE: "not told",
    Way.UPDATED: "from the representative next to it, in closed form",
    Way.SEARCHED: "by a search of its own",
    Way.NEIGHBOUR: "from a pixel nearby that was searched, in closed form",
}


@dataclass(frozen=True)
class Provenance:
    """What the report says beside the map; what is left out is not spoken of.

    Attributes:
        title: of the painting or cube.
        created: date and time.
        command: as it was typed.
        facts: names and words for the head of the page, such as the instrument, the ground and the
            paints tried.
        options: names and values of what was set.
        versions: names and numbers of programs.
        platform: the computer, in words.
        inputs: role, name and hash of each file that was read.
        hashed: what the hashes are of.
        shortcuts: name of each, and what it did and may cost.
        agreement: what was compared with the full search, and how far they agree.
        notes: sentences of the reader and the solver.
        unknown: further sentences on what the map does not say.
    """

    title: str
    created: str = ""
    command: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    platform: str = ""
    inputs: Sequence[tuple[str, str, str]] = ()
    hashed: str = "SHA-256"
    shortcuts: Mapping[str, str] = field(default_factory=dict)
    agreement: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()
    unknown: Sequence[str] = ()


def write_report(
    dataset: "xr.Dataset",
    tallies: Mapping[str, float],
    sets: Mapping[Members, SetSum],
    provenance: Provenance,
    folder: str | Path,
    *,
    cube: "xr.DataArray | None" = None,
    overwrite: bool = False,
) -> Path:
    """Write report.html into a folder, and the pictures beside it as PNG files in its folder
    pictures.

    Args:
        dataset: the map, with the variables of `layout.VARIABLES` and the coordinate `paint`.
        tallies: counts that the solver kept, by name.
        sets: sums over the pixels of each set, by its members ascending; () for none.
        provenance: what else is to be said.
        folder: is made.
        cube: the readings (y, x, wavelength) for a picture in false colour; none is made without.
        overwrite: replace an older report.

    Returns:
        Path of the page.

    Raises:
        FileExistsError: there is a report, and `overwrite` is false.
        ValueError: the dataset is no map.
    """
    folder = Path(folder)
    path = folder / "report.html"
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} is there already: --overwrite replaces it")
    look = overview(dataset)
    grid = np.asarray(dataset.attrs.get("working_wavelengths", ()), float)
    false = None if cube is None else false_colour(cube, look.step)
    numbers = numbers_of(look)
    paints = [paint_pictures(look, paint) for paint in found_paints(look)]
    pieces = page(
        look,
        tallies,
        sets,
        provenance,
        grid=grid,
        numbers=numbers,
        paints=paints,
        false=false,
        spots=dataset.attrs.get("spots", ()),
    )
    shown = [piece.encode("utf-8", "xmlcharrefreplace") for piece in pieces]
    (folder / "pictures").mkdir(parents=True, exist_ok=True)
    flat = [*numbers, *(each for both in paints for each in both)]
    write_pictures(
        look,
        folder / "pictures",
        flat,
        own=own_colours(look),
        false=None if false is None else false[0],
    )
    write_files({path: shown}, overwrite=overwrite)
    return path


def page(
    look: Overview,
    tallies: Mapping[str, float],
    sets: Mapping[Members, SetSum],
    provenance: Provenance,
    grid: np.ndarray,
    numbers: Sequence[MapPicture],
    paints: Sequence[Sequence[MapPicture]],
    false: tuple[RGB, str] | None,
    spots: Sequence[Mapping[str, Any]] = (),
) -> Iterator[str]:
    """The page, piece by piece."""
    style = files("glazefit.mapping.show").joinpath("page.css").read_text(encoding="utf-8")
    title = f"Map of paints: {provenance.title}"
    yield page_start(title, _head(look, provenance), style=style, images="data:")
    yield _summary(look)
    yield f'<div class="maps{"" if false is None else " three"}">\n' + _figure(
        look, enlarge(look.colour), "True colour", "sRGB for daylight D65."
    )
    yield _legend_figure(look)
    if false is not None:
        yield _figure(
            look, false[0], "False colour", f"Shown as {false[1]}, each stretched to its range."
        )
    yield "</div>\n"
    yield (
        "<h2>Sets of paints</h2>\n<p>The most probable set of each pixel. Probability: mean over "
        "the set’s pixels. Black line and grey band: mean reflectance of the pixels and one "
        "standard deviation of their spread; dashed: mean of their fits.</p>\n"
        + sets_table(look, sets, grid)
    )
    yield "<h2>How sure, how thick, how well it fits</h2>\n<p>Grey: not mapped, or not known.</p>\n"
    yield (
        '<div class="maps">\n'
        + "".join(_number_figure(look, each) for each in numbers)
        + "</div>\n"
    )
    yield "<h2>Paints</h2>\n" + paints_table(look)
    if paints:
        yield (
            "<p>Amount: thickness times share by mass, where the pixel’s most probable set has "
            "the paint.</p>\n"
        )
    for both in paints:
        yield (
            '<div class="maps small">\n'
            + "".join(_number_figure(look, each) for each in both)
            + "</div>\n"
        )
    yield spots_html(look, spots, grid)
    yield _unknown(provenance)
    yield _how_made(look, tallies, provenance)
    yield END


def _head(look: Overview, provenance: Provenance) -> str:
    height, width = look.shape
    size = f"{width:,} x {height:,} pixels"
    if look.pixel_area is not None:
        size += f", {look.pixel_area * 1e6:.3g} mm² each"
    if look.step > 1:
        size += (
            f"; pictures show every {look.step} x {look.step} pixels as one, the map itself has all"
        )
    facts = {
        "Made": provenance.created.replace("T", ", "),
        "Size": size.replace(" x ", " × "),
        **provenance.facts,
    }
    if provenance.notes:
        facts["Noticed"] = " ".join(provenance.notes)
    return facts_html(facts)


def _summary(look: Overview) -> str:
    total = look.shape[0] * look.shape[1]
    none = look.sets.get((), 0)
    rows = "".join(
        f'<tr><td>{escape(STATUS_WORDS[status].capitalize())}</td><td class="n">{count:,}</td>'
        f'<td class="n">{share_html(count, total)}</td></tr>\n'
        for status, count in sorted(look.status.items(), key=lambda each: -each[1])
    )
    table = (
        '<div class="scroll"><table class="amounts">\n<thead><tr><th>Pixels</th><th '
        'class="n">Number</th><th '
        f'class="n">Share</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n'
        if set(look.status) != {Status.MAPPED}
        else ""
    )
    undone = look.status.get(Status.UNDONE, 0)
    warn = (
        f'<p class="warn"><strong>Not finished.</strong> {share_html(undone, total)} of the map '
        "is not done yet; the "
        "same command goes on with it.</p>\n"
        if undone
        else ""
    )
    if not look.mapped:
        return f"<h2>Summary</h2>\n{warn}<p>No pixel was mapped.</p>\n{table}"
    paints = ", ".join(escape(look.paints[paint]) for paint in found_paints(look, 0.01))
    first = look.ranked[0] if look.ranked else ()
    largest = (
        f" The largest set is {escape(look.words(first))}, "
        f"{share_html(look.sets[first], look.mapped)}."
        if first
        else ""
    )
    return (
        f'<h2>Summary</h2>\n{warn}<p class="verdict">{share_html(look.explained, look.mapped)} '
        f"of {look.mapped:,} "
        f"mapped pixels are explained by {len(look.ranked):,} "
        f"{'set' if len(look.ranked) == 1 else 'sets'} of paints; "
        f"{share_html(none, look.mapped)} by none of them.{largest} Paints in 1\u202f% of the "
        "area or more: "
        f"{paints or 'none'}.</p>\n{table}"
    )


def _figure(
    look: Overview, image: RGB, title: str, words: str, over: str = "", after: str = ""
) -> str:
    # Alone a picture of few pixels is shown as squares.
    square = " square" if look.step == 1 and image.shape[1] >= 2 * look.shape[1] else ""
    data = base64.b64encode(png(image)).decode("ascii")
    caption = f"<strong>{escape(title)}.</strong> {escape(words)}".rstrip()
    return (
        f'<figure><div class="map{square}"><img alt="{escape(title)}" width="{image.shape[1]}" '
        f'height="{image.shape[0]}" src="data:image/png;base64,{data}">{over}</div>{after}'
        f"<figcaption>{caption}</figcaption></figure>\n"
    )


def _legend_figure(look: Overview) -> str:
    """The legend map with the number of each set in its midst."""
    image = legend_map(look)
    height, width = image.shape[:2]
    unit = width / 100
    marks = ""
    places = legend_places(look)
    for n, members in enumerate(legend_sets(look), start=1):
        if members in places:
            x = places[members][0] * width
            y = places[members][1] * height
            marks += (
                f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{2.1 * unit:.1f}" fill="#fff" '
                f'stroke="#26221e" stroke-width="{0.2 * unit:.2f}"/><text x="{x:.0f}" '
                f'y="{y + 0.9 * unit:.1f}" text-anchor="middle" font-size="{2.5 * unit:.1f}" '
                f'font-family="sans-serif" fill="#26221e">{n}</text>'
            )
    over = f'<svg viewBox="0 0 {width} {height}" aria-hidden="true">{marks}</svg>'
    words = (
        "Numbers and colours as in the table below; striped: none of these paints; white: not "
        "mapped."
    )
    return _figure(look, image, "Most probable set of paints", words, over)


def _number_figure(look: Overview, shown: MapPicture) -> str:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    stops = ", ".join(
        to_hex(colour) for colour in colormaps[shown.scale.colours](np.linspace(0, 1, 17))
    )
    unit = f" {shown.scale.unit}" if shown.scale.unit else ""
    more = "" if shown.scale.high == 1.0 and not unit else " and more"
    after = (
        f'<div class="scale">{shown.scale.low:g}<span class="bar" '
        f'style="background:linear-gradient(90deg, {stops})">'
        f"</span>{shown.scale.high:g}{escape(unit)}{more}</div>"
    )
    return _figure(look, colour_numbers(shown), shown.title, shown.words, after=after)


def _unknown(provenance: Provenance) -> str:
    points = [
        "Probabilities hold for these paints and these assumptions. A paint that is not in the "
        "catalogue cannot be found: its pixels are ‘none of these’, or are taken for a mixture "
        "that looks like it.",
        "Paints of like spectra cannot be told apart, and share their probability. What lies "
        "under a coat that hides it leaves no trace in a reading.",
        "A pixel on an edge sees two paints side by side, and may be read as their mixture.",
        "Standard deviations hold if the pixel is of the paints named; they do not count that it "
        "might be of others.",
        *provenance.unknown,
    ]
    return (
        "<h2>What the map does not say</h2>\n<ul>\n"
        + "".join(f"<li>{escape(p)}</li>\n" for p in points)
        + "</ul>\n"
    )


def _how_made(look: Overview, tallies: Mapping[str, float], provenance: Provenance) -> str:
    out = "<h2>How it was made</h2>\n"
    facts = {
        "Command": provenance.command,
        "Versions": ", ".join(f"{n} {v}" for n, v in provenance.versions.items()),
    }
    if provenance.platform:
        facts["Computer"] = provenance.platform
    facts["Catalogue"] = f"{len(look.paints)} paints: {', '.join(look.paints)}"
    out += facts_html(facts)
    if look.ways:
        ways = {_WAYS[way].capitalize(): f"{count:,} pixels" for way, count in look.ways.items()}
        out += "<h4>How pixels were answered</h4>\n" + facts_html(ways)
    for title, named in (
        ("Shortcuts, and what each may cost", provenance.shortcuts),
        ("Checked against the full search", provenance.agreement),
        ("Options", provenance.options),
        (
            "Counts",
            {name.replace("_", " ").capitalize(): f"{n:,.10g}" for name, n in tallies.items() if n},
        ),
    ):
        if named:
            out += f"<h4>{title}</h4>\n{facts_html(named)}"
    if provenance.inputs:
        rows = "".join(
            f"<tr><td>{escape(role)}</td><td><code>{escape(name)}</code></td><td><code>{escape(digest)}</code></td></tr>\n"
            for role, name, digest in provenance.inputs
        )
        out += (
            "<h4>Files that were read</h4>\n<div "
            'class="scroll"><table>\n<thead><tr><th>As</th><th>File</th>'
            f"<th>{escape(provenance.hashed)}</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
        )
    return out
