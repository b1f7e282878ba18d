"""Files that are there whole, or not at all."""

import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_COUNT = itertools.count()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A name to write under: what was written takes the file's own once it is whole, and is taken
    away if that fails. So a file is there whole, or as it was before. A device, a pipe or a
    link, such as /dev/stdout, is written to as it is.
    """
    # A link counts whether or not there is a file where it leads.
    if path.is_symlink() or (path.exists() and not path.is_file()):
        yield path
        return
    # Programs that write the same file at one time each write a part of their own, and so do files
    # written together whose long names differ at the end.
    temporary = path.with_name(f"{path.name[:200]}.{os.getpid()}.{next(_COUNT)}.part")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.filename is not None and Path(error.filename) == temporary:
            # What the user named, not what it is called meanwhile.
            raise type(error)(error.errno, error.strerror, str(path)) from None
        raise
    finally:
        temporary.unlink(missing_ok=True)
