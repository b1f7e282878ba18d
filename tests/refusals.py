"""Wrong input that is refused."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def refusal(words: str, kind: type[Exception] = ValueError) -> Iterator[pytest.ExceptionInfo]:
    """A call that ends with an error of one line in which these words stand."""
    with pytest.raises(kind, match=words) as error:
        yield error
    assert "\n" not in str(error.value)
