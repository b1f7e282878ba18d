"""What `glazejax posterior` tells its user: a table, sentences, and summary.csv."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from glazejax.io import write_table
from glazejax.report import plain_table

from .laplace import TRUSTED_TAIL
from .plots import shown
from .posterior import Posterior
from .summary import AGREES, Numbers, Row


def print_posterior(posterior: Posterior, console: Console) -> None:
    """Print the numbers, what is open, where Laplace fails, and whether the chain has converged."""
    rows = posterior.summary()
    if posterior.problem.kind == "bands":
        console.print(_bands(posterior, rows))
    else:
        spectral = {q.name for q in posterior.problem.quantities if q.spectrum}
        console.print(_film(posterior, [row for row in rows if row.quantity not in spectral]))
        if spectral:
            console.print(_spectra(posterior))
    for sentence in posterior.identifiability.sentences:
        console.print(f"[yellow]Open:[/yellow] {sentence}.")
    if not posterior.identifiability.sentences:
        console.print("The measurement narrows every unknown; none is left open.")
    console.print(_laplace(posterior, rows))
    if words := unsettled(posterior):
        console.print(f"[yellow]{words}[/yellow]")
    colour = "green" if posterior.converged else "yellow"
    words = posterior.words()
    console.print(f"[{colour}]{words[0].upper()}{words[1:]}.[/{colour}]")


def _film(posterior: Posterior, rows: list[Row]) -> Table:
    sampled = posterior.chain is not None
    titles = ("emcee", "sd", "Laplace", "sd", "Laplace") if sampled else ("Laplace", "sd", "its own test")
    table = plain_table("", *titles, title=_title(posterior), words=(0, len(titles)))
    for row in rows:
        title = shown(row.quantity, np.zeros(1))[0]
        scale = float(shown(row.quantity, np.ones(1))[1][0])
        cells = [_interval(row.median, row.lower, row.upper, scale), f"{scale * row.sd:.2g}"]
        if sampled:
            ends = f"[{scale * row.laplace_lower:.3g}, {scale * row.laplace_upper:.3g}]"
            cells += [ends, f"{scale * row.laplace_sd:.2g}"]
        table.add_row(title, *cells, row.laplace)
    return table


def _spectra(posterior: Posterior) -> Table:
    """k d and s d of a stack's unknown paint."""
    title = f"{posterior.films[0].name}, unknown paint: median [5 %, 95 %]"
    table = plain_table("band", "k d", "s d", "k/s", title=title)
    found = {name: Numbers.of(draws) for name, draws in posterior.spectra().items()}
    for b, wavelength in enumerate(posterior.films[0].wavelengths):
        cells = [_interval(n.median[b], n.lower[b], n.upper[b]) for n in found.values()]
        table.add_row(f"{wavelength:g}", *cells)
    return table


def _title(posterior: Posterior) -> str:
    return f"{posterior.films[0].name}: median [5 %, 95 %]"


def _interval(median: float, lower: float, upper: float, scale: float = 1.0) -> str:
    return f"{scale * median:.3g} [{scale * lower:.3g}, {scale * upper:.3g}]"


def _bands(posterior: Posterior, rows: list[Row]) -> Table:
    sampled = posterior.chain is not None
    last = ("ESS", "Laplace") if sampled else ("its own test",)
    table = plain_table("band", "k d", "s d", "k/s", *last, title=_title(posterior), words=(3 + len(last),))
    for block in posterior.problem.blocks:
        mine = {row.quantity: row for row in rows if row.block == block}
        cells = [_interval(r.median, r.lower, r.upper) for r in mine.values()]
        words = list(dict.fromkeys(r.laplace for r in mine.values()))
        others = [w for w in words if w != AGREES]
        samples = [f"{next(iter(mine.values())).effective_samples:.0f}"] if sampled else []
        table.add_row(block.removesuffix(" nm"), *cells, *samples, ", ".join(others) or words[0])
    return table


def unsettled(posterior: Posterior) -> str:
    """A sentence on the blocks at whose modes least squares was stopped; empty if there are none."""
    blocks = np.asarray(posterior.problem.blocks)[~posterior.laplace.converged]
    if not blocks.size:
        return ""
    return (
        f"Least squares stopped before it had settled at the mode of {', '.join(blocks)}: Laplace's errors may be off."
    )


def _laplace(posterior: Posterior, rows: list[Row]) -> str:
    """One sentence on Laplace's approximation."""
    many = len(posterior.problem.blocks) > 1
    if posterior.chain is None:
        bad = int((~posterior.laplace.trusted).sum())
        if not many:
            k = posterior.laplace.tail[0]
            verdict = "can" if posterior.laplace.trusted[0] else "cannot"
            return f"Laplace's errors {verdict} be trusted: tail index {k:.2f}, good below {TRUSTED_TAIL:g}."
        where = f"in {bad} of {len(posterior.problem.blocks)} bands (tail index {TRUSTED_TAIL:g} or more)"
        return f"Laplace's errors {'cannot be trusted ' + where if bad else 'can be trusted in every band'}."
    off = [row for row in rows if row.laplace != AGREES]
    if not off:
        return "Laplace's 90 % intervals agree with the chain's everywhere."
    if not many and not posterior.spectra():
        parts = [f"{shown(row.quantity, np.zeros(1))[0].split(' (')[0]} ({row.laplace})" for row in off]
        return "Laplace's 90 % intervals differ from the chain's for " + ", ".join(parts) + "."
    if not many:
        return f"Laplace's 90 % intervals differ from the chain's for {len(off)} of {len(rows)} quantities."
    blocks = len({row.block for row in off})
    return f"Laplace's 90 % intervals differ from the chain's in {blocks} of {len(posterior.problem.blocks)} bands."


def write_summary(posterior: Posterior, path: Path, *, overwrite: bool = False) -> None:
    """Write the summary as a table, a line a quantity and block; thickness in m, fractions 0 to 1."""
    rows = [asdict(row) for row in posterior.summary()]
    write_table(path, list(rows[0]), [list(row.values()) for row in rows], overwrite=overwrite)
