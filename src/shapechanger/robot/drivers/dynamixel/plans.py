"""From the settings of a profile to those of the bus and its servos."""

from __future__ import annotations

from collections.abc import Mapping

from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.settings import number, text, whole
from shapechanger.robot.guard.plan import OutputPlan

__all__ = ["bus_settings", "servo_settings"]


def servo_settings(plan: OutputPlan) -> ServoSettings:
    """The servo of an output, by the name of the output.

    Raises:
        RobotError: If it cannot be as it is set.
        UnknownName: If there is no such model.
    """
    settings = plan.settings
    return ServoSettings(
        name=plan.name,
        id=whole(settings, "id"),
        model=text(settings, "model"),
        spool_radius_m=number(settings, "spool_radius_m"),
        most_tension_n=number(settings, "most_tension_n"),
        pretension_n=number(settings, "pretension_n"),
        direction=whole(settings, "direction"),
        homing_n=number(settings, "homing_n"),
    )


def bus_settings(settings: Mapping[str, object], servos: tuple[ServoSettings, ...]) -> BusSettings:
    """A bus with these servos.

    Args:
        settings: Of any of its outputs: each has those of the bus too.
        servos: What is on it.

    Raises:
        RobotError: If it cannot be as it is set, or two servos have one id.
    """
    return BusSettings(
        device=text(settings, "device"),
        servos=servos,
        baud=whole(settings, "baud"),
        answer_ms=number(settings, "answer_ms"),
        watchdog_ms=whole(settings, "watchdog_ms"),
        ramp_ms=whole(settings, "ramp_ms"),
    )
