"""Finds where the servos of a rig stand while the finger is straight."""

from __future__ import annotations

from collections.abc import Callable

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.plans import bus_settings, servo_settings
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["find_zeros"]


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
