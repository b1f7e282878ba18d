"""One run at a time on a map: a lock beside its folder, that stays where the folder is replaced."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


@contextmanager
def hold(path: Path) -> Iterator[None]:
    """Hold a map, there or to be made, so that no other run replaces or writes it meanwhile.

    The lock is the system's own, on the file ``.NAME.lock`` beside the folder. It ends with the
    process that has it, however that ends: a file that a killed run left holds nothing. The file is
    taken away in the end.

    Args:
        path: folder of the map.

    Raises:
        ValueError: another run holds it.
        OSError: the file cannot be made.
    """
    # Two names of one folder have one lock.
    folder = path.resolve()
    beside = folder.with_name(f".{folder.name}.lock")
    while True:
        with beside.open("ab") as file:
            if not _lock(file):
                raise ValueError(
                    f"another run is writing {path}; wait for it or stop it, or name another map"
                )
            # The run before may have taken the file away after it was opened here: then others
            # would lock a new one.
            if not _is_at(file, beside):
                continue
            try:
                yield
            finally:
                # Windows removes no open file; there it stays.
                with suppress(OSError):
                    beside.unlink()
            return


def _is_at(file: BinaryIO, path: Path) -> bool:
    """Whether an open file still has its name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _lock(file: BinaryIO) -> bool:
    """Lock an open file for this process; False if another has it. The system lets go when the
    process ends.
    """
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    from fcntl import LOCK_EX, LOCK_NB, flock

    try:
        flock(file.fileno(), LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a network drive without locks
        return True
    return True
