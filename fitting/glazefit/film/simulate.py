"""Films of known absorption and scattering, as a noisy instrument would measure them."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.spectra import Bands, validate_wavelengths

from .films import Films, Instrument, InstrumentLike, Noise, usual_cards
from .model.optics import Optics


def simulate_films(
    wavelengths: Bands,
    absorption: Float[np.ndarray, "films bands *coats"],
    scattering: Float[np.ndarray, "films bands *coats"],
    *,
    names: Sequence[str],
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    seed: int = 0,
) -> Films:
    """Measured spectra of films of given optical thicknesses over both cards, with independent
    noise on all four.

    Args:
        wavelengths: (bands,), nm.
        absorption, scattering: k d and s d, (films, bands), or (films, bands, coats) for several
            coats, top first.
        names: of the films.
        instrument, noise: by default those of `recover_films`.
        seed: of the noise; equal seeds give equal spectra.

    Raises:
        ValueError: a grid that is not legal, or k d or s d of another shape.
    """
    grid = validate_wavelengths(wavelengths)
    # A single film may be given as (bands,).
    k, s = np.atleast_2d(absorption), np.atleast_2d(scattering)
    for what, values in (("absorption", k), ("scattering", s)):
        if values.ndim not in (2, 3) or values.shape[:2] != (len(names), grid.size):
            raise ValueError(
                f"{what} has shape {values.shape}; it must be (films, bands) or (films, bands, "
                f"coats), with {len(names)} films and {grid.size} bands"
            )
    instrument = resolve_instrument(instrument)
    noise = noise or Noise()
    rng = np.random.default_rng(seed)
    k, s = (values.reshape(len(names), grid.size, -1) for values in (k, s))
    grounds = np.broadcast_to(np.stack(usual_cards(grid), axis=-1), (*k.shape[:2], 2))
    optics = Optics.of(instrument)
    empty = np.full((1, 1, 1), 1e-12)

    def read_film(k: np.ndarray, s: np.ndarray) -> np.ndarray:
        body = optics.body(
            jnp.asarray(k)[:, :, None], jnp.asarray(s)[:, :, None], jnp.asarray(grounds), 1e-6
        )
        exact = np.asarray(body) + instrument.seen_surface
        return np.maximum(exact + noise.sd(exact) * rng.standard_normal(exact.shape), 0.0)

    bare = read_film(empty, empty)
    painted = read_film(k, s)
    return Films(
        names=tuple(names),
        wavelengths=grid,
        bare_black=bare[..., 0],
        bare_white=bare[..., 1],
        over_black=painted[..., 0],
        over_white=painted[..., 1],
    )


def simulate_paints(
    paints: Sequence[Pigment],
    thickness: float,
    *,
    instrument: Instrument,
    noise: Noise,
    seed: int = 0,
) -> Films:
    """Simulated films of paints on one grid, all of one thickness (m)."""
    return simulate_films(
        paints[0].wavelengths,
        np.stack([paint.absorption for paint in paints]) * thickness,
        np.stack([paint.scattering for paint in paints]) * thickness,
        names=[paint.name for paint in paints],
        instrument=instrument,
        noise=noise,
        seed=seed,
    )
