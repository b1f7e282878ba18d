"""Test of a chain's length.

A chain counts as converged in a block if it holds 400 effective samples or more and its R-hat is
below 1.05, both as ArviZ counts them.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..film.sample import Chain
from ..film.solve import BlockFlags, PerBlock, load_arviz

ENOUGH_SAMPLES = 400.0
"""Effective samples that it must hold."""

MOST_APART = 1.05
"""R-hat that it must stay below: how much wider all walkers together are than each by itself."""


@dataclass(frozen=True)
class Convergence:
    """Effective samples and R-hat, which decide whether a chain is long enough.

    Attributes:
        samples: effective samples of each block, (blocks,): of the quantity that has fewest.
        apart: R-hat of each block, (blocks,): that of the quantity whose walkers differ most.
        walkers: of the chain.
        length: steps kept.
        discarded: steps left out at the start.
    """

    samples: PerBlock
    apart: PerBlock
    walkers: int
    length: int
    discarded: int

    @property
    def times(self) -> PerBlock:
        """Steps of all walkers for one effective sample, (blocks,); infinite without a sample."""
        with np.errstate(divide="ignore"):
            return self.length * self.walkers / self.samples

    @property
    def converged(self) -> BlockFlags:
        """By block, (blocks,)."""
        return (self.samples >= ENOUGH_SAMPLES) & (self.apart < MOST_APART)

    def words(self) -> str:
        """One sentence, with the reason."""
        good = self.converged
        least = self.samples.min()
        rule = f"{ENOUGH_SAMPLES:.0f} samples are needed, and an R-hat below {MOST_APART:g}"
        numbers = (
            f"{self.length} steps kept, {least:.0f} effective samples, R-hat "
            f"{np.max(self.apart):.2f}"
        )
        if good.all():
            return f"converged: {numbers} ({rule})"
        if least <= 0:
            return (
                f"not converged: {self.length} steps kept are too few to count effective samples "
                f"({rule})"
            )
        where = "" if good.size == 1 else f" in {np.sum(~good)} of {good.size} blocks"
        needed = int(np.ceil(1.2 * ENOUGH_SAMPLES / least * self.length / 100.0) * 100)
        if np.max(self.apart) >= MOST_APART:
            # Effective samples of walkers that have not met are too many.
            needed = max(needed, 4 * self.length)
        return (
            f"not converged{where}: {numbers} ({rule}); a chain of about {needed + self.discarded} "
            "steps would do"
        )


def convergence(
    chain: Chain, values: Float[np.ndarray, "steps walkers blocks quantities"]
) -> Convergence:
    """Effective samples and R-hat of what is reported. Of emcee's chain, which has no warm-up, five
    times the steps of one effective sample are left out, or a tenth if that is more.

    Args:
        chain: the whole chain.
        values: of every quantity, on a scale where its mean means something.

    Raises:
        ModuleNotFoundError: ArviZ is not installed.
    """
    steps, walkers, blocks, count = values.shape
    flat = values.reshape(steps, walkers, -1)
    start = 0
    if chain.sampler == "emcee":
        samples, _ = count_samples(flat)
        longest = steps * walkers / samples[samples > 0].min(initial=np.inf)
        start = min(steps // 2, max(steps // 10, int(5 * longest)))
    samples, rhat = count_samples(flat[start:])
    return Convergence(
        samples=samples.reshape(blocks, count).min(axis=1),
        apart=rhat.reshape(blocks, count).max(axis=1),
        walkers=walkers,
        length=(steps - start) * chain.thin,
        discarded=start * chain.thin,
    )


def count_samples(
    values: Float[np.ndarray, "steps walkers n"],
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Effective samples and R-hat of each column by ArviZ: of ranks, of halves of walkers; 0 and
    infinite for a chain too short or stuck.

    Source: A. Vehtari et al., Bayesian Analysis 16 (2021) 667.

    Raises:
        ModuleNotFoundError: ArviZ is not installed.
    """
    arviz = load_arviz()
    # ArviZ takes what never moves for independent draws, and counts eight steps or more.
    moves = np.ptp(values, axis=(0, 1)) > 0
    if len(values) < 8 or not moves.any():
        return np.zeros(values.shape[-1]), np.full(values.shape[-1], np.inf)
    # More walkers than steps are what an ensemble has.
    with warnings.catch_warnings(action="ignore"):
        draws = arviz.convert_to_dataset({"of": np.swapaxes(values, 0, 1)})
        samples = arviz.ess(draws)["of"].to_numpy()
        rhat = arviz.rhat(draws)["of"].to_numpy()
    valid = moves & np.isfinite(samples) & np.isfinite(rhat)
    return np.where(valid, samples, 0.0), np.where(valid, rhat, np.inf)
