"""The encoders at a robot's joints, with what they measure."""

from __future__ import annotations

from functools import partial
from typing import Final, Protocol, runtime_checkable

from shapechanger.robot.drivers.settings import texts, whole, wholes
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.twin.chips.as5600 import As5600
from shapechanger.twin.chips.chip import Chip
from shapechanger.twin.chips.tca9548a import Behind, Tca9548a
from shapechanger.worlds.world import World

__all__ = ["JointWorld", "joint_chips"]

_AS5600: Final = 0x36


@runtime_checkable
class JointWorld(Protocol):
    """A world with joints that somebody measures."""

    def measured_angle(self, joint: str) -> float:
        """One reading of the angle of a joint, rad, with the noise of its sensor.

        Raises:
            RobotError: If there is no such joint.
        """
        ...


def joint_chips(plan: SensorPlan, world: World) -> dict[tuple[int, int], Chip]:
    """The multiplexer and what is behind it, by bus and address.

    Args:
        plan: The encoders of some joints.
        world: What they measure; where it has no joints they stand at their zero.

    Raises:
        RobotError: If the world has other joints.
    """
    measured = world.measured_angle if isinstance(world, JointWorld) else _at_zero
    columns = (wholes(plan.settings, key) for key in ("channels", "zeros", "directions"))
    behind: dict[int, Chip] = {}
    for joint, *row in zip(texts(plan.settings, "joints"), *columns, strict=True):
        measured(joint)  # Says in words what it does not know.
        channel, zero, direction = row
        behind[channel] = As5600(joint, partial(measured, joint), zero, direction)
    bus, mux = whole(plan.settings, "bus"), Tca9548a(behind)
    return {(bus, whole(plan.settings, "mux")): mux, (bus, _AS5600): Behind(mux)}


def _at_zero(joint: str) -> float:
    return 0.0
