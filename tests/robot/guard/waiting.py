"""Waits for something to become so."""

import time
from collections.abc import Callable


def until(condition: Callable[[], bool], at_most_s: float = 20.0) -> None:
    """Wait until a condition holds, and fail when it does not in time."""
    end = time.monotonic() + at_most_s
    while not condition():
        assert time.monotonic() < end, f"Still not so after {at_most_s} s."
        time.sleep(0.002)
