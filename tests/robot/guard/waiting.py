"""Polling helper for tests with processes."""

import time
from collections.abc import Callable


def until(condition: Callable[[], bool], at_most_s: float = 20.0) -> None:
    """Wait until a condition holds, and fail after a time."""
    end = time.monotonic() + at_most_s
    while not condition():
        assert time.monotonic() < end, f"the condition did not hold within {at_most_s} s"
        time.sleep(0.002)
