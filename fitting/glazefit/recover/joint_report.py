"""What a joint recovery tells its user: two tables on the screen, the files it leaves, and a picture a paint."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from glazejax.io import write_table

from .crossvalidation import LeftOut
from .joint_result import RELATIVE_LIMIT, RULE, JointRecovery
from .report import PIGMENT_COLUMNS, ranges, slug

FILM_COLUMNS = (
    "film",
    "recipe",
    "relative_thickness",
    "relative_thickness_sd",
    "gloss",
    "weight_error",
    "rmse",
    "delta_e_black",
    "delta_e_white",
)
LEFT_OUT_COLUMNS = (
    "film",
    "recipe",
    "delta_e_black",
    "delta_e_white",
    "delta_e_expected",
    "inside_90_percent_band",
    "delta_e_fitted_black",
    "delta_e_fitted_white",
)
# A weight that the fit wants changed by more than this is worth a second look at the recipe.
_SUSPECT = 0.3


def print_joint(recovery: JointRecovery, console: Console, seconds: float) -> None:
    """Print a line a paint and a line a film."""
    sd = np.median(recovery.log_sd, axis=2)
    ratio = np.median(recovery.log_ratio_sd, axis=1)
    bands = recovery.wavelengths.size
    table = Table(title=f"{len(recovery.paints)} paints from {len(recovery.films)} films in {seconds:.1f} s", box=None)
    table.title_justify = "left"
    table.add_column("paint", overflow="fold")
    for title in ("films", "error of k", "of s", "of k/s", "k, s told apart"):
        table.add_column(title, justify="right", no_wrap=True)
    for row, paint in enumerate(recovery.paints):
        table.add_row(
            paint,
            f"{(recovery.shares[:, row] > 0).sum()}",
            *(_per_cent(value) for value in (sd[0, row], sd[1, row], ratio[row])),
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    console.print(table)
    console.print(f"[dim]Errors: median over the bands, one standard deviation. Rule: {RULE}.[/dim]")
    for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
        wide = recovery.log_sd[:, row] > RELATIVE_LIMIT
        where = [
            f"{name} at {ranges(recovery.wavelengths, bands)}"
            for name, bands in zip("ks", wide, strict=True)
            if bands.any()
        ]
        console.print(f"  {recovery.paints[row]}: not known to {RELATIVE_LIMIT:.0%}: {'; '.join(where)}")
    difference = recovery.delta_e()
    console.print(
        f"Fitted films: ΔE00 (D65, 10°) {difference.mean():.2f} on average, {difference.max():.2f} at most "
        f"({recovery.films.names[int(difference.max(axis=1).argmax())]}); gloss of the paints from "
        f"{recovery.gloss.min():.2f} to {recovery.gloss.max():.2f}."
    )
    for film, paint, factor in suspects(recovery):
        console.print(
            f"[yellow]{recovery.films.names[film]}: reads as if it held {factor:.2g} times the {paint} that its "
            "recipe says.[/yellow]"
        )
    if not recovery.converged:
        console.print(f"[yellow]The solver did not settle in {recovery.steps} steps.[/yellow]")


def _per_cent(log_sd: float) -> str:
    return f"{log_sd:.0%}" if log_sd < 1 else f"factor {np.exp(log_sd):.1f}"


def suspects(recovery: JointRecovery) -> list[tuple[int, str, float]]:
    """Films whose weights the fit wants changed much: film, paint, and by what factor."""
    found = []
    for film, errors in enumerate(recovery.unknowns.films[:, 2:]):
        order = np.argsort(-recovery.shares[film])
        for place, error in enumerate(errors):
            if abs(error) > _SUSPECT:
                found.append((film, recovery.paints[order[1 + place]], float(np.exp(error))))
    return found


def write_joint_pigments(recovery: JointRecovery, thickness: float, path: Path, *, overwrite: bool = False) -> None:
    """Write k and s in 1/m for a pure film of unit relative thickness this thick (m), a line a paint and wavelength."""
    pigments = recovery.pigments(thickness)
    rows = (
        (
            name,
            f"{wavelength:g}",
            *(
                f"{float(np.asarray(values)[band]):.6g}"
                for values in (pigment.absorption, pigment.scattering, pigment.absorption_sd, pigment.scattering_sd)
            ),
            bool(recovery.identifiable[row, band]),
        )
        for row, (name, pigment) in enumerate(pigments.items())
        for band, wavelength in enumerate(recovery.wavelengths)
    )
    write_table(path, PIGMENT_COLUMNS, rows, overwrite=overwrite)


def write_joint_films(recovery: JointRecovery, path: Path, *, overwrite: bool = False) -> None:
    """Write what the fit says of each film: thickness, gloss, errors of weights and how well it is met."""
    difference = recovery.delta_e()
    each = recovery.unknowns.films.shape[1]
    thickness_sd = np.sqrt(np.diagonal(recovery.shared_covariance))[: len(recovery.films) * each : each]

    rows = (
        (
            name,
            _recipe(recovery, row),
            f"{recovery.thickness[row]:.4g}",
            f"{recovery.thickness[row] * thickness_sd[row]:.2g}",
            f"{recovery.gloss[row]:.3f}",
            " ".join(f"{np.exp(error):.3f}" for error in recovery.unknowns.films[row, 2:] if error != 0) or "1",
            f"{recovery.rmse[row]:.5f}",
            *(f"{value:.3f}" for value in difference[row]),
        )
        for row, name in enumerate(recovery.films.names)
    )
    write_table(path, FILM_COLUMNS, rows, overwrite=overwrite)


def _recipe(recovery: JointRecovery, row: int) -> str:
    return " + ".join(f"{paint} {100 * share:.3g}%" for paint, share in recovery.recipe(row).items())


def print_left_out(out: LeftOut, console: Console) -> None:
    """Say how well films that were left out of the fit were predicted by the others."""
    off = out.predicted.mean(axis=1)
    worst = int(off.argmax())
    console.print(
        f"Left out in turn and predicted from their recipes, {len(out.names)} mixtures: ΔE00 (D65, 10°) "
        f"{off.mean():.2f} on average, median {np.median(off):.2f}, {off[worst]:.2f} at most ({out.names[worst]}); "
        f"{out.inside.mean():.0%} of the readings lie in the 90 % bands."
    )
    if not out.complete:
        console.print("[yellow]Interrupted: the mixtures that follow were not left out.[/yellow]")


def write_left_out(recovery: JointRecovery, out: LeftOut, path: Path, *, overwrite: bool = False) -> None:
    """Write how well each film was predicted by the others, and how well it said it would be."""
    rows = (
        (
            name,
            _recipe(recovery, recovery.films.names.index(name)),
            *(f"{value:.3f}" for value in out.predicted[i]),
            f"{out.expected[i]:.3f}",
            f"{out.inside[i]:.3f}",
            *(f"{value:.3f}" for value in out.fitted[i]),
        )
        for i, name in enumerate(out.names)
    )
    write_table(path, LEFT_OUT_COLUMNS, rows, overwrite=overwrite)


def write_joint_plots(
    recovery: JointRecovery, thickness: float, folder: Path, step: Callable[[], object] = lambda: None
) -> None:
    """Draw every paint to its own file, and call `step` after each."""
    from .joint_plots import plot_joint_paint

    for row, paint in enumerate(recovery.paints):
        plot_joint_paint(recovery, row, thickness, folder / f"{slug(paint)}.png")
        step()
