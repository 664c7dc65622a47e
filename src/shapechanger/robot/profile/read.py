"""Decode the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, cast

import msgspec
from msgspec import Meta

from shapechanger.contract.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS, FilePath, Keys
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.servos.settings import ServoBusKeys
from shapechanger.robot.profile.profile import CommandTable, Profile, ResetStep, RobotTable
from shapechanger.robot.profile.rules import RULES
from shapechanger.robot.profile.toml import Table, choice, fields_of, keys_of

_AT: Final = re.compile(r"(.*) \(at line (\d+), column (\d+)\)", re.DOTALL)
_DIGITS: Final = re.compile(r"[0-9_]{600}")


class RewardKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[reward]`; see `Profile.reward`.

    Attributes:
        velocity: Reward per metre forward; a metre backward costs as much.
        collision: Reward per collision.
        stall: Reward per second of pushing without motion.
        collision_ends_episode: Whether a collision ends the episode.
    """

    velocity: Annotated[float, Meta(ge=0, le=1e6)] = 1.0
    collision: Annotated[float, Meta(ge=-1e6, le=0)] = -10.0
    stall: Annotated[float, Meta(ge=-1e6, le=0)] = -1.0
    collision_ends_episode: bool = True


class ResetKeys(Keys, frozen=True, kw_only=True):
    """Keys of a step of the reset routine; see `ResetStep`.

    Attributes:
        values: Value of each action within its caps; other actions are at rest.
        seconds: Duration of the step, s.
    """

    values: Annotated[
        dict[str, Annotated[float, Meta(ge=-1, le=1)]],
        Meta(description="a table of numbers from -1 to 1 by name of action"),
    ]
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
    """Key of `[emergency_button]`.

    Attributes:
        pin: Pin of a button to ground. Pressing it stops the robot until a person arms it again.
    """

    pin: Pin


class _NumberKeys(Keys, frozen=True, kw_only=True):
    """A camera on the ribbon cable.

    Attributes:
        number: Number of the camera.
    """

    number: Annotated[int, Meta(ge=0, le=9)] = 0


class _DeviceKeys(Keys, frozen=True, kw_only=True):
    """A webcam.

    Attributes:
        device: Device of the camera.
    """

    device: FilePath = "/dev/video0"


class _PathKeys(Keys, frozen=True, kw_only=True):
    """A folder of JPEG files, or a stream of them.

    Attributes:
        path: The folder, or the pipe, the file or "| program arguments" that streams.
    """

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
    "robot": (RobotTable,),
    "action": (ActionPlan,),
    "output": (OutputPlan,),
    "sensor": (SensorPlan,),
    "camera": (CameraPlan,),
    "limits": (LimitPlan, CommandTable),
    "stop": (StopPlan,),
    "reward": (RewardKeys,),
    "reset": (ResetKeys,),
    "enable": (EnableKeys,),
    "emergency_button": (EmergencyButtonKeys,),
    "servo_bus": (ServoBusKeys,),
}
"""Tables of a profile, with their keys; `action`, `output` and `sensor` hold one table per name."""

DRIVERS: Final[Mapping[str, Mapping[str, Mapping[str, Any]]]] = {
    "output": {"driver": OUTPUTS, "over": PULSES},
    "sensor": {"driver": SENSORS},
    "camera": {"driver": CAMERAS},
}
"""Chips, or their keys, that a key of a table chooses from; their keys are keys of the table."""

GIVEN: Final = ("name", "measures", "settings", "rows")
"""Fields of `TABLES` and of chips that are no keys of a table, but follow from it."""


def read_profile(text: str, path: Path) -> Profile:
    """Decode a profile.

    Args:
        text: TOML.
        path: The file that it comes from, for error messages.

    Raises:
        ProfileError: If the text is not TOML or not a valid profile; names the file and the line.
    """
    text = text.replace("\r\n", "\n")
    root = Table(path, text, (), _toml(text, path))
    for name in root.keys:
        if name not in TABLES:
            raise root.error((name,), f"a profile has no table or key {choice(name, TABLES)}")
    robot: RobotTable = _once(root, "robot")
    actions = {
        name: _read_action(name, table) for name, table in root.table("action").named().items()
    }
    if not actions:
        raise root.error(("action",), "a robot needs an action, such as [action.throttle]")
    outputs = tuple(
        _read_output(name, table) for name, table in root.table("output").named().items()
    )
    sensors = tuple(
        _read_sensor(name, table) for name, table in root.table("sensor").named().items()
    )
    pins: dict[str, Any] = {}
    if "enable" in root.keys:
        enable: EnableKeys = _once(root, "enable")
        pins = {"enable_pin": enable.pin, "enable_hold_ms": enable.hold_ms}
    if "emergency_button" in root.keys:
        pins["stop_pin"] = _once(root, "emergency_button").pin
    limits, commands = root.table("limits").decode(*TABLES["limits"])
    reward: RewardKeys = _once(root, "reward")
    profile = Profile(
        path=path,
        **vars(robot),
        actions=tuple(actions.values()),
        outputs=outputs,
        sensors=sensors,
        camera=_read_part(root.table("camera"), CameraPlan) if "camera" in root.keys else None,
        limits=limits,
        **vars(commands),
        stop=_once(root, "stop"),
        reward={key: float(weight) for key, weight in msgspec.structs.asdict(reward).items()},
        reset=tuple(_reset(root, actions)),
        **pins,
    )
    for rule in RULES:
        profile = rule(root, profile)
    return profile


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


def _once(root: Table, name: str) -> Any:
    """Return the keys of a table that is there once."""
    (keys,) = root.table(name).decode(*TABLES[name])
    return keys


def _read_action(name: str, table: Table) -> ActionPlan:
    (action,) = table.decode(ActionPlan, given={"name": name})
    if "low" not in table.keys and action.one_sided:
        action = replace(action, low=0.0)
    for key, words in action.mistakes():
        raise table.refused(key, words)
    return action


def _read_output(name: str, table: Table) -> OutputPlan:
    """Read one motor, servo or controller."""
    for key in DRIVERS["output"]:
        if "gpiozero" in str(table.keys.get(key)).lower():
            raise table.refused(
                key,
                "cannot be of gpiozero, which makes the pulses of a servo in steps of 200 µs, and "
                "1.4 ms out of a neutral of 1.5 ms (gpiozero#1209); use the driver servo or esc, "
                f"over one of {', '.join(PULSES)}",
            )
    return _read_part(table, OutputPlan, name=name)


def _read_sensor(name: str, table: Table) -> SensorPlan:
    """Read one sensor; one with a table for each joint has these as its rows."""
    chip = SENSORS[table.chosen("driver", SENSORS)]
    given: dict[str, Any] = {"name": name, "measures": chip.measures}
    if chip.rows is not None:
        rows: dict[str, Any] = {
            key: value for key, value in table.keys.items() if isinstance(value, dict)
        }
        if not rows:
            raise table.refused("", f"needs a table for each joint, such as [sensor.{name}.knee]")
        joints = replace(table, keys=rows).named()
        given["rows"] = {key: joint.decode(chip.rows)[0] for key, joint in joints.items()}
        table = replace(table, keys={k: v for k, v in table.keys.items() if k not in rows})
    return _read_part(table, SensorPlan, **given)


def _read_part(table: Table, plan: type, **given: Any) -> Any:
    """Return a plan with the settings of its driver, and of the pulses if the driver takes any."""
    drivers = DRIVERS[str(table.place[0])]
    kinds: list[type[Keys]] = []
    for key, chips in drivers.items():
        if not kinds or key in fields_of(kinds[0]):
            kinds.append(keys_of(chips[table.chosen(key, chips)]))
    given["settings"] = {}
    part, *parts = table.decode(plan, *kinds, given=given, drivers=drivers)
    settings = {key: value for keys in parts for key, value in keys.settings().items()}
    return replace(part, settings=settings)


def _reset(root: Table, actions: Mapping[str, ActionPlan]) -> Iterator[ResetStep]:
    """Read the reset routine; in each step, actions without a value are at rest."""
    tables = root.keys.get("reset", [])
    if not isinstance(tables, list):
        message = "the steps of the reset routine are written [[reset]], with two brackets"
        raise root.error(("reset",), message)
    for i, keys in enumerate(cast("list[Any]", tables)):
        table = replace(root, place=("reset", i), keys=keys)
        (step,) = table.decode(ResetKeys)
        for name, value in step.values.items():
            if name not in actions:
                raise table.refused("values", f"names no action: {choice(name, actions)}", name)
            low, high = actions[name].low, actions[name].high
            if not low <= value <= high:
                words = f"must have {low:g} to {high:g} for {name}, its own caps"
                raise table.refused("values", words, name)
        filled = tuple(step.values.get(action.name, action.rest) for action in actions.values())
        yield ResetStep(filled, step.seconds)
