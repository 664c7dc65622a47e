"""Pins, buses and pulses that remember what they were told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.robot.drivers.output import OutputDriver, open_output
from shapechanger.robot.drivers.sensor import SensorDriver, open_sensor
from shapechanger.robot.guard.plan import OutputPlan, SensorPlan
from shapechanger.robot.hardware import RealClock

MS = 1_000_000
"""Nanoseconds of a millisecond."""


class ScriptedPin(MockPWMPin):
    """A pin whose changes are logged, at a time that the test sets."""

    def _change_state(self, value: float) -> bool:
        changed = super()._change_state(value)
        self._last_change = self.factory.now_s
        if changed:
            self.factory.log.append((self.info.name, float(value)))
        return changed


class ScriptedFactory(MockFactory):
    """Makes such pins."""

    def __init__(self) -> None:
        super().__init__(pin_class=ScriptedPin)
        self.now_s = 0.0
        self.log: list[tuple[str, float]] = []

    def drive(self, pin: int, level: int, at_s: float) -> None:
        """Change an input."""
        self.now_s = at_s
        (self.pin(pin).drive_high if level else self.pin(pin).drive_low)()


class FakeBus:
    """Chips as tables of registers; a chip that is not there does not acknowledge."""

    def __init__(self, chips: dict[int, dict[int, int]]) -> None:
        self.chips = chips
        self.writes: list[tuple[int, int, list[int]]] = []
        self.closed = 0

    def _chip(self, address: int) -> dict[int, int]:
        if address not in self.chips:
            raise OSError(121, "Remote I/O error")
        return self.chips[address]

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """One register."""
        return self._chip(i2c_addr).get(register, 0)

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Set one register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Several registers."""
        chip = self._chip(i2c_addr)
        return [chip.get(register + i, 0) for i in range(length)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Set several registers."""
        chip = self._chip(i2c_addr)
        self.writes.append((i2c_addr, register, list(data)))
        chip.update({register + i: byte for i, byte in enumerate(data)})

    def close(self) -> None:
        """Let go."""
        self.closed += 1


class FakeServoPins:
    """Remembers the width of each pin's pulses."""

    def __init__(self) -> None:
        self.widths_us: dict[int, int] = {}

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses."""
        self.widths_us[pin] = width_us

    def close(self) -> None:
        """Let go."""


class FakeHardware:
    """All of it."""

    def __init__(self, chips: dict[int, dict[int, int]] | None = None) -> None:
        self.clock = RealClock()
        self.factory = ScriptedFactory()
        self.bus = FakeBus(chips or {})
        self.pulses = FakeServoPins()

    def pin_factory(self) -> Any:
        """The pins."""
        return self.factory

    def i2c(self, bus: int) -> FakeBus:
        """The one bus."""
        return self.bus

    def servo_pins(self) -> FakeServoPins:
        """The pulses."""
        return self.pulses

    def close(self) -> None:
        """Let go."""
        self.factory.close()

    def output(self, driver: str, **settings: Any) -> OutputDriver:
        """Open an output."""
        return open_output(OutputPlan("it", driver, settings=settings), self)

    def sensor(self, driver: str, **settings: Any) -> SensorDriver:
        """Open a sensor."""
        return open_sensor(SensorPlan("it", driver, "", settings=settings), self)
