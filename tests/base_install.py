"""What the package does by itself, without any extra: the solver, its slopes, the catalogue, paints
in a spectrum.

A program, not a test of pytest's: run it with the Python of an environment that has the wheel
alone,

    python tests/base_install.py

It fails where a package of an extra is installed too, for it would then show nothing.
"""

import re
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np


def is_installed(name: str) -> bool:
    try:
        requires(name)
    except PackageNotFoundError:
        return False
    return True


def requirements(name: str, *, of_extras: bool) -> set[str]:
    """Distributions that one asks for by itself, or with its extras; none where it is not
    installed.
    """
    lines = (requires(name) or []) if is_installed(name) else []
    chosen = [line for line in lines if bool(re.search(r"\bextra\s*==", line)) == of_extras]
    return {re.split(r"[^\w.-]", line)[0].lower().replace("_", "-") for line in chosen}


def mandatory() -> set[str]:
    """All that is installed with the package, and with what it needs."""
    found, ask = set(), {"glazejax"}
    while ask:
        found |= ask
        ask = {other for name in ask for other in requirements(name, of_extras=False)} - found
    return found


def check_environment() -> None:
    """The package is an installed one, and nothing of its extras is there."""
    import glazefit
    import glazejax

    for package in (glazejax, glazefit):
        assert "site-packages" in str(package.__file__), package.__file__
    extras = requirements("glazejax", of_extras=True) - mandatory()
    assert {"typer", "rich", "matplotlib", "pytest"} <= extras
    present = sorted(name for name in extras if is_installed(name))
    assert not present, f"packages of extras are installed: {present}"
    # By what is imported too: a folder on the path has no metadata.
    assert not any(
        find_spec(name)
        for name in ("typer", "rich", "matplotlib", "xarray", "starlette", "mitsuba")
    )


def check_names() -> None:
    """Every public name is there, those too whose work needs an extra."""
    import glazefit
    import glazejax
    import glazejax.appearance.mitsuba

    for package in (
        glazejax,
        glazejax.appearance,
        glazejax.appearance.scene,
        glazejax.io,
        glazefit,
    ):
        for name in package.__all__:
            getattr(package, name)
    assert glazejax.appearance.mitsuba.glaze_bsdf("Eosin:2um")["type"] == "glaze"


def check_reflectance() -> None:
    """A layer that absorbs alone, in closed form, and its slope; in single precision, JAX's own."""
    from glazejax import stack_reflectance_factor

    def factor(depth: jax.Array) -> jax.Array:
        return stack_reflectance_factor([0.0], depth[None], 0.3, refractive_index=1.0)

    value, slope = jax.value_and_grad(factor)(jnp.asarray(0.4))
    assert value.dtype == jnp.float32
    np.testing.assert_allclose([value, slope], [0.3 * np.exp(-0.8), -0.6 * np.exp(-0.8)], atol=1e-5)


def check_colour_and_recovery() -> None:
    """The colour of a glaze, and the scattering of a paint from its simulated films."""
    import glazefit
    import glazejax

    known = glazejax.catalogue.load()
    blue, white = known["CobaltBlue"], known["ZincWhite"]
    wavelengths = np.asarray(blue.wavelengths)
    glaze = glazejax.Glaze([glazejax.Layer(blue, 2e-6), glazejax.Layer(white, 10e-6)], 0.6)
    spectrum = np.asarray(glazejax.reflectance(glaze, glazejax.Hemispherical(8.0)))
    assert glazejax.colour.lab(wavelengths, spectrum, illuminant="D65")[2] < -20
    absorption, scattering = (
        25e-6 * np.asarray(values)[None] for values in (white.absorption, white.scattering)
    )
    found = glazefit.recover_films(
        glazefit.simulate_films(wavelengths, absorption, scattering, names=["white"])
    )
    told = found.identifiable[0]
    assert told.any()
    assert np.abs(found.scattering[0, told] / scattering[0, told] - 1).max() < 0.5


def check_identification() -> None:
    """Two paints of the catalogue, mixed and measured over two grounds: found by their names and
    shares.
    """
    import glazefit
    import glazejax

    known = glazejax.catalogue.load()
    paints = {
        name: known[name] for name in ("ZincWhite", "PrussianBlue", "Vermillion", "ChromeYellow")
    }
    white, blue = paints["ZincWhite"], paints["PrussianBlue"]
    wavelengths, grounds = np.asarray(white.wavelengths), np.array([0.025, 0.93])
    mixture = glazejax.Mixture([white, blue], [0.8, 0.2])
    instrument = glazejax.Hemispherical(8)
    spectra = []
    for ground in grounds:
        glaze = glazejax.Glaze([glazejax.Layer(mixture, 25e-6)], np.full(wavelengths.size, ground))
        spectra.append(glazejax.reflectance(glaze, instrument))
    under = grounds[:, None] * np.ones(wavelengths.size)
    found = glazefit.identify(
        wavelengths, np.array(spectra)[None], paints, ground=under, max_paints=2
    )
    best = found.ranked(0)[0]
    assert set(best.paints) == {"ZincWhite", "PrussianBlue"}, best
    share = dict(zip(best.paints, best.fractions, strict=True))["PrussianBlue"]
    assert abs(share - 0.2) < 0.05, best


check_environment()
check_names()
check_reflectance()
print(f"the base install reflects in {jnp.ones(1).dtype}")
check_identification()
print("the base install tells two paints in a film")
# As the commands do it.
jax.config.update("jax_enable_x64", True)
check_colour_and_recovery()
print("the base install gives a colour and recovers a paint")
