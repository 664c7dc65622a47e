"""Zeros of joint encoders and tendon servos, measured while the finger is straight."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.as5600 import COUNTS_PER_TURN, connect_encoders
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.homing import Homing
from shapechanger.robot.drivers.servos.settings import DRIVER, bus_settings
from shapechanger.robot.guard.outputs import Switches
from shapechanger.robot.hardware import Hardware

_START_TICKS: Final = 50  # Half a second, in which servos start that get their power now.
_READINGS: Final = 50  # Half a second; single readings differ by a count or two.


def find_joint_zeros(
    plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]
) -> dict[str, int]:
    """Average the encoder readings while a person holds the joints straight.

    Args:
        plan: Settings of the robot.
        hardware: Gives access to its buses.
        wait: Waits for about 10 ms.

    Returns:
        Counts of each encoder, 0 to 4095, by the names of sensor and joint, such as
        `joints.MCP_flexion`; empty for a robot without encoders.
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
                # The mean direction: the mean of counts around 0 would be half a turn.
                mean = math.atan2(sum(map(math.sin, turns)), sum(map(math.cos, turns)))
                counts = round(mean * COUNTS_PER_TURN / (2.0 * math.pi)) % COUNTS_PER_TURN
                zeros[f"{sensor.name}.{encoder.joint}"] = counts
        finally:
            opened.close()
    return zeros


def find_zeros(plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]) -> dict[str, int]:
    """Pull all tendons gently until nothing moves, and release them.

    A person holds the finger straight, and no other process may have the bus open.

    Args:
        plan: Settings of the robot.
        hardware: Gives access to its bus.
        wait: Waits for about 10 ms.

    Returns:
        Position of each servo, counts, by the name of its output.
    """
    outputs = [output for output in plan.outputs if output.driver == DRIVER]
    if not outputs:
        raise RobotError(f"{plan.name} has no tendons on a servo bus.")
    settings = bus_settings(outputs)
    homing = Homing(settings)
    switches = Switches(plan, hardware)
    try:
        bus = ServoBus(settings, hardware.servo_port(settings))
        try:
            for _ in range(_START_TICKS if plan.enable_pin is not None else 0):
                switches.toggle()
                wait()
            bus.set_up(switches.toggle)
            bus.hold()
            while homing.zeros is None and not homing.failure:
                switches.toggle()
                bus.send(homing.tensions)
                homing.see(bus.cycle(hardware.clock.now_ns()))
                wait()
        finally:
            bus.close()
    finally:
        switches.close()
    if homing.zeros is None:
        raise RobotError(homing.failure)
    return homing.zeros
