"""Work done side by side."""

import threading
import time

import pytest

from glazejax.radiative.common import threads
from glazejax.radiative.common.threads import in_threads


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 2)


def test_answers_come_in_order_and_side_by_side():
    """Two that wait for each other would never end one after the other."""
    both = threading.Barrier(2, timeout=30.0)

    def work(item: int) -> int:
        both.wait()
        return 10 * item

    assert in_threads(work, [3, 1, 2, 5]) == [30, 10, 20, 50]
    assert in_threads(lambda item: item, [7]) == [7]
    assert in_threads(lambda item: item, []) == []


def test_a_mistake_is_raised_and_ends_what_has_not_begun():
    begun = []

    def work(item: int) -> None:
        begun.append(item)
        if item == 0:
            raise ValueError("no such film")
        time.sleep(0.05)

    with pytest.raises(ValueError, match="no such film"):
        in_threads(work, list(range(100)))
    assert len(begun) < 20
