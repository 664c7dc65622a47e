"""A simulated bus of servos: executes instructions, and advances when asked to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.registers import (
    READ,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    ServoReply,
)
from shapechanger.twin.servos.motor import EndStops, Load
from shapechanger.twin.servos.servo import ServoPlan, SimulatedServo

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
        self._address_size = next(iter(self.servos.values())).family.address_size
        self._load = EndStops(len(plans)) if load is None else load
        self._travels = [0.0] * len(plans)
        self.now_ns = 0
        self.has_power = True

    def execute(self, servo_id: int, instruction: int, parameters: bytes) -> dict[int, ServoReply]:
        """Execute an instruction and return the replies, by id.

        Args:
            servo_id: Id of the addressed servo; sync instructions name theirs in `parameters`.
            instruction: Code of the instruction.
            parameters: Its parameters.
        """
        for servo in self.servos.values():
            if servo.is_awake:
                servo.feed_watchdog()
        if instruction not in (SYNC_READ, SYNC_WRITE):
            reply = self._execute(servo_id, instruction, parameters)
            return {} if reply is None else {servo_id: reply}
        size = self._address_size
        span, rest = parameters[: 2 * size], parameters[2 * size :]
        if instruction == SYNC_WRITE:
            step = 1 + int.from_bytes(span[size:], "little")
            for start in range(0, len(rest), step):
                one, *data = rest[start : start + step]
                self._execute(one, WRITE, span[:size] + bytes(data))
            return {}
        replies: dict[int, ServoReply] = {}
        for one in rest:
            if (reply := self._execute(one, READ, span)) is None:
                break
            replies[one] = reply
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

    def _execute(self, servo_id: int, instruction: int, parameters: bytes) -> ServoReply | None:
        """Let one servo execute an instruction; None if it does not reply."""
        servo = self.servos.get(servo_id)
        if servo is None or not servo.is_awake:
            return None
        reply = servo.execute(instruction, parameters)
        return None if servo.mute else reply
