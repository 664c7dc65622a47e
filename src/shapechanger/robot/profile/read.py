"""Parse the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from shapechanger.contract.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.drivers.pulse import PulsedKeys
from shapechanger.robot.drivers.servos.settings import ServoBusKeys
from shapechanger.robot.profile.mistakes import Place, Source, called, choice
from shapechanger.robot.profile.profile import Profile, ResetStep
from shapechanger.robot.profile.section import Section, fields_of
from shapechanger.robot.profile.tables import (
    CAMERAS,
    DRIVING_PARTS,
    TABLES,
    CommandKeys,
    EmergencyButtonKeys,
    EnableKeys,
    OutputKeys,
    ResetKeys,
    RewardKeys,
    RobotKeys,
    SensorKeys,
)
from shapechanger.robot.profile.wiring import PinAllocation, with_servo_bus

_MOST_NAMED: Final = 64  # As in the messages, see `shapechanger.robot.link.messages`.
_AT: Final = re.compile(r"(.*) \(at line (\d+), column (\d+)\)", re.DOTALL)
_DIGITS: Final = re.compile(r"[0-9_]{600}")


def read_profile(text: str, path: Path) -> Profile:
    """Parse a profile.

    Args:
        text: TOML.
        path: The file that it comes from, for error messages.

    Raises:
        ProfileError: If the text is not TOML or not a valid profile; names the file and the line.
    """
    data = _toml(text, path)
    source = Source(path, text)
    for name in data:
        if name not in TABLES:
            words = f"a profile has no table or key {choice(name, TABLES)}"
            raise source.mistake((name,), words)
    root = Section(source, (), data)
    wiring = PinAllocation(source)
    robot: RobotKeys = _table(root, "robot")
    actions = {name: _read_action(name, table) for name, table in _named(root, "action").items()}
    if not actions:
        raise root.mistake("a robot needs an action, such as [action.throttle]", "action")
    outputs = tuple(
        _read_output(name, table, wiring) for name, table in _named(root, "output").items()
    )
    _check_mix(source, actions, outputs)
    outputs = wiring.shared(outputs)
    sensors = tuple(
        _read_sensor(name, table, wiring) for name, table in _named(root, "sensor").items()
    )
    camera = _read_camera(root.section("camera")) if "camera" in root else None
    stop: StopPlan = _table(root, "stop")
    _check_stop(source, stop, actions, outputs)
    bus: ServoBusKeys | None = _table(root, "servo_bus") if "servo_bus" in root else None
    pins: dict[str, Any] = {}
    if "enable" in root:
        enable: EnableKeys = _table(root, "enable")
        wiring.take(("enable",), enable)
        pins = {"enable_pin": enable.pin, "enable_hold_ms": enable.hold_ms}
    if "emergency_button" in root:
        button: EmergencyButtonKeys = _table(root, "emergency_button")
        wiring.take(("emergency_button",), button)
        pins["stop_pin"] = button.pin
    hold_ms: int | None = pins.get("enable_hold_ms")
    outputs, sensors = with_servo_bus(source, bus, outputs, sensors, stop, hold_ms)
    limits, commands = _read_limits(root.section("limits"), robot.control_hz, camera, sensors)
    reward: RewardKeys = _table(root, "reward")
    return Profile(
        path=path,
        **msgspec.structs.asdict(robot),
        actions=tuple(actions.values()),
        outputs=outputs,
        sensors=sensors,
        camera=camera,
        limits=limits,
        **msgspec.structs.asdict(commands),
        stop=stop,
        reward={key: float(weight) for key, weight in msgspec.structs.asdict(reward).items()},
        reset=_reset(root, actions),
        **pins,
    )


def _table(root: Section, name: str) -> Any:
    """Return the keys of a table that is there once."""
    (keys,) = root.section(name).read(*TABLES[name])
    return keys


def _named(root: Section, kind: str) -> dict[str, Section]:
    """Return the tables of one kind by name, in the order of the file."""
    tables = root.section(kind).named()
    if len(tables) > _MOST_NAMED:
        raise root.mistake(f"a robot has at most {_MOST_NAMED} {kind}s, not {len(tables)}", kind)
    return tables


def _reset(root: Section, actions: Mapping[str, ActionPlan]) -> tuple[ResetStep, ...]:
    """Read the reset routine; in each step, actions without a value are at rest."""
    tables = root.table.get("reset", [])
    if not isinstance(tables, list):
        words = "the steps of the reset routine are written [[reset]], with two brackets"
        raise root.mistake(words, "reset")
    steps: list[ResetStep] = []
    for i, table in enumerate(cast("list[Any]", tables)):
        section = Section(root.source, ("reset", i), table)
        (step,) = section.read(ResetKeys)
        for name, value in step.values.items():
            if name not in actions:
                words = f"values of {section} name no action: {choice(name, actions)}"
                raise section.mistake(words, "values", name)
            low, high = actions[name].low, actions[name].high
            if not low <= value <= high:
                words = f"{name} of {section} must be {low:g} to {high:g}, its own caps"
                raise section.mistake(words, "values", name)
        filled = tuple(step.values.get(action.name, action.rest) for action in actions.values())
        steps.append(ResetStep(filled, step.seconds))
    return tuple(steps)


def _toml(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ProfileError(f"{path} is not a profile: it is nested too deeply.") from None
    except tomllib.TOMLDecodeError as error:
        words = str(error)
        line = text.count("\n") + 1
        if (at := _AT.fullmatch(words)) is not None:
            line = int(at[2])
            words = f"{at[1]} at column {at[3]}"
        what = f"this is not valid TOML: {words[:1].lower()}{words[1:]}"
    except ValueError:  # Python refuses to parse integers with thousands of digits.
        long = _DIGITS.search(text)
        line = text.count("\n", 0, long.start() if long else 0) + 1
        what = "a number has too many digits"
    raise ProfileError(f"{path}, line {line}: {what}.")


def _read_action(name: str, section: Section) -> ActionPlan:
    """Read one number of a command, which must be able to rest within its caps."""
    action: ActionPlan
    (action,) = section.read(ActionPlan, given={"name": name})
    lowest = 0.0 if action.one_sided else -1.0
    low = action.low if "low" in section else lowest
    if low < lowest:
        raise section.mistake(f"low of {section} must be 0 to 1, because it is one-sided", "low")
    if not low < action.high:
        words = f"high of {section} must be above low, which is {low:g}, not {action.high:g}"
        raise section.mistake(words, "high")
    if not low <= action.rest <= action.high:
        words = f"rest of {section} must lie between low and high, {low:g} to {action.high:g}"
        raise section.mistake(words, "rest")
    if action.propels and action.rest != 0.0:
        raise section.mistake(f"rest of {section} must be 0, because it propels", "rest")
    if action.propels and action.slew_down_per_s < math.inf:
        words = f"{section} cannot have slew_down_per_s, because it propels: a stop is immediate"
        raise section.mistake(words, "slew_down_per_s")
    if action.gain != 1.0 and action.unit == "1":
        raise section.mistake(f"gain of {section} needs a unit, such as unit = 'deg'", "gain")
    return replace(action, low=low)


def _read_output(name: str, section: Section, wiring: PinAllocation) -> OutputPlan:
    """Read one motor, servo or controller."""
    for key in ("driver", "over"):
        written = section.table.get(key)
        if isinstance(written, str) and "gpiozero" in written.lower():
            words = (
                f"{key} of {section} cannot be {written!r}: gpiozero makes the pulses of a servo "
                "in steps of 200 µs, and 1.4 ms out of a neutral of 1.5 ms (gpiozero#1209); use "
                f"the driver servo or esc, over one of {', '.join(PULSES)}"
            )
            raise section.mistake(words, key)
    kinds = [OUTPUTS[section.chosen("driver", OUTPUTS)].keys]
    given: dict[str, Any] = {"name": name} if "name" in fields_of(kinds[0]) else {}
    if issubclass(kinds[0], PulsedKeys):
        kinds.append(PULSES[section.chosen("over", PULSES)].keys)
    others = {"the driver": OUTPUTS, "the pulse source": PULSES}
    common, *parts = section.read(OutputKeys, *kinds, given=given, others=others)
    for keys in parts:
        wiring.take(section.place, keys)
    settings = {key: value for keys in parts for key, value in keys.settings().items()}
    return OutputPlan(name=name, **msgspec.structs.asdict(common), settings=settings)


def _read_sensor(name: str, section: Section, wiring: PinAllocation) -> SensorPlan:
    """Read one sensor; where it has a table for each joint, these are its rows."""
    chip = SENSORS[section.chosen("driver", SENSORS)]
    given: dict[str, Any] = {}
    if chip.rows is not None:
        rows = {
            key: cast("Any", value)
            for key, value in section.table.items()
            if isinstance(value, dict)
        }
        nested = Section(section.source, section.place, rows).named()
        if not nested:
            example = called((*section.place, "knee"))
            raise section.mistake(f"{section} needs a table for each joint, such as {example}")
        given["rows"] = {key: one.read(chip.rows)[0] for key, one in nested.items()}
        table = {key: value for key, value in section.table.items() if key not in rows}
        section = Section(section.source, section.place, table)
    others = {"the driver": SENSORS}
    common, keys = section.read(SensorKeys, chip.keys, given=given, others=others)
    wiring.take(section.place, keys)
    return SensorPlan(name, common.driver, measures=chip.measures, settings=keys.settings())


def _read_camera(section: Section) -> CameraPlan:
    """Read the camera."""
    keys = CAMERAS[section.chosen("driver", CAMERAS)]
    others = {"the driver": CAMERAS}
    camera, own = section.read(CameraPlan, keys, given={"settings": {}}, others=others)
    return replace(camera, settings=own.settings())


_CAMERA_STALE_MS: Final = 500
_NEEDS: Final = {
    "stop_distance_m": "distance",
    "low_battery_v": "battery",
    "high_temperature_c": "temperature",
    "stall_s": "speed",
    "bump_hold_ms": "bump",
}


def _read_limits(
    section: Section,
    control_hz: float,
    camera: CameraPlan | None,
    sensors: Iterable[SensorPlan],
) -> tuple[LimitPlan, CommandKeys]:
    """Read the limits; refuse those that need something that is missing or too slow.

    Args:
        section: The table of limits.
        control_hz: Expected rate of commands, Hz.
        camera: The camera; None without one.
        sensors: The sensors.
    """
    limits: LimitPlan
    limits, commands = section.read(*TABLES["limits"])
    if limits.deadline_ms * control_hz < 1000:
        words = (
            f"deadline_ms of {section} must be at least {1000 / control_hz:.0f} ms, the time from "
            f"one command to the next at control_hz = {control_hz:g}"
        )
        raise section.mistake(words, "deadline_ms")
    measured = {sensor.measures for sensor in sensors}
    for name, what in _NEEDS.items():
        if section.table.get(name) and what not in measured:
            drivers = " or ".join(d for d in SENSORS if SENSORS[d].measures == what)
            words = (
                f"{name} of {section} needs a sensor that measures {what}, such as one with the "
                f"driver {drivers}"
            )
            raise section.mistake(words, name)
    key = "camera_stale_ms"
    if camera is None:
        if key in section:
            raise section.mistake(f"{key} of {section} needs a [camera]", key)
        return limits, commands
    stale_ms = limits.camera_stale_ms or _CAMERA_STALE_MS
    needed_ms = 2000 / camera.fps  # One frame may be lost.
    if stale_ms < needed_ms:
        words = (
            f"{key} of {section} must be at least {needed_ms:.0f} ms, the time of two pictures at "
            f"fps = {camera.fps:g}"
        )
        raise section.mistake(words, key)
    return replace(limits, camera_stale_ms=stale_ms), commands


_NEARLY_ZERO: Final = 1e-9


def _check_mix(
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
                words = f"the weight of {name!r} in mix of {called(place)} is 0: leave it out"
                raise source.mistake((*mix, name), words)
        _check_rest(source, actions, output)
        moved |= output.mix.keys()
    for name in actions:
        if name not in moved:
            words = f"[action.{name}] moves nothing: no mix of an output names it"
            raise source.mistake(("action", name), words)


def _check_stop(
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
            f"{called(place)} is at {at_rest:g} when its actions rest, and must be at 0 then, "
            "because it propels the robot"
        )
        raise source.mistake((*place, "offset"), words)


def _drives(actions: Mapping[str, ActionPlan], output: OutputPlan) -> bool:
    """Return whether an output can propel the robot."""
    return (
        OUTPUTS[output.driver].drives
        or output.part in DRIVING_PARTS
        or any(actions[name].propels for name in output.mix)
    )
