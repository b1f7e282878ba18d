"""The command ``glazejax scene``: a scene file in, a picture and its spectra out."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options, progress

if TYPE_CHECKING:
    from ..appearance.scene.file import SceneFile
    from ..appearance.scene.render_result import Rendered


_SAMPLES = 256


def scene(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Scene file (TOML).",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="Picture to write: .png.")
    ] = Path("scene.png"),
    spectral: Annotated[
        Path | None,
        options.option(
            help="Also write the spectrum of every pixel (raycast only): .npz or .exr (OpenEXR).",
        ),
    ] = None,
    size: Annotated[
        str | None,
        options.option(
            callback=options.checked(lambda text: _read_size(text)),
            help="WIDTHxHEIGHT in pixels instead of the file's, such as 160x120.",
        ),
    ] = None,
    renderer: Annotated[
        str,
        typer.Option(
            callback=options.among("raycast", "mitsuba"),
            help="raycast (lamps, shadows, mirrors) or mitsuba (path tracing with soft shadows, "
            "area lights, relief and light between all surfaces, extra `render`).",
        ),
    ] = "raycast",
    samples: Annotated[
        int | None,
        options.option(
            callback=options.between(1, 1 << 20),
            help="Rays of a pixel with --renderer mitsuba; four times as many halve the noise.  "
            f"[default: {_SAMPLES}]",
        ),
    ] = None,
    overwrite: options.Overwrite = False,
    example: Annotated[
        bool, typer.Option("--example", help="Print a scene file to start from, and stop.")
    ] = False,
) -> None:
    """Render glazed objects under lamps, wavelength by wavelength.

    FILE describes shapes, lamps, a camera and materials: glazes as in
    `glazejax render`, plain and shiny paints, metals, thickness maps.
    Shadows and mirror reflections are computed. After Ctrl-C unfinished
    parts of the picture are grey.

    Example: glazejax scene --example > scene.toml
             glazejax scene scene.toml -o scene.png
             glazejax scene scene.toml --renderer mitsuba --samples 1024
    """
    if example:
        from ..appearance.scene.file import example as text

        typer.echo(text(), nl=False)
        return
    if file is None:
        raise ValueError("name a scene file; glazejax scene --example prints one to start from")
    _check_renderer(renderer, samples, spectral)
    _check_output(out, spectral, overwrite)
    missing = f"there is no scene file {file}; glazejax scene --example prints one to start from"
    options.existing(file, missing)
    from .main import start_jax

    start_jax()
    started = time.perf_counter()
    from ..appearance.scene.file import describe, read_scene

    loaded = read_scene(file)
    if size is not None:
        loaded = _resize(loaded, size)
    typer.echo(f"scene  {file}: {describe(loaded)}")
    for note in loaded.notes:
        _note(note)
    if renderer == "mitsuba" and (state := _without_llvm(loaded, samples or _SAMPLES)):
        _note(state)
    rendered = _render(loaded, spectral is not None, samples or _SAMPLES, renderer)
    if rendered.done == 0:
        typer.echo("stopped before the first pixel: nothing is written", err=True)
        raise typer.Exit(progress.INTERRUPTED)
    _write(loaded, rendered, out, spectral)
    files = str(out) if spectral is None else f"{out} and {spectral}"
    typer.echo(f"wrote  {files} in {time.perf_counter() - started:.1f} s")
    if rendered.done < 1:
        state = f"{rendered.done:.0%} of the picture is finished, the rest is grey"
        if renderer == "mitsuba":
            state = f"{rendered.done:.0%} of the paths are followed, so that noise is left"
        elif rendered.done > 0.99:
            state = "every pixel is there, but not all edges and highlights are smooth"
        typer.echo(f"stopped: {state}", err=True)
        raise typer.Exit(progress.INTERRUPTED)


def _check_renderer(renderer: str, samples: int | None, spectral: Path | None) -> None:
    """Refuse what a renderer does not know, before anything is computed."""
    if renderer == "raycast":
        if samples is not None:
            raise ValueError(
                "--samples belongs to --renderer mitsuba; the ray caster's are antialias in the "
                "file"
            )
        return
    from ..extras import require

    require("mitsuba")
    if spectral is not None:
        raise ValueError(
            "--spectral belongs to --renderer raycast; of Mitsuba's picture only its colours are "
            "kept"
        )


def _check_output(out: Path, spectral: Path | None, overwrite: bool) -> None:
    """Refuse what could not be written in the end, before anything is computed."""
    if out.suffix.lower() != ".png":
        raise ValueError(
            f"{out}: the picture is written as .png; spectra go to --spectral FILE.npz or FILE.exr"
        )
    if spectral is not None:
        from ..appearance.scene.picture import check_spectral

        check_spectral(spectral)
    from ..extras import require

    require("matplotlib")
    options.check_outputs({"--out": out, "--spectral": spectral}, overwrite, pictures=())


def _read_size(text: str) -> tuple[int, int]:
    """Pixels of WIDTHxHEIGHT."""
    try:
        width, height = map(int, text.lower().split("x"))
    except ValueError:
        raise ValueError(
            f"--size {text!r}: write WIDTHxHEIGHT in pixels, such as 160x120"
        ) from None
    return width, height


def _resize(loaded: "SceneFile", text: str) -> "SceneFile":
    """The scene with other numbers of pixels."""
    from dataclasses import replace

    width, height = _read_size(text)
    try:
        return replace(loaded, scene=replace(loaded.scene, width=width, height=height))
    except ValueError as error:
        raise ValueError(f"--size {text!r}: {error}") from None


def _without_llvm(loaded: "SceneFile", samples: int) -> str:
    """Warning of the time it takes where Mitsuba finds no LLVM that works, and what to do; else
    empty.
    """
    from ..appearance.mitsuba.variants import usable_variant

    if not usable_variant().startswith("scalar"):
        return ""
    # Paths a second on two cores; LLVM follows 1.6 million.
    seconds = samples * loaded.scene.width * loaded.scene.height / 3400
    hours = seconds >= 5400
    size = seconds / (3600 if hours else 60)
    return (
        f"Mitsuba finds no libllvm that works here, and takes about {size:.2g} "
        f"{'hours' if hours else 'minutes'} in place of {max(seconds / 470, 1):.2g} seconds: "
        "install LLVM 19 (Debian: apt-get install libllvm19), or name the library in "
        "DRJIT_LIBLLVM_PATH; --size 80x60 --samples 16 is a quick look"
    )


def _render(loaded: "SceneFile", spectral: bool, samples: int, renderer: str) -> "Rendered":
    """The picture, with a bar on the terminal, or a line now and then where none may move."""
    with progress.follow("reading") as report:
        if renderer == "mitsuba":
            from ..appearance.scene.path.path_trace import path_trace

            return path_trace(
                loaded.scene, samples=samples, tolerance=loaded.tolerance, progress=report
            )
        from ..appearance.scene.draw.render import render

        return render(loaded.scene, spectral=spectral, tolerance=loaded.tolerance, progress=report)


def _write(loaded: "SceneFile", rendered: "Rendered", out: Path, spectral: Path | None) -> None:
    """Files, and what was left out."""
    from ..appearance.scene.picture import save_png, save_spectral

    if spectral is not None:
        save_spectral(spectral, rendered)
    screen = loaded.on_screen(rendered)
    save_png(out, screen.rgb)
    for line in rendered.report.describe().splitlines():
        typer.echo(f"       {line}")
    for note in rendered.report.notes:
        _note(note)
    if screen.bright > 0:
        _note(
            f"{screen.bright:.1%} of the pixels are brighter than the screen's white; a lower "
            "exposure shows them"
        )
    if screen.colourful > 0:
        _note(
            f"{screen.colourful:.1%} of the pixels are more colourful than {loaded.display} can "
            f"show: they are brought inside ([picture] gamut = {loaded.gamut!r})"
        )


def _note(words: str) -> None:
    typer.echo(f"note   {words}", err=True)
