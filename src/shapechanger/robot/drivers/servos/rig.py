"""Servos of a twin on one bus, keyed by their tendons, and the load that the tendons pull."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, Protocol, get_args, runtime_checkable

from shapechanger.contract.plan import OutputPlan
from shapechanger.contract.world import World
from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.drivers.servos.simulation import COUNTS_PER_RAD, ServoPlan, SimulatedServo

_STEP_NS: Final = 1_000_000
# Of the end stops.
_SPRING_N_PER_M: Final = 300.0
_DAMPER_NS_PER_M: Final = 60.0


class Load(Protocol):
    """Load at the far ends of all tendons of a bus, such as a finger."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions for one step.

        Returns:
            How far each tendon's end is towards its spool since the beginning, m; negative away
            from it.
        """
        ...


class EndStops:
    """For each tendon a massless spring with a damper between two stops.

    Args:
        count: Number of tendons.
        nearest_m: How far an end can be pulled, m; it cannot go the other way.

    Attributes:
        travels: How far the ends are towards their spools, m.
    """

    def __init__(self, count: int, nearest_m: float = 0.02) -> None:
        self._nearest_m = nearest_m
        self.travels = [0.0] * count

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions; see `Load.pull`."""
        keep = math.exp(-dt_s * _SPRING_N_PER_M / _DAMPER_NS_PER_M)
        for i, tension in enumerate(tensions_n):
            rest = tension / _SPRING_N_PER_M
            travel = rest + keep * (self.travels[i] - rest)
            self.travels[i] = min(max(travel, 0.0), self._nearest_m)
        return self.travels


class SimulatedBus:
    """A bus with its servos.

    Assumed, as the worst case: in a sync read, servos behind a silent one stay silent.

    Args:
        plans: The servos.
        load: Load of their tendons; None for springs between two stops.

    Attributes:
        servos: Servos by id.
        now_ns: Time of the bus.
        has_power: Whether the servos have power.

    Raises:
        RobotError: If two servos have the same id.
    """

    def __init__(self, plans: Sequence[ServoPlan], load: Load | None = None) -> None:
        self.servos = {plan.id: SimulatedServo(plan) for plan in plans}
        if len(self.servos) != len(plans):
            raise RobotError("Two servos on a bus cannot have the same id.")
        self._load = EndStops(len(plans)) if load is None else load
        self._travels = [0.0] * len(plans)
        self.now_ns = 0
        self.has_power = True

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Let servos answer what they are asked for; see `ServoPort.read`."""
        replies: dict[int, ServoReply] = {}
        for servo in self._addressed(ids):
            if servo is None or servo.mute:
                break
            replies[servo.plan.id] = servo.read(at, size)
        return replies

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Let servos obey; see `ServoPort.write`."""
        replies: dict[int, ServoReply] = {}
        for servo in self._addressed(list(data)):
            if servo is not None:
                reply = servo.write(at, data[servo.plan.id])
                if not servo.mute:
                    replies[servo.plan.id] = reply
        return replies

    def set_power(self, *, on: bool) -> None:
        """Switch the supply of all servos."""
        if on != self.has_power:
            self.has_power = on
            for servo in self.servos.values():
                servo.set_power(on=on)

    def advance(self, ns: int) -> None:
        """Advance time by `ns`."""
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            before_ns, self.now_ns = self.now_ns, min(self.now_ns + _STEP_NS, end_ns)
            servos = list(self.servos.values())
            for servo, travel in zip(servos, self._travels, strict=True):
                servo.advance(self.now_ns, travel)
            dt_s = (self.now_ns - before_ns) / 1e9
            self._travels = list(self._load.pull([one.motor.tension for one in servos], dt_s))

    def set_travels(self, travels_m: Sequence[float]) -> None:
        """Set where the ends of the tendons are, m, after the load was moved from outside."""
        self._travels = list(travels_m)

    def _addressed(self, ids: Sequence[int]) -> list[SimulatedServo | None]:
        """Return servos by id, None for those that hear nothing, and feed all watchdogs."""
        awake = {one: servo for one, servo in self.servos.items() if servo.is_awake}
        for servo in awake.values():
            servo.feed_watchdog()
        return [awake.get(one) for one in ids]


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
        """Attach the tendons of a rig."""
        ...

    def travels(self) -> Sequence[float]:
        """Return how far the end of each tendon is towards its spool, m; see `Load.pull`."""
        ...


class Rig:
    """Servos on a bus, by the names of their tendons.

    Args:
        outputs: Outputs of the robot, some of which are servos on a bus.
        world: World of the robot; in a world without tendons the servos pull springs.

    Attributes:
        bus: The bus.
        is_switched: Whether its power comes from the enable line.

    Raises:
        RobotError: If the world has other tendons.
    """

    def __init__(self, outputs: Sequence[OutputPlan], world: World) -> None:
        outputs = [output for output in outputs if output.driver == DRIVER]
        settings = [output.settings for output in outputs]
        self.is_switched = not all(map(stops_itself, outputs))
        self._device = settings[0]["device"]
        self._names = tuple(output.name for output in outputs)
        self._world = world if isinstance(world, TendonWorld) else None
        stiffness = ServoPlan().stiffness if self._world is None else self._world.cable_stiffness
        plans = [
            ServoPlan(
                id=one["id"],
                model=one["model"],
                spool_radius_m=one["spool_radius_m"],
                direction=one["direction"],
                stiffness=stiffness,
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
        """Return the servo of a tendon."""
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
            motor = servo.motor
            motor.angle = servo.plan.angle + travel / servo.plan.lever_m
            motor.speed = motor.tension = 0.0
        self.bus.set_travels(travels)

    def break_servo(self, tendon: str, fault: ServoFault | str) -> None:
        """Make a servo fail.

        Args:
            tendon: Name of its tendon.
            fault: The fault; "" repairs what can be repaired.
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
                servo.motor.snapped = True
            case "power":
                servo.lose_power()
            case _:
                raise UnknownName("fault of a servo", fault, get_args(ServoFault))
