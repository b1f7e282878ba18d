"""How well a film of several coats is known: the entry to `coats`, `stack`, `stack_errors` and
`sample`.
"""

from collections.abc import Sequence
from typing import Unpack

from glazejax.geometry import resolve_instrument

from ..film.films import Films, InstrumentLike, Noise
from ..film.model.errors import Prior
from ..film.reading import Reading
from .coats import CoatPrior, check_coats
from .posterior import Posterior, one_reading, sample
from .sampling import Sampling, SamplingOptions
from .spectra import SpectraPrior
from .stack import pose_stack
from .stack_errors import pose_stack_errors


def posterior_of_coats(
    film: Films | Reading,
    coats: Sequence[CoatPrior],
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    prior: Prior | None = None,
    spectra: SpectraPrior | None = None,
    **sampling: Unpack[SamplingOptions],
) -> Posterior:
    """Thickness and fractions of every coat of a film, gloss and the paints' error; k and s of one
    unknown paint.

    Readings and slopes come from the solver itself, at an error of 1e-4.
    `Posterior.identifiability` names what the readings do not tell.

    Args:
        film: one film over black and white, or a `Reading`, over one ground or more.
        coats: top first, at most six, with an unknown paint in one of them at most; what is not
            known of each is found.
        spectra: what is likely of an unknown paint's k and s.
        instrument, noise, prior, sampling: see `posterior_of_film`.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: as `posterior_of_film`, and for a stack that
            cannot be found (`glazefit.posterior.coats.check_coats`).
    """
    options = Sampling(**sampling)
    instrument = resolve_instrument(instrument)
    prior = prior or Prior()
    coats = check_coats(coats)
    reading = one_reading(film, instrument, noise or Noise())
    problem = pose_stack([reading], [coats], instrument, prior, spectra or SpectraPrior())
    problem, found = pose_stack_errors(problem, [reading], prior, seed=options.seed)
    return sample(problem, (reading,), found, options)
