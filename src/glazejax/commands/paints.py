"""The command ``glazejax paints``: families of pigments, their exemplars, and where these are
from.
"""

from importlib.metadata import entry_points
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated

from . import options
from .progress import plain_console

if TYPE_CHECKING:
    from rich.console import Console

    from ..catalogue import Family, Provenance
    from ..paint.media import Pigment

_COS_45 = 0.5**0.5
_GEOMETRY = "d:8"


def paints(
    family: Annotated[
        str,
        options.option(
            metavar="NAME",
            help="One family, such as azurite: its exemplars, and a picture of them with --out.",
        ),
    ] = "",
    references: Annotated[Path | None, options.REFERENCES] = None,
    instrument: Annotated[str | None, options.instrument_option(_GEOMETRY)] = None,
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    out: options.PictureIfNamed = None,
    csv: Annotated[
        Path | None,
        options.option(
            metavar="FILE",
            help="Also write the exemplars and their provenance, or the references, as a table.",
        ),
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """List the families of pigments and their exemplars.

    Each family has its formula, Colour Index, years of use, and the number,
    sources and wavelengths of its exemplars. --references shows how your own
    reference paints are read.

    Example: glazejax paints --family azurite --out azurite.png
    """
    from .. import catalogue
    from ..names import nearest_hint

    of_references = {
        "--instrument": instrument,
        "--quantity": quantity,
        "--unit": unit,
        "--scale": scale,
    }
    for option, value in of_references.items():
        if value is not None and references is None:
            raise ValueError(f"{option} has no meaning without --references FILE")
    console = plain_console()
    options.check_outputs({"--out": out, "--csv": csv}, overwrite, inputs=[references])
    if references is not None:
        if family or out is not None:
            raise ValueError("--references lists a file's paints: leave out --family and --out")
        from .main import start_jax

        start_jax()
        seen_by = options.read_geometry(instrument, _GEOMETRY)
        # Reading them is an inverse task, which this package does not import.
        (lister,) = entry_points(group="glazejax.references")
        lister.load()(
            references,
            instrument=seen_by,
            console=console,
            csv=csv,
            overwrite=overwrite,
            stated=options.stated(quantity, unit, scale),
        )
        return
    families = catalogue.families()
    if family and family not in families:
        hint = nearest_hint(family, families)
        raise ValueError(f"no family of pigments is called {family!r}{hint}")
    if out is not None and not family:
        raise ValueError("--out draws one family: name it by --family, such as --family azurite")
    origins = [
        origin
        for origin in catalogue.provenance().values()
        if not family or origin.family == family
    ]
    if family:
        _print_family(console, families[family], origins)
    else:
        _print_families(console, families, origins)
    if csv is not None:
        from ..io import write_table

        write_table(csv, catalogue.Provenance._fields, origins, overwrite=overwrite)
        console.print(f"Wrote {len(origins)} exemplars to {csv}")
    if out is not None:
        _draw(out, families[family], [catalogue.load("pigments")[o.exemplar] for o in origins])
        console.print(f"Drew {len(origins)} exemplars to {out}")


def _print_families(
    console: "Console", families: "dict[str, Family]", origins: "list[Provenance]"
) -> None:
    console.print(f"{'family':<23}{'exemplars':>9}  {'nm':<10}{'Colour Index':<23}in use")
    without: list[str] = []
    for name, about in families.items():
        exemplars = [origin for origin in origins if origin.family == name]
        if not exemplars:
            without.append(name)
            continue
        numbers = shorten(about.colour_index, 22, placeholder="...")
        first = min(origin.first_nm for origin in exemplars)
        last = max(origin.last_nm for origin in exemplars)
        console.print(
            f"{name:<23}{len(exemplars):>9}  {f'{first:.0f}-{last:.0f}':<10}{numbers:<23}"
            f"{about.in_use}",
            soft_wrap=True,
        )
    sources = sorted({origin.source for origin in origins})
    console.print(
        f"{len(origins)} exemplars of {len(families) - len(without)} families, by {len(sources)} "
        f"sources: {', '.join(sources)}."
    )
    console.print(f"Known by name, without an exemplar: {', '.join(without)}.", style="dim")


def _print_family(console: "Console", about: "Family", origins: "list[Provenance]") -> None:
    elements = ", ".join(about.elements) or "none that X-ray fluorescence finds"
    console.print(
        f"{about.name}: {about.formula}; {about.colour_index}; in use "
        f"{about.in_use}; elements: {elements}{f'; {about.caution}' if about.caution else ''}."
    )
    if not origins:
        console.print("There is no exemplar of it.")
        return
    for origin in origins:
        told = origin.told_by
        console.print(
            f"{origin.exemplar.partition('/')[2]}: {origin.paint}; binder "
            f"{origin.binder or 'not said'}; {origin.first_nm:.0f}-{origin.last_nm:.0f} nm; "
            f"{told if told.startswith('k/s alone') else f'k and s by {told}'}",
            soft_wrap=True,
        )
    for source in dict.fromkeys(origin.source for origin in origins):
        first = next(origin for origin in origins if origin.source == source)
        console.print(f"{source}: {first.citation} ({first.licence})", style="dim", soft_wrap=True)


def _draw(path: Path, about: "Family", pigments: "list[Pigment]") -> None:
    """Reflectance factors of films that hide their ground, each exemplar one line."""
    import numpy as np

    from ..plots import label_spectra, picture
    from ..radiative import stack_reflectance_factor

    with picture(path, 7.0, 4.2) as figure:
        axes = figure.subplots()
        for number, pigment in enumerate(pigments):
            k = np.asarray(pigment.absorption, float)
            s = np.asarray(pigment.scattering, float)
            # Optical thickness that hides the ground, of paint that hardly absorbs, too.
            reading = stack_reflectance_factor(
                (s / (k + s))[:, None],
                np.full((k.size, 1), 1e6),
                0.0,
                cos_incidence=_COS_45,
                tolerance=1e-4,
            )
            axes.plot(
                pigment.wavelengths,
                np.asarray(reading),
                # Colours repeat after ten.
                "-" if number < 10 else "--",
                lw=1.0,
                label=pigment.name.partition("/")[2],
            )
        label_spectra(axes, "reflectance factor of a thick film, 45:0", ylim=(0.0, 1.05))
        axes.set_title(f"{about.name}: {len(pigments)} exemplars")
        # Lines that still have room for their names.
        if len(pigments) <= 14:
            axes.legend()
