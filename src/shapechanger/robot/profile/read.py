"""Parse the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.profile.mistakes import Place, Source, called, choice, shown
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
    check_mix,
    check_pulses,
    check_stop,
    read_action,
    read_camera,
    read_keys,
    read_limits,
    read_output,
    read_sensor,
    refuse_bad_name,
    refuse_unknown_keys,
    table_at,
)
from shapechanger.robot.profile.wiring import PinAllocation

__all__ = ["read_profile"]

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
        self._data = data
        self._wiring = PinAllocation(source)

    def profile(self) -> Profile:
        """Read the whole profile."""
        robot = self._only_table("robot", ROBOT_KEYS)
        named = {name: read_action(self._source, name, t) for name, t in self._named("action")}
        if not named:
            words = "a robot needs an action, such as [action.throttle]"
            raise self._source.mistake(("action",), words)
        outputs = self._outputs(named)
        sensors = self._sensors()
        camera = self._camera()
        stop = StopPlan(**self._only_table("stop", STOP_KEYS))
        check_stop(self._source, stop, named, outputs)
        outputs, sensors = self._servo_bus(outputs, sensors, stop)
        table = table_at(self._source, self._data, ("limits",))
        limits = read_limits(self._source, table, robot["control_hz"], camera, sensors)
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
            reward=RewardPlan(**self._only_table("reward", REWARD_KEYS)),
            reset=self._reset(actions),
            enable=self._enable(),
            stop_pin=self._stop_pin(),
        )

    def _outputs(self, actions: Mapping[str, ActionPlan]) -> tuple[OutputPlan, ...]:
        outputs = tuple(read_output(self._source, name, t) for name, t in self._named("output"))
        for output in outputs:
            check_pulses(self._source, output)
        check_mix(self._source, actions, outputs)
        return self._wiring.take_outputs(outputs)

    def _sensors(self) -> tuple[SensorPlan, ...]:
        sensors = tuple(read_sensor(self._source, name, t) for name, t in self._named("sensor"))
        for sensor in sensors:
            self._wiring.take_sensor(sensor)
        return sensors

    def _servo_bus(
        self, outputs: tuple[OutputPlan, ...], sensors: tuple[SensorPlan, ...], stop: StopPlan
    ) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
        settings = self._only_table("servo_bus", SERVO_BUS_KEYS)
        asked = "servo_bus" in self._data
        return with_servo_bus(self._source, settings if asked else None, outputs, sensors, stop)

    def _camera(self) -> CameraPlan | None:
        if "camera" not in self._data:
            return None
        return read_camera(self._source, table_at(self._source, self._data, ("camera",)))

    def _reset(self, actions: Sequence[ActionPlan]) -> tuple[ResetStep, ...]:
        steps = self._data.get("reset", [])
        if not isinstance(steps, list):
            words = "the steps of the reset routine are written [[reset]], with two brackets"
            raise self._source.mistake(("reset",), words)
        return tuple(
            self._step(("reset", i), step, actions)
            for i, step in enumerate(cast("list[Any]", steps))
        )

    def _step(self, place: Place, table: Any, actions: Sequence[ActionPlan]) -> ResetStep:
        if not isinstance(table, dict):
            words = f"{called(place)} must be a table, not {shown(table)}"
            raise self._source.mistake(place, words)
        step = self._keys(cast("dict[str, Any]", table), place, RESET_KEYS)
        values: dict[str, float] = step["values"]
        known = {action.name: action for action in actions}
        for name, value in values.items():
            at = (*place, "values", name)
            if name not in known:
                words = f"values of {called(place)} name no action: {choice(name, known)}"
                raise self._source.mistake(at, words)
            low, high = known[name].low, known[name].high
            if not low <= value <= high:
                words = f"{name} of {called(place)} must be {low:g} to {high:g}, its own caps"
                raise self._source.mistake(at, words)
        filled = tuple(values.get(action.name, action.rest) for action in actions)
        return ResetStep(filled, step["seconds"])

    def _enable(self) -> EnablePlan | None:
        if "enable" not in self._data:
            return None
        enable = EnablePlan(**self._only_table("enable", ENABLE_KEYS))
        self._wiring.take_pin(enable.pin, ("enable", "pin"))
        return enable

    def _stop_pin(self) -> int | None:
        if "emergency_button" not in self._data:
            return None
        pin: int = self._only_table("emergency_button", EMERGENCY_BUTTON_KEYS)["pin"]
        self._wiring.take_pin(pin, ("emergency_button", "pin"))
        return pin

    def _only_table(self, name: str, keys: Sequence[ProfileKey]) -> dict[str, Any]:
        return self._keys(table_at(self._source, self._data, (name,)), (name,), keys)

    def _keys(
        self, table: Mapping[str, Any], place: Place, keys: Sequence[ProfileKey]
    ) -> dict[str, Any]:
        refuse_unknown_keys(self._source, table, place, [key.name for key in keys])
        return read_keys(self._source, table, place, keys)

    def _named(self, kind: str) -> list[tuple[str, dict[str, Any]]]:
        """Return the tables of one kind by name, in the order of the file."""
        tables = table_at(self._source, self._data, (kind,))
        for name in tables:
            refuse_bad_name(self._source, (kind, name))
        if len(tables) > _MOST_NAMED:
            words = f"a robot has at most {_MOST_NAMED} {kind}s, not {len(tables)}"
            raise self._source.mistake((kind,), words)
        return [(name, table_at(self._source, tables, (kind, name))) for name in tables]


def _toml(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ProfileError(f"{path} is no profile: it is nested too deeply.") from None
    except tomllib.TOMLDecodeError as error:
        words = str(error)
        line = text.count("\n") + 1
        if (at := _AT.fullmatch(words)) is not None:
            line = int(at[2])
            words = f"{at[1]} at column {at[3]}"
        what = f"this is no TOML: {words[:1].lower()}{words[1:]}"
    except ValueError:  # Python refuses to parse integers with thousands of digits.
        long = _DIGITS.search(text)
        line = text.count("\n", 0, long.start() if long else 0) + 1
        what = "a number has too many digits"
    raise ProfileError(f"{path}, line {line}: {what}.")
