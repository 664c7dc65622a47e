"""Parse the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.guard.plan import ActionPlan, LimitPlan, StopPlan
from shapechanger.robot.profile.mistakes import Source, choice
from shapechanger.robot.profile.profile import Profile, ResetStep, with_servo_bus
from shapechanger.robot.profile.schema import (
    EMERGENCY_BUTTON_KEYS,
    ENABLE_KEYS,
    RESET_KEYS,
    REWARD_KEYS,
    ROBOT_KEYS,
    SERVO_BUS_KEYS,
    STOP_KEYS,
    TABLES,
)
from shapechanger.robot.profile.sections import (
    Section,
    check_mix,
    check_stop,
    read_action,
    read_camera,
    read_limits,
    read_output,
    read_sensor,
)
from shapechanger.robot.profile.wiring import PinAllocation

_MOST_NAMED: Final = 64  # As in the messages, see `shapechanger.link.messages`.
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
    robot = root.section("robot").read(ROBOT_KEYS)
    actions = {name: read_action(name, table) for name, table in _named(root, "action").items()}
    if not actions:
        raise root.mistake("a robot needs an action, such as [action.throttle]", "action")
    outputs = tuple(read_output(name, table) for name, table in _named(root, "output").items())
    check_mix(source, actions, outputs)
    outputs = wiring.take_outputs(outputs)
    sensors = tuple(read_sensor(name, table) for name, table in _named(root, "sensor").items())
    for sensor in sensors:
        wiring.take_sensor(sensor)
    camera = read_camera(root.section("camera")) if "camera" in root else None
    stop = StopPlan(**root.section("stop").read(STOP_KEYS))
    check_stop(source, stop, actions, outputs)
    bus = root.section("servo_bus").read(SERVO_BUS_KEYS) if "servo_bus" in root else None
    outputs, sensors = with_servo_bus(source, bus, outputs, sensors, stop)
    limits = read_limits(root.section("limits"), robot["control_hz"], camera, sensors)
    pins: dict[str, Any] = {}
    if "enable" in root:
        enable = root.section("enable").read(ENABLE_KEYS)
        wiring.take_pin(enable["pin"], ("enable", "pin"))
        pins = {"enable_pin": enable["pin"], "enable_hold_ms": enable["hold_ms"]}
    if "emergency_button" in root:
        pins["stop_pin"] = root.section("emergency_button").read(EMERGENCY_BUTTON_KEYS)["pin"]
        wiring.take_pin(pins["stop_pin"], ("emergency_button", "pin"))
    reward = root.section("reward").read(REWARD_KEYS)
    return Profile(
        path=path,
        **robot,
        actions=tuple(actions.values()),
        outputs=outputs,
        sensors=sensors,
        camera=camera,
        max_observation_age_ms=limits.pop("max_observation_age_ms"),
        arming=limits.pop("arming"),
        limits=LimitPlan(**limits),
        stop=stop,
        reward={name: float(weight) for name, weight in reward.items()},
        reset=_reset(root, actions),
        **pins,
    )


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
        step = section.read(RESET_KEYS)
        values: dict[str, float] = step["values"]
        for name, value in values.items():
            if name not in actions:
                words = f"values of {section} name no action: {choice(name, actions)}"
                raise section.mistake(words, "values", name)
            low, high = actions[name].low, actions[name].high
            if not low <= value <= high:
                words = f"{name} of {section} must be {low:g} to {high:g}, its own caps"
                raise section.mistake(words, "values", name)
        filled = tuple(values.get(action.name, action.rest) for action in actions.values())
        steps.append(ResetStep(filled, step["seconds"]))
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
