"""Without the packages of the extras the solver and its inverse work, and what does not says which
extra it needs.
"""

import sys
import tomllib
from pathlib import Path

import pytest

import glazejax
from glazejax.extras import advice, require

from .fresh import run_python

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
PACKAGES = {
    "commands": "typer rich",
    "plots": "matplotlib corner jinja2",
    "formats": "python_calamine",
    "arviz": "arviz h5py",
    "scene": "trimesh embreex OpenEXR",
    "cube": "xarray pandas zarr dask distributed h5netcdf tifffile PIL threadpoolctl filelock",
    "studio": "starlette uvicorn websockets anywidget",
    "render": "mitsuba",
}
OPTIONAL = {package: extra for extra, names in PACKAGES.items() for package in names.split()}

_BLOCK = f"""
import sys
from importlib import metadata

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(OPTIONAL)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

def distribution(name, found=metadata.distribution):
    if name.lower().replace("-", "_") in {sorted(name.lower() for name in OPTIONAL)}:
        raise metadata.PackageNotFoundError(name)
    return found(name)

sys.meta_path.insert(0, Absent())
metadata.distribution = distribution
import jax
jax.config.update("jax_enable_x64", True)
"""

_MISSING = """
import glazejax.appearance.mitsuba
import glazejax.colour
import numpy as np

glazejax.colour.colour_science()  # which puts an empty stand-in in the place of matplotlib
from glazejax.appearance.scene.picture import save_png
from glazefit.film.solve import load_arviz

for extra, call in (
    ("plots", lambda: save_png("a.png", np.zeros((2, 2, 3), np.uint8))),
    ("arviz", load_arviz),
    ("cube", lambda: glazejax.io.open_cube("a.npy")),
    ("render", lambda: glazejax.appearance.mitsuba.register()),
):
    try:
        call()
    except ModuleNotFoundError as error:
        assert f'pip install "glazejax[{extra}]"' in str(error), error
    else:
        raise AssertionError(extra)
"""


def test_a_missing_extra_is_one_sentence():
    variables = {
        "JAX_COMPILATION_CACHE_DIR": str(ROOT / ".pytest_cache" / "xla"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
    }
    run_python(_BLOCK + _MISSING, env=variables)


@pytest.mark.parametrize(("package", "extra"), OPTIONAL.items())
def test_the_extra_that_is_named_brings_the_package(package, extra):
    sentence = advice(f"{package}.part")
    assert sentence is not None
    assert f"glazejax[{extra}]" in sentence
    assert any(
        entry.replace("-", "_").lower().startswith(package.lower()) for entry in EXTRAS[extra]
    )
    other = ("all", "cuda", "test", "benchmark", "release", "mutation", "docs")
    assert f"[{','.join(e for e in EXTRAS if e not in other)}]" in EXTRAS["all"][0]


def test_what_no_extra_brings_has_no_advice():
    assert advice("no_such_package") is None
    assert advice(None) is None
    require("rich", "matplotlib")


def test_version_is_that_of_the_project():
    assert glazejax.__version__ == PROJECT["version"]


def test_fit_is_the_inverse_package():
    import glazefit

    assert glazejax.fit is glazefit
    assert glazejax.fit.identify is glazefit.identify


def test_the_inverse_package_is_not_loaded_before():
    run_python("""
import sys, glazejax
assert 'glazefit' not in sys.modules
glazejax.fit
assert 'glazefit' in sys.modules
""")


def test_without_the_inverse_package_a_sentence_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "glazefit", None)
    with pytest.raises(AttributeError, match="package glazefit, which is not installed"):
        glazejax.fit  # noqa: B018
