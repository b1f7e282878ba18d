"""Report of a joint recovery: tables on the screen, and the file that it leaves."""

from collections.abc import Iterator

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.report import plain_table
from glazejax.spectra import ranges

from ..films.report import Table
from ..films.result import RELATIVE_LIMIT
from .result import RULE, JointRecovery

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


def report_joint(recovery: JointRecovery, seconds: float) -> Iterator[RenderableType]:
    """A line a paint, and what holds for all films."""
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
            *(_per_cent(value) for value in (*sd[:, row], ratio[row])),
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    yield table
    yield Text(f"Errors: median over the bands, one standard deviation. Rule: {RULE}.", "dim")
    for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
        unknown = recovery.log_sd[:, row] > RELATIVE_LIMIT
        where = [
            f"{name} at {ranges(recovery.wavelengths, bands)}"
            for name, bands in zip("ks", unknown, strict=True)
            if bands.any()
        ]
        remark = f"not known to {RELATIVE_LIMIT:.0%}: {'; '.join(where)}"
        yield (
            f"  {recovery.paints[row]}: {remark if where else 'in no mixture: its scale is open'}"
        )
    difference = recovery.delta_e()
    yield (
        f"Fitted films: ΔE00 (D65, 10°) {difference.mean():.2f} on average, "
        f"{difference.max():.2f} at most "
        f"({recovery.films.names[int(difference.max(axis=1).argmax())]}); gloss of the paints from "
        f"{recovery.gloss.min():.2f} to {recovery.gloss.max():.2f}."
    )
    # Films of known recipes are met to 2.3 at most (the samples).
    if difference.max() > 5.0:
        yield Text(
            "No paint of these recipes reads so: do not rely on predictions of this "
            "fit. Are rows swapped, or films called by another paint's name?",
            "yellow",
        )
    # Films whose weights the fit wants changed much.
    for film, errors in enumerate(recovery.unknowns.films[:, 2:]):
        order = np.argsort(-recovery.shares[film])
        for index, error in enumerate(errors):
            # So much is worth a second look at the recipe.
            if abs(error) > 0.3:
                yield Text(
                    f"{recovery.films.names[film]}: reads as if it held {np.exp(error):.2g} times "
                    f"the {recovery.paints[order[1 + index]]} that its recipe says.",
                    "yellow",
                )
    if not recovery.converged:
        yield Text(f"The solver did not settle in {recovery.steps} steps.", "yellow")


def _per_cent(log_sd: float) -> str:
    return f"{log_sd:.0%}" if log_sd < 1 else f"factor {np.exp(log_sd):.1f}"


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
