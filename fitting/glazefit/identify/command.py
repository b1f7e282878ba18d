"""The command `glazejax identify`: measured spectra in; paints, fractions, thickness and probabilities out."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.geometry import Geometry

    from .result import Identification

_GEOMETRIES = ("di:8", "de:8", "45:0")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("identify")(identify)


def identify(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Table of spectra. Rows in fours, NAME_b, NAME_w, NAME_ob and NAME_ow, are films over a bare black "
            "and a bare white card; any other spectra lie on --ground, or are --opaque.",
            show_default=False,
        ),
    ] = None,
    ground: Annotated[
        str | None,
        typer.Option(
            help="Ground below: its internal reflectance, 0 to 1, or a table FILE, FILE:SAMPLE.", show_default=False
        ),
    ] = None,
    bare: Annotated[
        bool, typer.Option("--bare", help="--ground is what the bare ground reads in air, with the same instrument.")
    ] = False,
    opaque: Annotated[bool, typer.Option("--opaque", help="The films hide their ground.")] = False,
    pigments: Annotated[
        Path | None,
        typer.Option(
            help="Your own paints (pigments.csv of `glazejax recover`) instead of the catalogue's.", show_default=False
        ),
    ] = None,
    only: Annotated[str, typer.Option(help="Only these paints, such as ZincWhite,Eosin.", show_default=False)] = "",
    samples: Annotated[str, typer.Option(help="Only these spectra or films.", show_default=False)] = "",
    max_paints: Annotated[int, typer.Option(help="Largest number of paints in a film: 1, 2 or 3.")] = 3,
    layers: Annotated[int, typer.Option(help="2 tries two coats too, in both orders.")] = 1,
    geometry: Annotated[
        str, typer.Option(help="Instrument: di:8 (sphere, specular included), de:8 (excluded) or 45:0.")
    ] = "di:8",
    refractive_index: Annotated[float, typer.Option(help="Of the paint.")] = 1.5,
    noise: Annotated[float, typer.Option(help="Standard deviation of a reading near black.")] = 0.0005,
    noise_share: Annotated[float, typer.Option(help="What is added to it for each unit of reflectance.")] = 0.002,
    model_error: Annotated[
        float | None,
        typer.Option(help="Standard deviation of the model's own error in reflectance.", show_default=False),
    ] = None,
    thickness: Annotated[float, typer.Option(help="Usual thickness of a film, micrometres.")] = 25.0,
    top: Annotated[int, typer.Option(help="Explanations shown and written for each spectrum.")] = 5,
    csv: Annotated[Path | None, typer.Option(help="Write the explanations to this table.", show_default=False)] = None,
    residuals: Annotated[
        Path | None, typer.Option(help="Write measured, fitted and residual spectra.", show_default=False)
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Draw the first spectra to this picture.", show_default=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")] = False,
) -> None:
    """Which paints are in a film: a ranked list with probabilities, fractions and thickness.

    All sets of up to three paints compete, and "nothing in the catalogue
    explains this". Thicknesses are on the scale of the catalogue, whose
    films are taken as 25 micrometres thick.

    Example: glazejax identify films.tsv --out found.png
    """
    if file is None:
        raise ValueError("no FILE was given; name a table of spectra, such as films.tsv")
    _check_numbers(max_paints, layers, top, thickness)
    _check_outputs(csv, residuals, out, overwrite)
    seen_by = _geometry(geometry)
    if opaque and ground is not None:
        raise ValueError("--opaque films show no ground; leave out --ground, or leave out --opaque")
    if bare and ground is None:
        raise ValueError("--bare says what kind of number --ground is; give --ground too")

    from rich.console import Console

    from glazejax.commands.main import start_jax

    from ..film.errors import Discrepancy, Prior
    from ..film.films import Instrument, Noise

    start_jax()
    console = Console(highlight=False)
    paints = _paints(pigments, only)
    instrument = Instrument(refractive_index=refractive_index)
    task = _read(file, samples, ground, bare, opaque, seen_by, refractive_index, console)
    errors = Discrepancy() if model_error is None else Discrepancy(amplitude=model_error)
    options = {
        "instrument": instrument,
        "geometry": seen_by,
        "noise": Noise(noise, noise_share),
        "discrepancy": errors,
        "prior": Prior(thickness=thickness * 1e-6),
        "max_paints": max_paints,
        "layers": layers,
        "keep": max(top, 5),
    }
    began = time.perf_counter()
    found, interrupted = _run(task, paints, options)
    seconds = time.perf_counter() - began
    _report(found, console, top, csv, residuals, out, overwrite)
    words = f"{len(found)} spectra" if len(found) > 1 else "1 spectrum"
    console.print(f"[dim]{words} against {len(paints)} paints in {seconds:.1f} s, compilation included.[/dim]")
    if interrupted:
        console.print(f"[yellow]Interrupted: {len(found)} of {len(task.spectra)} spectra were finished.[/yellow]")
        raise typer.Exit(130)


class _Spectra(NamedTuple):
    """What is to be identified."""

    names: tuple[str, ...]
    wavelengths: "np.ndarray"
    spectra: "np.ndarray"
    grounds: "np.ndarray | float | None"


def _check_numbers(max_paints: int, layers: int, top: int, thickness: float) -> None:
    if max_paints not in (1, 2, 3):
        raise ValueError(f"--max-paints is {max_paints}; it must be 1, 2 or 3")
    if layers not in (1, 2):
        raise ValueError(f"--layers is {layers}; it must be 1 or 2")
    if top < 1:
        raise ValueError(f"--top is {top}; it must be 1 or more")
    if not 0 < thickness <= 10_000:
        raise ValueError(f"--thickness is {thickness:g}; it must be above 0 and at most 10000 micrometres, such as 25")


def _check_outputs(csv: Path | None, residuals: Path | None, out: Path | None, overwrite: bool) -> None:
    """Refuse, before anything is computed, what cannot be written."""
    if out is not None:
        from glazejax.plots import check_picture

        check_picture(out, overwrite=overwrite)
    from glazejax.io.outputs import check_output

    for option, path in (("--csv", csv), ("--residuals", residuals)):
        if path is not None:
            check_output(path, overwrite=overwrite, argument=option)
    if csv is not None and csv == residuals:
        raise ValueError(f"--csv and --residuals both name {csv}; they are two tables")


def _geometry(text: str) -> "Geometry":
    from glazejax import Bidirectional, Hemispherical

    if text not in _GEOMETRIES:
        raise ValueError(f"--geometry is {text!r}; it must be one of {', '.join(_GEOMETRIES)}")
    return Bidirectional(45, 0) if text == "45:0" else Hemispherical(8, specular=text == "di:8")


def _paints(path: Path | None, only: str) -> "list[Pigment]":
    from glazejax import catalogue
    from glazejax.paint.describe import find_name
    from glazejax.paint.pigment_table import read_pigments

    known = dict(catalogue.load()) if path is None else read_pigments(path)
    wanted = [name.strip() for name in only.split(",") if name.strip()]
    names = [find_name(name, known) for name in wanted] or list(known)
    return [known[name] for name in dict.fromkeys(names)]


def _read(
    file: Path,
    samples: str,
    ground: str | None,
    bare: bool,
    opaque: bool,
    geometry: "Geometry",
    index: float,
    console: "Console",
) -> _Spectra:
    """Spectra and the grounds below them."""
    import numpy as np

    from glazejax.io import read_spectra

    from ..film.readers import ROWS, read_films
    from .identify import ground_from_air

    table = read_spectra(file)
    for note in table.notes:
        console.print(f"[dim]{file}: {note}[/dim]")
    wanted = [name.strip() for name in samples.split(",") if name.strip()]
    if ground is None and not opaque and all(name.rpartition("_")[2] in ROWS for name in table.names):
        films = read_films(file)
        films = films.select(wanted) if wanted else films
        cards = np.stack([films.bare_black, films.bare_white], axis=1)
        spectra = np.stack([films.over_black, films.over_white], axis=1)
        return _Spectra(films.names, films.wavelengths, spectra, ground_from_air(cards, geometry, index))
    rows = _rows(file, table.names, wanted)
    spectra, names = table.reflectance[rows], tuple(table.names[i] for i in rows)
    if opaque:
        return _Spectra(names, table.wavelengths, spectra, None)
    if ground is None:
        raise ValueError(
            f"{file}: what is under the paint? Give --ground, its reflectance such as 0.9 or a table, or --opaque; or "
            f"rows in fours, such as {names[0]}_b, {names[0]}_w, {names[0]}_ob and {names[0]}_ow"
        )
    below = _ground(ground, table.wavelengths)
    return _Spectra(names, table.wavelengths, spectra, ground_from_air(below, geometry, index) if bare else below)


def _rows(file: Path, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    from ..film.films import nearest

    for name in wanted:
        if name not in names:
            raise ValueError(f"{file} holds no spectrum {name!r}; {nearest(name, names)}")
    return [names.index(name) for name in wanted] or list(range(len(names)))


def _ground(text: str, wavelengths: "np.ndarray") -> "np.ndarray":
    """Reflectance of the ground on the grid of the spectra."""
    import numpy as np

    from glazejax.io import read_sample
    from glazejax.spectra import resample

    try:
        level = float(text)
    except ValueError:
        pass
    else:
        if not 0 <= level <= 1:
            fix = f", which looks like percent: write {level / 100:g}" if 1 < level <= 100 else ""
            raise ValueError(f"--ground is {text}; reflectance lies between 0 and 1{fix}")
        return np.full(wavelengths.shape, level)
    table = read_sample(text, argument="--ground")
    return np.asarray(resample(table.wavelengths, table.reflectance[0], wavelengths))


def _run(task: _Spectra, paints: "list[Pigment]", options: dict[str, Any]) -> "tuple[Identification, bool]":
    """Identify with a progress bar; an interrupt keeps what is finished."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from .identify import identify_chunks
    from .result import Identification

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    parts: list[Identification] = []
    interrupted = False
    chunks = identify_chunks(task.spectra, task.wavelengths, paints, grounds=task.grounds, names=task.names, **options)
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("compiling, then searching", total=len(task.spectra))
        try:
            for part in chunks:
                parts.append(part)
                progress.update(bar, advance=len(part), description="searching")
        except KeyboardInterrupt:
            if not parts:
                raise
            interrupted = True
    return Identification.join(parts), interrupted


def _report(
    found: "Identification",
    console: "Console",
    top: int,
    csv: Path | None,
    residuals: Path | None,
    out: Path | None,
    overwrite: bool,
) -> None:
    from .report import (
        picture,
        print_identification,
        write_candidates,
        write_residuals,
    )

    print_identification(found, console, top, detailed=8 if len(found) <= 8 else 0)
    if csv is not None:
        write_candidates(found, csv, top, overwrite=overwrite)
        console.print(f"Wrote the explanations to {csv}")
    if residuals is not None:
        write_residuals(found, residuals, overwrite=overwrite)
        console.print(f"Wrote measured, fitted and residual spectra to {residuals}")
    if out is not None:
        count = picture(found, out)
        console.print(f"Drew {'the first ' if count < len(found) else ''}{count} to {out}")
