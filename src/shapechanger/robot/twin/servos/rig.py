"""Servos of a robot by the names of their tendons, and what the tendons pull."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, Protocol, get_args, runtime_checkable

from shapechanger.contract.plan import GuardPlan
from shapechanger.contract.world import World
from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.twin.servos.bus import SimulatedBus
from shapechanger.robot.twin.servos.motor import Load, Tendon
from shapechanger.robot.twin.servos.servo import COUNTS_PER_RAD, ServoPlan, SimulatedServo

ServoFault = Literal["", "mute", "deaf", "hot", "overload", "snapped", "power"]
"""Faults of a servo.

"mute": it obeys without answering. "deaf": it receives nothing. "hot", "overload": it shuts itself
off. "snapped": its tendon is torn for good. "power": its power fails for a moment. "" repairs
"mute", "deaf" and "hot".
"""

_HOT_C: Final = 75.0
_WELL_C: Final = 30.0


@runtime_checkable
class TendonWorld(Load, Protocol):
    """A world that tendons pull at, as their load."""

    @property
    def cable_stiffness(self) -> float:
        """Stiffness of the tendons, N/m."""
        ...

    def connect(self, tendons: Sequence[str], rig: Rig) -> None:
        """Attach the tendons of a rig.

        Args:
            tendons: Names, in the order of the servos.
            rig: The rig; its `settle` is to be called after each change of posture.

        Raises:
            RobotError: If the world has other tendons.
        """
        ...

    def travels(self) -> Sequence[float]:
        """Return how far the end of each tendon is towards its spool, m; see `Load.pull`."""
        ...


class Rig:
    """Servos on a bus, by the names of their tendons.

    Args:
        plan: The robot as it is wired, which has servos on a bus.
        world: World of the robot; in a world without tendons the servos pull springs.

    Attributes:
        bus: The bus.
        is_switched: Whether its power comes from the enable line.

    Raises:
        RobotError: If the world has other tendons.
    """

    def __init__(self, plan: GuardPlan, world: World) -> None:
        outputs = [output for output in plan.outputs if output.driver == DRIVER]
        settings = [output.settings for output in outputs]
        self.is_switched = not all(map(stops_itself, outputs))
        self._device = settings[0]["device"]
        self._names = tuple(output.name for output in outputs)
        self._world = world if isinstance(world, TendonWorld) else None
        stiffness = Tendon().stiffness if self._world is None else self._world.cable_stiffness
        plans = [
            ServoPlan(
                id=one["id"],
                model=one["model"],
                tendon=Tendon(one["spool_radius_m"], one["direction"], stiffness),
                # In the middle of a count, as it stands while the finger is straight.
                angle=(one["zero"] + 0.5) / COUNTS_PER_RAD,
            )
            for one in settings
        ]
        if self._world is not None:
            self._world.connect(self._names, self)
        self.bus = SimulatedBus(plans, self._world)
        self._servos = dict(zip(self._names, self.bus.servos.values(), strict=True))
        self.bus.set_power(on=not self.is_switched)
        self.settle()

    def require(self, device: str) -> None:
        """Raise RobotError if the bus is at another device."""
        if device != self._device:
            raise RobotError(f"There is no {device} at this twin, only {self._device}.")

    def servo(self, tendon: str) -> SimulatedServo:
        """Return the servo of a tendon.

        Raises:
            UnknownName: If there is no such tendon.
        """
        if tendon not in self._servos:
            raise UnknownName("tendon", tendon, self._servos)
        return self._servos[tendon]

    def tensions(self) -> dict[str, float]:
        """Return the tension of each tendon, N, by name."""
        return {name: servo.motor.tension for name, servo in self._servos.items()}

    def settle(self) -> None:
        """Turn all spools until their tendons are just taut, as a person does by hand."""
        if self._world is None:
            return
        travels = list(self._world.travels())
        for servo, travel in zip(self._servos.values(), travels, strict=True):
            tendon, motor = servo.plan.tendon, servo.motor
            motor.angle = servo.plan.angle + travel / (tendon.direction * tendon.spool_radius_m)
            motor.speed = motor.tension = 0.0
        self.bus.set_travels(travels)

    def break_servo(self, tendon: str, fault: ServoFault | str) -> None:
        """Make a servo fail.

        Args:
            tendon: Name of its tendon.
            fault: The fault; "" repairs what can be repaired.

        Raises:
            UnknownName: If there is no such tendon, or no such fault.
        """
        servo = self.servo(tendon)
        match fault:
            case "":
                servo.mute = servo.deaf = False
                servo.motor.temperature = min(servo.motor.temperature, _WELL_C)
            case "mute":
                servo.mute = True
            case "deaf":
                servo.deaf = True
            case "hot":
                servo.motor.temperature = _HOT_C
            case "overload":
                servo.overload()
            case "snapped":
                servo.plan.tendon.snapped = True
            case "power":
                servo.lose_power()
            case _:
                raise UnknownName("fault of a servo", fault, get_args(ServoFault))
