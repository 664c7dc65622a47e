"""Pins, chips, sensors and servos of the board, and the world that they move and measure.

Outputs keep their levels after the process that has set them has ended.
"""

from __future__ import annotations

import errno
import heapq
import json
import random
from collections.abc import Callable
from dataclasses import dataclass
from io import RawIOBase
from typing import Any, Final, Literal, TypeVar

from shapechanger.contract.world import World
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.drivers.servos.settings import DRIVER, bus_settings
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.drivers.simulation import (
    NO_PULSE,
    Edge,
    Levels,
    Pulse,
    PwmChannel,
    SimulatedChip,
    SimulatedSensor,
)
from shapechanger.robot.hardware import ServoReply
from shapechanger.robot.twin.camera import FrontCameraPipe
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.rpc import BoardConnection

# Longest step of the servos' time. A busy machine may delay the board for longer; without this
# limit, the servos' watchdogs would then release them although the guard is not silent.
_MAX_SERVO_STEP_NS: Final = 40_000_000

_Sensor = TypeVar("_Sensor", bound=SimulatedSensor)


@dataclass(slots=True)
class _Claim:
    """State of a pin that a process has claimed; it is kept after the process has ended."""

    owner: BoardConnection | None = None
    mode: Literal["input", "output"] = "input"
    hz: float = 0
    phase_ns: int = 0  # Start of a period of its PWM or pulses.


class PinBoard:
    """Pins, chips, servos and world, for a robot's processes and its operator.

    Changes of outputs are written to the `ledger`, unless it is None. The `seed` selects the phase
    of software PWM, and `clock` returns the time, ns. A process that uses a pin without having
    claimed it gets a RobotError. A chip that does not reply gives the kernel's OSError.
    """

    def __init__(
        self,
        wiring: TwinWiring,
        world: World,
        ledger: RawIOBase | None,
        seed: int,
        clock: Callable[[], int],
        camera: FrontCameraPipe | None = None,
    ) -> None:
        self.clock = clock
        self.world = world
        self.camera = camera
        self.levels = Levels()  # State of all outputs.
        self.stop_held = False  # Whether the stop button is pressed, for the next `advance`.
        self.dead_chips: set[tuple[int, int]] = set()  # Bus and address of silent chips.
        self._wiring = wiring
        self._ledger = ledger
        self._random = random.Random(f"phase {seed}")
        self._claims: dict[int, _Claim] = {}
        self._now_ns = clock()
        plan = wiring.plan
        kinds = ((one, SENSORS[one.driver].simulate) for one in plan.sensors)
        self._sensors = [simulate(one, world) for one, simulate in kinds if simulate is not None]
        self._due: list[Edge] = []  # Future edges that outputs have caused.
        self._inputs = {pin: level for one in self._sensors for pin, level in one.levels.items()}
        if plan.stop_pin is not None:
            self._inputs[plan.stop_pin] = 1  # A button to ground, with a pull-up.
        self._rig: Rig | None = None
        self._switches_rig = False
        if servos := [output for output in plan.outputs if output.driver == DRIVER]:
            settings = bus_settings(servos)
            self._rig = Rig(settings, world)
            # The enable line switches the power of servos that have no watchdogs.
            self._switches_rig = not settings.family.has_watchdog
            self._rig.set_power(on=not self._switches_rig)
        obeys = ((one, OUTPUTS[one.driver].obeys) for one in plan.outputs)
        self._obeys = {one.name: obey(one) for one, obey in obeys if obey is not None}
        self._chips: dict[tuple[int, int], SimulatedChip] = {}
        for output in plan.outputs:
            if over := output.settings.get("over"):
                # Several outputs may be channels of one chip, which is simulated once.
                self._chips = {**PULSES[over].chips(output), **self._chips}
        for sensor in self._sensors:
            self._chips.update(sensor.chips)
        for at, chip in self._chips.items():
            self._update_channels(at, chip)

    def record(self, kind: str, t: int | None = None, **fields: Any) -> None:
        """Write a line of the ledger with the time `t`, ns, or the present time."""
        if self._ledger is not None:
            line = {"t": self.clock() if t is None else t, "kind": kind, **fields}
            self._ledger.write(json.dumps(line, allow_nan=False).encode() + b"\n")

    def advance(self, now_ns: int) -> list[Edge]:
        """Advance the world to a time; record and return the edges of inputs until then."""
        start_ns = self._now_ns
        if now_ns > start_ns:
            if self._rig is not None:
                if self._switches_rig:
                    self._rig.set_power(on=self._wiring.has_power(self.levels, now_ns))
                self._rig.advance(min(now_ns - start_ns, _MAX_SERVO_STEP_NS))
            # The value of each part of the vehicle is the mean of the outputs that move it.
            values: dict[str, list[float]] = {}
            for name, (value, _) in self._wiring.read(self.levels, start_ns).items():
                shares = values.setdefault(self._wiring.outputs[name].part, [])
                if name in self._obeys:
                    value = self._obeys[name](value, start_ns)
                if value is not None:
                    shares.append(value)
            parts = {part: sum(got) / len(got) if got else None for part, got in values.items()}
            self.world.advance((now_ns - start_ns) / 1e9, parts)
            self._now_ns = now_ns
        seen = self.world.inputs()
        edges = [e for one in self._sensors for e in one.edges(start_ns, self._now_ns, seen)]
        while self._due and self._due[0].t <= self._now_ns:
            edges.append(heapq.heappop(self._due))
        stop_pin, stop_level = self._wiring.plan.stop_pin, int(not self.stop_held)
        if stop_pin is not None and self._inputs[stop_pin] != stop_level:
            edges.append(Edge(self._now_ns, stop_pin, stop_level))
        edges.sort()
        for edge in edges:
            self._inputs[edge.pin] = edge.level
            self.record("input", t=edge.t, pin=edge.pin, level=edge.level)
        return edges

    def of_kind(self, kind: type[_Sensor]) -> list[_Sensor]:
        """Return the sensors of one kind."""
        return [one for one in self._sensors if isinstance(one, kind)]

    def require_rig(self, device: str | None = None) -> Rig:
        """Return the servos; raise RobotError without servos, or with servos on another device."""
        if self._rig is None:
            raise RobotError("This twin has no servo bus.")
        if device not in (None, self._rig.device):
            raise RobotError(f"There is no {device} at this twin, only {self._rig.device}.")
        return self._rig

    def reader(self, pin: int) -> BoardConnection | None:
        """Return the process that has claimed a pin as an input, or None."""
        claim = self._claims.get(pin)
        return claim.owner if claim is not None and claim.mode == "input" else None

    def claim(
        self,
        caller: BoardConnection,
        pin: int,
        mode: Literal["input", "output"],
        pull: str,
        level: int,
    ) -> int:
        """Claim a pin and return its level; sensors, pulls and resistors set an input's level."""
        claim = self._claims.setdefault(pin, _Claim())
        if claim.owner is not None and claim.owner is not caller:
            raise RobotError(f"GPIO{pin} is busy: process {claim.owner.pid} holds it.")
        claim.owner, claim.mode, claim.hz = caller, mode, 0
        if mode == "output":
            self._drive(caller, pin, float(level))
            return level
        idle = self._wiring.idle_level(pin)
        if pin in self.levels.duties:
            self._drive(caller, pin, float(idle), released=True)
        if pull != "floating" and not self._wiring.has_resistor(pin):
            idle = int(pull == "up")
        return self._inputs.get(pin, idle)

    def drive(self, caller: BoardConnection, pin: int, duty: float, hz: int) -> None:
        """Set the level of an output (`hz` 0), or the duty of its software PWM."""
        self._start_pulses(caller, pin, hz)
        self._drive(caller, pin, duty, hz)

    def pulse(self, caller: BoardConnection, pin: int, us: int, hz: int) -> None:
        """Send servo pulses on an output; a width of 0 us ends them."""
        self._start_pulses(caller, pin, hz if us else 0)
        pulse = Pulse(us, hz)
        if self.levels.pulses.get(pin) != pulse:
            self.levels.pulse(pin, pulse)
            self.record("pulse", t=caller.t, pin=pin, us=us, hz=hz, pid=caller.pid)

    def read_chip(self, bus: int, address: int, register: int, length: int) -> list[int]:
        """Read registers of an I2C chip."""
        return self._chip(bus, address).read(register, length)

    def write_chip(
        self, caller: BoardConnection, bus: int, address: int, register: int, data: list[int]
    ) -> None:
        """Write registers of an I2C chip."""
        chip = self._chip(bus, address)
        chip.write(register, data)
        if not chip.is_logged:
            return
        at: dict[str, Any] = {"t": caller.t, "bus": bus, "address": address}
        self.record("i2c", **at, register=register, data=data, pid=caller.pid)
        for channel, pulse in self._update_channels((bus, address), chip):
            us, hz = round(pulse.us, 3), round(pulse.hz, 3)
            self.record("i2c", **at, channel=channel, us=us, hz=hz, pid=caller.pid)

    def read_servos(self, device: str, ids: list[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of servos, and return their replies, keyed by id."""
        return self.require_rig(device).read(ids, at, size)

    def write_servos(self, device: str, data: dict[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of servos, and return their replies, keyed by id."""
        return self.require_rig(device).write(data, at)

    def free(self, caller: BoardConnection, died: bool) -> None:
        """Free the pins of a process that has ended; `died` is true if it did not `leave`.

        Outputs keep the level that they have at that moment.
        """
        if died:
            self.record("gone", t=caller.t, pid=caller.pid)
        for pin, claim in sorted(self._claims.items()):
            if claim.owner is not caller:
                continue
            claim.owner = None
            if claim.mode != "output" or not (died or claim.hz):
                continue
            duty = self.levels.duties.get(pin, 0.0)
            if claim.hz and 0.0 < duty < 1.0:
                period_ns = 1e9 / claim.hz
                duty = float((caller.t - claim.phase_ns) % period_ns < duty * period_ns)
            claim.hz = 0
            self._drive(caller, pin, duty)

    def _update_channels(self, at: tuple[int, int], chip: SimulatedChip) -> list[tuple[int, Pulse]]:
        """Update the levels of a chip's channels and return those that changed."""
        changed: list[tuple[int, Pulse]] = []
        for number, pulse in enumerate(chip.pulses):
            channel = PwmChannel(*at, number)
            before = self.levels.channels.get(channel, NO_PULSE)
            if pulse.us != before.us or (pulse.us and pulse.hz != before.hz):
                changed.append((number, pulse))
                self.levels.channels[channel] = pulse
        return changed

    def _start_pulses(self, caller: BoardConnection, pin: int, hz: float) -> None:
        claim = self._claims.get(pin)
        if claim is None or claim.owner is not caller or claim.mode != "output":
            raise RobotError(f"Process {caller.pid} does not hold GPIO{pin} as an output.")
        if hz and hz != claim.hz:
            claim.phase_ns = caller.t - int(self._random.random() * 1e9 / hz)
        claim.hz = hz

    def _drive(
        self, caller: BoardConnection, pin: int, duty: float, hz: float = 0, **released: bool
    ) -> None:
        t = caller.t
        if released:
            self.levels.release(pin)
        else:
            self.levels.drive(pin, duty, t)
        self.record("pin", t=t, pin=pin, duty=duty, hz=hz, pid=caller.pid, **released)
        for sensor in self._sensors:
            for edge in sensor.output_changed(t, pin, duty):
                heapq.heappush(self._due, edge)

    def _chip(self, bus: int, address: int) -> SimulatedChip:
        chip = self._chips.get((bus, address))
        if chip is None or (bus, address) in self.dead_chips:
            raise OSError(errno.EREMOTEIO, "no chip answers")
        return chip
