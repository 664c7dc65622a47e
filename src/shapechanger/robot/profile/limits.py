"""Reads when a robot stops by itself, and refuses a protection that could not protect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.profile.lines import Place
from shapechanger.robot.profile.mistake import Source
from shapechanger.robot.profile.schema import LIMIT_KEYS, MEASURES
from shapechanger.robot.profile.table import read_keys, refuse_unknown_keys

__all__ = ["read_limits"]

_PLACE: Final[Place] = ("limits",)
_CAMERA_STALE_MS: Final = 500
_NEEDS: Final = {
    "stop_distance_m": "distance",
    "low_battery_v": "battery",
    "high_temperature_c": "temperature",
    "stall_s": "speed",
    "bump_hold_ms": "bump",
}


def read_limits(
    source: Source,
    table: Mapping[str, Any],
    control_hz: float,
    camera: CameraPlan | None,
    sensors: Iterable[SensorPlan],
) -> dict[str, Any]:
    """The value of each limit.

    Args:
        source: Where the profile was read.
        table: The table of limits.
        control_hz: How many commands a second the robot expects.
        camera: Its camera.
        sensors: Its sensors.

    Raises:
        ProfileError: If a key is unknown or wrong, if a limit needs a sensor or a camera that is
            not there, or if commands or pictures come too seldom for it.
    """
    refuse_unknown_keys(source, table, _PLACE, [key.name for key in LIMIT_KEYS])
    limits = read_keys(source, table, _PLACE, LIMIT_KEYS)
    if limits["deadline_ms"] * control_hz < 1000:
        words = (
            f"deadline_ms of [limits] must be at least {1000 / control_hz:.0f} ms, the time from "
            f"one command to the next at control_hz = {control_hz:g}"
        )
        raise source.mistake((*_PLACE, "deadline_ms"), words)
    measured = {sensor.measures for sensor in sensors}
    for name, what in _NEEDS.items():
        if table.get(name) and what not in measured:
            drivers = " or ".join(d for d, m in MEASURES.items() if m == what)
            words = (
                f"{name} of [limits] needs a sensor that measures {what}, such as one with the "
                f"driver {drivers}"
            )
            raise source.mistake((*_PLACE, name), words)
    limits["camera_stale_ms"] = _camera_stale_ms(source, limits["camera_stale_ms"], camera)
    return limits


def _camera_stale_ms(source: Source, stale_ms: int | None, camera: CameraPlan | None) -> int:
    place = (*_PLACE, "camera_stale_ms")
    if camera is None:
        if stale_ms is not None:
            raise source.mistake(place, "camera_stale_ms of [limits] needs a [camera]")
        return 0
    if stale_ms is None:
        stale_ms = _CAMERA_STALE_MS
    # One picture may be lost.
    needed_ms = 2000 / camera.fps
    if stale_ms < needed_ms:
        words = (
            f"camera_stale_ms of [limits] must be at least {needed_ms:.0f} ms, the time of two "
            f"pictures at fps = {camera.fps:g}"
        )
        raise source.mistake(place, words)
    return stale_ms
