"""Progress of a long computation: one callable type, the same in every function."""

import itertools
from collections.abc import Callable
from typing import Protocol, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """Message that a `progress=` argument is called with, each time a part is done.

    `done` of `total` parts are finished (`total` is None where it is unknown, as for
    the bytes of a pipe), and `words` say what is being done, as in 'computing spectra'.
    """

    def __call__(self, done: int, total: int | None, stage: str, /) -> object:
        """Take note of a part that is done."""


def no_progress(done: int, total: int | None, stage: str, /) -> None:
    """Reports nothing: the default of a `progress=` argument."""


def counted(progress: Progress, total: int, stage: str) -> Callable[[], object]:
    """A function to call after each of so many parts."""
    numbers = itertools.count(1)
    return lambda: progress(next(numbers), total, stage)
