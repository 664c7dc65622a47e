"""One simulated servo: its registers, its safety functions and its current control.

Source: ROBOTIS e-manual, control tables and DYNAMIXEL Protocol 2.0. It has the registers that the
driver uses. Assumed for want of a source, to be tried on a rig:

- A bus watchdog that trips in current mode takes the current away; torque enable stays 1
  (`on_trip` "coast"), or goes to 0 ("release"). In the manual the servo "will stop".
- Any valid instruction on the bus feeds the watchdog, whichever servo it is for.
- The gaps between registers cannot be read, nor parts of registers. (Real servos may answer 0 for
  the gaps, so a driver must not rely on an error.)
- Without power the count of turns is lost: the position starts again within one turn.
- It needs 0.3 s to start.
- In current-based position mode (5) the current is proportional to the error of the position, with
  that of a stall at 1/32 turn, and within the goal current.
"""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from shapechanger.robot.drivers.dynamixel.protocol import (
    ALERT,
    BUS_WATCHDOG,
    CURRENT_LIMIT,
    CURRENT_MODE,
    DRIVE_MODE,
    FIRMWARE,
    GOAL_CURRENT,
    GOAL_POSITION,
    HARDWARE_ERROR,
    LENGTH_MODE,
    OPERATING_MODE,
    PING,
    PRESENT_POSITION,
    READ,
    REBOOT,
    RETURN_DELAY,
    TORQUE_ENABLE,
    TRIPPED,
    WATCHDOG_STEP_NS,
    WRITE,
    Register,
    ServoReply,
)
from shapechanger.robot.drivers.dynamixel.settings import COUNTS_PER_TURN
from shapechanger.twin.servos.motor import SimulatedMotor, Tendon, motor_model

_MODEL_NUMBER: Final = Register("model number", 0, 2)
_PRESENT_CURRENT: Final = Register("present current", 126, 2, signed=True)
_PRESENT_VELOCITY: Final = Register("present velocity", 128, 4, signed=True)
_VELOCITY_TRAJECTORY: Final = Register("velocity trajectory", 136, 4, signed=True)
_POSITION_TRAJECTORY: Final = Register("position trajectory", 140, 4, signed=True)
_PRESENT_VOLTAGE: Final = Register("present input voltage", 144, 2)
_PRESENT_TEMPERATURE: Final = Register("present temperature", 146, 1)
_EEPROM_END: Final = 64
_OPERATING_MODES: Final = (0, 1, 3, 4, 5, 16)

# Reasons of refusals.
_UNKNOWN_INSTRUCTION: Final = 2
_RANGE: Final = 4
_LENGTH: Final = 5
_LIMIT: Final = 6
_ACCESS: Final = 7

# Bits of the hardware error status.
_VOLTAGE: Final = 0x01
_HOT: Final = 0x04
_OVERLOAD: Final = 0x20

_COUNTS_PER_RAD: Final = COUNTS_PER_TURN / (2.0 * math.pi)
_PER_RAD_PER_S: Final = 60.0 / (2.0 * math.pi * 0.229)
_START_NS: Final = 300_000_000
_STALL_AT: Final = 2.0 * math.pi / 32.0  # rad.


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


class _Refusal(Exception):
    """An instruction that the servo refuses; its argument is the number of the reason."""


class _Field(NamedTuple):
    """A register, its value at delivery, and the values that it takes; None if read-only."""

    register: Register
    initial: int
    values: Container[int] | None = None


class SimulatedServo:
    """A servo.

    Args:
        plan: The servo and its tendon.

    Attributes:
        plan: The servo and its tendon.
        mute: Whether it obeys without answering.
        deaf: Whether it receives nothing, as without its data line.
        motor: Its motor.
        volts: Voltage of its supply.

    Raises:
        UnknownName: If there is no such model.
    """

    def __init__(self, plan: ServoPlan) -> None:
        motor = motor_model(plan.model)
        self.plan = plan
        self.mute = self.deaf = False
        self.volts = motor.servo.volts
        self.motor = SimulatedMotor(motor, plan.tendon, plan.angle)
        self._model = motor.servo
        self._shutdown = motor.shutdown
        most = self._model.most_counts
        fields = (
            _Field(_MODEL_NUMBER, self._model.number),
            _Field(FIRMWARE, plan.firmware),
            _Field(RETURN_DELAY, 250, range(255)),
            _Field(DRIVE_MODE, 0, range(14)),
            _Field(OPERATING_MODE, 3, _OPERATING_MODES),
            _Field(CURRENT_LIMIT, most, range(most + 1)),
            _Field(TORQUE_ENABLE, 0, range(2)),
            _Field(HARDWARE_ERROR, 0),
            _Field(BUS_WATCHDOG, 0, range(128)),
            _Field(GOAL_CURRENT, most, range(-32768, 32768)),
            _Field(GOAL_POSITION, 0, range(-1_048_575, 1_048_576)),
            _Field(_PRESENT_CURRENT, 0),
            _Field(_PRESENT_VELOCITY, 0),
            _Field(PRESENT_POSITION, 0),
            _Field(_VELOCITY_TRAJECTORY, 0),
            _Field(_POSITION_TRAJECTORY, 0),
            _Field(_PRESENT_VOLTAGE, 0),
            _Field(_PRESENT_TEMPERATURE, 0),
        )
        self._fields = {one.register.address: one for one in fields}
        self._values = {one.register: one.initial for one in fields}
        self._now_ns = 0
        self._fed_ns = 0
        self._starts_until_ns = 0
        self._turns = 0  # Counts lost with the power.
        self._cache()

    @property
    def is_awake(self) -> bool:
        """True if it receives instructions."""
        return self._now_ns >= self._starts_until_ns and not self.deaf

    @property
    def has_torque(self) -> bool:
        """True if torque enable is on."""
        return bool(self._values[TORQUE_ENABLE])

    @property
    def pulls_a(self) -> float:
        """Goal current in effect, A, with the sign of its registers; in mode 5 its limit."""
        return self._goal_a

    def register(self, at: int) -> int:
        """Return the current value of the register at an address."""
        self._measure()
        return self._values[self._fields[at].register]

    def feed_watchdog(self) -> None:
        """Notice a valid instruction on the bus."""
        self._fed_ns = self._now_ns

    def execute(self, instruction: int, parameters: bytes) -> ServoReply:
        """Execute an instruction and return the reply.

        Args:
            instruction: Code of the instruction.
            parameters: Its parameters.
        """
        try:
            error, data = 0, self._do(instruction, parameters)
        except _Refusal as refusal:
            error, data = refusal.args[0], b""
        return ServoReply(error | (ALERT if self._values[HARDWARE_ERROR] else 0), data)

    def overload(self) -> None:
        """Set the overload error."""
        self._fail(_OVERLOAD)

    def lose_power(self) -> None:
        """Interrupt its supply, so that it restarts."""
        for at, one in self._fields.items():
            if at >= _EEPROM_END:
                self._values[one.register] = one.initial
        self._turns = math.floor(self.motor.angle / (2.0 * math.pi)) * COUNTS_PER_TURN
        self._starts_until_ns = self._now_ns + _START_NS
        self._fed_ns = self._starts_until_ns
        self._cache()

    def advance(self, now_ns: int, travel_m: float) -> None:
        """Advance to a time.

        Args:
            now_ns: The time, ns.
            travel_m: How far the tendon's far end is towards the spool, m.
        """
        dt_s = (now_ns - self._now_ns) / 1e9
        self._now_ns = now_ns
        if self._watchdog_ns is not None and now_ns - self._fed_ns >= self._watchdog_ns:
            self._trip()
        self.motor.advance(self._controlled_a(), self.volts, travel_m, dt_s)
        if self.motor.temperature > self._model.most_c:
            self._fail(_HOT)
        if not self._model.least_v <= self.volts <= self._model.most_v:
            self._fail(_VOLTAGE)

    def _controlled_a(self) -> float:
        """Return the current that its controller asks for, A."""
        if self._goal_angle is None:
            return self._goal_a
        limit = abs(self._goal_a)
        wanted = self._model.stall_a * (self._goal_angle - self.motor.angle) / _STALL_AT
        return min(max(wanted, -limit), limit)

    def _cache(self) -> None:
        """Cache what each step needs of the registers."""
        values = self._values
        steps = values[BUS_WATCHDOG]
        counts = self.has_torque and 0 < steps < TRIPPED
        self._watchdog_ns = steps * WATCHDOG_STEP_NS if counts else None
        mode = values[OPERATING_MODE]
        known = mode in (CURRENT_MODE, LENGTH_MODE)  # Others are not simulated.
        pulls = self.has_torque and steps != TRIPPED and known
        counts_ahead = values[GOAL_POSITION] + self._turns + 0.5
        self._goal_angle = counts_ahead / _COUNTS_PER_RAD if mode == LENGTH_MODE else None
        self._goal_a = values[GOAL_CURRENT] * self._model.ampere_per_count if pulls else 0.0

    def _trip(self) -> None:
        self._values[BUS_WATCHDOG] = TRIPPED
        self._values[GOAL_CURRENT] = 0
        if self.plan.on_trip == "release":
            self._values[TORQUE_ENABLE] = 0
        self._cache()

    def _fail(self, bit: int) -> None:
        self._values[HARDWARE_ERROR] |= bit
        if bit & self._shutdown:
            self._values[TORQUE_ENABLE] = 0
        self._cache()

    def _do(self, instruction: int, parameters: bytes) -> bytes:
        at = int.from_bytes(parameters[:2], "little")
        if instruction == PING:
            return self._read(0, 2) + self._read(FIRMWARE.address, FIRMWARE.size)
        if instruction == READ:
            return self._read(at, int.from_bytes(parameters[2:4], "little"))
        if instruction == WRITE:
            self._write(at, parameters[2:])
        elif instruction == REBOOT:
            self.lose_power()
        else:
            raise _Refusal(_UNKNOWN_INSTRUCTION)
        return b""

    def _read(self, at: int, length: int) -> bytes:
        self._measure()
        data = b""
        while len(data) < length:
            if (one := self._fields.get(at + len(data))) is None:
                raise _Refusal(_ACCESS)
            data += one.register.encode(self._values[one.register])
        if len(data) != length or not length:
            raise _Refusal(_ACCESS)
        return data

    def _write(self, at: int, data: bytes) -> None:
        """Write registers: all of them, or none if one is refused."""
        new: dict[Register, int] = {}
        while data:
            one = self._fields.get(at)
            if one is None or one.values is None:
                raise _Refusal(_ACCESS)
            register = one.register
            if len(data) < register.size:
                raise _Refusal(_LENGTH)
            if at < _EEPROM_END and self.has_torque:
                raise _Refusal(_ACCESS)  # Locked while torque is on.
            new[register] = value = register.decode(data)
            if value not in one.values:
                raise _Refusal(_RANGE)
            self._check(register, value)
            at, data = at + register.size, data[register.size :]
        if not new:
            raise _Refusal(_LENGTH)
        self._values |= new
        if OPERATING_MODE in new:  # A change of mode sets the goal to its limit.
            self._values[GOAL_CURRENT] = self._values[CURRENT_LIMIT]
        if TORQUE_ENABLE in new or BUS_WATCHDOG in new:
            self._fed_ns = self._now_ns
        self._cache()

    def _check(self, register: Register, value: int) -> None:
        """Refuse a value that the present state of the servo does not allow."""
        if register == GOAL_CURRENT and self._values[BUS_WATCHDOG] == TRIPPED:
            raise _Refusal(_RANGE)
        if register == GOAL_CURRENT and abs(value) > self._values[CURRENT_LIMIT]:
            raise _Refusal(_LIMIT)
        failed = self._values[HARDWARE_ERROR] & self._shutdown
        if register == TORQUE_ENABLE and value and failed:
            raise _Refusal(_RANGE)  # Until a reboot.

    def _measure(self) -> None:
        """Update the registers of its measurements."""
        motor, values = self.motor, self._values
        values[_PRESENT_CURRENT] = round(motor.current / self._model.ampere_per_count)
        values[_PRESENT_VELOCITY] = round(motor.speed * _PER_RAD_PER_S)
        values[PRESENT_POSITION] = math.floor(motor.angle * _COUNTS_PER_RAD) - self._turns
        values[_PRESENT_VOLTAGE] = round(10 * self.volts)
        values[_PRESENT_TEMPERATURE] = round(motor.temperature)
