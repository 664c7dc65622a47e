"""Decode the text of a profile into a `Profile`, or report one error with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, cast, get_args

import msgspec
from msgspec import Meta

from shapechanger.contract.plan import (
    ActionPlan,
    DrivingPart,
    LimitPlan,
    OutputPlan,
    SensorPlan,
    StopPlan,
)
from shapechanger.errors import ProfileError, translate_errors
from shapechanger.robot.cameras.camera import CAMERAS, CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS, Claim, KeyMistake, Keys
from shapechanger.robot.drivers.pins import NO_PIN, Pin
from shapechanger.robot.drivers.servos.settings import (
    DRIVER,
    ServoBusKeys,
    bus_settings,
    stops_itself,
)
from shapechanger.robot.profile.profile import CommandTable, Profile, ResetStep, RobotTable
from shapechanger.robot.profile.toml import Table, choice, fields_of, line_of

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
        values: Value of each action, within its caps; actions that are not listed are at rest.
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
        hold_ms: Time for which the one-shot keeps the enable line active after an edge, ms. The
            guard toggles the pin at each tick, every 10 ms, and may be a few ms late.
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
"""Keys of the tables of a profile; `action`, `output` and `sensor` contain one table per name."""

DRIVERS: Final[Mapping[str, Mapping[str, Mapping[str, Any]]]] = {
    "output": {"driver": OUTPUTS, "over": PULSES},
    "sensor": {"driver": SENSORS},
    "camera": {"driver": CAMERAS},
}
"""Chips from which a key of a table selects; the table then also has the selected chip's keys."""

GIVEN: Final = ("name", "measures", "settings", "rows")
"""Fields of `TABLES` and of chips that a table cannot set, because they are derived."""


def read_profile(text: str, path: Path) -> Profile:
    """Decode a profile.

    Args:
        text: Text of the profile, in TOML.
        path: File of the text, for error messages.

    Raises:
        ProfileError: If the text is not a valid profile; the message names the file and the line.
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
    _check_mix(root, profile)
    profile = _share_boards(root, profile)
    _check_stop(root, profile)
    _check_claims(root)
    return _check_limits(root, _join_servo_bus(root, profile))


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
    for key, text in action.contradictions():
        raise table.refused(key, text)
    return action


def _read_sensor(table: Table) -> SensorPlan:
    """Read one sensor; the tables of its joints become its setting `rows`."""
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
    """Return a plan with the settings of its driver, and of the pulses if the driver sends any."""
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
                text = f"must be {low:g} to {high:g} for {name}, the caps of this action"
                raise table.refused("values", text, name)
        filled = tuple(step.values.get(action.name, action.rest) for action in actions)
        yield ResetStep(filled, step.seconds)


def _check_claims(root: Table) -> None:
    """Refuse a pin, a channel or an address that two keys claim, unless their group shares it."""
    users: dict[str, tuple[Table, Claim]] = {}
    for table, claim in ((table, one) for table, keys in root.decoded for one in keys.claims()):
        before, earlier = users.setdefault(claim.resource, (table, claim))
        if earlier is claim or (claim.group and claim.group == earlier.group):
            continue
        line = line_of(before.text, (*before.place, earlier.key))
        raise table.error(
            f"{claim.resource}{claim.use} is used twice: by {earlier.key} of {before} (line "
            f"{line}) and by {claim.key} of {table}",
            claim.key,
        )


def _share_boards(root: Table, profile: Profile) -> Profile:
    """Set the frequency and the enable pin of a PCA9685 for all of its outputs."""
    boards: dict[tuple[int, ...], dict[str, Any]] = {}
    for output in profile.outputs:
        for name in ("hz", "output_enable") if (board := _board(output)) else ():
            shared, value = boards.setdefault(board, {}), output.settings[name]
            before = shared.setdefault(name, value)
            if before == NO_PIN:
                shared[name] = value
            elif value not in (before, NO_PIN):
                text = f"the PCA9685 at {board[1]:#x} of I2C bus {board[0]} has one {name} for "
                text += f"all its channels, {before} or {value}"
                raise root.error(text, "output", output.name, name)
    outputs = tuple(
        replace(output, settings=output.settings | boards.get(_board(output), {}))
        for output in profile.outputs
    )
    return replace(profile, outputs=outputs)


def _board(output: OutputPlan) -> tuple[int, ...]:
    """Return bus and address of the PCA9685 of an output; () for an output without a PCA9685."""
    settings = output.settings
    return (settings["bus"], settings["address"]) if settings.get("over") == "pca9685" else ()


_NEARLY_ZERO: Final = 1e-9


def _check_mix(root: Table, profile: Profile) -> None:
    """Refuse a wrong or empty mix, an action without outputs, and an output that drives at rest."""
    rests = {action.name: action.rest for action in profile.actions}
    for output in profile.outputs:
        table = root.table("output", output.name)
        if not output.mix:
            text = f"is empty, so no action moves it; there are: {', '.join(rests)}"
            raise table.refused("mix", text)
        for name, weight in output.mix.items():
            if name not in rests:
                raise table.refused("mix", f"names no action: {choice(name, rests)}", name)
            if weight == 0.0:
                raise table.refused("mix", f"has the weight 0 for {name!r}: leave it out", name)
        if output.part in get_args(DrivingPart) and not _propelling(profile) & output.mix.keys():
            text = f"must name an action with propels = true, because it moves the {output.part}"
            raise table.refused("mix", text)
        rest = output.offset + sum(weight * rests[name] for name, weight in output.mix.items())
        if _drives(profile, output) and abs(rest) > _NEARLY_ZERO:
            text = "and must be at 0 then, because it propels the robot"
            raise table.error(f"{table} is at {rest:g} when its actions rest, {text}", "offset")
    for name in rests:
        if not any(name in output.mix for output in profile.outputs):
            raise root.table("action", name).refused("", "moves nothing: no mix names it")


def _check_stop(root: Table, profile: Profile) -> None:
    """Refuse a hold or ramp if an action that does not propel moves a propelling output."""
    held = [key for key in ("hold_ms", "ramp_ms") if getattr(profile.stop, key)]
    for output in (one for one in profile.outputs if held and _drives(profile, one)):
        for name in output.mix.keys() - _propelling(profile):
            text = f"would keep [output.{output.name}] driving after a stop, because {name!r} "
            text += "moves it and does not propel"
            raise root.table("stop").refused(held[0], text)


def _propelling(profile: Profile) -> set[str]:
    return {action.name for action in profile.actions if action.propels}


def _drives(profile: Profile, output: OutputPlan) -> bool:
    return (
        OUTPUTS[output.driver].drives
        or output.part in get_args(DrivingPart)
        or bool(_propelling(profile) & output.mix.keys())
    )


# Default and smallest value of `camera_stale_ms`, ms.
_CAMERA_STALE_MS: Final = 500
_LEAST_STALE_MS: Final = 50


def _check_limits(root: Table, profile: Profile) -> Profile:
    """Refuse limits that need a missing sensor or camera, or a faster rate; add the camera's."""
    table, limits, camera = root.table("limits"), profile.limits, profile.camera
    if limits.deadline_ms * profile.control_hz < 1000:
        text = f"must be at least {1000 / profile.control_hz:.0f} ms, the time from one command "
        text += f"to the next at control_hz = {profile.control_hz:g}"
        raise table.refused("deadline_ms", text)
    measured = {sensor.measures for sensor in profile.sensors}
    for name, quantity in limits.measured.items():
        if table.keys.get(name) and quantity not in measured:
            drivers = " or ".join(d for d, chip in SENSORS.items() if chip.measures == quantity)
            text = f"needs a sensor that measures {quantity}, such as one with the driver "
            raise table.refused(name, text + drivers)
    key = "camera_stale_ms"
    if camera is None:
        if key in table.keys:
            raise table.refused(key, "needs a [camera]")
        return profile
    stale_ms = limits.camera_stale_ms if key in table.keys else _CAMERA_STALE_MS
    needed_ms = max(2000 / camera.fps, _LEAST_STALE_MS)  # One frame may be lost.
    if stale_ms < needed_ms:
        text = f"must be at least {needed_ms:.0f} ms: one of two images may be lost at fps = "
        raise table.refused(key, f"{text}{camera.fps:g}")
    return replace(profile, limits=replace(limits, camera_stale_ms=stale_ms))


# Boot time of servos that the guard powers, s.
_START_S: Final = 0.5


def _join_servo_bus(root: Table, profile: Profile) -> Profile:
    """Copy the settings of the servo bus to its outputs and its sensor."""
    servos = [output for output in profile.outputs if output.driver == DRIVER]
    sensing = [sensor for sensor in profile.sensors if sensor.driver == DRIVER]
    on_bus = root.table("servo_bus")
    if not servos:
        alone = [on_bus] if "servo_bus" in root.keys else []
        for table in (*alone, *(root.table("sensor", sensor.name) for sensor in sensing)):
            raise table.refused("", f"needs an output with the driver {DRIVER}")
        return profile
    if "servo_bus" not in root.keys:
        raise root.table("output", servos[0].name).refused("", "is on a bus: add [servo_bus]")
    if len(sensing) != 1:
        text = f"servos need one sensor with the driver {DRIVER}, such as [sensor.tendons], which "
        second = (sensor.name for sensor in sensing[1:2])
        raise root.error(f"{text}reports their failures", "sensor", *second)
    if profile.stop.then != "release":
        text = 'must be "release", so that no servo pulls without a command'
        raise root.table("stop").refused("then", text)
    (bus,) = on_bus.decode(ServoBusKeys)
    settings = bus.settings()
    for output in servos:
        if not stops_itself(output):
            if profile.enable_pin is None:
                text = f"is an {output.settings['model']}, which does not stop when its bus is "
                text += "silent: add [enable] with the pin that keeps its power on"
                raise root.table("output", output.name).refused("", text)
            settings |= {"cut_ms": 2 * profile.enable_hold_ms, "arm_s": _START_S}
    wired = {one.name: replace(one, settings=one.settings | settings) for one in servos}
    with translate_errors(KeyMistake, to=lambda error: on_bus.refused(error.key, str(error))):
        bus_settings([*wired.values()])
    tendons = {"device": bus.device, "tendons": {one.name: one.settings for one in servos}}
    return replace(
        profile,
        outputs=tuple(wired.get(output.name, output) for output in profile.outputs),
        sensors=tuple(
            replace(one, settings=tendons) if one in sensing else one for one in profile.sensors
        ),
    )
