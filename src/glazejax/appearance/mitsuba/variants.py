"""Choice of the variant of Mitsuba that computes spectra here, and its use without taking another
one from the user.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from ...extras import require

# Fast first.
SPECTRAL = ("llvm_ad_spectral", "scalar_spectral")
# A picture of a few pixels: with some versions of LLVM the process ends at its first kernel, not
# before.
_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
film = {"type": "hdrfilm", "width": 4, "height": 4}
scene = {"type": "scene", "sensor": {"type": "perspective", "film": film}}
scene |= {"integrator": {"type": "path"}, "light": {"type": "constant"}}
scene |= {"ball": {"type": "sphere", "center": [0, 0, 4]}}
sys.exit(0 if float(mi.TensorXf(mi.render(mi.load_dict(scene), spp=4)).array[0]) > 0 else 1)
"""


@cache
def works(variant: str) -> bool:
    """Test whether a variant of Mitsuba renders here; tried in a process of its own, which may be
    aborted.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE, variant],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=120.0,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


@cache
def usable_variant() -> str:
    """The fastest spectral variant that works here: LLVM's, or the one that needs nothing.

    Raises:
        ModuleNotFoundError: Mitsuba is not installed.
        ValueError: it was built without spectral variants.
    """
    require("mitsuba")
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    available = [variant for variant in SPECTRAL if variant in mi.variants()]
    if not available:
        names = ", ".join(mi.variants())
        raise ValueError(
            f"this Mitsuba has no spectral variant ({' or '.join(SPECTRAL)}), only {names}"
        )
    return next((variant for variant in available[:-1] if works(variant)), available[-1])


def check_llvm(variant: str | None) -> None:
    """Refuse a variant that would end the process at its first picture.

    Raises:
        ValueError: it is one of LLVM's, and the LLVM that is found here aborts.
    """
    if variant is None or not variant.startswith("llvm"):
        return
    import drjit  # pyright: ignore[reportMissingImports]

    major = drjit.detail.llvm_version()[0]
    # The last LLVM with which Dr.Jit ends the process, on new processors; older ones it does not
    # take.
    if major <= 15 and not works(variant):
        raise ValueError(
            f"with LLVM {major} Mitsuba's variant {variant} ends the process here: install LLVM 19 "
            "(Debian: apt-get install libllvm19), name it in DRJIT_LIBLLVM_PATH, or write "
            'mitsuba.set_variant("scalar_spectral")'
        )


def is_spectral(variant: str | None) -> bool:
    """Test whether scenes of this program can be rendered in a variant: with spectra, without
    polarisation.
    """
    return variant is not None and "spectral" in variant and "polarized" not in variant


@contextmanager
def spectral_variant() -> Iterator[str]:
    """A spectral variant for as long as this lasts: the user's own if it is one, which stays;
    otherwise the one set before comes back in the end.
    """
    require("mitsuba")
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    before = mi.variant()
    if is_spectral(before):
        check_llvm(before)
        yield str(before)
        return
    variant = usable_variant()
    mi.set_variant(variant)
    try:
        yield variant
    finally:
        if before is not None:
            mi.set_variant(before)
