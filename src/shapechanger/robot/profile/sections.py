"""Read the sections of a profile: actions, outputs, sensors, camera, limits and stop."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final, cast

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import ActionPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.profile.mistakes import Place, Source, called, choice, shown
from shapechanger.robot.profile.schema import (
    ACTION_KEYS,
    CAMERA_KEYS,
    CAMERA_SETTINGS,
    DRIVING_PARTS,
    JOINT_KEYS,
    LIMIT_KEYS,
    MEASURES,
    OUTPUT_KEYS,
    OUTPUT_SETTINGS,
    OVER,
    OVER_SETTINGS,
    REQUIRED,
    SENSOR_KEYS,
    SENSOR_SETTINGS,
    ProfileKey,
    unit_of,
    with_unit,
)

__all__ = [
    "check_mix",
    "check_pulses",
    "check_stop",
    "joints_in",
    "read_action",
    "read_camera",
    "read_joints",
    "read_key",
    "read_keys",
    "read_limits",
    "read_output",
    "read_sensor",
    "refuse_bad_name",
    "refuse_unknown_keys",
    "table_at",
]

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")


def table_at(source: Source, data: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Return a nested table, or an empty one if it is missing.

    Raises:
        ProfileError: If it is not a table.
    """
    found = data.get(str(place[-1]), {})
    if not isinstance(found, dict):
        what = shown(found)
        raise source.mistake(place, f"{called(place)} must be a table, not {what}")
    return cast("dict[str, Any]", found)


def read_keys(
    source: Source, table: Mapping[str, Any], place: Place, keys: Iterable[ProfileKey]
) -> dict[str, Any]:
    """Return the value of each key, with defaults.

    Raises:
        ProfileError: If one is missing or invalid.
    """
    return {key.name: read_key(source, table, place, key) for key in keys}


def read_key(source: Source, table: Mapping[str, Any], place: Place, key: ProfileKey) -> Any:
    """Return the value of a key, or its default.

    Raises:
        ProfileError: If it is missing or invalid.
    """
    if key.name not in table:
        if key.default is REQUIRED:
            words = f"{called(place)} lacks the key {key.name!r}, {key.wanted}"
            raise source.mistake(place, words)
        return key.default
    written = table[key.name]
    try:
        return key.value_of(written)
    except ValueError as error:
        words = f"{key.name} of {called(place)} must be {key.wanted}, {error}"
        raise source.mistake((*place, key.name), words) from None


def refuse_bad_name(source: Source, place: Place) -> None:
    """Refuse a table with an invalid name, the last of its path.

    Raises:
        ProfileError: If the name is invalid.
    """
    name = str(place[-1])
    if _NAME.fullmatch(name) is None:
        words = (
            f"the name {name!r} must begin with a letter and have at most 32 letters, digits, "
            "'_' and '-'"
        )
        raise source.mistake(place, words)


def refuse_unknown_keys(
    source: Source,
    table: Mapping[str, Any],
    place: Place,
    known: Iterable[str],
    elsewhere: Mapping[str, str] | None = None,
) -> None:
    """Refuse unknown keys.

    Args:
        source: Where the table was read.
        table: The table.
        place: Path of the table.
        known: The permitted keys.
        elsewhere: For keys of other tables, where they belong.

    Raises:
        ProfileError: If there is one. The message names the key with the right unit, the table
            where it belongs, or the known keys.
    """
    names = tuple(known)
    for name in table:
        if name in names:
            continue
        if (meant := with_unit(name, names)) is not None:
            raise _unit_is_missing(source, place, name, meant)
        if elsewhere and name in elsewhere:
            words = f"{name!r} belongs to {elsewhere[name]}, not to {called(place)}"
        else:
            words = f"{called(place)} has no key {choice(name, names)}"
        raise source.mistake((*place, name), words)


def _unit_is_missing(source: Source, place: Place, name: str, meant: str) -> Exception:
    what = f"{name!r} of {called(place)} lacks its unit or has another one"
    return source.mistake((*place, name), f"{what}: write {meant!r} ({unit_of(meant)})")


def joints_in(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the joint tables of a sensor, by name."""
    return {name: cast("dict[str, Any]", t) for name, t in table.items() if isinstance(t, dict)}


def read_joints(
    source: Source, place: Place, joints: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the settings of all joints as lists, in the order of the file.

    Args:
        source: Where the profile was read.
        place: The sensor.
        joints: Table of each joint.

    Returns:
        `joints`, their names, and their `channels`, `zeros` and `directions`.

    Raises:
        ProfileError: If there is no joint, a key is unknown, missing or invalid, or a channel is
            used twice.
    """
    if not joints:
        words = f"{called(place)} needs a table for each joint, such as {called((*place, 'knee'))}"
        raise source.mistake(place, words)
    rows: list[dict[str, Any]] = []
    users: dict[int, str] = {}
    for name, table in joints.items():
        at = (*place, name)
        refuse_bad_name(source, at)
        refuse_unknown_keys(source, table, at, [key.name for key in JOINT_KEYS])
        row = read_keys(source, table, at, JOINT_KEYS)
        if row["direction"] == 0:
            words = f"direction of {called(at)} must be 1 or -1, not 0"
            raise source.mistake((*at, "direction"), words)
        other = users.setdefault(row["channel"], name)
        if other != name:
            words = f"channel {row['channel']} of {called(at)} is that of {other}, too"
            raise source.mistake((*at, "channel"), words)
        rows.append(row)
    return {
        "joints": list(joints),
        "channels": [row["channel"] for row in rows],
        "zeros": [row["zero"] for row in rows],
        "directions": [row["direction"] for row in rows],
    }


_Table = Mapping[str, Any]

_NOT_GPIOZERO: Final = (
    "gpiozero makes the pulses of a servo in steps of 200 µs, and 1.4 ms out of a neutral of "
    f"1.5 ms (gpiozero#1209); use the driver servo or esc, over one of {', '.join(OVER)}"
)
_DRIVER, _OVER = OUTPUT_KEYS[0], next(key for key in OUTPUT_SETTINGS["servo"] if key.name == "over")


def read_output(source: Source, name: str, table: _Table) -> OutputPlan:
    """Read one motor, servo or controller.

    Raises:
        ProfileError: If a key is unknown, missing or invalid.
    """
    place: Place = ("output", name)
    for key in (_DRIVER, _OVER):
        _refuse_gpiozero(source, table, place, key)
    driver: str = read_key(source, table, place, _DRIVER)
    keys: tuple[ProfileKey, ...] = OUTPUT_SETTINGS[driver]
    if _OVER in keys:
        keys += OVER_SETTINGS[read_key(source, table, place, _OVER)]
    known = [key.name for key in (*OUTPUT_KEYS, *keys)]
    refuse_unknown_keys(source, table, place, known, _ELSEWHERE)
    common = read_keys(source, table, place, OUTPUT_KEYS)
    return OutputPlan(name=name, **common, settings=read_keys(source, table, place, keys))


def read_sensor(source: Source, name: str, table: _Table) -> SensorPlan:
    """Read one sensor.

    Raises:
        ProfileError: If a key is unknown, missing or invalid.
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
    """Read the camera.

    Raises:
        ProfileError: If a key is unknown, missing or invalid.
    """
    place: Place = ("camera",)
    driver: str = read_key(source, table, place, CAMERA_KEYS[0])
    keys = CAMERA_SETTINGS[driver]
    known = [key.name for key in (*CAMERA_KEYS, *keys)]
    refuse_unknown_keys(source, table, place, known, _CAMERAS_ELSEWHERE)
    common = read_keys(source, table, place, CAMERA_KEYS)
    return CameraPlan(**common, settings=read_keys(source, table, place, keys))


def _refuse_gpiozero(source: Source, table: _Table, place: Place, key: ProfileKey) -> None:
    """Explain why gpiozero is not supported as a pulse source, although it looks as if it were."""
    written = table.get(key.name)
    if isinstance(written, str) and "gpiozero" in written.lower():
        words = f"{key.name} of {called(place)} cannot be {written!r}: {_NOT_GPIOZERO}"
        raise source.mistake((*place, key.name), words)


def _owners(kind: str, tables: Mapping[str, Iterable[ProfileKey]]) -> dict[str, str]:
    """Return, for each key, the drivers that have it."""
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
    """Read the limits.

    Args:
        source: Where the profile was read.
        table: The table of limits.
        control_hz: Expected rate of commands, Hz.
        camera: Its camera.
        sensors: Its sensors.

    Raises:
        ProfileError: If a key is unknown or invalid, a limit needs a missing sensor or camera, or
            the rate of commands or frames is too low for it.
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
    # Tolerates the loss of one frame.
    needed_ms = 2000 / camera.fps
    if stale_ms < needed_ms:
        words = (
            f"camera_stale_ms of [limits] must be at least {needed_ms:.0f} ms, the time of two "
            f"pictures at fps = {camera.fps:g}"
        )
        raise source.mistake(place, words)
    return stale_ms


_NEARLY_ZERO: Final = 1e-9
_PULSES: Final = {
    "servo": ("left_us", "centre_us", "right_us"),
    "esc": ("backward_us", "neutral_us", "forward_us"),
}
# 1 s in µs; a pulse must end before the next one starts.
_SECOND_US: Final = 1_000_000


def read_action(source: Source, name: str, table: Mapping[str, Any]) -> ActionPlan:
    """Read one action.

    Raises:
        ProfileError: If a key is unknown or invalid, or the rest lies outside the caps.
    """
    place: Place = ("action", name)
    refuse_unknown_keys(source, table, place, [key.name for key in ACTION_KEYS])
    values = read_keys(source, table, place, ACTION_KEYS)
    lowest = 0.0 if values["one_sided"] else -1.0
    low: float = lowest if values["low"] is None else values["low"]
    action = replace(ActionPlan(name), **{**values, "low": low})
    if low < lowest:
        words = f"low of {called(place)} must be 0 to 1, because it is one-sided"
        raise source.mistake((*place, "low"), words)
    if not low < action.high:
        words = f"{called(place)} may only move from low = {low:g} to high = {action.high:g}"
        raise source.mistake((*place, "high"), f"{words}, which is nowhere")
    if not low <= action.rest <= action.high:
        words = f"rest of {called(place)} must lie between low and high, {low:g} to {action.high:g}"
        raise source.mistake((*place, "rest"), words)
    if action.propels and action.rest != 0.0:
        words = f"rest of {called(place)} must be 0, because it propels"
        raise source.mistake((*place, "rest"), words)
    if action.gain != 1.0 and action.unit == "1":
        words = f"gain of {called(place)} needs a unit, such as unit = 'deg'"
        raise source.mistake((*place, "gain"), words)
    return action


def check_pulses(source: Source, output: OutputPlan) -> None:
    """Refuse settings that an output cannot satisfy.

    Raises:
        ProfileError: If the middle pulse is not between the others, pulses are longer than their
            period, or a motor has no range between start and full speed.
    """
    place: Place = ("output", output.name)
    settings: dict[str, Any] = {**output.settings}
    if "full" in settings:
        if not float(settings["start"]) < float(settings["full"]):
            words = f"start of {called(place)} must be below full, which is {settings['full']:g}"
            raise source.mistake((*place, "start"), words)
        return
    if output.driver not in _PULSES:
        return
    names = _PULSES[output.driver]
    first, middle, last = (int(settings[name]) for name in names)
    low, high = sorted((first, last))
    if not low < middle < high:
        words = f"{names[1]} of {called(place)} must lie between {names[0]} and {names[2]}"
        raise source.mistake((*place, names[1]), f"{words}, {low} and {high}")
    if high * int(settings["hz"]) >= _SECOND_US:
        words = f"hz of {called(place)} leaves no time for a pulse of {high} µs"
        raise source.mistake((*place, "hz"), words)


def check_mix(
    source: Source, actions: Mapping[str, ActionPlan], outputs: Iterable[OutputPlan]
) -> None:
    """Refuse unconnected outputs and actions, and a rest that drives.

    Raises:
        ProfileError: If a mix has no action or an unknown one, an action moves nothing, or a
            propelling part has no propelling action or is not at 0 at rest.
    """
    moved: set[str] = set()
    for output in outputs:
        place: Place = ("output", output.name)
        mix: Place = (*place, "mix")
        if not output.mix:
            words = f"mix of {called(place)} is empty, so nothing moves it; {_there_are(actions)}"
            raise source.mistake(mix, words)
        for name, weight in output.mix.items():
            if name not in actions:
                words = f"mix of {called(place)} names no action: {choice(name, actions)}"
                raise source.mistake((*mix, name), words)
            if weight == 0.0:
                words = f"mix of {called(place)} takes nothing of {name!r}: leave it out"
                raise source.mistake((*mix, name), words)
        _check_rest(source, actions, output)
        moved |= output.mix.keys()
    for name in actions:
        if name not in moved:
            words = f"[action.{name}] moves nothing: no mix of an output names it"
            raise source.mistake(("action", name), words)


def check_stop(
    source: Source,
    stop: StopPlan,
    actions: Mapping[str, ActionPlan],
    outputs: Iterable[OutputPlan],
) -> None:
    """Refuse a stop that would keep driving.

    Raises:
        ProfileError: If the stop holds or ramps an action that contributes to a propelling part.
    """
    if not stop.hold_ms and not stop.ramp_ms:
        return
    for output in outputs:
        if not _drives(actions, output):
            continue
        for name in output.mix:
            if not actions[name].propels:
                which = "hold_ms" if stop.hold_ms else "ramp_ms"
                words = (
                    f"{which} of [stop] would keep {called(('output', output.name))} driving "
                    f"after a stop, because {name!r} moves it and does not propel"
                )
                raise source.mistake(("stop", which), words)


def _check_rest(source: Source, actions: Mapping[str, ActionPlan], output: OutputPlan) -> None:
    place: Place = ("output", output.name)
    propelled = any(actions[name].propels for name in output.mix)
    if output.part in DRIVING_PARTS and not propelled:
        words = (
            f"{called(place)} moves the {output.part}, so an action in its mix must have "
            "propels = true"
        )
        raise source.mistake((*place, "mix"), words)
    at_rest = output.offset + sum(
        weight * actions[name].rest for name, weight in output.mix.items()
    )
    if _drives(actions, output) and abs(at_rest) > _NEARLY_ZERO:
        words = (
            f"{called(place)} would be at {at_rest:g} at rest, and must be at 0 because it drives"
        )
        raise source.mistake((*place, "offset"), words)


def _drives(actions: Mapping[str, ActionPlan], output: OutputPlan) -> bool:
    """Return whether an output can propel the robot."""
    return (
        output.driver == "esc"
        or output.part in DRIVING_PARTS
        or any(actions[name].propels for name in output.mix)
    )


def _there_are(actions: Iterable[str]) -> str:
    return f"there are: {', '.join(actions)}"
