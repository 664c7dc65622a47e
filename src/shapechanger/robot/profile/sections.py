"""Read the tables of a profile: actions, outputs, sensors, camera, limits and stop."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.pulse import PULSE_KEYS
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

_Owners = Mapping[str, Mapping[str, Iterable[ProfileKey]]]
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")


class Section:
    """One table of a profile and its path, so that a mistake in it can be located.

    Every method raises a `ProfileError` with one sentence and the line.

    Args:
        source: Where the profile was read.
        place: Path of the table.
        table: Its keys and nested tables; anything else is refused.
    """

    def __init__(self, source: Source, place: Place, table: Any) -> None:
        self.source = source
        self.place = place
        if not isinstance(table, dict):
            raise self.mistake(f"{self} must be a table, not {shown(table)}")
        self.table = cast("dict[str, Any]", table)

    def __str__(self) -> str:
        return called(self.place)

    def __contains__(self, name: str) -> bool:
        return name in self.table

    def mistake(self, words: str, *at: str | int) -> ProfileError:
        """Return the error for a mistake in this table, or in one of its keys."""
        return self.source.mistake((*self.place, *at), words)

    def section(self, name: str) -> Section:
        """Return a nested table, which is empty if it is missing."""
        return Section(self.source, (*self.place, name), self.table.get(name, {}))

    def named(self) -> dict[str, Section]:
        """Return the nested tables by name; refuse names that are not allowed for a part."""
        for name in self.table:
            if _NAME.fullmatch(name) is None:
                words = "must begin with a letter and have at most 32 letters, digits, '_' and '-'"
                raise self.mistake(f"the name {name!r} {words}", name)
        return {name: self.section(name) for name in self.table}

    def read(self, keys: Iterable[ProfileKey], owners: _Owners | None = None) -> dict[str, Any]:
        """Return the value of each key, with defaults, and refuse unknown keys.

        Args:
            keys: The permitted keys.
            owners: Keys of other drivers, by what these are called and by driver.
        """
        known = {key.name: key for key in keys}
        for name in self.table:
            if name in known:
                continue
            if (meant := with_unit(name, known)) is not None:
                words = f"{name!r} of {self} lacks its unit or has another one: write {meant!r}"
                raise self.mistake(f"{words} ({unit_of(meant)})", name)
            for kind, drivers in (owners or {}).items():
                if having := [d for d, ks in drivers.items() if name in (k.name for k in ks)]:
                    words = f"{name!r} belongs to {kind} {' and '.join(having)}, not to {self}"
                    raise self.mistake(words, name)
            raise self.mistake(f"{self} has no key {choice(name, known)}", name)
        return {name: self.value(key) for name, key in known.items()}

    def value(self, key: ProfileKey) -> Any:
        """Return the value of one key, or its default."""
        if key.name not in self.table:
            if key.default is REQUIRED:
                raise self.mistake(f"{self} lacks the key {key.name!r}, {key.wanted}")
            return key.default
        try:
            return key.value_of(self.table[key.name])
        except ValueError as error:
            words = f"{key.name} of {self} must be {key.wanted}, {error}"
            raise self.mistake(words, key.name) from None


def read_action(name: str, section: Section) -> ActionPlan:
    """Read one number of a command, which must be able to rest within its caps.

    Args:
        name: Name of the action.
        section: Its table.
    """
    values = section.read(ACTION_KEYS)
    lowest = 0.0 if values["one_sided"] else -1.0
    low: float = lowest if values["low"] is None else values["low"]
    action = replace(ActionPlan(name), **{**values, "low": low})
    if low < lowest:
        raise section.mistake(f"low of {section} must be 0 to 1, because it is one-sided", "low")
    if not low < action.high:
        words = f"{section} may only move from low = {low:g} to high = {action.high:g}"
        raise section.mistake(f"{words}, which is nowhere", "high")
    if not low <= action.rest <= action.high:
        words = f"rest of {section} must lie between low and high, {low:g} to {action.high:g}"
        raise section.mistake(words, "rest")
    if action.propels and action.rest != 0.0:
        raise section.mistake(f"rest of {section} must be 0, because it propels", "rest")
    if action.gain != 1.0 and action.unit == "1":
        raise section.mistake(f"gain of {section} needs a unit, such as unit = 'deg'", "gain")
    return action


_NOT_GPIOZERO: Final = (
    "gpiozero makes the pulses of a servo in steps of 200 µs, and 1.4 ms out of a neutral of "
    f"1.5 ms (gpiozero#1209); use the driver servo or esc, over one of {', '.join(OVER)}"
)
_DRIVER, _OVER = OUTPUT_KEYS[0], next(key for key in OUTPUT_SETTINGS["servo"] if key.name == "over")


def _read_device(
    section: Section,
    common: tuple[ProfileKey, ...],
    drivers: Mapping[str, tuple[ProfileKey, ...]],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read an output, a sensor or a camera.

    Args:
        section: Its table.
        common: Keys that do not depend on the driver; the first is the driver.
        drivers: Keys of each driver.

    Returns:
        The values of the common keys, and the settings of the driver.
    """
    keys = drivers[section.value(common[0])]
    owners = {"the driver": drivers}
    if drivers is OUTPUT_SETTINGS:
        owners["what goes over"] = OVER_SETTINGS
    if _OVER in keys:
        keys += OVER_SETTINGS[section.value(_OVER)]
    values = section.read((*common, *keys), owners)
    settings = {key.name: values.pop(key.name) for key in keys}
    return values, settings


def read_output(name: str, section: Section) -> OutputPlan:
    """Read one motor, servo or controller.

    Args:
        name: Name of the output.
        section: Its table.
    """
    for key in (_DRIVER, _OVER):
        written = section.table.get(key.name)
        if isinstance(written, str) and "gpiozero" in written.lower():
            words = f"{key.name} of {section} cannot be {written!r}: {_NOT_GPIOZERO}"
            raise section.mistake(words, key.name)
    common, settings = _read_device(section, OUTPUT_KEYS, OUTPUT_SETTINGS)
    output = OutputPlan(name=name, **common, settings=settings)
    _check_pulses(section, output)
    return output


def read_sensor(name: str, section: Section) -> SensorPlan:
    """Read one sensor.

    Args:
        name: Name of the sensor.
        section: Its table.
    """
    is_encoder = section.table.get("driver") == "as5600"
    joints = {k for k, v in section.table.items() if is_encoder and isinstance(v, dict)}
    table = {k: v for k, v in section.table.items() if k not in joints}
    own = Section(section.source, section.place, table)
    common, settings = _read_device(own, SENSOR_KEYS, SENSOR_SETTINGS)
    if is_encoder:
        by_joint = {k: section.table[k] for k in section.table if k in joints}
        settings |= _joints(Section(section.source, section.place, by_joint))
    return SensorPlan(name, **common, measures=MEASURES[common["driver"]], settings=settings)


def _joints(sensor: Section) -> dict[str, Any]:
    """Return names, channels, zeros and directions of all joints, in the order of the file."""
    if not sensor.table:
        example = called((*sensor.place, "knee"))
        raise sensor.mistake(f"{sensor} needs a table for each joint, such as {example}")
    rows: list[dict[str, Any]] = []
    users: dict[int, str] = {}
    for name, joint in sensor.named().items():
        row = joint.read(JOINT_KEYS)
        if row["direction"] == 0:
            raise joint.mistake(f"direction of {joint} must be 1 or -1, not 0", "direction")
        other = users.setdefault(row["channel"], name)
        if other != name:
            words = f"channel {row['channel']} of {joint} is that of {other}, too"
            raise joint.mistake(words, "channel")
        rows.append(row)
    columns = (("channels", "channel"), ("zeros", "zero"), ("directions", "direction"))
    return {"joints": list(sensor.table)} | {
        column: [row[key] for row in rows] for column, key in columns
    }


def read_camera(section: Section) -> CameraPlan:
    """Read the camera."""
    common, settings = _read_device(section, CAMERA_KEYS, CAMERA_SETTINGS)
    return CameraPlan(**common, settings=settings)


_CAMERA_STALE_MS: Final = 500
_NEEDS: Final = {
    "stop_distance_m": "distance",
    "low_battery_v": "battery",
    "high_temperature_c": "temperature",
    "stall_s": "speed",
    "bump_hold_ms": "bump",
}


def read_limits(
    section: Section,
    control_hz: float,
    camera: CameraPlan | None,
    sensors: Iterable[SensorPlan],
) -> dict[str, Any]:
    """Read the limits; refuse those that need something that is missing or too slow.

    Args:
        section: The table of limits.
        control_hz: Expected rate of commands, Hz.
        camera: The camera; None without one.
        sensors: The sensors.
    """
    limits = section.read(LIMIT_KEYS)
    if limits["deadline_ms"] * control_hz < 1000:
        words = (
            f"deadline_ms of {section} must be at least {1000 / control_hz:.0f} ms, the time from "
            f"one command to the next at control_hz = {control_hz:g}"
        )
        raise section.mistake(words, "deadline_ms")
    measured = {sensor.measures for sensor in sensors}
    for name, what in _NEEDS.items():
        if section.table.get(name) and what not in measured:
            drivers = " or ".join(d for d, m in MEASURES.items() if m == what)
            words = (
                f"{name} of {section} needs a sensor that measures {what}, such as one with the "
                f"driver {drivers}"
            )
            raise section.mistake(words, name)
    limits["camera_stale_ms"] = _camera_stale_ms(section, limits["camera_stale_ms"], camera)
    return limits


def _camera_stale_ms(section: Section, stale_ms: int | None, camera: CameraPlan | None) -> int:
    key = "camera_stale_ms"
    if camera is None:
        if stale_ms is not None:
            raise section.mistake(f"{key} of {section} needs a [camera]", key)
        return 0
    if stale_ms is None:
        stale_ms = _CAMERA_STALE_MS
    needed_ms = 2000 / camera.fps  # One frame may be lost.
    if stale_ms < needed_ms:
        words = (
            f"{key} of {section} must be at least {needed_ms:.0f} ms, the time of two pictures at "
            f"fps = {camera.fps:g}"
        )
        raise section.mistake(words, key)
    return stale_ms


_NEARLY_ZERO: Final = 1e-9
# 1 s in µs; a pulse must end before the next one begins.
_SECOND_US: Final = 1_000_000


def _check_pulses(section: Section, output: OutputPlan) -> None:
    """Refuse a range of duties or pulses that is empty, or a pulse longer than its period."""
    settings = output.settings
    if "full" in settings and not settings["start"] < settings["full"]:
        words = f"start of {section} must be below full, which is {settings['full']:g}"
        raise section.mistake(words, "start")
    if output.driver not in PULSE_KEYS:
        return
    names = PULSE_KEYS[output.driver]
    first, middle, last = (settings[name] for name in names)
    low, high = sorted((first, last))
    if not low < middle < high:
        words = f"{names[1]} of {section} must lie between {names[0]} and {names[2]}"
        raise section.mistake(f"{words}, {low} and {high}", names[1])
    if high * settings["hz"] >= _SECOND_US:
        raise section.mistake(f"hz of {section} leaves no time for a pulse of {high} µs", "hz")


def check_mix(
    source: Source, actions: Mapping[str, ActionPlan], outputs: Iterable[OutputPlan]
) -> None:
    """Refuse unconnected outputs and actions, and a rest that drives.

    Args:
        source: The profile's text, for messages.
        actions: Actions by name.
        outputs: The outputs.

    Raises:
        ProfileError: If a mix has no action or an unknown one, an action moves nothing, or a
            propelling part has no propelling action or is not at 0 at rest.
    """
    moved: set[str] = set()
    for output in outputs:
        place: Place = ("output", output.name)
        mix: Place = (*place, "mix")
        if not output.mix:
            words = f"mix of {called(place)} is empty, so nothing moves it; there are: "
            words += ", ".join(actions)
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

    Args:
        source: The profile's text, for messages.
        stop: The stop.
        actions: Actions by name.
        outputs: The outputs.

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
