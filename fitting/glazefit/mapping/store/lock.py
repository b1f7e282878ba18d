"""One run at a time on a map: a lock next to its folder, which stays if the folder is replaced."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def hold(path: Path) -> Iterator[None]:
    """Hold a map, there or to be made, so that no other run replaces or writes it meanwhile.

    The lock is the system's own, on the file ``.NAME.lock`` next to the folder. It ends with the
    process that has it, however that ends: a file that a killed run left holds nothing. The file is
    taken away in the end.

    Args:
        path: folder of the map.

    Raises:
        ValueError: another run holds it.
        OSError: the file cannot be made or locked.
    """
    from filelock import FileLock, Timeout

    # Two names of one folder have one lock.
    folder = path.resolve()
    lock_file = folder.with_name(f".{folder.name}.lock")
    lock = FileLock(lock_file)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(
            f"another run is writing {path}; wait for it or stop it, or name another map"
        ) from None
    try:
        yield
    finally:
        # While it is held: filelock takes no file that was taken away. Windows removes no open
        # file; there it stays.
        with suppress(OSError):
            lock_file.unlink()
        lock.release()
