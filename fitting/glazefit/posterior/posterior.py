"""Posterior of a film's paints and thickness, or of its k d and s d band by band.

`posterior_of_film` asks how much of which known paint a film holds, how thick it is and how far the
paints' own k and s are off; `posterior_of_bands` asks for k d and s d at every wavelength of a
measured film, with no paint assumed. Both give Laplace's standard errors at once and, with `steps`,
a chain with them, of Hamiltonian Monte Carlo or of emcee.
`posterior_of_coats` asks the first of a film of several coats.

ArviZ, emcee and h5py are loaded when a posterior is computed, not before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any, Unpack

import numpy as np
from jaxtyping import Float

from glazejax.geometry import resolve_instrument

from ..film.films import Films, Instrument, InstrumentLike, Noise, Reading, readings
from ..film.gloss import estimate_gloss
from ..film.model.errors import ModelError, Prior
from ..film.model.mixing import Pigments, listed_pigments
from ..film.problem import FilmProblem
from ..film.sample import Chain, draw_chain
from ..film.sampling import Sampling, SamplingOptions
from ..film.solve import TRUSTED_TAIL, Laplace, Modes, laplace, load_arviz, solve
from .bands import pose_bands
from .chain import Convergence, convergence
from .coats import CoatPrior, SpectraPrior, check_coats
from .film import pose_stack
from .identifiability import Identifiability, identify_open
from .summary import Numbers, Row, Summary, compare


@dataclass(frozen=True)
class Posterior:
    """Distribution of a film's unknowns after a measurement.

    Attributes:
        problem: what was sampled.
        films: the film as measured.
        laplace: Laplace's approximation.
        chain: as sampled, or None.
        weighted: whether Laplace's draws, weighted, were asked for in place of a chain.
    """

    problem: FilmProblem
    films: tuple[Reading, ...]
    laplace: Laplace
    chain: Chain | None
    weighted: bool = False

    def __repr__(self) -> str:
        return f"Posterior({self.films[0].name!r}: {self.words()})"

    @cached_property
    def convergence(self) -> Convergence | None:
        """Test of the chain's length; None if nothing was sampled."""
        if self.chain is None:
            return None
        values = [quantity.scaled(self.chain.free) for quantity in self.problem.quantities]
        return convergence(self.chain, np.stack(values, axis=-1))

    @property
    def converged(self) -> bool:
        """True if there is a chain and it is long enough in every block."""
        return self.convergence is not None and bool(self.convergence.converged.all())

    @cached_property
    def free(self) -> Float[np.ndarray, "steps walkers blocks dims"]:
        """Draws of the free unknowns: the kept part of the chain, or Laplace's (one walker)."""
        if self.chain is None or self.convergence is None:
            return self.laplace.sample[:, None]
        return self.chain.free[self.convergence.discarded // self.chain.thin :]

    @property
    def flat(self) -> Float[np.ndarray, "draws blocks dims"]:
        """The same draws in a row, walker after walker of each step."""
        return self.free.reshape(-1, *self.free.shape[2:])

    @cached_property
    def draws(self) -> Mapping[str, Float[np.ndarray, "steps walkers blocks"]]:
        """Draws of every reported quantity, from `free`, and from strengths of the paints for
        thicknesses and fractions.
        """
        return self.problem.draws(self.free)

    @cached_property
    def laplace_draws(self) -> Mapping[str, Float[np.ndarray, "draws blocks"]]:
        """The same from Laplace's approximation."""
        return self.problem.draws(self.laplace.sample)

    def spectra(self, *, laplace: bool = False) -> Mapping[str, Float[np.ndarray, "draws bands"]]:
        """Draws of k d, s d and k/s, of a film band by band or of a stack's unknown paint; empty
        for known paints.
        """
        return self.problem.spectra(self.laplace.sample if laplace else self.flat)

    def summary(self) -> Summary:
        """A row for each quantity of each block: the chain's numbers, Laplace's, and where the two
        differ.

        A list of `glazefit.posterior.summary.Row`, in SI units, that prints as a table.
        """
        state = self.convergence
        nothing = np.full(len(self.problem.blocks), np.nan)
        samples, times, converged = (
            (nothing, nothing, np.isfinite(nothing))
            if state is None
            else (state.samples, state.times, state.converged)
        )
        rows = []
        for quantity in self.problem.quantities:
            chain = Numbers.of(self.draws[quantity.name])
            gaussian = Numbers.of(self.laplace_draws[quantity.name])
            if state is None:
                verdicts = ["trusted" if good else "not trusted" for good in self.laplace.trusted]
            else:
                # Random strengths, alike in both, would hide how far the two are apart.
                verdicts = compare(
                    Numbers.of(quantity.values(self.free)),
                    Numbers.of(quantity.values(self.laplace.sample)),
                    logarithmic=quantity.logarithmic,
                    multimodal=self.laplace.many,
                )
            columns = {"effective_samples": samples, "autocorrelation_time": times} | vars(chain)
            columns |= {
                f"laplace_{name}": values
                for name, values in vars(gaussian).items()
                if name != "median"
            }
            rows += [
                Row(
                    quantity=quantity.name,
                    block=block,
                    **{name: float(values[b]) for name, values in columns.items()},
                    converged=bool(converged[b]),
                    laplace=verdicts[b],
                )
                for b, block in enumerate(self.problem.blocks)
            ]
        return Summary(rows, by="" if self.chain is None else self.chain.sampler)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Directions that the measurement leaves open, named."""
        sentences = identify_open(self.problem, self.flat, self.films[0].wavelengths)
        return Identifiability(tuple(sentences))

    def words(self) -> str:
        """Convergence, in a sentence."""
        if self.convergence is None and self.weighted:
            tail = self.laplace.tail.max()
            good = "good" if self.laplace.trusted.all() else "not to be trusted"
            count = np.min(self.laplace.effective)
            return (
                f"weighted draws of Laplace's approximation, {good}: {count:.0f} effective "
                f"samples, tail index {tail:.2f} (below {TRUSTED_TAIL:g} is needed)"
            )
        if self.convergence is None:
            return "nothing was sampled: these are Laplace's standard errors"
        stopped = "stopped early; " if self.chain is not None and self.chain.interrupted else ""
        return stopped + self.convergence.words()

    @cached_property
    def inference_data(self) -> Any:
        """The posterior as ArviZ's InferenceData, the form that its plots, its statistics and
        NetCDF files take.

        Walkers are ArviZ's chains. Lengths are in m, k d and s d optical thicknesses, reflectance a
        fraction. Groups are posterior, sample_stats, log_likelihood, posterior_predictive,
        observed_data and constant_data.

        Thicknesses and fractions hold strengths of the paints, drawn at random, which would hide
        that a chain has not converged. Those with `_shown` behind their names are as the readings
        show them, and go with the log-likelihoods. The predictive group holds spectra without
        noise, of some draws; log-likelihoods are up to a constant.
        """
        return _inference_data(self)


def _inference_data(posterior: Posterior) -> Any:
    """See `Posterior.inference_data`."""
    arviz = load_arviz()
    problem = posterior.problem
    film = posterior.films[0]
    bands = problem.kind == "bands"
    coords: dict[str, Any] = {"wavelength": film.wavelengths, "ground": list(film.grounds)}
    if not bands:
        coords["film"] = list(problem.blocks)
    dims: dict[str, list[str]] = {}

    def by_block(name: str, values: np.ndarray) -> np.ndarray:
        """(steps, walkers, blocks) as (walkers, steps, blocks), or without the last axis for a
        film.
        """
        values = np.swapaxes(values, 0, 1)
        if not bands:
            return values[..., 0]
        dims[name] = ["wavelength"]
        return values

    variables: dict[str, np.ndarray] = {}
    # What has a further axis: of paints, or of the bands of a spectrum.
    stacks: dict[str, list[np.ndarray]] = {}
    spectrum = {q.name: q.spectrum for q in problem.quantities}
    shown = problem.shown(posterior.free) if problem.random else {}
    rows = [(name, "", values) for name, values in posterior.draws.items()]
    rows += [
        (name, "_shown", values)
        for name, values in shown.items()
        if name.startswith(("fraction", "thickness"))
    ]
    for name, suffix, values in rows:
        paint = name.startswith("fraction ")
        key = ("fraction" if paint else spectrum[name] or name.replace(" ", "_")) + suffix
        values = by_block(key, values)
        if paint or spectrum[name]:
            stacks.setdefault(key, []).append(values)
        else:
            variables[key] = values
    for key, each_value in stacks.items():
        variables[key] = np.stack(each_value, axis=-1)
        dims[key] = ["paint" if key.startswith("fraction") else "wavelength"]
    if "fraction" in stacks:
        names = [name for name in posterior.draws if name.startswith("fraction ")]
        coords["paint"] = [name.removeprefix("fraction ") for name in names]

    flat = posterior.flat
    steps = posterior.free.shape[:3]
    likelihood = problem.log_likelihood(flat).reshape(steps)
    total = problem.log_probability(flat).reshape(steps)
    # Spectra of so many draws are enough for a picture.
    spectra = problem.readings(flat[:: max(1, len(flat) // 400)])[None]
    reading_dims = ["wavelength", "ground"] if bands else ["film", "wavelength", "ground"]
    dims |= {name: reading_dims for name in ("reflectance", "ground_reflectance", "reflectance_sd")}
    measured, ground, sd = (
        values if bands else values[None] for values in (film.reflectance, film.ground, film.sd)
    )
    attributes = _attributes(posterior)
    return arviz.from_dict(
        posterior=variables,
        sample_stats={"lp": np.swapaxes(total.sum(axis=-1), 0, 1)},
        log_likelihood={"reading": by_block("reading", likelihood)},
        posterior_predictive={"reflectance": spectra},
        observed_data={"reflectance": measured},
        constant_data={"ground_reflectance": ground, "reflectance_sd": sd},
        coords=coords,
        dims=dims,
        attrs=attributes,
        posterior_attrs=attributes,
    )


def _attributes(posterior: Posterior) -> dict[str, Any]:
    """Convergence and where the draws come from, as NetCDF takes it, which knows no booleans."""
    attributes: dict[str, Any] = {
        "film": posterior.films[0].name,
        "inference_library": "Laplace approximation",
        "glazejax": version("glazejax"),
        "converged": int(posterior.converged),
        "convergence": posterior.words(),
        "open_directions": "; ".join(posterior.identifiability.sentences) or "none",
        "laplace_tail_index": posterior.laplace.tail.tolist(),
        "laplace_modes_settled": int(posterior.laplace.converged.all()),
    }
    state = posterior.convergence
    chain = posterior.chain
    if state is not None and chain is not None:
        library = "emcee" if chain.sampler == "emcee" else "glazejax"
        attributes |= {
            "inference_library": library,
            "inference_library_version": version(library),
            "sampler": chain.sampler,
            "autocorrelation_time": state.times.tolist(),
            "effective_samples": state.samples.tolist(),
            "r_hat": float(np.max(state.apart)),
            "steps_kept": state.length,
            "steps_discarded": state.discarded,
            "thin": chain.thin,
            "acceptance": chain.accepted,
        }
    return attributes


def posterior_of_film(
    film: Films | Reading,
    pigments: Pigments,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    discrepancy: ModelError | None = None,
    prior: Prior | None = None,
    **sampling: Unpack[SamplingOptions],
) -> Posterior:
    """Fractions, thickness, gloss and model error of a film of known paints.

    Thickness and fractions allow for paint that is stronger or weaker in one film than in others
    (`glazefit.film.model.variation.STRENGTH`), of which readings show the product with thickness.

    Args:
        film: one film over black and white, or a `Reading` (see `reading_over` for one spectrum).
        pigments: one to five, with k and s in 1/m; of a mapping its values.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading.
        discrepancy: errors of the model, and of paints at most; by default those that films showed.
            What paints state of their errors counts, and further ones of a size that is not known
            (`Prior.error`).
        prior: of the film.
        sampling: sampler, steps, walkers, thin, seed, path, resume, overwrite and progress, see
            `glazefit.film.sampling.Sampling`.

    Raises:
        ValueError: more films than one, no paint, paints of which there is no coat (see
            `CoatPrior`) or that do not cover the film's wavelengths, too few walkers or steps, a
            chain of another problem, or JAX in single precision.
        FileExistsError, FileNotFoundError: see `glazefit.film.sample.DrawsFile`.
    """
    options = Sampling(**sampling)
    instrument = resolve_instrument(instrument)
    reading = _single_reading(film, instrument, noise or Noise())
    if not pigments:
        raise ValueError(f"0 paints were given for {reading.name!r}; name one at least")
    coats = [CoatPrior(listed_pigments(pigments))]
    problem = pose_stack(
        reading,
        coats,
        instrument,
        prior or Prior(),
        SpectraPrior(),
        discrepancy=discrepancy,
        kind="paints",
    )
    return sample(*solve(problem, seed=options.seed), (reading,), options)


def posterior_of_coats(
    film: Films | Reading,
    coats: Sequence[CoatPrior],
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    discrepancy: ModelError | None = None,
    prior: Prior | None = None,
    spectra: SpectraPrior | None = None,
    **sampling: Unpack[SamplingOptions],
) -> Posterior:
    """Thickness and fractions of every coat of a film, gloss and the paints' error; k and s of one
    unknown paint.

    Thicknesses and fractions allow for strengths as in `posterior_of_film`; a thickness that is
    stated holds. Readings of several coats, and their slopes, come from the solver itself, at an
    error of 1e-4. `Posterior.identifiability` names what the readings leave open.

    Args:
        film: one film over black and white, or a `Reading`, over one ground or more.
        coats: top first, at most six, with an unknown paint in one of them at most; what is not
            known of each is found.
        spectra: what is likely of an unknown paint's k and s.
        instrument, noise, discrepancy, prior, sampling: see `posterior_of_film`.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: as `posterior_of_film`, and for a stack that
            cannot be found (`glazefit.posterior.coats.check_coats`).
    """
    options = Sampling(**sampling)
    instrument = resolve_instrument(instrument)
    coats = check_coats(coats)
    reading = _single_reading(film, instrument, noise or Noise())
    problem = pose_stack(
        reading,
        coats,
        instrument,
        prior or Prior(),
        spectra or SpectraPrior(),
        discrepancy=discrepancy,
    )
    return sample(*solve(problem, seed=options.seed), (reading,), options)


def posterior_of_bands(
    film: Films | Reading,
    *,
    gloss: float | None = None,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    **sampling: Unpack[SamplingOptions],
) -> Posterior:
    """Optical thicknesses k d and s d of a measured film at every wavelength; no paint is assumed.

    Args:
        film: one film over black and white, or a `Reading`.
        gloss: share of the surface's reflection in the readings; by default estimated from films
            over both cards, and 1 for a `Reading`.
        instrument, noise: see `posterior_of_film`.
        sampling: the same.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: as `posterior_of_film`, and for a gloss out
            of range.
    """
    options = Sampling(**sampling)
    instrument = resolve_instrument(instrument)
    noise = noise or Noise()
    # As much above that of a smooth surface as a measured one may be (`glazefit.film.gloss`).
    if gloss is not None and not 0 <= gloss <= 1.5:
        raise ValueError(
            f"gloss is {gloss:g}; it must be in [0, 1.5], a share of the reflection of a smooth "
            "surface"
        )
    reading = _single_reading(film, instrument, noise)
    if gloss is None:
        gloss = (
            float(estimate_gloss(film, instrument, noise)[0]) if isinstance(film, Films) else 1.0
        )
    problem = pose_bands(reading, gloss, instrument)
    return sample(*solve(problem, seed=options.seed), (reading,), options)


def sample(
    problem: FilmProblem, modes: Modes, films: tuple[Reading, ...], options: Sampling
) -> Posterior:
    """Sample a problem from draws of its Laplace approximation at the modes found; with no steps
    that is all.
    """
    approximate = laplace(problem, modes, seed=options.seed)
    chain = draw_chain(problem, approximate, options) if options.length else None
    return Posterior(problem, films, approximate, chain, options.sampler == "importance")


def _single_reading(film: Films | Reading, instrument: Instrument, noise: Noise) -> Reading:
    """The film as a `Reading`.

    Raises:
        ValueError: there are more films than one, or none.
    """
    if isinstance(film, Reading):
        return film
    if len(film) != 1:
        raise ValueError(
            f"a posterior is of one film, not of {len(film)}; choose one with films.select([name])"
        )
    return readings(film, instrument, noise)[0]
