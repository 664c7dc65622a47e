"""A simulated bus of servos: answers, and advances when asked to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.twin.servos.motor import EndStops, Load
from shapechanger.robot.twin.servos.servo import ServoPlan, SimulatedServo

_STEP_NS: Final = 1_000_000


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
