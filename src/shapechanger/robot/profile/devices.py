"""Reads the tables of a robot's outputs, sensors and camera, each with the keys of its driver."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import OutputPlan, SensorPlan
from shapechanger.robot.profile.joints import joints_in, read_joints
from shapechanger.robot.profile.keys import Key
from shapechanger.robot.profile.lines import Place
from shapechanger.robot.profile.mistake import Source, called
from shapechanger.robot.profile.schema import (
    CAMERA_KEYS,
    CAMERA_SETTINGS,
    MEASURES,
    OUTPUT_KEYS,
    OUTPUT_SETTINGS,
    OVER,
    OVER_SETTINGS,
    SENSOR_KEYS,
    SENSOR_SETTINGS,
)
from shapechanger.robot.profile.table import read_key, read_keys, refuse_unknown_keys

__all__ = ["read_camera", "read_output", "read_sensor"]

_Table = Mapping[str, Any]

_NOT_GPIOZERO: Final = (
    "gpiozero makes the pulses of a servo in steps of 200 µs, and 1.4 ms out of a neutral of "
    f"1.5 ms (gpiozero#1209); use the driver servo or esc, over one of {', '.join(OVER)}"
)
_DRIVER, _OVER = OUTPUT_KEYS[0], next(key for key in OUTPUT_SETTINGS["servo"] if key.name == "over")


def read_output(source: Source, name: str, table: _Table) -> OutputPlan:
    """One motor, servo or controller.

    Raises:
        ProfileError: If a key is unknown, missing or wrong.
    """
    place: Place = ("output", name)
    for key in (_DRIVER, _OVER):
        _refuse_gpiozero(source, table, place, key)
    driver: str = read_key(source, table, place, _DRIVER)
    keys: tuple[Key, ...] = OUTPUT_SETTINGS[driver]
    if _OVER in keys:
        keys += OVER_SETTINGS[read_key(source, table, place, _OVER)]
    known = [key.name for key in (*OUTPUT_KEYS, *keys)]
    refuse_unknown_keys(source, table, place, known, _ELSEWHERE)
    common = read_keys(source, table, place, OUTPUT_KEYS)
    return OutputPlan(name=name, **common, settings=read_keys(source, table, place, keys))


def read_sensor(source: Source, name: str, table: _Table) -> SensorPlan:
    """One sensor.

    Raises:
        ProfileError: If a key is unknown, missing or wrong.
    """
    place: Place = ("sensor", name)
    driver: str = read_keys(source, table, place, SENSOR_KEYS)["driver"]
    keys = SENSOR_SETTINGS[driver]
    known = [key.name for key in (*SENSOR_KEYS, *keys)]
    joints = joints_in(table) if driver == "as5600" else {}
    rest = {key: value for key, value in table.items() if key not in joints}
    refuse_unknown_keys(source, rest, place, known, _SENSORS_ELSEWHERE)
    settings = read_keys(source, rest, place, keys)
    if driver == "as5600":
        settings |= read_joints(source, place, joints)
    return SensorPlan(name=name, driver=driver, measures=MEASURES[driver], settings=settings)


def read_camera(source: Source, table: _Table) -> CameraPlan:
    """The camera.

    Raises:
        ProfileError: If a key is unknown, missing or wrong.
    """
    place: Place = ("camera",)
    driver: str = read_key(source, table, place, CAMERA_KEYS[0])
    keys = CAMERA_SETTINGS[driver]
    known = [key.name for key in (*CAMERA_KEYS, *keys)]
    refuse_unknown_keys(source, table, place, known, _CAMERAS_ELSEWHERE)
    common = read_keys(source, table, place, CAMERA_KEYS)
    return CameraPlan(**common, settings=read_keys(source, table, place, keys))


def _refuse_gpiozero(source: Source, table: _Table, place: Place, key: Key) -> None:
    """Say why gpiozero moves no servo here, since it looks as if it could."""
    written = table.get(key.name)
    if isinstance(written, str) and "gpiozero" in written.lower():
        words = f"{key.name} of {called(place)} cannot be {written!r}: {_NOT_GPIOZERO}"
        raise source.mistake((*place, key.name), words)


def _owners(kind: str, tables: Mapping[str, Iterable[Key]]) -> dict[str, str]:
    """For each key which drivers have it, in words."""
    owners: dict[str, list[str]] = {}
    for driver, keys in tables.items():
        for key in keys:
            owners.setdefault(key.name, []).append(driver)
    return {name: f"{kind} {' and '.join(drivers)}" for name, drivers in owners.items()}


_ELSEWHERE: Final = {
    **_owners("what goes over", OVER_SETTINGS),
    **_owners("the driver", OUTPUT_SETTINGS),
}
_SENSORS_ELSEWHERE: Final = _owners("the driver", SENSOR_SETTINGS)
_CAMERAS_ELSEWHERE: Final = _owners("the driver", CAMERA_SETTINGS)
