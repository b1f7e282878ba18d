"""Compiled programs kept between runs: in the user's folder if that can be written, else the run
goes on without.

What goes wrong with the folder costs the time that it saves, and one sentence.
"""

import os
import re
import stat
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

_COMPLAINT = re.compile(
    r"Error (reading|writing) persistent compilation cache entry for '([^']*)': (.*)", re.DOTALL
)
_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_told = False


def keep_programs() -> None:
    """Let JAX keep what it compiles in ``GLAZEJAX_CACHE``, or else in the user's cache."""
    import jax
    from platformdirs import user_cache_path

    from ..programs import keep_traced

    try:
        named = os.environ.get("GLAZEJAX_CACHE")
        folder = Path(named) if named else user_cache_path("glazejax", False).expanduser() / "xla"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not named:
            _close(folder)
        if (whose := _others(folder)) is not None:
            _tell(f"{folder} {whose}, and programs are run as they are found")
            return
        # A folder's permissions do not tell whether its disk is read-only or full.
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(4096))
    except (OSError, RuntimeError) as error:
        _tell(str(getattr(error, "strerror", None) or error))
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    keep_traced(folder)
    _listen(folder)


def _close(folder: Path) -> None:
    """Take from others what an old umask has let them write in a folder of one's own."""
    found = folder.stat()
    if hasattr(os, "geteuid") and found.st_uid == os.geteuid() and found.st_mode & _OTHERS:
        folder.chmod(stat.S_IMODE(found.st_mode) & ~_OTHERS)


def _others(folder: Path) -> str | None:
    """How somebody else may write to a folder; None where nobody may, or nobody says who."""
    if not hasattr(os, "geteuid"):
        return None
    found = folder.stat()
    if found.st_uid != os.geteuid():
        return "belongs to another user"
    return "may be written by others" if found.st_mode & _OTHERS else None


def _listen(folder: Path) -> None:
    """Say JAX's warnings about the cache once and in our words, and take out what was written in
    part.
    """
    # Python shows a warning of one place once only, unless told otherwise.
    warnings.filterwarnings(
        "always", message="Error (reading|writing) persistent compilation cache"
    )
    shown = warnings.showwarning

    def show(message: Warning | str, *rest: Any, **more: Any) -> None:
        found = _COMPLAINT.match(str(message))
        if found is None:
            shown(message, *rest, **more)
            return
        _tell(found[3])
        # JAX never writes an entry again that is there, however short a full disk has left it.
        for path in folder.glob(f"{found[2]}-*"):
            try:
                path.unlink()
            except OSError:
                continue

    warnings.showwarning = show


def _tell(reason: str) -> None:
    global _told
    if not _told:
        print(
            f"note: compiled programs are not kept ({reason}), so that the next run compiles them "
            "again; GLAZEJAX_CACHE names another folder",
            file=sys.stderr,
        )
    _told = True
