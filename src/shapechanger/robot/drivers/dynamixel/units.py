"""Tensions and lengths, as the counts of a servo.

A length is that of the tendon beyond its zero: it grows as the tendon is let out.
"""

from __future__ import annotations

import math
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.registers import COUNTS_PER_TURN
from shapechanger.robot.drivers.dynamixel.settings import ServoSettings

__all__ = [
    "cap_count",
    "goal_count",
    "length_m",
    "length_per_count",
    "lengthening",
    "tension_n",
    "within",
]

_ROUNDING: Final = 1e-9  # Of a quotient that is a whole number: 3.0 may come out as 2.9999999999.


def cap_count(servo: ServoSettings) -> int:
    """The current limit, in counts: the largest that pulls no more than the most tension."""
    return math.floor(servo.most_tension_n / servo.newton_per_count + _ROUNDING)


def within(servo: ServoSettings, tension: float) -> float:
    """A tension, kept between the pretension and the most tension, N.

    Raises:
        RobotError: If it is no number: nobody knows what was meant.
    """
    if not math.isfinite(tension):
        raise RobotError(f"{servo.words} cannot pull {tension} N.")
    return min(max(tension, servo.pretension_n), servo.most_tension_n)


def goal_count(servo: ServoSettings, tension: float) -> int:
    """The goal current for a tension, in counts with the sign that winds in; never above the cap.

    It is rounded towards slack.

    Args:
        servo: Who pulls.
        tension: N; below 0 counts as 0, for a tendon does not push.

    Raises:
        RobotError: If it is no number.
    """
    if not math.isfinite(tension):
        raise RobotError(f"{servo.words} cannot pull {tension} N.")
    # Clipped first: a number near the largest that there is would divide to infinity.
    pulled = min(max(tension, 0.0), servo.most_tension_n)
    counts = math.floor(pulled / servo.newton_per_count + _ROUNDING)
    return servo.direction * min(counts, cap_count(servo))


def tension_n(servo: ServoSettings, current: int) -> float:
    """What a current pulls, N; below 0 for one that lets out."""
    return servo.direction * current * servo.newton_per_count


def length_per_count(servo: ServoSettings) -> float:
    """How much longer the tendon gets with one more count, m; below 0 if it winds in."""
    return -servo.direction * 2.0 * math.pi * servo.spool_radius_m / COUNTS_PER_TURN


def length_m(servo: ServoSettings, position: int, zero: int) -> float:
    """Length of the tendon beyond its zero, m.

    Args:
        servo: Whose tendon.
        position: Present position, in counts.
        zero: Position at the zero.
    """
    return (position - zero) * length_per_count(servo)


def lengthening(servo: ServoSettings, speed: float) -> float:
    """How fast the tendon gets longer, m/s, for a speed of the servo in rad/s."""
    return -servo.direction * speed * servo.spool_radius_m
