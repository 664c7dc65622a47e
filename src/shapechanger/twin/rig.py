"""The servo bus of a robot, with what its tendons pull at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, Protocol, get_args, runtime_checkable

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.settings import number, text, whole
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.twin.servos.bus import SimulatedBus
from shapechanger.twin.servos.motor import EndStops, Load, Tendon
from shapechanger.twin.servos.servo import ServoPlan, SimulatedServo
from shapechanger.worlds.world import World

__all__ = ["Rig", "ServoFault", "TendonWorld", "rig_of"]

ServoFault = Literal["", "mute", "deaf", "hot", "overload", "snapped", "power"]
"""What can happen to a servo: it says nothing, hears nothing, is too hot, is overloaded, has lost
its tendon for good, or loses its power for a moment. "" makes it speak and cool."""

_COUNTS_PER_RAD: Final = 4096 / (2.0 * math.pi)
_HOT_C: Final = 75.0
_WELL_C: Final = 30.0


@runtime_checkable
class TendonWorld(Protocol):
    """A world that tendons pull at."""

    @property
    def cable_stiffness(self) -> float:
        """Of the tendons between servos and what they move, N/m."""
        ...

    def connect(self, tendons: Sequence[str], rig: Rig) -> Load:
        """Be what these tendons pull at, in this order; the rig is told when it is put somewhere.

        Raises:
            RobotError: If it has other tendons.
        """
        ...

    def travels(self) -> Sequence[float]:
        """How far the end of each tendon is towards its spool, m, as `Load.pull` says."""
        ...


class Rig:
    """Servos on a line, by the names of their tendons.

    Args:
        plan: The robot; it has outputs with the driver dynamixel.
        world: Where it is; its tendons are pulled where it has some, and springs elsewhere.

    Attributes:
        line: The bus.

    Raises:
        RobotError: If the world has other tendons.
    """

    def __init__(self, plan: GuardPlan, world: World) -> None:
        outputs = [output for output in plan.outputs if output.driver == "dynamixel"]
        settings = [output.settings for output in outputs]
        self._device = text(settings[0], "device")
        self._names = tuple(output.name for output in outputs)
        self._world = world if isinstance(world, TendonWorld) else None
        stiffness = Tendon().stiffness if self._world is None else self._world.cable_stiffness
        plans = [
            ServoPlan(
                id=whole(one, "id"),
                model=text(one, "model"),
                tendon=Tendon(number(one, "spool_radius_m"), whole(one, "direction"), stiffness),
                # In the middle of a count: where it stands while the finger is straight.
                angle=(whole(one, "zero") + 0.5) / _COUNTS_PER_RAD,
            )
            for one in settings
        ]
        load: Load = EndStops(len(plans))
        if self._world is not None:
            load = self._world.connect(self._names, self)
        self.line = SimulatedBus(plans, load, whole(settings[0], "baud"))
        self._servos = dict(zip(self._names, self.line.servos.values(), strict=True))
        self.settle()

    def require(self, device: str) -> None:
        """Refuse a bus that is not there.

        Raises:
            RobotError: If it is at another device.
        """
        if device != self._device:
            raise RobotError(f"There is no {device} at this twin, only {self._device}.")

    def servo(self, tendon: str) -> SimulatedServo:
        """The servo of a tendon.

        Raises:
            UnknownName: If there is no such tendon.
        """
        if tendon not in self._servos:
            raise UnknownName("tendon", tendon, self._servos)
        return self._servos[tendon]

    def tensions(self) -> dict[str, float]:
        """What each tendon is pulled with, N, by name."""
        return {name: servo.motor.tension for name, servo in self._servos.items()}

    def settle(self) -> None:
        """Turn all spools so that their tendons are just taut, as a person does by hand."""
        if self._world is None:
            return
        travels = list(self._world.travels())
        for servo, travel in zip(self._servos.values(), travels, strict=True):
            tendon, motor = servo.plan.tendon, servo.motor
            motor.angle = servo.plan.angle + travel / (tendon.direction * tendon.spool_radius_m)
            motor.speed = motor.tension = 0.0
        self.line.set_travels(travels)

    def break_servo(self, tendon: str, how: ServoFault) -> None:
        """Let something happen to a servo; "" takes back what can be taken back.

        Raises:
            UnknownName: If there is no such tendon, or no such fault.
        """
        servo = self.servo(tendon)
        if how not in get_args(ServoFault):  # It may have come from another process.
            raise UnknownName("fault of a servo", str(how), get_args(ServoFault))
        match how:
            case "":
                servo.faults.mute = servo.faults.deaf = False
                servo.motor.temperature = min(servo.motor.temperature, _WELL_C)
            case "mute":
                servo.faults.mute = True
            case "deaf":
                servo.faults.deaf = True
            case "hot":
                servo.motor.temperature = _HOT_C
            case "overload":
                servo.overload()
            case "snapped":
                servo.plan.tendon.snapped = True
            case "power":
                servo.lose_power()


def rig_of(plan: GuardPlan, world: World) -> Rig | None:
    """The servos of a robot; None for one without a servo bus.

    Raises:
        RobotError: If the world has other tendons.
    """
    if not any(output.driver == "dynamixel" for output in plan.outputs):
        return None
    return Rig(plan, world)
