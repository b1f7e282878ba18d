"""A first answer sooner: programs compiled in half the time on the processor, and kept between
runs, in the user's folder if that can be written.

What goes wrong with the folder costs the time that it saves, and one sentence.
"""

import os
import re
import stat
import sys
import tempfile
import warnings
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

# XLA ends a process at an option that it does not know: versions of jaxlib looked at.
_KNOWN = (0, 9), (0, 13)
# Emitters of fused loops take a third of compilation, and what they emit here runs no faster.
_SIMPLE_LOOPS = "--xla_cpu_use_fusion_emitters=false"
# The first level of optimisation leaves the solver a tenth slower than the last, without any it
# takes several times as long.
_LEVEL = "--xla_backend_optimization_level"
_COMPLAINT = re.compile(
    r"Error (reading|writing) persistent compilation cache entry for '([^']*)': (.*)", re.DOTALL
)
_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_WRITABLE = "may be written by others"
_told = False


def enable_program_cache(path: str | Path | None = None) -> None:
    """Let programs be compiled quickly, and kept between runs, as the commands do.

    The next process that asks for the same takes from the folder what this one compiled and
    traced. Call it before JAX computes anything: XLA reads its options once. What ``XLA_FLAGS``
    says already counts. Only you should be able to write to the folder, for what lies in it is
    run; where it can't be used, a note on stderr says why, and nothing is kept.

    Args:
        path: the folder, made if it is not there; by default ``GLAZEJAX_CACHE``, or else a folder
            in the user's cache.
    """
    compile_quickly(1)
    import jax
    from platformdirs import user_cache_path

    from .programs import keep_traced

    configure = jax.config.update
    # XLA reports every program it takes from that cache as an error, harmlessly, and for pages.
    configure("jax_logging_level", "CRITICAL")
    try:
        named = path or os.environ.get("GLAZEJAX_CACHE")
        folder = Path(named or user_cache_path("glazejax", False) / "xla").expanduser().absolute()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # An old umask may have let others write in a folder of one's own.
        if not named and _others(folder) == _WRITABLE:
            folder.chmod(stat.S_IMODE(folder.stat().st_mode) & ~_OTHERS)
        if (whose := _others(folder)) is not None:
            _warn(f"{folder} {whose}, and programs are run as they are found")
            return
        # A folder's permissions do not show whether its disk is read-only or full.
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(4096))
    except (OSError, RuntimeError) as error:
        _warn(str(getattr(error, "strerror", None) or error))
        return
    configure("jax_compilation_cache_dir", str(folder))
    configure("jax_persistent_cache_min_compile_time_secs", 0.0)
    configure("jax_persistent_cache_min_entry_size_bytes", -1)
    keep_traced(folder)
    _listen(folder)


def compile_quickly(optimisation: int) -> None:
    """Put these options into ``XLA_FLAGS``, before JAX compiles anything; those that are there
    count.

    Args:
        optimisation: of optimisation, from 0 to 3.
    """
    jaxlib = tuple(map(int, version("jaxlib").split(".")[:2]))
    if not _alone() or not _KNOWN[0] <= jaxlib < _KNOWN[1]:
        return
    flags = os.environ.get("XLA_FLAGS", "")
    new = [
        flag
        for flag in (_SIMPLE_LOOPS, f"{_LEVEL}={optimisation}")
        if flag.partition("=")[0] not in flags
    ]
    if new:
        os.environ["XLA_FLAGS"] = " ".join([*new, flags]).strip()


def _alone() -> bool:
    """Test whether JAX has the processor only: other devices' compilers have that level too."""
    asked = os.environ.get("JAX_PLATFORMS", "")
    return asked == "cpu" or (not asked and find_spec("jax_plugins") is None)


def _others(folder: Path) -> str | None:
    """Way for somebody else to write to a folder; None where nobody may, or nobody says who."""
    if not hasattr(os, "geteuid"):
        return None
    status = folder.stat()
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    return _WRITABLE if status.st_mode & _OTHERS else None


def _listen(folder: Path) -> None:
    """Say JAX's warnings about the cache once and in our words, and take out what was written in
    part.
    """
    # Python shows a warning of one place once only, unless stated otherwise.
    warnings.filterwarnings(
        "always", message="Error (reading|writing) persistent compilation cache"
    )
    show_warning = warnings.showwarning

    def show(message: Warning | str, *details: Any, **options: Any) -> None:
        complaint = _COMPLAINT.match(str(message))
        if complaint is None:
            show_warning(message, *details, **options)
            return
        _warn(complaint[3])
        # JAX never writes an entry again that is there, however short a full disk has left it.
        for path in folder.glob(f"{complaint[2]}-*"):
            try:
                path.unlink()
            except OSError:
                continue

    warnings.showwarning = show


def _warn(reason: str) -> None:
    global _told
    if not _told:
        print(
            f"note: compiled programs are not kept ({reason}), so that the next run compiles them "
            "again; GLAZEJAX_CACHE names another folder",
            file=sys.stderr,
        )
    _told = True
