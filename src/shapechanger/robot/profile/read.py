"""Decode the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import datetime
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, cast

import msgspec
from msgspec import Meta

from shapechanger.contract.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.drivers.keys import FilePath, Keys, Text
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.pulse import PulsedKeys
from shapechanger.robot.drivers.servos.settings import ServoBusKeys
from shapechanger.robot.profile.checks import (
    Part,
    PinAllocation,
    check_action,
    check_limits,
    check_mix,
    check_stop,
    with_servo_bus,
)
from shapechanger.robot.profile.diagnostics import Section, called, choice, fields_of
from shapechanger.robot.profile.profile import Profile, ResetStep

_MOST_NAMED: Final = 64  # As in the messages, see `shapechanger.robot.link.messages`.
_AT: Final = re.compile(r"(.*) \(at line (\d+), column (\d+)\)", re.DOTALL)
_DIGITS: Final = re.compile(r"[0-9_]{600}")


class RobotKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[robot]`; see `Profile`."""

    name: Text
    body: Text
    control_hz: Annotated[float, Meta(ge=1, le=100)] = 20.0
    calibrated: datetime.date | None = None
    turn_deg_per_m: Annotated[float, Meta(ge=0, le=10_000)] | None = None
    turn_deg_per_s: Annotated[float, Meta(ge=0, le=10_000)] | None = None


class OutputKeys(Keys, frozen=True, kw_only=True):
    """Keys of every output; see `OutputPlan`."""

    driver: str
    part: Part = ""
    mix: dict[str, Annotated[float, Meta(ge=-10, le=10)]]
    offset: Annotated[float, Meta(ge=-1, le=1)] = 0.0


class SensorKeys(Keys, frozen=True, kw_only=True):
    """Key of every sensor."""

    driver: str


class CommandKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[limits]` that concern clients and their commands; see `Profile`."""

    max_observation_age_ms: Annotated[int, Meta(ge=20, le=5000)] = 400
    arming: Literal["person", "anyone"] = "person"


class RewardKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[reward]`; see `Profile.reward`."""

    velocity: Annotated[float, Meta(ge=0, le=1e6)] = 1.0
    collision: Annotated[float, Meta(ge=-1e6, le=0)] = -10.0
    stall: Annotated[float, Meta(ge=-1e6, le=0)] = -1.0
    collision_ends_episode: bool = True


class ResetKeys(Keys, frozen=True, kw_only=True):
    """Keys of a step of the reset routine; see `ResetStep`."""

    values: dict[str, Annotated[float, Meta(ge=-1, le=1)]]
    seconds: Annotated[float, Meta(gt=0, le=60)]


class EnableKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[enable]`.

    Attributes:
        pin: Pin that the guard toggles.
        hold_ms: How long the one-shot holds the line after an edge. The guard toggles the pin at
            each tick, every 10 ms, and may be a few ms late.
    """

    pin: Pin
    hold_ms: Annotated[int, Meta(ge=30, le=1000)] = 100


class EmergencyButtonKeys(Keys, frozen=True, kw_only=True):
    """Key of `[emergency_button]`: pin of a button to ground."""

    pin: Pin


class _NumberKeys(Keys, frozen=True, kw_only=True):
    number: Annotated[int, Meta(ge=0, le=9)] = 0


class _DeviceKeys(Keys, frozen=True, kw_only=True):
    device: FilePath = "/dev/video0"


class _PathKeys(Keys, frozen=True, kw_only=True):
    path: FilePath


CAMERAS: Final[Mapping[str, type[Keys]]] = {
    "picamera2": _NumberKeys,
    "v4l2": _DeviceKeys,
    "file": _PathKeys,
    "pipe": _PathKeys,
    "pattern": Keys,
}
"""Keys of each camera driver."""

TABLES: Final[Mapping[str, tuple[type, ...]]] = {
    "robot": (RobotKeys,),
    "action": (ActionPlan,),
    "output": (OutputKeys,),
    "sensor": (SensorKeys,),
    "camera": (CameraPlan,),
    "limits": (LimitPlan, CommandKeys),
    "stop": (StopPlan,),
    "reward": (RewardKeys,),
    "reset": (ResetKeys,),
    "enable": (EnableKeys,),
    "emergency_button": (EmergencyButtonKeys,),
    "servo_bus": (ServoBusKeys,),
}
"""Tables of a profile, with their keys; `action`, `output` and `sensor` hold one table per name."""


def read_profile(text: str, path: Path) -> Profile:
    """Decode a profile.

    Args:
        text: TOML.
        path: The file that it comes from, for error messages.

    Raises:
        ProfileError: If the text is not TOML or not a valid profile; names the file and the line.
    """
    text = text.replace("\r\n", "\n")
    root = Section(path, text, (), _toml(text, path))
    for name in root.table:
        if name not in TABLES:
            raise root.error_at(name, f"a profile has no table or key {choice(name, TABLES)}")
    robot: RobotKeys = _table(root, "robot")
    actions = {name: _read_action(name, table) for name, table in _named(root, "action").items()}
    if not actions:
        raise root.error_at("action", "a robot needs an action, such as [action.throttle]")
    wiring = PinAllocation(root)
    outputs = wiring.shared(
        [_read_output(name, table, wiring) for name, table in _named(root, "output").items()]
    )
    check_mix(root, actions, outputs)
    sensors = tuple(
        _read_sensor(name, table, wiring) for name, table in _named(root, "sensor").items()
    )
    camera = _read_camera(root.section("camera")) if "camera" in root.table else None
    stop: StopPlan = _table(root, "stop")
    check_stop(root, stop, actions, outputs)
    pins: dict[str, Any] = {}
    if "enable" in root.table:
        enable: EnableKeys = _table(root, "enable")
        wiring.take(root.section("enable"), enable)
        pins = {"enable_pin": enable.pin, "enable_hold_ms": enable.hold_ms}
    if "emergency_button" in root.table:
        button: EmergencyButtonKeys = _table(root, "emergency_button")
        wiring.take(root.section("emergency_button"), button)
        pins["stop_pin"] = button.pin
    bus: ServoBusKeys | None = _table(root, "servo_bus") if "servo_bus" in root.table else None
    hold_ms: int | None = pins.get("enable_hold_ms")
    outputs, sensors = with_servo_bus(root, bus, outputs, sensors, stop, hold_ms)
    limits, commands = root.section("limits").decode(*TABLES["limits"])
    reward: RewardKeys = _table(root, "reward")
    return Profile(
        path=path,
        **msgspec.structs.asdict(robot),
        actions=tuple(actions.values()),
        outputs=outputs,
        sensors=sensors,
        camera=camera,
        limits=check_limits(root.section("limits"), limits, robot.control_hz, camera, sensors),
        **msgspec.structs.asdict(commands),
        stop=stop,
        reward={key: float(weight) for key, weight in msgspec.structs.asdict(reward).items()},
        reset=tuple(_reset(root, actions)),
        **pins,
    )


def _toml(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ProfileError(f"{path} is not a profile: it is nested too deeply.") from None
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        line = text.count("\n") + 1
        if (at := _AT.fullmatch(message)) is not None:
            line, message = int(at[2]), f"{at[1]} at column {at[3]}"
        message = f"this is not valid TOML: {message[:1].lower()}{message[1:]}"
    except ValueError:  # Python refuses to parse integers with thousands of digits.
        long = _DIGITS.search(text)
        line = text.count("\n", 0, long.start() if long else 0) + 1
        message = "a number has too many digits"
    raise ProfileError(f"{path}, line {line}: {message}.")


def _table(root: Section, name: str) -> Any:
    """Return the keys of a table that is there once."""
    (keys,) = root.section(name).decode(*TABLES[name])
    return keys


def _named(root: Section, kind: str) -> dict[str, Section]:
    """Return the tables of one kind keyed by name, in the order of the file."""
    tables = root.section(kind).named()
    if len(tables) > _MOST_NAMED:
        message = f"a robot has at most {_MOST_NAMED} {kind}s, not {len(tables)}"
        raise root.error_at(kind, message)
    return tables


def _read_action(name: str, section: Section) -> ActionPlan:
    (action,) = section.decode(ActionPlan, given={"name": name})
    if "low" not in section.table and action.one_sided:
        action = replace(action, low=0.0)
    check_action(section, action)
    return action


def _read_output(name: str, section: Section, wiring: PinAllocation) -> OutputPlan:
    """Read one motor, servo or controller."""
    for key in ("driver", "over"):
        written = section.table.get(key)
        if isinstance(written, str) and "gpiozero" in written.lower():
            raise section.error_at(
                key,
                f"{key} of {section} cannot be {written!r}: gpiozero makes the pulses of a servo "
                "in steps of 200 µs, and 1.4 ms out of a neutral of 1.5 ms (gpiozero#1209); use "
                f"the driver servo or esc, over one of {', '.join(PULSES)}",
            )
    kinds = [OUTPUTS[section.chosen("driver", OUTPUTS)].keys]
    given = {"name": name} if "name" in fields_of(kinds[0]) else {}
    if issubclass(kinds[0], PulsedKeys):
        kinds.append(PULSES[section.chosen("over", PULSES)].keys)
    others = {"the driver": OUTPUTS, "the pulse source": PULSES}
    common, *parts = section.decode(OutputKeys, *kinds, given=given, others=others)
    settings: dict[str, Any] = {}
    for keys in parts:
        wiring.take(section, keys)
        settings |= keys.settings()
    return OutputPlan(name=name, **msgspec.structs.asdict(common), settings=settings)


def _read_sensor(name: str, section: Section, wiring: PinAllocation) -> SensorPlan:
    """Read one sensor; one with a table for each joint has these as its rows."""
    chip = SENSORS[section.chosen("driver", SENSORS)]
    given: dict[str, Any] = {}
    table = section.table
    if chip.rows is not None:
        rows: dict[str, Any] = {k: v for k, v in table.items() if isinstance(v, dict)}
        if not rows:
            example = called(*section.place, "knee")
            message = f"{section} needs a table for each joint, such as {example}"
            raise section.error_at((), message)
        nested = section.within(rows).named()
        given["rows"] = {key: one.decode(chip.rows)[0] for key, one in nested.items()}
        section = section.within({key: v for key, v in table.items() if key not in rows})
    others = {"the driver": SENSORS}
    common, keys = section.decode(SensorKeys, chip.keys, given=given, others=others)
    wiring.take(section, keys)
    return SensorPlan(name, common.driver, measures=chip.measures, settings=keys.settings())


def _read_camera(section: Section) -> CameraPlan:
    keys = CAMERAS[section.chosen("driver", CAMERAS)]
    others = {"the driver": CAMERAS}
    camera, own = section.decode(CameraPlan, keys, given={"settings": {}}, others=others)
    return replace(camera, settings=own.settings())


def _reset(root: Section, actions: Mapping[str, ActionPlan]) -> Iterator[ResetStep]:
    """Read the reset routine; in each step, actions without a value are at rest."""
    tables = root.table.get("reset", [])
    if not isinstance(tables, list):
        message = "the steps of the reset routine are written [[reset]], with two brackets"
        raise root.error_at("reset", message)
    for i, table in enumerate(cast("list[Any]", tables)):
        section = root.section("reset", i, table=table)
        (step,) = section.decode(ResetKeys)
        for name, value in step.values.items():
            if name not in actions:
                message = f"values of {section} name no action: {choice(name, actions)}"
                raise section.error_at(("values", name), message)
            low, high = actions[name].low, actions[name].high
            if not low <= value <= high:
                message = f"{name} of {section} must be {low:g} to {high:g}, its own caps"
                raise section.error_at(("values", name), message)
        filled = tuple(step.values.get(action.name, action.rest) for action in actions.values())
        yield ResetStep(filled, step.seconds)
