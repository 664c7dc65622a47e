"""Fake pins, buses and pulses that record what was written."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OUTPUTS, SENSORS, OutputDriver, SensorDriver
from shapechanger.robot.drivers.servos.servo import ServoPort
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.hardware import Clock

MS = 1_000_000
"""Nanoseconds of a millisecond."""


class Fault:
    """Makes one armed operation on the hardware fail."""

    def __init__(self) -> None:
        self._left = 0
        self._takes_effect = False
        self.happened = False  # Whether the operation was reached and failed.

    def arm(self, operation: int, takes_effect: bool) -> None:
        """Make operation number `operation`, from 1, fail.

        It may still take effect, for example if a chip acknowledges it late.
        """
        self._left, self._takes_effect, self.happened = operation, takes_effect, False

    def disarm(self) -> None:
        self._left = 0

    def during(self, operation: Callable[[], None]) -> None:
        self._left -= 1
        fails = self._left == 0
        if not fails or self._takes_effect:
            operation()
        if fails:
            self.happened = True
            raise OSError(110, "Connection timed out")


class ScriptedPin(MockPWMPin):
    """A pin that logs its changes, at times set by the test."""

    def _set_state(self, value: float) -> None:
        self.factory.fault.during(lambda: super(ScriptedPin, self)._set_state(value))

    def _change_state(self, value: float) -> bool:
        changed = super()._change_state(value)
        self._last_change = self.factory.now_s
        if changed:
            self.factory.log.append((self.info.name, float(value)))
        return changed


class ScriptedFactory(MockFactory):
    """Factory of scripted pins, and the width of the servo pulses on each."""

    def __init__(self) -> None:
        super().__init__(pin_class=ScriptedPin)
        self.now_s = 0.0
        self.log: list[tuple[str, float]] = []
        self.fault = Fault()
        self.widths_us: dict[int, int] = {}

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        self.fault.during(functools.partial(self.widths_us.__setitem__, pin, width_us))

    def drive(self, pin: int, level: int, at_s: float) -> None:
        self.now_s = at_s
        (self.pin(pin).drive_high if level else self.pin(pin).drive_low)()


class FakeBus:
    """Chips as tables of registers; an absent chip does not acknowledge."""

    def __init__(self, chips: dict[int, dict[int, int]], fault: Fault) -> None:
        self.chips = chips
        self._fault = fault
        self.writes: list[tuple[int, int, list[int]]] = []
        self.closed = 0

    def _chip(self, address: int) -> dict[int, int]:
        if address not in self.chips:
            raise OSError(121, "Remote I/O error")
        return self.chips[address]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        self.write_i2c_block_data(i2c_addr, value, [])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        chip = self._chip(i2c_addr)
        return [chip.get(register + i, 0) for i in range(length)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        chip = self._chip(i2c_addr)
        self.writes.append((i2c_addr, register, list(data)))
        for i, byte in enumerate(data):  # A transfer may fail in the middle.
            self._fault.during(functools.partial(chip.__setitem__, register + i, byte))

    def close(self) -> None:
        self.closed += 1


class FakeHardware:
    """All fake hardware of a robot."""

    def __init__(self, chips: dict[int, dict[int, int]] | None = None) -> None:
        self.clock = Clock()
        self.factory = ScriptedFactory()
        self.fault = self.factory.fault
        self.bus = FakeBus(chips or {}, self.fault)

    def pin_factory(self) -> Any:
        return self.factory

    def i2c(self, bus: int) -> FakeBus:
        return self.bus

    def servo_port(self, settings: BusSettings, open_port: object) -> ServoPort:
        raise RobotError(f"The bus at {settings.device} cannot be opened.")

    def close(self) -> None:
        self.factory.close()

    def output(self, driver: str, **settings: Any) -> OutputDriver:
        return OUTPUTS[driver].open(OutputPlan("it", driver, settings=settings), self)

    def sensor(self, driver: str, **settings: Any) -> SensorDriver:
        return SENSORS[driver].open(SensorPlan("it", driver, "", settings=settings), self)
