"""Parse the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.guard.plan import ActionPlan, LimitPlan, StopPlan
from shapechanger.robot.profile.mistakes import Source, choice
from shapechanger.robot.profile.profile import (
    EnablePlan,
    Profile,
    ResetStep,
    RewardPlan,
    with_servo_bus,
)
from shapechanger.robot.profile.schema import (
    EMERGENCY_BUTTON_KEYS,
    ENABLE_KEYS,
    RESET_KEYS,
    REWARD_KEYS,
    ROBOT_KEYS,
    SERVO_BUS_KEYS,
    STOP_KEYS,
    TABLES,
    ProfileKey,
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
    return _Reader(source, data).profile()


class _Reader:
    """Reader of one profile, table by table."""

    def __init__(self, source: Source, data: Mapping[str, Any]) -> None:
        self._source = source
        self._root = Section(source, (), data)
        self._wiring = PinAllocation(source)

    def profile(self) -> Profile:
        """Read the whole profile."""
        root = self._root
        robot = root.section("robot").read(ROBOT_KEYS)
        named = {name: read_action(name, table) for name, table in self._named("action").items()}
        if not named:
            words = "a robot needs an action, such as [action.throttle]"
            raise root.mistake(words, "action")
        outputs = tuple(read_output(name, table) for name, table in self._named("output").items())
        check_mix(self._source, named, outputs)
        outputs = self._wiring.take_outputs(outputs)
        sensors = tuple(read_sensor(name, table) for name, table in self._named("sensor").items())
        for sensor in sensors:
            self._wiring.take_sensor(sensor)
        camera = read_camera(root.section("camera")) if "camera" in root else None
        stop = StopPlan(**root.section("stop").read(STOP_KEYS))
        check_stop(self._source, stop, named, outputs)
        bus = root.section("servo_bus").read(SERVO_BUS_KEYS) if "servo_bus" in root else None
        outputs, sensors = with_servo_bus(self._source, bus, outputs, sensors, stop)
        limits = read_limits(root.section("limits"), robot["control_hz"], camera, sensors)
        enable = self._with_pin("enable", ENABLE_KEYS)
        button = self._with_pin("emergency_button", EMERGENCY_BUTTON_KEYS)
        actions = tuple(named.values())
        return Profile(
            path=self._source.path,
            **robot,
            actions=actions,
            outputs=outputs,
            sensors=sensors,
            camera=camera,
            limits=LimitPlan(**{field.name: limits[field.name] for field in fields(LimitPlan)}),
            max_observation_age_ms=limits["max_observation_age_ms"],
            arming=limits["arming"],
            stop=stop,
            reward=RewardPlan(**root.section("reward").read(REWARD_KEYS)),
            reset=self._reset(actions),
            enable=EnablePlan(**enable) if enable else None,
            stop_pin=button["pin"] if button else None,
        )

    def _reset(self, actions: Sequence[ActionPlan]) -> tuple[ResetStep, ...]:
        steps = self._root.table.get("reset", [])
        if not isinstance(steps, list):
            words = "the steps of the reset routine are written [[reset]], with two brackets"
            raise self._root.mistake(words, "reset")
        tables = enumerate(cast("list[Any]", steps))
        return tuple(_step(Section(self._source, ("reset", i), t), actions) for i, t in tables)

    def _with_pin(self, name: str, keys: Sequence[ProfileKey]) -> dict[str, Any] | None:
        """Read a table with a pin, and allocate the pin; None if it is missing."""
        if name not in self._root:
            return None
        values = self._root.section(name).read(keys)
        self._wiring.take_pin(values["pin"], (name, "pin"))
        return values

    def _named(self, kind: str) -> dict[str, Section]:
        """Return the tables of one kind by name, in the order of the file."""
        tables = self._root.section(kind).named()
        if len(tables) > _MOST_NAMED:
            words = f"a robot has at most {_MOST_NAMED} {kind}s, not {len(tables)}"
            raise self._root.mistake(words, kind)
        return tables


def _step(section: Section, actions: Sequence[ActionPlan]) -> ResetStep:
    """Read one step of the reset routine; actions without a value are at rest."""
    step = section.read(RESET_KEYS)
    values: dict[str, float] = step["values"]
    known = {action.name: action for action in actions}
    for name, value in values.items():
        if name not in known:
            words = f"values of {section} name no action: {choice(name, known)}"
            raise section.mistake(words, "values", name)
        low, high = known[name].low, known[name].high
        if not low <= value <= high:
            words = f"{name} of {section} must be {low:g} to {high:g}, its own caps"
            raise section.mistake(words, "values", name)
    filled = tuple(values.get(action.name, action.rest) for action in actions)
    return ResetStep(filled, step["seconds"])


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
