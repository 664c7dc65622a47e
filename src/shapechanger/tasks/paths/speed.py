"""How fast a path may be: faster is a jump, or a unit taken for another."""

from __future__ import annotations

from typing import Final

__all__ = ["FASTEST_MPS", "jumps", "too_fast"]

FASTEST_MPS: Final = 2.0
"""The fastest that a path may be, m/s: a fingertip 0.1 m from its knuckle turns at 20 rad/s."""


def jumps(distance_m: float, seconds: float) -> bool:
    """Whether that distance, m, at least 0, in that time, s, at least 0, is a jump."""
    return distance_m > FASTEST_MPS * seconds


def too_fast(distance_m: float, seconds: float) -> str:
    """What to say of a jump of that distance, m, in that time, s: the end of a sentence."""
    return (
        f"the point moves {distance_m:.3g} m in {seconds:.3g} s, and no fingertip is faster than "
        f"{FASTEST_MPS:g} m/s"
    )
