"""A simulated servo: its motor, its registers, its safety functions and its control.

Sources as of `shapechanger.robot.drivers.servos.family`, whose registers it has. Assumed for
want of a source, to be tried on a rig:

- A bus watchdog that trips in current mode takes the current away; torque enable stays 1
  (`on_trip` "coast"), or goes to 0 ("release"). In the manual the servo "will stop".
- Any valid instruction on the bus feeds the watchdog, whichever servo it is for.
- The gaps between registers cannot be read, nor parts of registers, but for those in the block of
  present values. (Real servos may answer 0 for the gaps, so a driver must not rely on an error.)
- Without power the count of turns is lost: the position starts again within one turn.
- It needs 0.3 s to start.
- With control of the length the current is proportional to the error of the position, with that of
  a stall at 1/32 turn, and within the goal. That is 32 times 0.166 per rad in `bam`'s STS3215.
- The goal of a Feetech servo limits the voltage, and with it the torque of a motor at rest.
- A Feetech servo does not tell which instructions it refuses, and refuses to write to its EEPROM
  while that is locked. An overload takes its torque away until it has lost its power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.robot.drivers.servos.family import (
    COUNTS_PER_TURN,
    MODELS,
    TRIPPED,
    WATCHDOG_STEP_MS,
    Register,
)
from shapechanger.robot.drivers.servos.registers import ServoReply

# Heat, all chosen for want of a source: a servo that stalls with half its current gets some 55
# degrees warmer, with a time constant of two minutes.
_ROOM_C: Final = 25.0
_KELVIN_PER_WATT: Final = 30.0
_HEAT_S: Final = 120.0


@dataclass(frozen=True, slots=True)
class ServoPlan:
    """A servo, its spool and its tendon.

    Attributes:
        id: Id on the bus.
        model: Name of its model.
        spool_radius_m: Radius of the spool, m.
        direction: 1 if a positive angle winds in, -1 if it lets out.
        stiffness: Stiffness of cable and frame, N/m. Chosen: a good millimetre for 25 N. The end
            of the load needs a mass of more than 0.01 kg to follow such a spring in steps of 1 ms.
        angle: Angle of the spool at power-on, with the tendon just taut, rad.
        firmware: Version of its firmware.
        on_trip: Effect of its watchdog; see the module.
    """

    id: int = 1
    model: str = "XL330-M288"
    spool_radius_m: float = 0.005
    direction: int = 1
    stiffness: float = 20e3
    angle: float = 1.0
    firmware: int = 52
    on_trip: Literal["coast", "release"] = "coast"

    @property
    def lever_m(self) -> float:
        """Length of tendon that is wound in per angle, m/rad."""
        return self.direction * self.spool_radius_m


class SimulatedMotor:
    """A motor with its gears, its spool and its end of a tendon.

    Args:
        plan: The servo.

    Attributes:
        angle: Angle of the spool over many turns, rad.
        speed: Speed of the spool, rad/s.
        current: Current, A.
        tension: Tension of the tendon, N.
        temperature: Temperature, degrees Celsius.
        snapped: Whether the tendon is torn.
    """

    def __init__(self, plan: ServoPlan) -> None:
        self._plan = plan
        self._model = model = MODELS[plan.model]
        no_load, gears = model.no_load_rad_per_s, model.gears
        lost = (gears.friction_nm + gears.viscous * no_load) / model.stall_nm
        self._electric_rad_per_s = no_load / (1.0 - lost)  # No current: friction takes some speed.
        self.angle = plan.angle
        self.speed = 0.0
        self.current = 0.0
        self.tension = 0.0
        self.temperature = _ROOM_C
        self.snapped = False

    def current_at(self, volts: float) -> float:
        """Return the current at a voltage and the present speed, A."""
        share = volts / self._model.volts - self.speed / self._electric_rad_per_s
        return self._model.stall_a * share

    def advance(self, goal_a: float, volts: float, travel_m: float, dt_s: float) -> None:
        """Turn for one short step."""
        model, gears, lever = self._model, self._model.gears, self._plan.lever_m
        # The faster it turns, the less current the voltage can still drive.
        least, most = min(self.current_at(-volts), 0.0), max(self.current_at(volts), 0.0)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, least), most)
        # Friction and cable use the speed at the end of the step, so that a stiff cable does not
        # need a tiny step.
        inertia = gears.inertia + dt_s * gears.viscous
        torque = model.torque_constant * self.current
        if (pull := self._pull(travel_m)) > 0.0:
            torque -= lever * pull
            inertia += (dt_s * lever) ** 2 * self._plan.stiffness
        speed = (gears.inertia * self.speed + dt_s * torque) / inertia
        held = dt_s * gears.friction_nm / inertia
        self.speed = math.copysign(max(abs(speed) - held, 0.0), speed)
        self.angle += dt_s * self.speed
        self.tension = self._pull(travel_m)
        self._warm(dt_s)

    def _pull(self, travel_m: float) -> float:
        """Return the tension for the positions of both ends, N."""
        stretch = self._plan.lever_m * (self.angle - self._plan.angle) - travel_m
        return 0.0 if self.snapped else max(0.0, self._plan.stiffness * stretch)

    def _warm(self, dt_s: float) -> None:
        ohm = self._model.volts / self._model.stall_a
        warm = _ROOM_C + _KELVIN_PER_WATT * ohm * self.current**2
        self.temperature += (warm - self.temperature) * -math.expm1(-dt_s / _HEAT_S)


# Reasons of refusals.
_RANGE: Final = 4
_LENGTH: Final = 5
_LIMIT: Final = 6
_ACCESS: Final = 7

# Bits of the hardware error status, equal in both families.
_VOLTAGE: Final = 0x01
_HOT: Final = 0x04
_OVERLOAD: Final = 0x20

COUNTS_PER_RAD: Final = COUNTS_PER_TURN / (2.0 * math.pi)
"""Counts of position per rad."""
_START_NS: Final = 300_000_000
_STALL_AT: Final = 2.0 * math.pi / 32.0  # rad.


class SimulatedServo:
    """A servo.

    Args:
        plan: The servo.

    Attributes:
        plan: The servo.
        family: Family of the servo.
        mute: Whether it obeys without answering.
        deaf: Whether it receives nothing, as without its data line.
        motor: Its motor.
        volts: Voltage of its supply; 0 without power.
    """

    def __init__(self, plan: ServoPlan) -> None:
        self._model = model = MODELS[plan.model]
        self.plan = plan
        self.family = family = model.family
        self.mute = self.deaf = False
        self.volts = model.volts
        self.motor = SimulatedMotor(plan)
        self._registers = {one.address: one for one in family.registers}
        self._values = {one.address: one.initial for one in family.registers}
        self._values[family.model_number.address] = model.number
        self._values[family.firmware.address] = plan.firmware
        self._values[family.most.address] = model.most_counts
        self._values[family.goal.address] = model.most_counts
        self._now_ns = 0
        self._fed_ns = 0
        self._starts_until_ns = 0
        self._turns = 0  # Counts lost with the power.
        self._cache()

    @property
    def is_awake(self) -> bool:
        """True if it receives instructions."""
        return self._now_ns >= self._starts_until_ns and not self.deaf and self.volts > 0.0

    @property
    def has_torque(self) -> bool:
        """True if torque enable is on."""
        return bool(self._values[self.family.torque_enable.address])

    @property
    def pulls_a(self) -> float:
        """Goal current in effect, A, with the sign of its registers; of a length its limit."""
        return self._goal_a

    def register(self, at: int) -> int:
        """Return the current value of the register at an address."""
        self._measure()
        return self._values[at]

    def feed_watchdog(self) -> None:
        """Notice a valid instruction on the bus."""
        self._fed_ns = self._now_ns

    def read(self, at: int, size: int) -> ServoReply:
        """Reply with bytes of the registers."""
        self._measure()
        data, block = b"", self.family.present
        while len(data) < size:
            here = at + len(data)
            if (register := self._registers.get(here)) is not None:
                data += register.encode(self._values[here])
            elif block.address <= here < block.address + block.size:
                data += b"\0"
            else:
                return self._reply(_ACCESS)
        return self._reply(0, data) if len(data) == size > 0 else self._reply(_ACCESS)

    def write(self, at: int, data: bytes) -> ServoReply:
        """Write one register and reply."""
        family, values, register = self.family, self._values, self._registers.get(at)
        if register is None or register.values is None:
            return self._reply(_ACCESS)
        if len(data) != register.size:
            return self._reply(_LENGTH)
        locked = self.has_torque if family.lock is None else values[family.lock.address]
        if at < family.eeprom_end and locked:
            return self._reply(_ACCESS)
        value = register.decode(data)
        if refusal := self._refusal(register, value):
            return self._reply(refusal)
        values[at] = value
        if register == family.mode:  # A change of mode sets the goal to its limit.
            values[family.goal.address] = values[family.most.address]
        if register in (family.torque_enable, family.mark):
            self._fed_ns = self._now_ns
        self._cache()
        return self._reply(0)

    def overload(self) -> None:
        """Set the overload error."""
        self._fail(_OVERLOAD)

    def set_power(self, *, on: bool) -> None:
        """Switch its supply, from where it starts afresh."""
        self.lose_power()
        self.volts = self._model.volts if on else 0.0

    def lose_power(self) -> None:
        """Interrupt its supply, so that it restarts."""
        for at, register in self._registers.items():
            if at >= self.family.eeprom_end:
                self._values[at] = register.initial
        self._values[self.family.goal.address] = self._values[self.family.most.address]
        self._turns = math.floor(self.motor.angle / (2.0 * math.pi)) * COUNTS_PER_TURN
        self._starts_until_ns = self._fed_ns = self._now_ns + _START_NS
        self._cache()

    def advance(self, now_ns: int, travel_m: float) -> None:
        """Advance to a time."""
        dt_s = (now_ns - self._now_ns) / 1e9
        self._now_ns = now_ns
        if self._watchdog_ns is not None and now_ns - self._fed_ns >= self._watchdog_ns:
            self._trip()
        self.motor.advance(self._controlled_a(), self.volts, travel_m, dt_s)
        if self.motor.temperature > self._model.most_c:
            self._fail(_HOT)
        if self.volts and not self._model.least_v <= self.volts <= self._model.most_v:
            self._fail(_VOLTAGE)

    def _reply(self, refusal: int, data: bytes = b"") -> ServoReply:
        failed = self._values[self.family.hardware_error.address]
        if self.family.refused:
            return ServoReply(refusal | (self.family.alert if failed else 0), data)
        return ServoReply(failed, data)

    def _controlled_a(self) -> float:
        """Return the current that its controller asks for, A."""
        if self._goal_angle is None or not self._goal_a:
            return self._goal_a
        most = abs(self._goal_a)
        wanted = self._model.stall_a * (self._goal_angle - self.motor.angle) / _STALL_AT
        wanted = min(max(wanted, -most), most)
        if "tension" in self.family.modes:
            return wanted
        return self.motor.current_at(self.volts * wanted / self._model.stall_a)

    def _cache(self) -> None:
        """Cache what each step needs of the registers."""
        values, family = self._values, self.family
        steps = values[family.mark.address] if family.has_watchdog else 0
        counts = self.has_torque and 0 < steps < TRIPPED
        self._watchdog_ns = steps * WATCHDOG_STEP_MS * 1_000_000 if counts else None
        mode = values[family.mode.address]
        pulls = self.has_torque and steps != TRIPPED and mode in family.modes.values()
        counts_ahead = values[family.goal_position.address] + self._turns + 0.5
        has_length = mode == family.modes["length"]
        self._goal_angle = counts_ahead / COUNTS_PER_RAD if has_length else None
        goal = values[family.goal.address]
        self._goal_a = goal * self._model.ampere_per_goal if pulls else 0.0

    def _trip(self) -> None:
        self._values[self.family.mark.address] = TRIPPED
        self._values[self.family.goal.address] = 0
        if self.plan.on_trip == "release":
            self._values[self.family.torque_enable.address] = 0
        self._cache()

    def _fail(self, bit: int) -> None:
        self._values[self.family.hardware_error.address] |= bit
        if bit & self._model.shutdown:
            self._values[self.family.torque_enable.address] = 0
        self._cache()

    def _refusal(self, register: Register, value: int) -> int:
        """Return why the register, or the present state of the servo, refuses a value; 0 if not."""
        family, values = self.family, self._values
        allowed = range(self._model.most_counts + 1) if register == family.most else register.values
        failed = values[family.hardware_error.address] & self._model.shutdown
        tripped = family.has_watchdog and values[family.mark.address] == TRIPPED
        if allowed is None or value not in allowed or (register == family.goal and tripped):
            return _RANGE
        if register == family.goal and abs(value) > values[family.most.address]:
            return _LIMIT
        # Until a reboot.
        return _RANGE if register == family.torque_enable and value and failed else 0

    def _measure(self) -> None:
        """Update the registers of its measurements."""
        motor, values, family = self.motor, self._values, self.family
        values[family.current.address] = round(motor.current / self._model.ampere_per_count)
        values[family.speed.address] = round(motor.speed / family.rad_per_s)
        values[family.position.address] = math.floor(motor.angle * COUNTS_PER_RAD) - self._turns
        values[family.voltage.address] = round(10 * self.volts)
        values[family.temperature.address] = round(motor.temperature)
