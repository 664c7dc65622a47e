"""Finds the servos of a bus and makes them ready, all without torque."""

from __future__ import annotations

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.registers import (
    BUS_WATCHDOG,
    CURRENT_LIMIT,
    CURRENT_MODE,
    DRIVE_MODE,
    FIRMWARE,
    GOAL_CURRENT,
    HARDWARE_ERROR,
    OPERATING_MODE,
    RETURN_DELAY,
    TORQUE_ENABLE,
    WATCHDOG_STEP_NS,
    Register,
    hardware_errors,
)
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.dynamixel.units import cap_count
from shapechanger.robot.drivers.dynamixel.wire import Wire

__all__ = ["find", "grip", "make_ready", "watchdog_steps"]


def watchdog_steps(bus: BusSettings) -> int:
    """The time of the watchdog in steps of 20 ms."""
    return bus.watchdog_ms * 1_000_000 // WATCHDOG_STEP_NS


def find(wire: Wire, bus: BusSettings) -> None:
    """Check that every servo answers and is what it should be.

    Raises:
        RobotError: If one is missing, is of another model, or its firmware is too old.
    """
    models = {servo.id: wire.ping(servo.id) for servo in bus.servos}
    if missing := [f"{one.name} (id {one.id})" for one in bus.servos if models[one.id] is None]:
        there = [f"{one.name} (id {one.id})" for one in bus.servos if models[one.id] is not None]
        raise RobotError(
            f"At {bus.device}, with {bus.baud} baud, no servo answers as {', '.join(missing)}; "
            f"those that do: {', '.join(there) or 'none'}. Look at power, cables, ids and baud, "
            "and at the latency timer of the adapter."
        )
    for servo in bus.servos:
        known, number = servo.known, models[servo.id]
        if number != known.number:
            raise RobotError(
                f"{servo.words} is no {known.name}: its model number is {number}, "
                f"not {known.number}."
            )
        firmware = wire.read(servo.id, FIRMWARE)
        if firmware < known.least_firmware:
            raise RobotError(
                f"{servo.words} has firmware {firmware}; its own watchdog needs "
                f"{known.least_firmware} or newer."
            )


def make_ready(wire: Wire, bus: BusSettings, servo: ServoSettings) -> None:
    """Make one servo ready to pull: current mode, its caps, no goal, and no torque.

    Raises:
        RobotError: If it does not answer, refuses, or has switched itself off.
    """
    wire.write(servo.id, TORQUE_ENABLE, 0)
    wire.write(
        servo.id, BUS_WATCHDOG, 0
    )  # A watchdog that has tripped keeps all goals as they are.
    if error := wire.read(servo.id, HARDWARE_ERROR):
        words = ", ".join(hardware_errors(error)) or f"it gives the unknown code {error}"
        raise RobotError(
            f"{servo.words} has switched itself off: {words}. Only a reboot gives it torque again, "
            "after which it must find its zero afresh."
        )
    # These last without power, and wear out: they are written only where they differ.
    _keep(wire, servo, RETURN_DELAY, 0)
    _keep(wire, servo, DRIVE_MODE, 0)
    _keep(wire, servo, OPERATING_MODE, CURRENT_MODE)
    _keep(wire, servo, CURRENT_LIMIT, cap_count(servo))
    # A change of the mode sets the goal to the limit.
    wire.write(servo.id, GOAL_CURRENT, 0)
    wire.write(servo.id, BUS_WATCHDOG, watchdog_steps(bus))


def grip(wire: Wire, bus: BusSettings, servo: ServoSettings) -> None:
    """Give one servo torque; it pulls nothing yet, and its watchdog looks after it.

    Raises:
        RobotError: If it does not answer or refuses.
    """
    wire.write(servo.id, BUS_WATCHDOG, 0)
    wire.write(servo.id, GOAL_CURRENT, 0)
    wire.write(servo.id, BUS_WATCHDOG, watchdog_steps(bus))
    wire.write(servo.id, TORQUE_ENABLE, 1)


def _keep(wire: Wire, servo: ServoSettings, register: Register, value: int) -> None:
    if wire.read(servo.id, register) != value:
        wire.write(servo.id, register, value)
