"""Servos of a twin on one bus: motors, registers, safety functions, control, and their load.

The registers and their sources are in `servos.toml`. Assumptions without a source, to be tested on
a rig:

- A bus watchdog that trips in current mode sets the current to 0; in the manual the servo "will
  stop". Torque enable stays 1.
- Any valid instruction on the bus resets the watchdogs of all servos.
- Gaps between registers and parts of registers cannot be read, except in the block of present
  values. (Real servos may answer 0 for the gaps, so a driver must not rely on an error.)
- Without power the count of turns is lost: the position starts again within one turn.
- A servo needs 0.3 s to start.
- In a sync read, servos behind a silent one stay silent, the worst case.
- With control of the length, the current is proportional to the error of the position, reaches the
  stall current at 1/32 turn (5.1 times the stall current per rad), and is limited by the goal.
  `bam` has 5.3 (32 times 0.166) for the STS3215.
- The goal of a Feetech servo limits the voltage, and with it the torque of a motor at rest.
- A Feetech servo does not report which instructions it refuses, and refuses to write to its EEPROM
  while that is locked. After an overload it has no torque until its power is cycled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, Protocol, get_args, runtime_checkable

from shapechanger.contract.world import World
from shapechanger.errors import UnknownName, require_known
from shapechanger.robot.drivers.servos.settings import (
    COUNTS_PER_TURN,
    TRIPPED,
    WATCHDOG_STEP_MS,
    BusSettings,
    ServoSettings,
)
from shapechanger.robot.hardware import ServoReply

CABLE_N_PER_M: Final = 20e3
"""Stiffness of cable and frame, N/m. Chosen: a little over 1 mm for 25 N. The end of the load needs
a mass of more than 0.01 kg for a stable simulation in steps of 1 ms."""

_COUNTS_PER_RAD: Final = COUNTS_PER_TURN / (2.0 * math.pi)

# Heat, chosen without a source: an XL330 that stalls with half its stall current gets about 55
# degrees warmer, with a time constant of two minutes.
_ROOM_C: Final = 25.0
_KELVIN_PER_WATT: Final = 30.0
_HEAT_S: Final = 120.0


class SimulatedMotor:
    """A motor with its gears, its spool and its end of a tendon of a `stiffness`, N/m.

    It has an `angle` over many turns, rad, a `speed`, rad/s, a `current`, A, a `temperature`,
    degrees Celsius, and the `tension` of the tendon, N. The tendon is just taut at the zero.
    """

    def __init__(self, settings: ServoSettings, stiffness: float = CABLE_N_PER_M) -> None:
        self._model = model = settings.known
        self._stiffness = stiffness
        self._lever_m = settings.lever_m
        no_load = model.no_load_rad_per_s
        lost = (model.friction_nm + model.viscous * no_load) / model.stall_nm
        self._electric_rad_per_s = no_load / (1.0 - lost)  # Speed without current and friction.
        # The middle of the count at which the finger is straight.
        self._taut = self.angle = (settings.zero + 0.5) / _COUNTS_PER_RAD
        self.speed = self.current = self.tension = 0.0
        self.temperature = _ROOM_C
        self.snapped = False  # Whether the tendon is torn.

    def current_at(self, volts: float) -> float:
        """Return the current at a voltage and the present speed, A."""
        share = volts / self._model.volts - self.speed / self._electric_rad_per_s
        return self._model.stall_a * share

    def advance(self, goal_a: float, volts: float, travel_m: float, dt_s: float) -> None:
        """Turn for one short step; the tendon's far end is `travel_m` nearer than at the start."""
        model, lever = self._model, self._lever_m
        # The voltage drives less current at higher speed.
        least, most = min(self.current_at(-volts), 0.0), max(self.current_at(volts), 0.0)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, least), most)
        # Friction and cable use the speed at the end of the step, so that a stiff cable does not
        # need a tiny step.
        inertia = model.inertia + dt_s * model.viscous
        torque = model.torque_constant * self.current
        if (pull := self._pull(travel_m)) > 0.0:
            torque -= lever * pull
            inertia += (dt_s * lever) ** 2 * self._stiffness
        speed = (model.inertia * self.speed + dt_s * torque) / inertia
        held = dt_s * model.friction_nm / inertia
        self.speed = math.copysign(max(abs(speed) - held, 0.0), speed)
        self.angle += dt_s * self.speed
        self.tension = self._pull(travel_m)
        warm = _ROOM_C + _KELVIN_PER_WATT * model.volts / model.stall_a * self.current**2
        self.temperature += (warm - self.temperature) * -math.expm1(-dt_s / _HEAT_S)

    def settle(self, travel_m: float) -> None:
        """Turn the spool until the tendon is just taut, as a person does by hand."""
        self.angle = self._taut + travel_m / self._lever_m
        self.speed = self.tension = 0.0

    def _pull(self, travel_m: float) -> float:
        stretch = self._lever_m * (self.angle - self._taut) - travel_m
        return 0.0 if self.snapped else max(0.0, self._stiffness * stretch)


ServoFault = Literal["", "mute", "deaf", "hot", "overload", "snapped", "power"]
"""Faults of a servo.

"mute": it obeys without answering. "deaf": it receives no instructions. "hot": it has 75 °C, which
most models do not bear. "overload": it shuts itself off. "snapped": its tendon is permanently torn.
"power": its power fails for a moment. "": not mute, not deaf and cool again.
"""

_HOT_C: Final = 75.0
_WELL_C: Final = 30.0

# Reasons of refusals.
_RANGE: Final = 4
_LENGTH: Final = 5
_LIMIT: Final = 6
_ACCESS: Final = 7

# Bits of the hardware error status, equal in both families.
_VOLTAGE: Final = 0x01
_HOT: Final = 0x04
_OVERLOAD: Final = 0x20

_FIRMWARE: Final = 52
_START_NS: Final = 300_000_000
_STALL_AT: Final = 2.0 * math.pi / 32.0  # Error of the position at the stall current, rad.


class SimulatedServo:
    """A simulated servo, whose tendon has a `stiffness`, N/m.

    `pulls_a` is its goal current in effect, A, with its sign, or the limit of its current.
    """

    def __init__(self, settings: ServoSettings, stiffness: float) -> None:
        self._model = model = settings.known
        self.family = family = model.family
        self.mute = False  # Whether it obeys without answering.
        self.deaf = False  # Whether it receives no instructions.
        self.volts = model.volts  # Voltage of its supply; 0 without power.
        self.motor = SimulatedMotor(settings, stiffness)
        own = {name: one for name, one in family.registers.items() if name != "present"}
        self._names = {one.address: name for name, one in own.items()}
        self.values = {name: one.initial for name, one in own.items()}
        self.values |= {"model_number": model.number, "firmware": _FIRMWARE}
        self.values |= {"most": model.most_counts, "goal": model.most_counts}
        self._now_ns = self._fed_ns = self._starts_until_ns = 0
        self._turns = 0  # Counts lost with the power.
        self._cache()

    @property
    def has_torque(self) -> bool:
        """True if torque enable is on."""
        return bool(self.values["torque_enable"])

    def hears(self) -> bool:
        """Return whether it receives an instruction on the bus, which then feeds its watchdog."""
        if self._now_ns < self._starts_until_ns or self.deaf or self.volts == 0.0:
            return False
        self._fed_ns = self._now_ns
        return True

    def read(self, at: int, size: int) -> ServoReply:
        """Reply with bytes of the registers."""
        motor, family, block = self.motor, self.family, self.family["present"]
        self.values |= {
            "current": round(motor.current / self._model.ampere_per_count),
            "speed": round(motor.speed / family.rad_per_s),
            "position": math.floor(motor.angle * _COUNTS_PER_RAD) - self._turns,
            "voltage": round(10 * self.volts),
            "temperature": round(motor.temperature),
        }
        data = b""
        while len(data) < size:
            here = at + len(data)
            if name := self._names.get(here):
                data += family[name].encode(self.values[name])
            elif block.address <= here < block.address + block.size:
                data += b"\0"
            else:
                return self._reply(_ACCESS)
        return self._reply(0, data) if len(data) == size > 0 else self._reply(_ACCESS)

    def write(self, at: int, data: bytes) -> ServoReply:
        """Write one register and reply."""
        name = self._names.get(at, "")
        refusal = self._refusal(name, data)
        if not refusal:
            self.values[name] = self.family[name].decode(data)
            if name == "mode":  # A change of mode sets the goal to its limit.
                self.values["goal"] = self.values["most"]
            if name in ("torque_enable", "mark"):
                self._fed_ns = self._now_ns
            self._cache()
        return self._reply(refusal)

    def _refusal(self, name: str, data: bytes) -> int:
        """Return the code of the refusal of data for a register; 0 if it is accepted."""
        family, values = self.family, self.values
        if not name or not (takes := family[name].takes):
            return _ACCESS
        if len(data) != family[name].size:
            return _LENGTH
        locked = values.get("lock", self.has_torque)
        if locked and family[name].address < family.eeprom_end:
            return _ACCESS
        value = family[name].decode(data)
        if name == "most":
            takes = ((0, self._model.most_counts),)
        # A tripped watchdog refuses goals; an error refuses torque until a reboot.
        tripped = name == "goal" and family.has_watchdog and values["mark"] == TRIPPED
        failed = values["hardware_error"] & self._model.shutdown
        blocked = tripped or (name == "torque_enable" and value and failed)
        if blocked or not any(least <= value <= most for least, most in takes):
            return _RANGE
        return _LIMIT if name == "goal" and abs(value) > values["most"] else 0

    def fail(self, bits: int) -> None:
        """Set bits of the hardware error status, which may shut it off."""
        self.values["hardware_error"] |= bits
        if bits & self._model.shutdown:
            self.values["torque_enable"] = 0
        self._cache()

    def set_power(self, *, on: bool) -> None:
        """Switch its supply; with power, the servo restarts."""
        self.lose_power()
        self.volts = self._model.volts if on else 0.0

    def lose_power(self) -> None:
        """Interrupt its supply, so that it restarts."""
        for name in self.values:
            if (register := self.family[name]).address >= self.family.eeprom_end:
                self.values[name] = register.initial
        self.values["goal"] = self.values["most"]
        self._turns = math.floor(self.motor.angle / (2.0 * math.pi)) * COUNTS_PER_TURN
        self._starts_until_ns = self._fed_ns = self._now_ns + _START_NS
        self._cache()

    def advance(self, now_ns: int, travel_m: float) -> None:
        """Advance to a time."""
        dt_s = (now_ns - self._now_ns) / 1e9
        self._now_ns = now_ns
        if self._watchdog_ns is not None and now_ns - self._fed_ns >= self._watchdog_ns:
            self.values |= {"mark": TRIPPED, "goal": 0}
            self._cache()
        current_a = self.pulls_a  # The current that the servo's controller requests.
        if self._pulls_angle is not None and self.pulls_a:
            most = abs(self.pulls_a)
            wanted = self._model.stall_a * (self._pulls_angle - self.motor.angle) / _STALL_AT
            current_a = min(max(wanted, -most), most)
            if "tension" not in self.family.modes:
                volts = self.volts * current_a / self._model.stall_a
                current_a = self.motor.current_at(volts)
        self.motor.advance(current_a, self.volts, travel_m, dt_s)
        if self.motor.temperature > self._model.most_c:
            self.fail(_HOT)
        if self.volts and not self._model.least_v <= self.volts <= self._model.most_v:
            self.fail(_VOLTAGE)

    def _reply(self, refusal: int, data: bytes = b"") -> ServoReply:
        failed = self.values["hardware_error"]
        if self.family.refused:
            return ServoReply(refusal | (self.family.alert if failed else 0), data)
        return ServoReply(failed, data)

    def _cache(self) -> None:
        """Cache the registers that each step needs."""
        values, family = self.values, self.family
        steps = values["mark"] if family.has_watchdog else 0
        counts = self.has_torque and 0 < steps < TRIPPED
        self._watchdog_ns = steps * WATCHDOG_STEP_MS * 1_000_000 if counts else None
        mode = values["mode"]
        pulls = self.has_torque and steps != TRIPPED and mode in family.modes.values()
        counts_ahead = values["goal_position"] + self._turns + 0.5
        has_length = mode == family.modes["length"]
        self._pulls_angle = counts_ahead / _COUNTS_PER_RAD if has_length else None
        self.pulls_a = values["goal"] * self._model.ampere_per_goal if pulls else 0.0


_STEP_NS: Final = 1_000_000


@runtime_checkable
class TendonWorld(Protocol):
    """A world that is the load of tendons, such as a finger."""

    @property
    def cable_stiffness(self) -> float:
        """Stiffness of the tendons, N/m."""
        ...

    def connect(self, tendons: Sequence[str], rig: Rig) -> None:
        """Attach the tendons of a rig."""

    def travels(self) -> Sequence[float]:
        """Return how far the end of each tendon has moved towards its spool since the start, m."""
        ...

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions for one step, and return `travels`."""
        ...


# In other worlds, each tendon pulls a massless spring with a damper between two stops.
_SPRING_N_PER_M: Final = 300.0
_DAMPER_NS_PER_M: Final = 60.0
_NEAREST_M: Final = 0.02  # Largest travel of an end towards its spool; 0 is the other stop.


def pull_spring(travel_m: float, tension_n: float, dt_s: float) -> float:
    """Return the travel of a tendon's end after it has pulled its spring for a step, m."""
    rest = tension_n / _SPRING_N_PER_M
    keep = math.exp(-dt_s * _SPRING_N_PER_M / _DAMPER_NS_PER_M)
    return min(max(rest + keep * (travel_m - rest), 0.0), _NEAREST_M)


class Rig:
    """A bus with its servos, keyed by id, and the load that their tendons pull.

    In a world without tendons the servos pull springs.
    """

    def __init__(self, settings: BusSettings, world: World | None = None) -> None:
        names = [servo.name for servo in settings.servos]
        self.device = settings.device
        self._world = world if isinstance(world, TendonWorld) else None
        self._travels: Sequence[float] = [0.0] * len(names)
        stiffness = CABLE_N_PER_M
        if self._world is not None:
            self._world.connect(names, self)
            stiffness = self._world.cable_stiffness
        self.servos = {one.id: SimulatedServo(one, stiffness) for one in settings.servos}
        self._names = dict(zip(names, self.servos.values(), strict=True))
        self.now_ns = 0
        self.has_power = True
        self.settle()

    def servo(self, tendon: str) -> SimulatedServo:
        """Return the servo of a tendon."""
        require_known("tendon", self._names, tendon)
        return self._names[tendon]

    def tensions(self) -> dict[str, float]:
        """Return the tension of each tendon, N, keyed by name."""
        return {name: servo.motor.tension for name, servo in self._names.items()}

    def settle(self) -> None:
        """Turn all spools until their tendons are just taut at the present place of the load."""
        if self._world is not None:
            self._travels = self._world.travels()
        for servo, travel in zip(self.servos.values(), self._travels, strict=True):
            servo.motor.settle(travel)

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read registers of servos; see `ServoPort.read`."""
        awake, replies = self._awake(), dict[int, ServoReply]()
        for one in ids:
            if one not in awake or awake[one].mute:
                break
            replies[one] = awake[one].read(at, size)
        return replies

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write registers of servos; see `ServoPort.write`."""
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
            tensions = [one.motor.tension for one in servos]
            if self._world is not None:
                self._travels = self._world.pull(tensions, dt_s)
            else:
                pairs = zip(self._travels, tensions, strict=True)
                self._travels = [pull_spring(*pair, dt_s) for pair in pairs]

    def break_servo(self, tendon: str, fault: ServoFault | str) -> None:
        """Make the servo of a tendon fail, or repair it."""
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
                servo.fail(_OVERLOAD)
            case "snapped":
                servo.motor.snapped = True
            case "power":
                servo.lose_power()
            case _:
                raise UnknownName("fault of a servo", fault, get_args(ServoFault))

    def _awake(self) -> dict[int, SimulatedServo]:
        """Return the servos that receive an instruction, keyed by id."""
        return {one: servo for one, servo in self.servos.items() if servo.hears()}
