"""MuJoCo's stopwatch, which rests while an env steps.

In C nothing is measured unless somebody installs a clock. Python's MuJoCo installs one, and an
ant's step reads it hundreds of times to fill `data.timer`; how often, and what that costs, is a row
of `python -m benchmarks.run speed`. No other number depends on it.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
from functools import cache
from typing import Any, cast

import mujoco

__all__ = ["Resting", "resting_stopwatch"]


class Resting:
    """A context in which MuJoCo measures nothing, for all threads; threads may be in it together.

    A clock that somebody has installed with `mujoco.set_mjcb_time` goes on.

    Args:
        clock: Where the address of the function is that tells the time.
    """

    def __init__(self, clock: ctypes.c_void_p) -> None:
        self._clock = clock
        self._usual = clock.value
        self._inside = 0
        self._lock = threading.Lock()

    def __enter__(self) -> None:
        with self._lock:
            self._inside += 1
            if self._clock.value == self._usual:
                self._clock.value = None

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside and self._clock.value is None:
                self._clock.value = self._usual


@cache
def resting_stopwatch() -> contextlib.AbstractContextManager[None]:
    """The context in which the stopwatch rests; it does nothing where there is no way to it."""
    if mujoco.get_mjcb_time() is not None:
        return contextlib.nullcontext()  # Somebody's own clock, and ours is not known.
    try:
        # The bindings are linked to the library, wherever it lies.
        bindings = ctypes.CDLL(cast("Any", mujoco)._callbacks.__file__)
        return Resting(ctypes.c_void_p.in_dll(bindings, "mjcb_time"))
    except (AttributeError, OSError, ValueError):
        return contextlib.nullcontext()
