"""The board's pins and chips: who drives what, and what is left when a process dies."""

from __future__ import annotations

import errno
import random
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal, Protocol, runtime_checkable

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.settings import texts, whole, wholes
from shapechanger.robot.guard.plan import GuardPlan, SensorPlan
from shapechanger.twin.chips import (
    Behind,
    Chip,
    SimulatedAs5600,
    SimulatedIna219,
    SimulatedMpu6050,
    SimulatedPca9685,
    Tca9548a,
)
from shapechanger.twin.signals import Ledger, Levels, Pulse, PwmChannel
from shapechanger.twin.wiring import TwinWiring
from shapechanger.worlds.world import World

__all__ = ["JointWorld", "Owner", "PinBoard", "chips_of", "joint_chips"]

_AS5600: Final = 0x36


@runtime_checkable
class JointWorld(Protocol):
    """A world with joints that somebody measures."""

    def measured_angle(self, joint: str) -> float:
        """One reading of the angle of a joint, rad, with the noise of its sensor.

        Raises:
            RobotError: If there is no such joint.
        """
        ...


def joint_chips(plan: SensorPlan, world: World) -> dict[tuple[int, int], Chip]:
    """The multiplexer and what is behind it, by bus and address.

    Args:
        plan: The encoders of some joints.
        world: What they measure; where it has no joints they stand at their zero.

    Raises:
        RobotError: If the world has other joints.
    """
    measured = world.measured_angle if isinstance(world, JointWorld) else _at_zero
    columns = (wholes(plan.settings, key) for key in ("channels", "zeros", "directions"))
    behind: dict[int, Chip] = {}
    for joint, *row in zip(texts(plan.settings, "joints"), *columns, strict=True):
        measured(joint)  # Says in words what it does not know.
        channel, zero, direction = row
        behind[channel] = SimulatedAs5600(joint, partial(measured, joint), zero, direction)
    bus, mux = whole(plan.settings, "bus"), Tca9548a(behind)
    return {(bus, whole(plan.settings, "mux")): mux, (bus, _AS5600): Behind(mux)}


def _at_zero(joint: str) -> float:
    return 0.0


@dataclass(frozen=True, slots=True)
class Owner:
    """A process that holds pins.

    Attributes:
        connection: What tells it from others.
        pid: Its number.
    """

    connection: Hashable
    pid: int


@dataclass(slots=True)
class _Line:
    """A pin that a process has claimed, or had when it died."""

    owner: Owner | None = None
    mode: Literal["input", "output"] = "input"
    pull: str = "floating"
    hz: float = 0
    phase_ns: int = 0  # When a period of its pulses began.


class PinBoard:
    """Pins, pulses and chips; it writes all that happens to them into the ledger.

    Args:
        wiring: What is attached, for the level of pins that nobody drives.
        chips: Chips by bus and address.
        ledger: Where changes go.
        seed: Of the phase of software PWM.

    Attributes:
        levels: What all outputs do now.
        on_output: Called with time, pin and duty at each change of a pin.
        dead_chips: Chips that do not answer.
    """

    def __init__(
        self,
        wiring: TwinWiring,
        chips: Mapping[tuple[int, int], Chip],
        ledger: Ledger,
        seed: int,
    ) -> None:
        self._wiring = wiring
        self._chips = dict(chips)
        self._ledger = ledger
        self._random = random.Random(f"phase {seed}")
        self._lines: dict[int, _Line] = {}
        self.levels = Levels()
        self.on_output: Callable[[int, int, float], None] | None = None
        self.dead_chips: set[tuple[int, int]] = set()
        for address, chip in self._chips.items():
            if isinstance(chip, SimulatedPca9685):
                self._take_channels(address, chip)

    def owner(self, pin: int) -> Owner | None:
        """Who holds a pin."""
        line = self._lines.get(pin)
        return None if line is None else line.owner

    def claim(
        self,
        owner: Owner,
        pin: int,
        mode: Literal["input", "output"],
        pull: str,
        level: int,
        t: int,
    ) -> int:
        """Take a pin.

        Args:
            owner: Who takes it.
            pin: Its BCM number.
            mode: What it is from now on.
            pull: Which way an input is pulled.
            level: Where an output begins.
            t: The time.

        Returns:
            Its level; that of an input as far as its pull and the resistors around it make it.

        Raises:
            RobotError: If another process holds it.
        """
        line = self._lines.setdefault(pin, _Line())
        if line.owner is not None and line.owner != owner:
            raise RobotError(f"GPIO{pin} is busy: process {line.owner.pid} holds it.")
        line.owner, line.mode, line.pull, line.hz = owner, mode, pull, 0
        if mode == "output":
            self._drive(owner.pid, pin, float(level), 0, t)
            return level
        if pin in self.levels.duties:
            self.levels.release(pin)
            idle = self._wiring.idle_level(pin)
            self._ledger.write(
                t, "pin", pin=pin, duty=float(idle), hz=0, pid=owner.pid, released=True
            )
            self._tell(t, pin, float(idle))
        if pull == "floating":
            return self._wiring.idle_level(pin)
        return int(pull == "up")

    def drive(self, owner: Owner, pin: int, duty: float, hz: float, t: int) -> None:
        """Set an output's level, or the duty of its software PWM.

        Raises:
            RobotError: If the process does not hold the pin as an output.
        """
        self._start_pulses(self._output(owner, pin), hz, t)
        self._drive(owner.pid, pin, duty, hz, t)

    def pulse(self, owner: Owner, pin: int, us: float, hz: float, t: int) -> None:
        """Send servo pulses on an output.

        Raises:
            RobotError: If the process does not hold the pin as an output.
        """
        self._start_pulses(self._output(owner, pin), hz if us else 0, t)
        pulse = Pulse(us, hz)
        if self.levels.pulses.get(pin) != pulse:
            self.levels.pulse(pin, pulse)
            self._ledger.write(t, "pulse", pin=pin, us=us, hz=hz, pid=owner.pid)

    def leave(self, owner: Owner, t: int, *, died: bool) -> None:
        """A process has ended: its outputs keep the level that they have at that moment."""
        if died:
            self._ledger.write(t, "gone", pid=owner.pid)
        for pin, line in sorted(self._lines.items()):
            if line.owner != owner:
                continue
            line.owner = None
            if line.mode != "output" or not (died or line.hz):
                continue
            duty = self.levels.duties.get(pin, 0.0)
            if line.hz and 0.0 < duty < 1.0:
                period_ns = 1e9 / line.hz
                duty = float((t - line.phase_ns) % period_ns < duty * period_ns)
            line.hz = 0
            self.levels.drive(pin, duty, t)
            self._ledger.write(t, "pin", pin=pin, duty=duty, hz=0, pid=owner.pid)
            self._tell(t, pin, duty)

    def read_chip(self, bus: int, address: int, register: int, length: int) -> list[int]:
        """Read registers.

        Raises:
            OSError: If no chip answers, with the number that the kernel's driver gives.
        """
        return self._chip(bus, address).read(register, length)

    def write_chip(
        self, pid: int, bus: int, address: int, register: int, data: list[int], t: int
    ) -> None:
        """Write registers.

        Raises:
            OSError: If no chip answers, with the number that the kernel's driver gives.
        """
        chip = self._chip(bus, address)
        chip.write(register, data)
        if isinstance(chip, Tca9548a):
            return  # It moves nothing, and hundreds of such bytes a second would fill the ledger.
        self._ledger.write(
            t, "i2c", bus=bus, address=address, register=register, data=data, pid=pid
        )
        if isinstance(chip, SimulatedPca9685):
            for channel, pulse in self._take_channels((bus, address), chip):
                self._ledger.write(
                    t,
                    "i2c",
                    bus=bus,
                    address=address,
                    channel=channel,
                    us=round(pulse.us, 3),
                    hz=round(pulse.hz, 3),
                    pid=pid,
                )

    def encoder(self, joint: str) -> SimulatedAs5600:
        """The encoder of a joint.

        Raises:
            UnknownName: If no encoder is on such a joint.
        """
        muxes = [chip for chip in self._chips.values() if isinstance(chip, Tca9548a)]
        behind = [chip for mux in muxes for chip in mux.channels.values()]
        encoders = {chip.joint: chip for chip in behind if isinstance(chip, SimulatedAs5600)}
        if joint not in encoders:
            raise UnknownName("joint with an encoder", joint, encoders)
        return encoders[joint]

    def _take_channels(
        self, at: tuple[int, int], chip: SimulatedPca9685
    ) -> list[tuple[int, Pulse]]:
        """Follow a chip's channels; those that changed."""
        changed: list[tuple[int, Pulse]] = []
        for number, pulse in enumerate(chip.channels):
            channel = PwmChannel(*at, number)
            before = self.levels.channels.get(channel, Pulse(0.0, 0.0))
            if pulse.us != before.us or (pulse.us and pulse.hz != before.hz):
                changed.append((number, pulse))
                self.levels.channels[channel] = pulse
        return changed

    def _output(self, owner: Owner, pin: int) -> _Line:
        line = self._lines.get(pin)
        if line is None or line.owner != owner or line.mode != "output":
            raise RobotError(f"Process {owner.pid} does not hold GPIO{pin} as an output.")
        return line

    def _start_pulses(self, line: _Line, hz: float, t: int) -> None:
        if hz and hz != line.hz:
            line.phase_ns = t - int(self._random.random() * 1e9 / hz)
        line.hz = hz

    def _drive(self, pid: int, pin: int, duty: float, hz: float, t: int) -> None:
        self.levels.drive(pin, duty, t)
        self._ledger.write(t, "pin", pin=pin, duty=duty, hz=hz, pid=pid)
        self._tell(t, pin, duty)

    def _tell(self, t: int, pin: int, duty: float) -> None:
        if self.on_output is not None:
            self.on_output(t, pin, duty)

    def _chip(self, bus: int, address: int) -> Chip:
        chip = self._chips.get((bus, address))
        if chip is None or (bus, address) in self.dead_chips:
            raise OSError(errno.EREMOTEIO, "no chip answers")
        return chip


def chips_of(plan: GuardPlan, world: World) -> dict[tuple[int, int], Chip]:
    """The chips that a robot has, by bus and address.

    Raises:
        RobotError: If the world has other joints than the robot.
    """
    readings = world.inputs
    chips: dict[tuple[int, int], Chip] = {}
    for output in plan.outputs:
        if output.settings.get("over") == "pca9685":
            at = whole(output.settings, "bus"), whole(output.settings, "address")
            chips.setdefault(at, SimulatedPca9685())
    for sensor in plan.sensors:
        if sensor.driver in ("mpu6050", "ina219"):
            at = whole(sensor.settings, "bus"), whole(sensor.settings, "address")
            chips[at] = (
                SimulatedMpu6050(readings)
                if sensor.driver == "mpu6050"
                else SimulatedIna219(readings)
            )
        elif sensor.driver == "as5600":
            chips |= joint_chips(sensor, world)
    return chips
