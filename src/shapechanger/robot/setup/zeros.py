"""The encoders at a robot's joints: where they stand while it is straight, and how they are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.as5600 import COUNTS_PER_TURN, As5600, connect_encoders
from shapechanger.robot.drivers.dynamixel.settings import bus_settings, servo_settings
from shapechanger.robot.guard.plan import GuardPlan, SensorPlan
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.setup.finding import Finding

__all__ = ["bus_speed", "examine_encoders", "find_joint_zeros", "find_zeros", "real_encoders"]

_READINGS: Final = 50  # Half a second: an encoder is off by a count or two from one to the next.
_FAST_HZ: Final = 400_000
_BAUD: Final = re.compile(r"^\s*dtparam\s*=\s*(?:[^#]*,)?i2c(?:_arm)?_baudrate=(\d+)", re.MULTILINE)


def find_joint_zeros(
    plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]
) -> dict[str, int]:
    """Read all encoders for a while; somebody holds the joints straight.

    Args:
        plan: The robot.
        hardware: Where its buses are.
        wait: Lets some ten milliseconds go by.

    Returns:
        Counts of each encoder, 0 to 4095, by the names of sensor and joint, such as
        `joints.MCP_flexion`; empty for a robot without encoders.

    Raises:
        RobotError: If one does not answer or detects no magnet.
    """
    zeros: dict[str, int] = {}
    for sensor in (one for one in plan.sensors if one.driver == "as5600"):
        opened = connect_encoders(sensor, hardware)
        try:
            for encoder in opened.encoders:
                turns: list[float] = []
                for _ in range(_READINGS):
                    turns.append(opened.counts(encoder) * 2.0 * math.pi / COUNTS_PER_TURN)
                    wait()
                # The mean of directions: counts around 0 must not become half a turn.
                mean = math.atan2(sum(map(math.sin, turns)), sum(map(math.cos, turns)))
                counts = round(mean * COUNTS_PER_TURN / (2.0 * math.pi)) % COUNTS_PER_TURN
                zeros[f"{sensor.name}.{encoder.joint}"] = counts
        finally:
            opened.close()
    return zeros


def real_encoders(plan: SensorPlan) -> As5600:
    """The encoders on this machine's bus.

    Raises:
        RobotError: If there is no such bus.
    """
    return connect_encoders(plan, RealHardware())


def examine_encoders(
    plan: SensorPlan, connect: Callable[[SensorPlan], As5600], *, served: bool
) -> Iterator[Finding]:
    """Whether each encoder answers, and how its magnet sits.

    Args:
        plan: The sensor.
        connect: Reaches its encoders.
        served: Whether the robot may be served now. Its guard then has the multiplexer to itself:
            a channel that somebody else opens would give it the angle of another joint.
    """
    if served:
        words = "The robot may be served now, so nobody else asks its encoders."
        yield Finding("encoders", "unknown", words)
        return
    try:
        sensor = connect(plan)
    except RobotError as error:
        yield Finding("encoders", "missing", str(error))
        return
    try:
        for encoder in sensor.encoders:
            yield _one(sensor, encoder.joint)
    finally:
        sensor.close()


def _one(sensor: As5600, joint: str) -> Finding:
    (encoder,) = (one for one in sensor.encoders if one.joint == joint)
    try:
        measured = sensor.measure(encoder)
    except RobotError as error:
        return Finding("encoders", "missing", str(error))
    if not measured.detects_magnet:
        words = f"The encoder of {joint} detects no magnet: fit one above the chip."
        return Finding("encoders", "missing", words)
    if measured.too_weak or measured.too_strong:
        way = "far from" if measured.too_weak else "near to"
        words = f"The magnet of {joint} is too {way} its encoder."
        return Finding("encoders", "missing", words)
    return Finding("encoders", "good", f"That of {joint} sees its magnet.")


def bus_speed(config: Path | None) -> Finding:
    """Whether the I2C bus is fast enough for encoders in each tick of the guard.

    Args:
        config: The config.txt of a Raspberry Pi; None without one.
    """
    if config is None:
        words = f"It should be {_FAST_HZ} bits a second, which nothing here tells."
        return Finding("I2C speed", "unknown", words)
    said = _BAUD.findall(config.read_text())
    if said and int(said[-1]) >= _FAST_HZ:
        return Finding("I2C speed", "good", f"{config} sets {said[-1]} bits a second.")
    return Finding(
        "I2C speed",
        "missing",
        f"Four encoders take 3 of every 10 ms at the usual 100000 bits a second: add "
        f"`dtparam=i2c_arm_baudrate={_FAST_HZ}` to {config} and restart the computer.",
    )


def find_zeros(plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]) -> dict[str, int]:
    """Pull all tendons gently until nothing moves, and let go.

    Nobody else may have the bus open, and somebody holds the finger straight.

    Args:
        plan: The robot.
        hardware: Where its bus is.
        wait: Lets some ten milliseconds go by.

    Returns:
        Position of each servo, in counts, by the name of its output.

    Raises:
        RobotError: If the robot has no servo bus, a servo fails, or a tendon finds no end.
    """
    # They need the SDK, which only a rig has.
    from shapechanger.robot.drivers.dynamixel.bus import ServoBus
    from shapechanger.robot.drivers.dynamixel.homing import Homing

    outputs = [output for output in plan.outputs if output.driver == "dynamixel"]
    if not outputs:
        raise RobotError(f"{plan.name} has no tendons on a servo bus, and so no zeros to find.")
    settings = bus_settings(outputs[0].settings, tuple(map(servo_settings, outputs)))
    homing = Homing(settings)
    bus = ServoBus(settings, hardware.servo_port)
    try:
        bus.set_up()
        bus.hold()
        while homing.zeros is None and not homing.failure:
            homing.see(bus.cycle(homing.tensions, hardware.clock.now_ns()))
            wait()
    finally:
        bus.close()
    if homing.zeros is None:
        raise RobotError(homing.failure)
    return homing.zeros
