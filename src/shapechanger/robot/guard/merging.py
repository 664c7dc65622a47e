"""Makes one number out of what several sensors say of the same quantity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

__all__ = ["merge"]


def _larger(new: float, old: float) -> bool:
    return new > old


def _smaller(new: float, old: float) -> bool:
    return new < old


def _slower(new: float, old: float) -> bool:
    return abs(new) < abs(old)


# The one that calls for more care counts. Of two speeds it is the smaller one, so that a track that
# turns does not hide one that is stalled. Of other quantities the last one counts.
_COUNTS_MORE: Final[dict[str, Callable[[float, float], bool]]] = {
    "bump": _larger,
    "collision": _larger,
    "stall": _larger,
    "temperature": _larger,
    "distance": _smaller,
    "battery": _smaller,
    "speed": _slower,
}


def merge(
    quantities: dict[str, float],
    sources: dict[str, str],
    measured: Mapping[str, float],
    sensor: str,
) -> None:
    """Add what one more sensor measured.

    Args:
        quantities: What was measured so far, by name; changed.
        sources: Name of the sensor behind each; changed.
        measured: What this sensor measured.
        sensor: Its name.
    """
    for name, value in measured.items():
        counts_more = _COUNTS_MORE.get(name)
        is_first = name not in quantities
        if is_first or counts_more is None or counts_more(value, quantities[name]):
            quantities[name], sources[name] = value, sensor
