"""The levels of a check of a robot: which lists of checks each has, and in which order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from typing import Final, Literal

from shapechanger.errors import RobotError
from shapechanger.robot.check.check import Finding, run_checks
from shapechanger.robot.check.computer import examine
from shapechanger.robot.check.lamps import SHOWN_S, lamps_of, walk
from shapechanger.robot.check.standing import StandingRobot
from shapechanger.robot.twin.check.bench import Watcher
from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.check.trial import Trial, fault_checks

CheckLevel = Literal["wiring", "plain", "leds", "faults"]
Part = Literal["wiring", "LEDs", "driving", "faults"]

PARTS: Final[dict[CheckLevel, tuple[Part, ...]]] = {
    "wiring": ("wiring",),
    "plain": ("wiring", "driving"),
    "leds": ("wiring", "LEDs", "driving", "faults"),
    "faults": ("faults",),
}
"""Parts of each level. Nothing moves in the first part; all others drive outputs."""

# Longer than two cycles of software PWM at 50 Hz.
_MEASURED_S: Final = 0.04


def require_level(level: CheckLevel, trial: Trial) -> None:
    """Refuse a level that a robot cannot have.

    Args:
        level: The level.
        trial: The robot.

    Raises:
        RobotError: If it takes no LEDs, or nothing of it can be stopped.
    """
    profile = trial.bench.profile
    if level == "leds":
        lamps_of(trial.bench.plan)
    if level == "faults" and trial.lacks("throttle"):
        raise RobotError(f"Nothing of {profile.name} propels, so there is nothing to stop.")


def check_robot(
    level: CheckLevel, trial: Trial, standing: StandingRobot, cap: float
) -> Iterator[tuple[Part, Iterator[Finding]]]:
    """Yield each part of a level, and its findings, before its first question.

    Args:
        level: The level.
        trial: The robot for the faults, and where it is.
        standing: The robot for the checks that move nothing.
        cap: Largest throttle of the checks that drive, 0 to 1.
    """
    for part in PARTS[level]:
        yield part, _findings(part, level, trial, standing, cap)


def _findings(
    part: Part, level: CheckLevel, trial: Trial, standing: StandingRobot, cap: float
) -> Iterator[Finding]:
    """Yield the findings of a part, and leave everything at rest."""
    bench = trial.bench
    try:
        match part:
            case "wiring":
                robot = replace(standing, hardware=bench.pins, on_twin=bench.twin)
                yield from examine(robot)
            case "LEDs":
                with closing(bench.watcher()) as watcher:
                    shown_s = SHOWN_S if type(watcher) is Watcher else _MEASURED_S
                    yield from walk(bench.plan, bench.pins, trial.ask, watcher.sees, shown_s)
            case "driving":
                with bench.robot() as served:
                    yield from check_driving(served, bench.profile, cap)
            case "faults":
                yield from run_checks(fault_checks(trial, all_faults=level == "faults"))
    finally:
        failures = bench.close()
    if failures:
        yield Finding("safe pins", "bad", " ".join(failures))
