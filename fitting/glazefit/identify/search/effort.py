"""How much of a search is done in full."""

from typing import NamedTuple


class Effort(NamedTuple):
    """What a search looks at, and what it takes as alike.

    Attributes:
        fitted_pairs: sets of two paints that are fitted, after all were compared with the spectrum
            on a grid of amounts.
        kept_sets: sets that are fitted with errors of their own.
        fit_within: log weight by which these may stay behind the best while all have the same
            errors.
        refit_within: the same with errors of their own, to be fitted again where they then stand.
        show_within: the same, to be an answer at all.
        trace_effect: a paint that does less than this to the readings (root mean square, per unit
            of the logarithm of its k and s) is a trace: films that differ by traces share their
            errors.
        refit_beyond: how far that may be from where the errors were worked out.
        ranking_steps: damped steps of a fit while sets are ranked.
        fit_steps: the same with errors of their own.
        refit_steps: the same again with these.
        amount_steps: the same to the amounts that are shown.
        single_precision: whether sets are weighed in it; amounts that are shown never are.
    """

    fitted_pairs: int
    kept_sets: int
    fit_within: float
    refit_within: float
    show_within: float
    trace_effect: float
    refit_beyond: float
    ranking_steps: int
    fit_steps: int
    refit_steps: int
    amount_steps: int
    single_precision: bool


USUAL = Effort(
    fitted_pairs=80,
    kept_sets=40,
    fit_within=8.0,
    refit_within=6.0,
    show_within=8.0,
    trace_effect=0.005,
    refit_beyond=0.0005,
    ranking_steps=5,
    fit_steps=8,
    refit_steps=6,
    amount_steps=8,
    single_precision=True,
)
"""Told from `THOROUGH` by one first answer in a hundred or two, where several sets explain a film
about as well (`python -m benchmarks.identification`)."""
THOROUGH = Effort(
    fitted_pairs=10_000,
    kept_sets=120,
    fit_within=20.0,
    refit_within=20.0,
    show_within=20.0,
    trace_effect=0.0,
    refit_beyond=0.0,
    ranking_steps=14,
    fit_steps=14,
    refit_steps=14,
    amount_steps=14,
    single_precision=False,
)
"""Every pair is fitted, and all that may matter have errors of their own."""
