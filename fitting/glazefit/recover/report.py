"""Report of a recovery, film by film or joint: tables on the screen, and the files it leaves."""

import numpy as np
from rich.console import Console

from glazejax.report import plain_table
from glazejax.spectra import ranges

from .crossvalidation import LeftOut
from .joint_result import RULE as JOINT_RULE
from .joint_result import JointRecovery
from .prediction import PARTS
from .result import RELATIVE_LIMIT, RULE, Recovery
from .settings import Table

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
        console.print("Too opaque to separate k from s, only k/s is known:")
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


def fit_table(recovery: Recovery) -> Table:
    """Ratio k/s and fitted spectra, a line a paint and wavelength; none needs a thickness."""
    header = (
        "pigment",
        "wavelength_nm",
        "ratio",
        "ratio_sd",
        "fitted_over_black",
        "fitted_over_white",
    )
    columns = [recovery.ratio, recovery.ratio_sd, recovery.fitted_black, recovery.fitted_white]
    rows = (
        (name, f"{wavelength:g}", *(f"{column[film, band]:.6g}" for column in columns))
        for film, name in enumerate(recovery.films.names)
        for band, wavelength in enumerate(recovery.films.wavelengths)
    )
    return header, rows


def print_joint(recovery: JointRecovery, console: Console, seconds: float) -> None:
    """Print a line a paint and a line a film."""
    sd = np.median(recovery.log_sd, axis=2)
    ratio = np.median(recovery.log_ratio_sd, axis=1)
    bands = recovery.wavelengths.size
    title = f"{len(recovery.paints)} paints from {len(recovery.films)} films in {seconds:.1f} s"
    table = plain_table(
        "paint", "films", "error of k", "of s", "of k/s", "k, s separable", title=title
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
        remark = f"not known to {RELATIVE_LIMIT:.0%}: {'; '.join(where)}"
        console.print(
            f"  {recovery.paints[row]}: {remark if where else 'in no mixture: its scale is open'}"
        )
    difference = recovery.delta_e()
    console.print(
        f"Fitted films: ΔE00 (D65, 10°) {difference.mean():.2f} on average, "
        f"{difference.max():.2f} at most "
        f"({recovery.films.names[int(difference.max(axis=1).argmax())]}); gloss of the paints from "
        f"{recovery.gloss.min():.2f} to {recovery.gloss.max():.2f}."
    )
    # Films of known recipes are met to 2.3 at most (the samples).
    if difference.max() > 5.0:
        console.print(
            "[yellow]No paint of these recipes reads so: do not rely on predictions of this "
            "fit. Are rows swapped, or films called by another paint's name?[/yellow]"
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
    suspects = []
    for film, errors in enumerate(recovery.unknowns.films[:, 2:]):
        order = np.argsort(-recovery.shares[film])
        for index, error in enumerate(errors):
            # So much is worth a second look at the recipe.
            if abs(error) > 0.3:
                suspects.append((film, recovery.paints[order[1 + index]], float(np.exp(error))))
    return suspects


def film_table(recovery: JointRecovery) -> Table:
    """Thickness, gloss and errors of weights that the fit says of each film, and how well it is
    met.
    """
    difference = recovery.delta_e()
    rows = (
        (
            name,
            describe_recipe(recovery, row),
            f"{recovery.thickness[row]:.4g}",
            f"{recovery.thickness_sd[row]:.2g}",
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
    return FILM_COLUMNS, rows


def describe_recipe(recovery: JointRecovery, row: int) -> str:
    """Paints of a film and the share of each, such as "Red 40% + White 60%"."""
    return " + ".join(
        f"{paint} {100 * share:.3g}%" for paint, share in recovery.recipe(row).items()
    )


def print_left_out(out: LeftOut, console: Console) -> None:
    """Say how well films that were left out of the fit were predicted by the others."""
    off = out.predicted.mean(axis=1)
    farthest = int(off.argmax())
    console.print(
        f"Left out in turn and predicted from their recipes, {len(out.names)} mixtures: ΔE00 "
        f"(D65, 10°) {off.mean():.2f} on average, median {np.median(off):.2f}, {off[farthest]:.2f} "
        f"at most ({out.names[farthest]}); {out.inside.mean():.0%} of the readings lie in the 90 % "
        "bands."
    )
    errors = {
        source: np.mean(
            [prediction.expected_error(parts=(source,)) for prediction in out.predictions]
        )
        for source in PARTS
    }
    console.print(
        f"What they were expected to be off, ΔE00 {out.expected.mean():.1f} on average, comes "
        f"from the film ({errors['film']:.1f}, as the other films left out show), from the scale "
        f"of its paints ({errors['scale']:.1f}) and from the shape of their k and s "
        f"({errors['paint']:.1f}). Two mixings of one recipe differ by about ΔE00 "
        f"{np.mean([prediction.between_mixings() for prediction in out.predictions]):.1f}."
    )
    unsteady = {p: chance for p, chance in out.variation.unsteady.items() if chance >= 0.5}
    if unsteady:
        listed = ", ".join(f"{paint} ({chance:.0%})" for paint, chance in unsteady.items())
        console.print(
            "Films of these paints are probably twice as far from their recipes as films are on "
            f"average; such paint fades, stains or is hard to weigh: {listed}. Behind each, how "
            "probable that is."
        )
    if not out.complete:
        console.print("[yellow]Interrupted: the mixtures that follow were not left out.[/yellow]")


def left_out_table(recovery: JointRecovery, out: LeftOut) -> Table:
    """Colour differences of each film as the others predict it, and as they were expected."""
    rows = (
        (
            name,
            describe_recipe(recovery, recovery.films.names.index(name)),
            *(f"{value:.3f}" for value in out.predicted[i]),
            f"{out.expected[i]:.3f}",
            f"{out.inside[i]:.3f}",
            *(f"{value:.3f}" for value in out.fitted[i]),
        )
        for i, name in enumerate(out.names)
    )
    return LEFT_OUT_COLUMNS, rows
