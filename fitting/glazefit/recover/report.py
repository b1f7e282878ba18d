"""What a recovery, film by film or joint, tells its user: tables on the screen, and the files it
leaves.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from rich.console import Console

from glazejax.io import write_table
from glazejax.report import plain_table
from glazejax.spectra import ranges

from .crossvalidation import LeftOut
from .joint_covariance import mode_cell
from .joint_result import RULE as JOINT_RULE
from .joint_result import JointRecovery
from .prediction import PARTS
from .result import RELATIVE_LIMIT, RULE, Recovery

PIGMENT_COLUMNS = (
    "pigment",
    "wavelength_nm",
    "absorption",
    "scattering",
    "absorption_sd",
    "scattering_sd",
    "identifiable",
)
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
# A paint that is this probably unsteady is named.
_LIKELY = 0.5


def print_summary(recovery: Recovery, console: Console, seconds: float, first: float) -> None:
    """Print a line a paint: how well it is met, and what is known of it.

    Args:
        recovery: recovered films.
        console: to print to.
        seconds: the recovery took.
        first: seconds until the first chunk was done, with what was compiled for it.
    """
    title = (
        f"{len(recovery)} paints in {seconds:.1f} s ({first:.1f} s to compile and do the first few)"
    )
    table = plain_table("paint", "RMSE", "ΔE00 D65", "ΔE00 A", "gloss", "k, s known", title=title)
    d65 = recovery.delta_e("D65")
    a = recovery.delta_e("A")
    bands = recovery.films.wavelengths.size
    for row, name in enumerate(recovery.films.names):
        table.add_row(
            name,
            f"{recovery.rmse[row]:.5f}",
            f"{d65[row]:.2f}",
            f"{a[row]:.2f}",
            "1" if recovery.gloss[row] == 1 else f"{recovery.gloss[row]:.2f}",
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    console.print(table)
    if not recovery.identifiable.all():
        console.print("Too opaque to tell k from s, only k/s is known:")
        for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
            where = ranges(recovery.films.wavelengths, ~recovery.identifiable[row])
            console.print(f"  {recovery.films.names[row]}: {where}: k/s {_ratios(recovery, row)}")
    console.print(f"[dim]Rule: {RULE}.[/dim]")
    if (recovery.gloss < 1).any():
        console.print(
            "[dim]Gloss below 1: the film reads less than a smooth surface reflects; that share "
            "of it was counted.[/dim]"
        )
    odd = ~recovery.converged & (recovery.misfit > 9)
    for row in np.flatnonzero(odd.any(axis=1)):
        console.print(
            f"[yellow]{recovery.films.names[row]}: the solver did not settle at "
            f"{ranges(recovery.films.wavelengths, odd[row])}.[/yellow]"
        )
    off = recovery.misfit > 16
    for row in np.flatnonzero(off.any(axis=1)):
        console.print(
            f"[yellow]{recovery.films.names[row]}: no k and s meet both spectra within 4 standard "
            f"deviations at {ranges(recovery.films.wavelengths, off[row])}.[/yellow]"
        )


def _ratios(recovery: Recovery, row: int) -> str:
    """Range of k/s, with errors, over the bands where only that is known."""
    bands = np.flatnonzero(~recovery.identifiable[row])
    ratio = recovery.ratio[row]
    sd = recovery.ratio_sd[row]
    ends = [bands[np.argmin(ratio[bands])], bands[np.argmax(ratio[bands])]]
    return " to ".join(_with_error(ratio[b], sd[b]) for b in dict.fromkeys(ends))


def _with_error(value: float, sd: float) -> str:
    """Value and error with as many digits as the error has; a lower bound where it is no better
    known.
    """
    if sd > value / 2:
        return f"above {max(value - 2 * sd, 0.2 * value):.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(sd)))) if sd > 0 else 6
    return f"{value:.{digits}f}±{sd:.{digits}f}"


def write_pigments(
    recovery: Recovery, thickness: float, path: Path, *, overwrite: bool = False
) -> None:
    """Write k and s in 1/m for a film this thick (m), a line a paint and wavelength."""
    columns = (
        recovery.absorption,
        recovery.scattering,
        recovery.absorption_sd,
        recovery.scattering_sd,
    )
    rows = band_rows(
        recovery.films.names, recovery.films.wavelengths, [column / thickness for column in columns]
    )
    write_table(path, PIGMENT_COLUMNS, flag_rows(rows, recovery.identifiable), overwrite=overwrite)


def band_rows(
    names: Sequence[str],
    wavelengths: Float[np.ndarray, "bands"],
    columns: Sequence[Float[np.ndarray, "names bands"]],
) -> Iterator[tuple[object, ...]]:
    """A row a name and wavelength."""
    for i, name in enumerate(names):
        for j, wavelength in enumerate(wavelengths):
            yield name, f"{wavelength:g}", *(f"{column[i, j]:.6g}" for column in columns)


def flag_rows(
    rows: Iterator[tuple[object, ...]], flags: Bool[np.ndarray, "names bands"]
) -> Iterator[tuple[object, ...]]:
    """The rows of `band_rows`, each with whether k and s are told apart."""
    return ((*row, flag) for row, flag in zip(rows, flags.ravel().tolist(), strict=True))


def write_fits(recovery: Recovery, path: Path, *, overwrite: bool = False) -> None:
    """Write the ratio k/s and the fitted spectra, a line a paint and wavelength; none needs a
    thickness.
    """
    header = (
        "pigment",
        "wavelength_nm",
        "ratio",
        "ratio_sd",
        "fitted_over_black",
        "fitted_over_white",
    )
    columns = [recovery.ratio, recovery.ratio_sd, recovery.fitted_black, recovery.fitted_white]
    rows = band_rows(recovery.films.names, recovery.films.wavelengths, columns)
    write_table(path, header, rows, overwrite=overwrite)


def slug(name: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("_.") or "paint"


def write_plots(
    recovery: Recovery, thickness: float, folder: Path, step: Callable[[], object] = lambda: None
) -> None:
    """Draw every paint to its own file, and call `step` after each."""
    from .plots import plot_paint

    for row, path in enumerate(pictures_of(recovery.films.names, folder)):
        plot_paint(recovery, row, thickness, path)
        step()


def pictures_of(names: Sequence[str], folder: Path) -> Iterator[Path]:
    """A file for each name, all different also where the file system takes capitals for small
    letters.
    """
    taken: set[str] = set()
    for name in names:
        stem = slug(name)
        while stem.lower() in taken:
            stem += "_"
        taken.add(stem.lower())
        yield folder / f"{stem}.png"


def print_joint(recovery: JointRecovery, console: Console, seconds: float) -> None:
    """Print a line a paint and a line a film."""
    sd = np.median(recovery.log_sd, axis=2)
    ratio = np.median(recovery.log_ratio_sd, axis=1)
    bands = recovery.wavelengths.size
    title = f"{len(recovery.paints)} paints from {len(recovery.films)} films in {seconds:.1f} s"
    table = plain_table(
        "paint", "films", "error of k", "of s", "of k/s", "k, s told apart", title=title
    )
    for row, paint in enumerate(recovery.paints):
        table.add_row(
            paint,
            f"{(recovery.shares[:, row] > 0).sum()}",
            *(_per_cent(value) for value in (sd[0, row], sd[1, row], ratio[row])),
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    console.print(table)
    console.print(
        f"[dim]Errors: median over the bands, one standard deviation. Rule: {JOINT_RULE}.[/dim]"
    )
    for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
        unknown = recovery.log_sd[:, row] > RELATIVE_LIMIT
        where = [
            f"{name} at {ranges(recovery.wavelengths, bands)}"
            for name, bands in zip("ks", unknown, strict=True)
            if bands.any()
        ]
        words = f"not known to {RELATIVE_LIMIT:.0%}: {'; '.join(where)}"
        console.print(
            f"  {recovery.paints[row]}: {words if where else 'in no mixture: its scale is open'}"
        )
    difference = recovery.delta_e()
    console.print(
        f"Fitted films: ΔE00 (D65, 10°) {difference.mean():.2f} on average, "
        f"{difference.max():.2f} at most "
        f"({recovery.films.names[int(difference.max(axis=1).argmax())]}); gloss of the paints from "
        f"{recovery.gloss.min():.2f} to {recovery.gloss.max():.2f}."
    )
    for film, paint, factor in find_suspect_weights(recovery):
        console.print(
            f"[yellow]{recovery.films.names[film]}: reads as if it held {factor:.2g} times the "
            f"{paint} that its recipe says.[/yellow]"
        )
    if not recovery.converged:
        console.print(f"[yellow]The solver did not settle in {recovery.steps} steps.[/yellow]")


def _per_cent(log_sd: float) -> str:
    return f"{log_sd:.0%}" if log_sd < 1 else f"factor {np.exp(log_sd):.1f}"


def find_suspect_weights(recovery: JointRecovery) -> list[tuple[int, str, float]]:
    """Films whose weights the fit wants changed much: film, paint, and by what factor."""
    found = []
    for film, errors in enumerate(recovery.unknowns.films[:, 2:]):
        order = np.argsort(-recovery.shares[film])
        for place, error in enumerate(errors):
            if abs(error) > _SUSPECT:
                found.append((film, recovery.paints[order[1 + place]], float(np.exp(error))))
    return found


def write_joint_pigments(
    recovery: JointRecovery, thickness: float, path: Path, *, overwrite: bool = False
) -> None:
    """Write k and s in 1/m for a pure film of unit relative thickness this thick (m), a line a
    paint and wavelength.
    """
    k = recovery.absorption / thickness
    s = recovery.scattering / thickness
    rows = band_rows(
        recovery.paints,
        recovery.wavelengths,
        [k, s, k * recovery.log_sd[0], s * recovery.log_sd[1]],
    )
    modes = recovery.error_modes()
    # (paints, bands, 2 modes): of log k, then of log s.
    numbers = np.moveaxis(modes, (2, 3), (0, 1)).transpose(0, 1, 3, 2).reshape(-1, 2 * len(modes))
    titles = [f"{what}_mode_{i + 1}" for what in "ks" for i in range(len(modes))]
    flagged = flag_rows(rows, recovery.identifiable)
    joined = (
        (*row, *map(mode_cell, more.tolist())) for row, more in zip(flagged, numbers, strict=True)
    )
    write_table(path, (*PIGMENT_COLUMNS, *titles), joined, overwrite=overwrite)


def write_joint_films(recovery: JointRecovery, path: Path, *, overwrite: bool = False) -> None:
    """Write what the fit says of each film: thickness, gloss, errors of weights and how well it is
    met.
    """
    difference = recovery.delta_e()
    each = recovery.unknowns.films.shape[1]
    thickness_sd = np.sqrt(np.diagonal(recovery.shared_covariance))[
        : len(recovery.films) * each : each
    ]

    rows = (
        (
            name,
            _recipe(recovery, row),
            f"{recovery.thickness[row]:.4g}",
            f"{recovery.thickness[row] * thickness_sd[row]:.2g}",
            f"{recovery.gloss[row]:.3f}",
            " ".join(
                f"{np.exp(error):.3f}" for error in recovery.unknowns.films[row, 2:] if error != 0
            )
            or "1",
            f"{recovery.rmse[row]:.5f}",
            *(f"{value:.3f}" for value in difference[row]),
        )
        for row, name in enumerate(recovery.films.names)
    )
    write_table(path, FILM_COLUMNS, rows, overwrite=overwrite)


def _recipe(recovery: JointRecovery, row: int) -> str:
    return " + ".join(
        f"{paint} {100 * share:.3g}%" for paint, share in recovery.recipe(row).items()
    )


def print_left_out(out: LeftOut, console: Console) -> None:
    """Say how well films that were left out of the fit were predicted by the others."""
    off = out.predicted.mean(axis=1)
    worst = int(off.argmax())
    console.print(
        f"Left out in turn and predicted from their recipes, {len(out.names)} mixtures: ΔE00 "
        f"(D65, 10°) {off.mean():.2f} on average, median {np.median(off):.2f}, {off[worst]:.2f} "
        f"at most ({out.names[worst]}); {out.inside.mean():.0%} of the readings lie in the 90 % "
        "bands."
    )
    parts = {
        part: np.mean([found.expected_error(parts=(part,)) for found in out.predictions])
        for part in PARTS
    }
    console.print(
        f"What they were expected to be off, ΔE00 {out.expected.mean():.1f} on average, comes "
        f"from the film ({parts['film']:.1f}, as the other films left out show), from the scale "
        f"of its paints ({parts['scale']:.1f}) and from the shape of their k and s "
        f"({parts['paint']:.1f}). Two mixings of one recipe differ by about ΔE00 "
        f"{np.mean([found.between_mixings() for found in out.predictions]):.1f}."
    )
    unsteady = {p: chance for p, chance in out.variation.unsteady.items() if chance >= _LIKELY}
    if unsteady:
        each = ", ".join(f"{paint} ({chance:.0%})" for paint, chance in unsteady.items())
        console.print(
            "Films of these paints are probably twice as far from their recipes as films are on "
            f"average; such paint fades, stains or is hard to weigh: {each}. Behind each, how "
            "probable that is."
        )
    if not out.complete:
        console.print("[yellow]Interrupted: the mixtures that follow were not left out.[/yellow]")


def write_left_out(
    recovery: JointRecovery, out: LeftOut, path: Path, *, overwrite: bool = False
) -> None:
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
    recovery: JointRecovery,
    thickness: float,
    folder: Path,
    step: Callable[[], object] = lambda: None,
) -> None:
    """Draw every paint to its own file, and call `step` after each."""
    from .plots import plot_joint_paint

    for row, path in enumerate(pictures_of(recovery.paints, folder)):
        plot_joint_paint(recovery, row, thickness, path)
        step()
