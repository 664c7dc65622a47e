"""One simulated servo: its answers, its safety functions and its current control.

Assumed for want of a source, to be tried on a rig:

- A bus watchdog that trips in current mode takes the current away; torque enable stays 1
  (`on_trip` "coast"), or goes to 0 ("release"). In the manual the servo "will stop".
- Any valid instruction packet on the bus feeds the watchdog, whichever servo it is for.
- The gaps between registers cannot be read.
- Without power the count of turns is lost: the position starts again within one turn.
- It needs 0.3 s to start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Literal

from shapechanger.twin.servos.motor import SimulatedMotor, Tendon, TwinModel, twin_model
from shapechanger.twin.servos.protocol import BROADCAST, LIMIT, RANGE, Table, TableError

_PING: Final = 0x01
_READ: Final = 0x02
_WRITE: Final = 0x03
_REBOOT: Final = 0x08

_UNKNOWN_INSTRUCTION: Final = 2
_WRONG_LENGTH: Final = 5
_ALERT: Final = 0x80
_VOLTAGE: Final = 0x01
_HOT: Final = 0x04
_OVERLOAD: Final = 0x20

_COUNTS_PER_RAD: Final = 4096 / (2.0 * math.pi)
_PER_RAD_PER_S: Final = 60.0 / (2.0 * math.pi * 0.229)
_WATCHDOG_STEP_NS: Final = 20_000_000
_TRIPPED: Final = 0xFF
_START_NS: Final = 300_000_000
_GOALS: Final = (100, 102, 104, 116)
_CURRENT_MODE: Final = 0


@dataclass(slots=True)
class Faults:
    """Faults of a servo.

    Attributes:
        mute: Whether it obeys without answering.
        deaf: Whether it receives nothing, as without its data line.
        late_ns: Delay of its answers.
        bad_crc: Whether its answers are damaged.
    """

    mute: bool = False
    deaf: bool = False
    late_ns: int = 0
    bad_crc: bool = False


@dataclass(frozen=True, slots=True)
class ServoPlan:
    """A servo and what is attached to it.

    Attributes:
        id: Id on the bus.
        model: Name of its model.
        tendon: Its tendon.
        angle: Angle of the spool at power-on, with the tendon just taut, rad.
        firmware: Version of its firmware.
        on_trip: Effect of its watchdog; see the module.
    """

    id: int
    model: str = "XL330-M288"
    tendon: Tendon = field(default_factory=Tendon)
    angle: float = 1.0
    firmware: int = 52
    on_trip: Literal["coast", "release"] = "coast"


@dataclass(frozen=True, slots=True)
class StatusPacket:
    """Content of a status packet.

    Attributes:
        error: Error byte.
        data: Parameters.
    """

    error: int
    data: bytes = b""


class SimulatedServo:
    """A servo.

    Args:
        plan: The servo and its tendon.
        baud_code: Value of register 8, the baud rate.

    Attributes:
        plan: The servo and its tendon.
        model: Its model.
        faults: Its faults.
        motor: Its motor.
        volts: Voltage of its supply.
    """

    def __init__(self, plan: ServoPlan, baud_code: int = 3) -> None:
        self.plan = plan
        self.model: TwinModel = twin_model(plan.model)
        self.faults = Faults()
        self.volts = self.model.volts
        self.motor = SimulatedMotor(self.model, plan.tendon, plan.angle)
        self._table = Table(self.model, plan.id, plan.firmware, baud_code, self._check)
        self._now_ns = 0
        self._fed_ns = 0
        self._starts_until_ns = 0
        self._turns = 0  # Counts lost with the power.
        self._cache()

    @property
    def is_awake(self) -> bool:
        """True if it receives packets."""
        return self._now_ns >= self._starts_until_ns and not self.faults.deaf

    @property
    def has_torque(self) -> bool:
        """True if torque enable is on."""
        return self._torque

    @property
    def pulls_a(self) -> float:
        """Goal current in effect, A, with the sign of its registers."""
        return self._goal_a

    def register(self, at: int) -> int:
        """Return the current value of a register."""
        self._measure()
        return self._table.get(at)

    def feed_watchdog(self) -> None:
        """Notice a valid instruction packet on the bus."""
        if self.is_awake:
            self._fed_ns = self._now_ns

    def execute(self, instruction: int, parameters: bytes, addressed: int) -> StatusPacket | None:
        """Execute an instruction.

        Args:
            instruction: Code of the instruction.
            parameters: Its parameters.
            addressed: Id in the packet.

        Returns:
            The answer; None without one.
        """
        self._measure()
        try:
            data = self._do(instruction, parameters)
            error = 0
        except TableError as refusal:
            data, error = b"", refusal.number
        level = self._table.get(68)
        if instruction == _PING:
            return self._status(error, data)
        answers = level == 2 or (instruction == _READ and level == 1)
        return self._status(error, data) if answers and addressed != BROADCAST else None

    def read(self, at: int, length: int) -> StatusPacket:
        """Return the answer to a sync read."""
        self._measure()
        try:
            return self._status(0, self._table.read(at, length))
        except TableError as refusal:
            return self._status(refusal.number, b"")

    def write(self, at: int, data: bytes) -> None:
        """Execute its part of a sync write, which has no answer."""
        try:
            self._write(at, data)
        except TableError:
            return

    def overload(self) -> None:
        """Set the overload error."""
        self._fail(_OVERLOAD)

    def lose_power(self) -> None:
        """Interrupt its supply, so that it restarts."""
        self._table.lose_power()
        self._cache()
        self._turns = math.floor(self.motor.angle / (2.0 * math.pi)) * 4096
        self._starts_until_ns = self._now_ns + _START_NS
        self._fed_ns = self._starts_until_ns

    def advance(self, now_ns: int, travel_m: float) -> None:
        """Advance to a time.

        Args:
            now_ns: The time.
            travel_m: How far the tendon's far end is towards the spool, m.
        """
        dt_s = (now_ns - self._now_ns) / 1e9
        self._now_ns = now_ns
        self._watch()
        self.motor.advance(self.pulls_a, self.volts, travel_m, dt_s)
        most_c, least_v, most_v = self._limits
        if self.motor.temperature > most_c:
            self._fail(_HOT)
        if not least_v <= self.volts <= most_v:
            self._fail(_VOLTAGE)

    def _cache(self) -> None:
        """Cache the registers that are used in each step."""
        table = self._table
        self._torque = bool(table.get(64))
        steps = table.get(98)
        self._watchdog_ns = steps * _WATCHDOG_STEP_NS if self._torque and 0 < steps < 128 else None
        pulls = self._torque and steps != _TRIPPED and table.get(11) == _CURRENT_MODE
        # Other modes are not simulated.
        self._goal_a = table.get(102) * self.model.ampere_per_count if pulls else 0.0
        self._limits = (table.get(31), table.get(34) / 10, table.get(32) / 10)

    def _watch(self) -> None:
        if self._watchdog_ns is None or self._now_ns - self._fed_ns < self._watchdog_ns:
            return
        self._table.set(98, _TRIPPED)
        self._table.set(102, 0)
        if self.plan.on_trip == "release":
            self._table.set(64, 0)
        self._cache()

    def _do(self, instruction: int, parameters: bytes) -> bytes:
        if instruction == _PING:
            return self._table.read(0, 2) + self._table.read(6, 1)
        if instruction == _READ:
            if len(parameters) != 4:
                raise TableError(_WRONG_LENGTH)
            at, length = (int.from_bytes(parameters[i : i + 2], "little") for i in (0, 2))
            return self._table.read(at, length)
        if instruction == _WRITE:
            if len(parameters) < 3:
                raise TableError(_WRONG_LENGTH)
            self._write(int.from_bytes(parameters[:2], "little"), parameters[2:])
            return b""
        if instruction == _REBOOT:
            self.lose_power()
            return b""
        raise TableError(_UNKNOWN_INSTRUCTION)

    def _write(self, at: int, data: bytes) -> None:
        for register in self._table.write(at, data):
            if register == 11:  # A change of mode sets the goals to their limits.
                self._table.set(102, self._table.get(38))
                self._table.set(100, self._table.get(36))
            elif register in (64, 98):
                self._fed_ns = self._now_ns
        self._cache()

    def _check(self, at: int, value: int) -> None:
        if at in _GOALS and self._table.get(98) == _TRIPPED:
            raise TableError(RANGE)
        if at == 102 and abs(value) > self._table.get(38):
            raise TableError(LIMIT)
        if at == 64 and value and self._table.get(70) & self._table.get(63):
            raise TableError(RANGE)  # Until a reboot.

    def _fail(self, bit: int) -> None:
        self._table.set(70, self._table.get(70) | bit)
        if bit & self._table.get(63):
            self._table.set(64, 0)
        self._cache()

    def _status(self, error: int, data: bytes) -> StatusPacket:
        return StatusPacket(error | (_ALERT if self._table.get(70) else 0), data)

    def _measure(self) -> None:
        """Update the registers of its measurements."""
        motor, table = self.motor, self._table
        table.set(126, round(motor.current / self.model.ampere_per_count))
        table.set(128, round(motor.speed * _PER_RAD_PER_S))
        table.set(132, math.floor(motor.angle * _COUNTS_PER_RAD) - self._turns)
        table.set(144, round(10 * self.volts))
        table.set(146, round(motor.temperature))
