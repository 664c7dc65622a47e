"""Decode the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, cast

import msgspec
from msgspec import Meta

from shapechanger.contract.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CAMERAS, CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS, Keys
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.servos.settings import ServoBusKeys
from shapechanger.robot.profile.profile import CommandTable, Profile, ResetStep, RobotTable
from shapechanger.robot.profile.rules import RULES
from shapechanger.robot.profile.toml import Table, choice, fields_of

_AT: Final = re.compile(r"(.*) \(at line (\d+), column (\d+)\)", re.DOTALL)


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
        Meta(description="a table of numbers from -1 to 1, keyed by action"),
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
"""Chips that a key of a table chooses from; their keys are keys of the table."""

GIVEN: Final = ("name", "measures", "settings", "rows")
"""Fields of `TABLES` and of chips that are derived instead of being keys of a table."""


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
            raise root.error(f"a profile has no table or key {choice(name, TABLES)}", name)
    (robot,) = root.table("robot").decode(RobotTable)
    actions = tuple(_read_action(table) for table in root.table("action").named().values())
    if not actions:
        raise root.error("a robot needs an action, such as [action.throttle]", "action")
    outputs = tuple(
        _read_part(table, OutputPlan, name=name)
        for name, table in root.table("output").named().items()
    )
    sensors = tuple(_read_sensor(table) for table in root.table("sensor").named().values())
    pins: dict[str, Any] = {}
    if "enable" in root.keys:
        (enable,) = root.table("enable").decode(EnableKeys)
        pins = {"enable_pin": enable.pin, "enable_hold_ms": enable.hold_ms}
    if "emergency_button" in root.keys:
        (button,) = root.table("emergency_button").decode(EmergencyButtonKeys)
        pins["stop_pin"] = button.pin
    limits, commands = root.table("limits").decode(LimitPlan, CommandTable)
    (reward,) = root.table("reward").decode(RewardKeys)
    (stop,) = root.table("stop").decode(StopPlan)
    profile = Profile(
        path=path,
        **vars(robot),
        actions=actions,
        outputs=outputs,
        sensors=sensors,
        camera=_read_part(root.table("camera"), CameraPlan) if "camera" in root.keys else None,
        limits=limits,
        **vars(commands),
        stop=stop,
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
    except tomllib.TOMLDecodeError as error:
        at = _AT.fullmatch(str(error))
        line = int(at[2]) if at else text.count("\n") + 1
        message = f"{at[1]} at column {at[3]}" if at else str(error)
        message = f"this is not valid TOML: {message[:1].lower()}{message[1:]}"
        raise ProfileError(f"{path}, line {line}: {message}.") from None
    except (RecursionError, ValueError):  # Python refuses integers with thousands of digits.
        message = "it is nested too deeply, or a number has too many digits"
        raise ProfileError(f"{path} is not a profile: {message}.") from None


def _read_action(table: Table) -> ActionPlan:
    (action,) = table.decode(ActionPlan, given={"name": table.place[-1]})
    if "low" not in table.keys and action.one_sided:
        action = replace(action, low=0.0)
    for key, text in action.mistakes():
        raise table.refused(key, text)
    return action


def _read_sensor(table: Table) -> SensorPlan:
    """Read one sensor; tables for its joints become its rows."""
    name, chip = table.place[-1], SENSORS[table.chosen("driver", SENSORS)]
    given: dict[str, Any] = {"name": name, "measures": chip.measures}
    if chip.rows is not None:
        rows: dict[str, Any] = {k: v for k, v in table.keys.items() if isinstance(v, dict)}
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
            kinds.append(chips[table.chosen(key, chips)].keys)
    given["settings"] = {}
    part, *parts = table.decode(plan, *kinds, given=given, drivers=drivers)
    settings = {key: value for keys in parts for key, value in keys.settings().items()}
    return replace(part, settings=settings)


def _reset(root: Table, actions: Sequence[ActionPlan]) -> Iterator[ResetStep]:
    """Read the reset routine; in each step, actions without a value are at rest."""
    tables = root.keys.get("reset", [])
    if not isinstance(tables, list):
        message = "the steps of the reset routine are written [[reset]], with two brackets"
        raise root.error(message, "reset")
    named = {action.name: action for action in actions}
    for i, keys in enumerate(cast("list[Any]", tables)):
        table = replace(root, place=("reset", i), keys=keys)
        (step,) = table.decode(ResetKeys)
        for name, value in step.values.items():
            if name not in named:
                raise table.refused("values", f"names no action: {choice(name, named)}", name)
            low, high = named[name].low, named[name].high
            if not low <= value <= high:
                text = f"must have {low:g} to {high:g} for {name}, its own caps"
                raise table.refused("values", text, name)
        filled = tuple(step.values.get(action.name, action.rest) for action in actions)
        yield ResetStep(filled, step.seconds)
