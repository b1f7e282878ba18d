"""Output of `glazejax posterior`: a table, sentences, and summary.csv."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from glazejax.io import write_table
from glazejax.report import plain_table

from ..film.model.variation import STRENGTH
from ..film.solve import TRUSTED_TAIL
from .posterior import Posterior
from .summary import AGREES, MEDIANS, Numbers, Row, Summary, in_units, interval


def report_posterior(posterior: Posterior) -> Iterator[RenderableType]:
    """The numbers, what is open, where Laplace fails, and whether the chain has converged."""
    rows = posterior.summary()
    spectral = {q.name for q in posterior.problem.quantities if q.spectrum}
    plain = [row for row in rows if row.quantity not in spectral]
    yield _table(posterior, Summary(plain, by=rows.by))
    if posterior.problem.random:
        yield (
            "Thicknesses and fractions allow for paint that is stronger or weaker in one film than "
            f"in others, by {STRENGTH:.0%}."
        )
    if spectral:
        yield _spectra(posterior)
    for sentence in posterior.identifiability.sentences:
        yield Text.assemble(("Open:", "yellow"), f" {sentence}.")
    if not posterior.identifiability.sentences:
        yield "The measurement narrows every unknown; none is left open."
    yield _laplace(posterior, rows)
    for message in (describe_unsettled(posterior), describe_misfit(posterior)):
        if message:
            yield Text(message, "yellow")
    colour = "green" if posterior.converged else "yellow"
    message = posterior.words()
    yield Text(f"{message[0].upper()}{message[1:]}.", colour)


def _table(posterior: Posterior, rows: Summary) -> Table:
    titles, lines = rows.cells()
    title = f"{posterior.films[0].name}: {MEDIANS}"
    table = plain_table(*titles, title=title, words=(0, len(titles) - 1))
    for line in lines:
        table.add_row(*line)
    return table


def _spectra(posterior: Posterior) -> Table:
    """k d and s d of a stack's unknown paint."""
    title = f"{posterior.films[0].name}, unknown paint: {MEDIANS}"
    table = plain_table("band", "k d", "s d", "k/s", title=title)
    numbers = [Numbers.of(draws) for draws in posterior.spectra().values()]
    for b, wavelength in enumerate(posterior.films[0].wavelengths):
        cells = [interval(n.median[b], n.lower[b], n.upper[b]) for n in numbers]
        table.add_row(f"{wavelength:g}", *cells)
    return table


def describe_unsettled(posterior: Posterior) -> str:
    """A sentence on the blocks at whose modes least squares was stopped; empty if there
    are none.
    """
    blocks = np.asarray(posterior.problem.blocks)[~posterior.laplace.converged]
    if not blocks.size:
        return ""
    return (
        f"Least squares stopped before it had settled at the mode of {', '.join(blocks)}: "
        "Laplace's errors may be off."
    )


def describe_misfit(posterior: Posterior) -> str:
    """A sentence on a film that its paints do not explain: their k and s would have to be off by
    more than in 99 of 100 films of the prior; empty where they do, or no paint is assumed.
    """
    quantity = next((q for q in posterior.problem.quantities if q.name == "model error"), None)
    if quantity is None:
        return ""
    prior = quantity.values(posterior.problem.prior_draws(np.random.default_rng(0), 4000))
    error = np.median(quantity.values(posterior.free), axis=(0, 1))
    most = np.quantile(prior, 0.99)
    if (error <= most).all():
        return ""
    return (
        f"These paints do not explain the film: their k and s would have to be off by "
        f"{error.max():.0%}, where {np.median(prior):.0%} is usual and {most:.0%} rare. Is it made "
        "of them, over these cards? Its intervals hold only if it is."
    )


def _laplace(posterior: Posterior, rows: list[Row]) -> str:
    """One sentence on Laplace's approximation."""
    bands = len(posterior.problem.blocks)
    if posterior.chain is None:
        bad = np.sum(~posterior.laplace.trusted)
        can = f"Laplace's errors {'cannot' if bad else 'can'} be trusted"
        if bands == 1:
            return (
                f"{can}: tail index {posterior.laplace.tail[0]:.2f}, good below {TRUSTED_TAIL:g}."
            )
        where = f"{bad} of {bands} bands (tail index {TRUSTED_TAIL:g} or more)"
        return f"{can} in {where if bad else 'every band'}."
    off = [row for row in rows if row.laplace != AGREES]
    if not off:
        return "Laplace's 90 % intervals agree with the chain's everywhere."
    if bands > 1:
        where = f"in {len({row.block for row in off})} of {bands} bands"
    elif posterior.spectra():
        where = f"for {len(off)} of {len(rows)} quantities"
    else:
        differences = [f"{in_units(row.quantity)[0].split(' (')[0]} ({row.laplace})" for row in off]
        where = f"for {', '.join(differences)}"
    return f"Laplace's 90 % intervals differ from the chain's {where}."


def write_summary(posterior: Posterior, path: Path) -> None:
    """Write the summary as a table, a line a quantity and block; thickness in m,
    fractions 0 to 1, in place of an older one.
    """
    rows = [vars(row) for row in posterior.summary()]
    write_table(path, list(rows[0]), [list(row.values()) for row in rows], overwrite=True)
