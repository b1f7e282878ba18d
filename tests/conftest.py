"""Double precision, hypothesis without deadlines (the first call compiles), and shared measured data."""

import gc
import os
from pathlib import Path

# Most of the suite's time is compilation. Fast code is for users; here it is compiled quickly instead.
os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "") + " --xla_backend_optimization_level=0"

import hypothesis
import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_logging_level", "CRITICAL")  # XLA calls a program taken from the cache an error
# Programs compiled by one worker or run serve the others.
jax.config.update("jax_compilation_cache_dir", str(Path(__file__).parents[1] / ".pytest_cache" / "xla"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)
hypothesis.settings.register_profile("glazejax", deadline=None, max_examples=50)
hypothesis.settings.load_profile("glazejax")


_MANY_MAPPINGS = 20_000
"""Of memory by one process; Linux allows 65530, and LLVM, which takes some for each program, crashes beyond."""


@pytest.fixture(autouse=True, scope="module")
def _programs_are_let_go():
    """Throws compiled programs away before there are too many."""
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and len(mappings.read_bytes().splitlines()) > _MANY_MAPPINGS:
        jax.clear_caches()
        gc.collect()


def _shared(variable: str, folder: str) -> Path:
    path = Path(os.environ.get(variable) or Path(__file__).parents[2] / "shared" / folder)
    if not path.is_dir():
        pytest.skip(f"no shared {folder} at {path}; set {variable}")
    return path


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured spectra."""
    return _shared("GLAZEJAX_DATA", "data")


@pytest.fixture(scope="session")
def shared_reference() -> Path:
    """Folder of values that other programs computed."""
    return _shared("GLAZEJAX_REFERENCE", "reference")
