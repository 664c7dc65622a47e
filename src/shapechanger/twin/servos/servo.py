"""One servo: what it answers, when it stops by itself, and what it does with its current.

Assumed, because no source tells it; each is to be tried on a rig:

- A bus watchdog that trips in current mode takes the current away; torque enable stays 1
  (`on_trip` "coast"), or goes to 0 ("release"). The manual says that the servo "will stop".
- Any whole instruction packet on the bus feeds the watchdog, whomever it is for.
- The gaps between registers cannot be read.
- Without power the count of turns is lost: the position begins again within one turn.
- It needs 0.3 s to start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Literal

from shapechanger.twin.servos.models import TwinModel, twin_model
from shapechanger.twin.servos.motor import SimulatedMotor, Tendon
from shapechanger.twin.servos.protocol import BROADCAST, LIMIT, RANGE, Table, TableError

__all__ = ["Faults", "ServoPlan", "SimulatedServo", "StatusPacket"]

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
    """What can be wrong with a servo, to be set by a test.

    Attributes:
        mute: It obeys and says nothing.
        deaf: It hears nothing: as without its cable, but with power.
        late_ns: How long after everybody else it answers.
        bad_crc: Its answers are damaged.
    """

    mute: bool = False
    deaf: bool = False
    late_ns: int = 0
    bad_crc: bool = False


@dataclass(frozen=True, slots=True)
class ServoPlan:
    """A servo as it is attached.

    Attributes:
        id: Its id.
        model: Name of its model.
        tendon: What it pulls.
        angle: Of its spool when power comes, rad. Its tendon is just taut then.
        firmware: Version.
        fast: Whether it knows the fast sync read.
        on_trip: What its watchdog does; see the module.
    """

    id: int
    model: str = "XL330-M288"
    tendon: Tendon = field(default_factory=Tendon)
    angle: float = 1.0
    firmware: int = 52
    fast: bool = True
    on_trip: Literal["coast", "release"] = "coast"


@dataclass(frozen=True, slots=True)
class StatusPacket:
    """What goes into a status packet.

    Attributes:
        error: Error byte.
        data: Parameters.
    """

    error: int
    data: bytes = b""


class SimulatedServo:
    """One servo.

    Args:
        plan: How it is attached.
        baud_code: Register 8.

    Attributes:
        faults: What is wrong with it.
        motor: How it turns.
        volts: Of its supply.
    """

    def __init__(self, plan: ServoPlan, baud_code: int = 3) -> None:
        self.plan = plan
        self.model: TwinModel = twin_model(plan.model)
        self.faults = Faults()
        self.volts = self.model.volts
        self.motor = SimulatedMotor(self.model, plan.tendon, plan.angle)
        self._table = Table(self.model, plan.id, plan.firmware, baud_code, self._check)
        self._now_ns = 0
        self._heard_ns = 0
        self._starts_until_ns = 0
        self._turns = 0  # Counts that were forgotten with the power.
        self._recall()

    @property
    def is_awake(self) -> bool:
        """Whether it hears and obeys."""
        return self._now_ns >= self._starts_until_ns and not self.faults.deaf

    @property
    def has_torque(self) -> bool:
        """Whether torque enable is on."""
        return self._torque

    @property
    def pulls_a(self) -> float:
        """The current that it is told to let flow, A, with the sign of its registers."""
        return self._goal_a

    def register(self, at: int) -> int:
        """What is in a register now, for a test to look at."""
        self._show()
        return self._table.get(at)

    def hear(self) -> None:
        """A whole instruction packet came by, for whomever."""
        if self.is_awake:
            self._heard_ns = self._now_ns

    def obey(self, instruction: int, parameters: bytes, addressed: int) -> StatusPacket | None:
        """Do what an instruction says.

        Args:
            instruction: Its code.
            parameters: What it needs.
            addressed: The id in the packet.

        Returns:
            What it answers; None where it does not.
        """
        self._show()
        try:
            data = self._do(instruction, parameters)
            error = 0
        except TableError as refusal:
            data, error = b"", refusal.number
        level = self._table.get(68)
        if instruction == _PING or (instruction == _READ and level >= 1) or level == 2:
            return (
                None if addressed == BROADCAST and instruction != _PING else self._said(error, data)
            )
        return None

    def read(self, at: int, length: int) -> StatusPacket:
        """What it says in a sync read."""
        self._show()
        try:
            return self._said(0, self._table.read(at, length))
        except TableError as refusal:
            return self._said(refusal.number, b"")

    def write(self, at: int, data: bytes) -> None:
        """Obey its part of a sync write; nobody hears of a refusal."""
        try:
            self._write(at, data)
        except TableError:
            return

    def overload(self) -> None:
        """Let it notice that it is overloaded."""
        self._fail(_OVERLOAD)

    def lose_power(self) -> None:
        """Let its supply dip, so that it starts afresh."""
        self._table.lose_power()
        self._recall()
        self._turns = math.floor(self.motor.angle / (2.0 * math.pi)) * 4096
        self._starts_until_ns = self._now_ns + _START_NS
        self._heard_ns = self._starts_until_ns

    def advance(self, now_ns: int, travel_m: float) -> None:
        """Go on to a time, with the tendon's far end there.

        Args:
            now_ns: The time.
            travel_m: Where the tendon's far end is, m towards the spool.
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

    def _recall(self) -> None:
        """Look at the registers that count all the time; they are asked for in each step."""
        table = self._table
        self._torque = bool(table.get(64))
        steps = table.get(98)
        self._patience_ns = steps * _WATCHDOG_STEP_NS if self._torque and 0 < steps < 128 else None
        pulls = self._torque and steps != _TRIPPED and table.get(11) == _CURRENT_MODE
        # The twin has no other mode.
        self._goal_a = table.get(102) * self.model.ampere_per_count if pulls else 0.0
        self._limits = (table.get(31), table.get(34) / 10, table.get(32) / 10)

    def _watch(self) -> None:
        if self._patience_ns is None or self._now_ns - self._heard_ns < self._patience_ns:
            return
        self._table.set(98, _TRIPPED)
        self._table.set(102, 0)
        if self.plan.on_trip == "release":
            self._table.set(64, 0)
        self._recall()

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
            if register == 11:  # A change of the mode sets the goals to their limits.
                self._table.set(102, self._table.get(38))
                self._table.set(100, self._table.get(36))
            elif register in (64, 98):
                self._heard_ns = self._now_ns
        self._recall()

    def _check(self, at: int, value: int) -> None:
        if at in _GOALS and self._table.get(98) == _TRIPPED:
            raise TableError(RANGE)
        if at == 102 and abs(value) > self._table.get(38):
            raise TableError(LIMIT)
        if at == 64 and value and self._table.get(70) & self._table.get(63):
            raise TableError(RANGE)  # Only a reboot gives torque again.

    def _fail(self, bit: int) -> None:
        self._table.set(70, self._table.get(70) | bit)
        if bit & self._table.get(63):
            self._table.set(64, 0)
        self._recall()

    def _said(self, error: int, data: bytes) -> StatusPacket:
        return StatusPacket(error | (_ALERT if self._table.get(70) else 0), data)

    def _show(self) -> None:
        """Put what it measures into its registers."""
        motor, table = self.motor, self._table
        table.set(126, round(motor.current / self.model.ampere_per_count))
        table.set(128, round(motor.speed * _PER_RAD_PER_S))
        table.set(132, math.floor(motor.angle * _COUNTS_PER_RAD) - self._turns)
        table.set(144, round(10 * self.volts))
        table.set(146, round(motor.temperature))
