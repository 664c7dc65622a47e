"""Pins, chips and servos of the board: their owners, and the levels that outlive a process."""

from __future__ import annotations

import errno
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from shapechanger.contract.world import World
from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.as5600 import SimulatedAs5600, SimulatedJoints
from shapechanger.robot.drivers.chip import PULSES
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.rig import Rig
from shapechanger.robot.drivers.simulation import (
    Edge,
    Levels,
    Pulse,
    PwmChannel,
    SimulatedChip,
)
from shapechanger.robot.twin.sensors import Surroundings
from shapechanger.robot.twin.signals import LedgerWriter
from shapechanger.robot.twin.wiring import TwinWiring


class Owner(Protocol):
    """Connection of a process that holds pins; two connections of one process are two owners."""

    pid: int


@dataclass(slots=True)
class _Claim:
    """A pin that a process holds, or held until it ended."""

    owner: Owner | None = None
    mode: Literal["input", "output"] = "input"
    hz: float = 0
    phase_ns: int = 0  # Start of a period of its PWM or pulses.


class PinBoard:
    """Pins, pulses, chips and servos, with the world that moves their sensors.

    Args:
        wiring: What is attached; it gives undriven pins their level.
        world: World of the robot.
        ledger: Record of the changes of outputs; None to keep none.
        seed: Seed of the phase of software PWM.
        now_ns: Time, ns.

    Attributes:
        levels: State of all outputs.
        sensors: The sensors.
        rig: Servos on a bus; None without any.
        dead_chips: Bus and address of the chips that do not answer.
    """

    def __init__(
        self, wiring: TwinWiring, world: World, ledger: LedgerWriter | None, seed: int, now_ns: int
    ) -> None:
        self._wiring = wiring
        self._ledger = ledger
        self._random = random.Random(f"phase {seed}")
        self._claims: dict[int, _Claim] = {}
        self.levels = Levels()
        self._surroundings = Surroundings(wiring, world, now_ns)
        self.sensors = self._surroundings.sensors
        self.rig = self._surroundings.rig
        self.dead_chips: set[tuple[int, int]] = set()
        self._chips: dict[tuple[int, int], SimulatedChip] = {}
        for output in wiring.plan.outputs:
            if over := output.settings.get("over"):
                # Channels of one board share it.
                self._chips = {**PULSES[over].chips(output.settings), **self._chips}
        for sensor in self.sensors.sensors.values():
            self._chips.update(sensor.chips)
        for address, chip in self._chips.items():
            self._update_channels(address, chip)

    def advance(self, now_ns: int) -> list[Edge]:
        """Advance the world to a time and return the edges of inputs on the way."""
        return self._surroundings.advance(now_ns, self.levels)

    def require_rig(self) -> Rig:
        """Return the servos; raise RobotError without servos."""
        if self.rig is None:
            raise RobotError("This twin has no servo bus.")
        return self.rig

    def owner(self, pin: int) -> Owner | None:
        """Return the owner of a pin; None for a free one."""
        claim = self._claims.get(pin)
        return None if claim is None else claim.owner

    def reader(self, pin: int) -> Owner | None:
        """Return the owner of an input; None for other pins."""
        claim = self._claims.get(pin)
        return claim.owner if claim is not None and claim.mode == "input" else None

    @property
    def functions(self) -> tuple[Callable[..., object], ...]:
        """Functions of a robot's processes; each takes the process and the time, ns, first.

        They raise RobotError if another process holds the pin, or this one has not claimed it, and
        OSError with the `errno` of the kernel's driver if no chip answers.
        """
        return (
            self.claim,
            self.drive,
            self.pulse,
            self.read_chip,
            self.write_chip,
            self.read_servos,
            self.write_servos,
        )

    def claim(
        self,
        owner: Owner,
        t: int,
        pin: int,
        mode: Literal["input", "output"],
        pull: str,
        level: int,
    ) -> int:
        """Claim a pin, and return its level: for an input its sensor's, pull's or resistors'."""
        claim = self._claims.setdefault(pin, _Claim())
        if claim.owner is not None and claim.owner is not owner:
            raise RobotError(f"GPIO{pin} is busy: process {claim.owner.pid} holds it.")
        claim.owner, claim.mode, claim.hz = owner, mode, 0
        if mode == "output":
            self._drive(owner.pid, pin, float(level), 0, t)
            return level
        idle = self._wiring.idle_level(pin)
        if pin in self.levels.duties:
            self.levels.release(pin)
            self._record(t, "pin", pin=pin, duty=float(idle), hz=0, pid=owner.pid, released=True)
            self.sensors.output_changed(t, pin, float(idle))
        if pull != "floating" and not self._wiring.has_resistor(pin):
            idle = int(pull == "up")
        return self.sensors.levels.get(pin, idle)

    def drive(self, owner: Owner, t: int, pin: int, duty: float, hz: int) -> None:
        """Set the level of an output (`hz` 0), or the duty of its software PWM."""
        self._start_pulses(self._output(owner, pin), hz, t)
        self._drive(owner.pid, pin, duty, hz, t)

    def pulse(self, owner: Owner, t: int, pin: int, us: int, hz: int) -> None:
        """Send servo pulses on an output; a width of 0 us ends them."""
        self._start_pulses(self._output(owner, pin), hz if us else 0, t)
        pulse = Pulse(us, hz)
        if self.levels.pulses.get(pin) != pulse:
            self.levels.pulse(pin, pulse)
            self._record(t, "pulse", pin=pin, us=us, hz=hz, pid=owner.pid)

    def read_chip(
        self, owner: Owner, t: int, bus: int, address: int, register: int, length: int
    ) -> list[int]:
        """Read registers of an I2C chip."""
        return self._chip(bus, address).read(register, length)

    def write_chip(
        self, owner: Owner, t: int, bus: int, address: int, register: int, data: list[int]
    ) -> None:
        """Write registers of an I2C chip."""
        chip = self._chip(bus, address)
        chip.write(register, data)
        if not chip.is_logged:
            return
        at = {"bus": bus, "address": address}
        self._record(t, "i2c", **at, register=register, data=data, pid=owner.pid)
        for channel, pulse in self._update_channels((bus, address), chip):
            us, hz = round(pulse.us, 3), round(pulse.hz, 3)
            self._record(t, "i2c", **at, channel=channel, us=us, hz=hz, pid=owner.pid)

    def read_servos(
        self, owner: Owner, t: int, device: str, ids: list[int], at: int, size: int
    ) -> dict[int, ServoReply]:
        """Read bytes of servos, and return their replies by id."""
        return self._rig_at(device).bus.read(ids, at, size)

    def write_servos(
        self, owner: Owner, t: int, device: str, data: dict[int, bytes], at: int
    ) -> dict[int, ServoReply]:
        """Write bytes of servos, and return their replies by id."""
        return self._rig_at(device).bus.write(data, at)

    def leave(self, owner: Owner, t: int, *, died: bool) -> None:
        """Free the pins of a process that has ended; outputs keep their level of that moment.

        Args:
            owner: The process.
            t: Time, ns.
            died: Whether it ended without closing its pins.
        """
        if died:
            self._record(t, "gone", pid=owner.pid)
        for pin, claim in sorted(self._claims.items()):
            if claim.owner is not owner:
                continue
            claim.owner = None
            if claim.mode != "output" or not (died or claim.hz):
                continue
            duty = self.levels.duties.get(pin, 0.0)
            if claim.hz and 0.0 < duty < 1.0:
                period_ns = 1e9 / claim.hz
                duty = float((t - claim.phase_ns) % period_ns < duty * period_ns)
            claim.hz = 0
            self._drive(owner.pid, pin, duty, 0, t)

    def encoder(self, joint: str) -> SimulatedAs5600:
        """Return the encoder of a joint."""
        joints = self.sensors.of_kind(SimulatedJoints)
        encoders = {name: one for some in joints for name, one in some.encoders.items()}
        if joint not in encoders:
            raise UnknownName("joint with an encoder", joint, encoders)
        return encoders[joint]

    def _record(self, t: int, kind: str, **fields: Any) -> None:
        if self._ledger is not None:
            self._ledger.write(t, kind, **fields)

    def _rig_at(self, device: str) -> Rig:
        rig = self.require_rig()
        rig.require(device)
        return rig

    def _update_channels(self, at: tuple[int, int], chip: SimulatedChip) -> list[tuple[int, Pulse]]:
        """Update the levels of a chip's channels and return those that changed."""
        changed: list[tuple[int, Pulse]] = []
        for number, pulse in enumerate(chip.pulses):
            channel = PwmChannel(*at, number)
            before = self.levels.channels.get(channel, Pulse(0.0, 0.0))
            if pulse.us != before.us or (pulse.us and pulse.hz != before.hz):
                changed.append((number, pulse))
                self.levels.channels[channel] = pulse
        return changed

    def _output(self, owner: Owner, pin: int) -> _Claim:
        claim = self._claims.get(pin)
        if claim is None or claim.owner is not owner or claim.mode != "output":
            raise RobotError(f"Process {owner.pid} does not hold GPIO{pin} as an output.")
        return claim

    def _start_pulses(self, claim: _Claim, hz: float, t: int) -> None:
        if hz and hz != claim.hz:
            claim.phase_ns = t - int(self._random.random() * 1e9 / hz)
        claim.hz = hz

    def _drive(self, pid: int, pin: int, duty: float, hz: float, t: int) -> None:
        self.levels.drive(pin, duty, t)
        self._record(t, "pin", pin=pin, duty=duty, hz=hz, pid=pid)
        self.sensors.output_changed(t, pin, duty)

    def _chip(self, bus: int, address: int) -> SimulatedChip:
        chip = self._chips.get((bus, address))
        if chip is None or (bus, address) in self.dead_chips:
            raise OSError(errno.EREMOTEIO, "no chip answers")
        return chip
