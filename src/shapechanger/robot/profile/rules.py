"""Rules between the tables of a profile: pins, mixes, stops, limits and the servo bus.

Each rule returns the profile, with fields that depend on several tables filled in, or raises a
`ProfileError` with the line and one sentence.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, get_args

from shapechanger.contract.plan import DrivingPart, OutputPlan
from shapechanger.errors import translate_errors
from shapechanger.robot.drivers.chip import OUTPUTS, SENSORS, Claim, KeyMistake
from shapechanger.robot.drivers.pins import NO_PIN
from shapechanger.robot.drivers.servos.settings import (
    DRIVER,
    ServoBusKeys,
    bus_settings,
    stops_itself,
)
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.profile.toml import Table, choice, line_of


def check_claims(root: Table, profile: Profile) -> Profile:
    """Refuse a pin, a channel or an address that two keys claim."""
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
    return profile


def share_boards(root: Table, profile: Profile) -> Profile:
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
    """Return bus and address of the PCA9685 of an output; () without one."""
    settings = output.settings
    return (settings["bus"], settings["address"]) if settings.get("over") == "pca9685" else ()


_NEARLY_ZERO: Final = 1e-9


def check_mix(root: Table, profile: Profile) -> Profile:
    """Refuse outputs and actions without a connection, and outputs that drive at rest."""
    rests = {action.name: action.rest for action in profile.actions}
    for output in profile.outputs:
        table = root.table("output", output.name)
        if not output.mix:
            text = f"is empty, so nothing moves it; there are: {', '.join(rests)}"
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
    return profile


def check_stop(root: Table, profile: Profile) -> Profile:
    """Refuse a stop that holds or ramps an action that contributes to a propelling output."""
    held = [key for key in ("hold_ms", "ramp_ms") if getattr(profile.stop, key)]
    for output in (one for one in profile.outputs if held and _drives(profile, one)):
        for name in output.mix.keys() - _propelling(profile):
            text = f"would keep [output.{output.name}] driving after a stop, because {name!r} "
            text += "moves it and does not propel"
            raise root.table("stop").refused(held[0], text)
    return profile


def _propelling(profile: Profile) -> set[str]:
    """Return the names of the actions that propel the robot."""
    return {action.name for action in profile.actions if action.propels}


def _drives(profile: Profile, output: OutputPlan) -> bool:
    """Return whether an output can propel the robot."""
    return (
        OUTPUTS[output.driver].drives
        or output.part in get_args(DrivingPart)
        or bool(_propelling(profile) & output.mix.keys())
    )


# Default of `camera_stale_ms`, and its least value.
_CAMERA_STALE_MS: Final = 500
_LEAST_STALE_MS: Final = 50


def check_limits(root: Table, profile: Profile) -> Profile:
    """Refuse limits that need something that is missing or too slow."""
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


def join_servo_bus(root: Table, profile: Profile) -> Profile:
    """Give the outputs and the sensor of the servo bus its settings."""
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


RULES: Final = (check_mix, share_boards, check_stop, check_claims, join_servo_bus, check_limits)
"""All rules, in the order in which they apply."""
