"""Servos of a twin on one bus: motors, registers, safety functions, control, and their load.

Sources as of `shapechanger.robot.drivers.servos.family`, whose registers it has. Assumed for
want of a source, to be tried on a rig:

- A bus watchdog that trips in current mode takes the current away; torque enable stays 1 or goes
  to 0 (`releases_on_trip`). In the manual the servo "will stop".
- Any valid instruction on the bus feeds the watchdog, whichever servo it is for.
- The gaps between registers cannot be read, nor parts of registers, but for those in the block of
  present values. (Real servos may answer 0 for the gaps, so a driver must not rely on an error.)
- Without power the count of turns is lost: the position starts again within one turn.
- It needs 0.3 s to start.
- In a sync read, servos behind a silent one stay silent, the worst case.
- With control of the length the current is proportional to the error of the position, with that of
  a stall at 1/32 turn, and within the goal. That is 32 times 0.166 per rad in `bam`'s STS3215.
- The goal of a Feetech servo limits the voltage, and with it the torque of a motor at rest.
- A Feetech servo does not tell which instructions it refuses, and refuses to write to its EEPROM
  while that is locked. An overload takes its torque away until it has lost its power.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, Protocol, get_args, runtime_checkable

from msgspec.structs import replace

from shapechanger.contract.world import World
from shapechanger.errors import UnknownName
from shapechanger.robot.drivers.servos.family import (
    COUNTS_PER_TURN,
    TRIPPED,
    WATCHDOG_STEP_MS,
    Register,
)
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings

CABLE_N_PER_M: Final = 20e3
"""Stiffness of cable and frame, N/m. Chosen: a good millimetre for 25 N. The end of the load needs
a mass of more than 0.01 kg to follow such a spring in steps of 1 ms."""

COUNTS_PER_RAD: Final = COUNTS_PER_TURN / (2.0 * math.pi)
"""Counts of position per rad."""

# Heat, all chosen for want of a source: a servo that stalls with half its current gets some 55
# degrees warmer, with a time constant of two minutes.
_ROOM_C: Final = 25.0
_KELVIN_PER_WATT: Final = 30.0
_HEAT_S: Final = 120.0


class SimulatedMotor:
    """A motor with its gears, its spool and its end of a tendon.

    Args:
        settings: The servo, at whose zero the tendon is just taut.
        stiffness: Stiffness of the tendon, N/m.

    Attributes:
        angle: Angle of the spool over many turns, rad.
        speed: Speed of the spool, rad/s.
        current: Current, A.
        tension: Tension of the tendon, N.
        temperature: Temperature, degrees Celsius.
        snapped: Whether the tendon is torn.
    """

    def __init__(self, settings: ServoSettings, stiffness: float = CABLE_N_PER_M) -> None:
        self._model = model = settings.known
        self._stiffness = stiffness
        self._lever_m = settings.direction * settings.spool_radius_m  # Wound in per angle, m/rad.
        no_load, gears = model.no_load_rad_per_s, model.gears
        lost = (gears.friction_nm + gears.viscous * no_load) / model.stall_nm
        self._electric_rad_per_s = no_load / (1.0 - lost)  # No current: friction takes some speed.
        # In the middle of a count, as it stands while the finger is straight.
        self._taut = self.angle = (settings.zero + 0.5) / COUNTS_PER_RAD
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
        model, gears, lever = self._model, self._model.gears, self._lever_m
        # The faster it turns, the less current the voltage can still drive.
        least, most = min(self.current_at(-volts), 0.0), max(self.current_at(volts), 0.0)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, least), most)
        # Friction and cable use the speed at the end of the step, so that a stiff cable does not
        # need a tiny step.
        inertia = gears.inertia + dt_s * gears.viscous
        torque = model.torque_constant * self.current
        if (pull := self._pull(travel_m)) > 0.0:
            torque -= lever * pull
            inertia += (dt_s * lever) ** 2 * self._stiffness
        speed = (gears.inertia * self.speed + dt_s * torque) / inertia
        held = dt_s * gears.friction_nm / inertia
        self.speed = math.copysign(max(abs(speed) - held, 0.0), speed)
        self.angle += dt_s * self.speed
        self.tension = self._pull(travel_m)
        self._warm(dt_s)

    def _pull(self, travel_m: float) -> float:
        """Return the tension for the positions of both ends, N."""
        stretch = self._lever_m * (self.angle - self._taut) - travel_m
        return 0.0 if self.snapped else max(0.0, self._stiffness * stretch)

    def settle(self, travel_m: float) -> None:
        """Turn the spool until the tendon is just taut, as a person does by hand."""
        self.angle = self._taut + travel_m / self._lever_m
        self.speed = self.tension = 0.0

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

_START_NS: Final = 300_000_000
_STALL_AT: Final = 2.0 * math.pi / 32.0  # rad.


class SimulatedServo:
    """A servo.

    Args:
        settings: The servo.
        stiffness: Stiffness of its tendon, N/m.

    Attributes:
        family: Family of the servo.
        firmware: Version of its firmware.
        releases_on_trip: Effect of its watchdog; see the module.
        mute: Whether it obeys without answering.
        deaf: Whether it receives nothing, as without its data line.
        motor: Its motor.
        volts: Voltage of its supply; 0 without power.
        pulls_a: Goal current in effect, A, with the sign of its registers; of a length its limit.
    """

    def __init__(self, settings: ServoSettings, stiffness: float) -> None:
        self._model = model = settings.known
        self.family = family = model.family
        self.firmware = 52
        self.releases_on_trip = False
        self.mute = self.deaf = False
        self.volts = model.volts
        self.motor = SimulatedMotor(settings, stiffness)
        self._registers = {one.address: one for one in family.registers}
        most = replace(family.most, range=(0, model.most_counts))
        self._registers[most.address] = most
        self._values = {one.address: one.initial for one in family.registers}
        self._values[family.model_number.address] = model.number
        self._values[family.most.address] = model.most_counts
        self._values[family.goal.address] = model.most_counts
        self._now_ns = 0
        self._fed_ns = 0
        self._starts_until_ns = 0
        self._turns = 0  # Counts lost with the power.
        self._cache()

    @property
    def has_torque(self) -> bool:
        """True if torque enable is on."""
        return bool(self._values[self.family.torque_enable.address])

    def register(self, at: int) -> int:
        """Return the current value of the register at an address."""
        self._measure()
        return self._values[at]

    def hears(self) -> bool:
        """Return whether it receives an instruction on the bus, which then feeds its watchdog."""
        if self._now_ns < self._starts_until_ns or self.deaf or self.volts == 0.0:
            return False
        self._fed_ns = self._now_ns
        return True

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
        if register is None or not register.is_writable:
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
            self._values[self.family.mark.address] = TRIPPED
            self._values[self.family.goal.address] = 0
            if self.releases_on_trip:
                self._values[self.family.torque_enable.address] = 0
            self._cache()
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
        if self.pulls_angle is None or not self.pulls_a:
            return self.pulls_a
        most = abs(self.pulls_a)
        wanted = self._model.stall_a * (self.pulls_angle - self.motor.angle) / _STALL_AT
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
        self.pulls_angle = counts_ahead / COUNTS_PER_RAD if has_length else None
        goal = values[family.goal.address]
        self.pulls_a = goal * self._model.ampere_per_goal if pulls else 0.0

    def _fail(self, bit: int) -> None:
        self._values[self.family.hardware_error.address] |= bit
        if bit & self._model.shutdown:
            self._values[self.family.torque_enable.address] = 0
        self._cache()

    def _refusal(self, register: Register, value: int) -> int:
        """Return why the register, or the present state of the servo, refuses a value; 0 if not."""
        family, values = self.family, self._values
        failed = values[family.hardware_error.address] & self._model.shutdown
        tripped = family.has_watchdog and values[family.mark.address] == TRIPPED
        if not register.takes(value) or (register == family.goal and tripped):
            return _RANGE
        if register == family.goal and abs(value) > values[family.most.address]:
            return _LIMIT
        # Until a reboot.
        return _RANGE if register == family.torque_enable and value and failed else 0

    def _measure(self) -> None:
        """Update the registers of its measurements."""
        motor, values, family = self.motor, self._values, self.family
        values[family.firmware.address] = self.firmware
        values[family.current.address] = round(motor.current / self._model.ampere_per_count)
        values[family.speed.address] = round(motor.speed / family.rad_per_s)
        values[family.position.address] = math.floor(motor.angle * COUNTS_PER_RAD) - self._turns
        values[family.voltage.address] = round(10 * self.volts)
        values[family.temperature.address] = round(motor.temperature)


_STEP_NS: Final = 1_000_000
# Of the end stops.
_SPRING_N_PER_M: Final = 300.0
_DAMPER_NS_PER_M: Final = 60.0
_NEAREST_M: Final = 0.02  # How far an end can be pulled; it cannot go the other way.


@runtime_checkable
class TendonWorld(Protocol):
    """A world that tendons pull at, as their load, such as a finger."""

    @property
    def cable_stiffness(self) -> float:
        """Stiffness of the tendons, N/m."""
        ...

    def connect(self, tendons: Sequence[str], rig: Rig) -> None:
        """Attach the tendons of a rig."""
        ...

    def travels(self) -> Sequence[float]:
        """Return how far the end of each tendon is towards its spool since the beginning, m."""
        ...

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions for one step, and return `travels`."""
        ...


class EndStops:
    """For each tendon a massless spring with a damper between two stops; see `TendonWorld`."""

    cable_stiffness = CABLE_N_PER_M

    def __init__(self, count: int) -> None:
        self._travels = [0.0] * count

    def travels(self) -> Sequence[float]:
        """Return how far the ends are towards their spools, m."""
        return list(self._travels)

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions; see `TendonWorld.pull`."""
        keep = math.exp(-dt_s * _SPRING_N_PER_M / _DAMPER_NS_PER_M)
        for i, tension in enumerate(tensions_n):
            rest = tension / _SPRING_N_PER_M
            travel = rest + keep * (self._travels[i] - rest)
            self._travels[i] = min(max(travel, 0.0), _NEAREST_M)
        return self.travels()


ServoFault = Literal["", "mute", "deaf", "hot", "overload", "snapped", "power"]
"""Faults of a servo.

"mute": it obeys without answering. "deaf": it receives nothing. "hot", "overload": it shuts itself
off. "snapped": its tendon is torn for good. "power": its power fails for a moment. "" repairs
"mute", "deaf" and "hot".
"""

_HOT_C: Final = 75.0
_WELL_C: Final = 30.0


class Rig:
    """A bus with its servos, and the load that their tendons pull.

    Args:
        settings: The bus.
        world: World of the robot; in a world without tendons the servos pull springs.

    Attributes:
        device: Device of the bus.
        servos: Servos by id.
        now_ns: Time of the bus.
        has_power: Whether the servos have power.
    """

    def __init__(self, settings: BusSettings, world: World | None = None) -> None:
        names = [servo.name for servo in settings.servos]
        self.device = settings.device
        self._load: TendonWorld | EndStops = EndStops(len(names))
        if isinstance(world, TendonWorld):
            world.connect(names, self)
            self._load = world
        stiffness = self._load.cable_stiffness
        self.servos = {one.id: SimulatedServo(one, stiffness) for one in settings.servos}
        self._names = dict(zip(names, self.servos.values(), strict=True))
        self.now_ns = 0
        self.has_power = True
        self.settle()

    def servo(self, tendon: str) -> SimulatedServo:
        """Return the servo of a tendon."""
        if tendon not in self._names:
            raise UnknownName("tendon", tendon, self._names)
        return self._names[tendon]

    def tensions(self) -> dict[str, float]:
        """Return the tension of each tendon, N, by name."""
        return {name: servo.motor.tension for name, servo in self._names.items()}

    def settle(self) -> None:
        """Turn all spools until their tendons are just taut, wherever the load was moved."""
        self._travels = self._load.travels()
        for servo, travel in zip(self.servos.values(), self._travels, strict=True):
            servo.motor.settle(travel)

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Let servos answer what they are asked for; see `ServoPort.read`."""
        awake, replies = self._awake(), dict[int, ServoReply]()
        for one in ids:
            if one not in awake or awake[one].mute:
                break
            replies[one] = awake[one].read(at, size)
        return replies

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Let servos obey; see `ServoPort.write`."""
        awake = self._awake()
        replies = {one: awake[one].write(at, data[one]) for one in data if one in awake}
        return {one: reply for one, reply in replies.items() if not awake[one].mute}

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
            self._travels = self._load.pull([one.motor.tension for one in servos], dt_s)

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

    def _awake(self) -> dict[int, SimulatedServo]:
        """Return the servos that hear an instruction, by id."""
        return {one: servo for one, servo in self.servos.items() if servo.hears()}
