"""Pins of a Raspberry Pi, with a fake lgpio modelled on lgpio's source."""

import collections
import importlib
import sys
import types
from collections.abc import Iterator
from typing import Any

import pytest

_OURS = "shapechanger.robot.lgpio_pins"


class _Lgpio(types.ModuleType):
    """Levels and PWM of a chip; a new duty waits for the end of the cycle, like `lgPthTx.c`'s."""

    SET_PULL_NONE, SET_PULL_UP, SET_PULL_DOWN = 0, 1, 2
    BOTH_EDGES, RISING_EDGE, FALLING_EDGE = 3, 1, 2

    class error(Exception):
        pass

    def __init__(self) -> None:
        super().__init__("lgpio")
        self.outputs: set[int] = set()
        self.levels: dict[int, int] = {}
        self.pwm: dict[int, tuple[float, float]] = {}
        self.pulses: dict[int, int] = {}
        self.closed = False

    def gpiochip_open(self, chip: int) -> int:
        if chip != 0:
            raise self.error("can not open gpiochip")
        return 7

    def gpiochip_close(self, handle: int) -> None:
        self.closed = True

    def gpio_claim_input(self, handle: int, pin: int, flags: int = 0) -> None:
        self.outputs.discard(pin)
        self.pwm.pop(pin, None)

    def gpio_claim_output(self, handle: int, pin: int, level: int = 0, flags: int = 0) -> None:
        if pin not in self.outputs:
            self.outputs.add(pin)
            self.levels[pin] = level

    def gpio_get_mode(self, handle: int, pin: int) -> int:
        return 2 if pin in self.outputs else 0

    def gpio_read(self, handle: int, pin: int) -> int:
        return self.levels.get(pin, 0)

    def gpio_write(self, handle: int, pin: int, level: int) -> None:
        self.levels[pin] = level

    def tx_pwm(self, handle: int, pin: int, hz: float, duty: float) -> None:
        if hz == 0:
            self.pwm.pop(pin, None)  # The level stays.
        else:
            self.pwm[pin] = (hz, duty)
            if duty > 0:
                self.levels[pin] = 1  # Now in the high phase; a duty of 0 acts later.

    def tx_servo(self, handle: int, pin: int, width_us: int, hz: int) -> None:
        self.pulses[pin] = width_us
        if width_us > 0:
            self.levels[pin] = 1


@pytest.fixture
def lgpio(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Lgpio]:
    """A Raspberry Pi 4 with the fake lgpio."""
    fake = _Lgpio()
    for name in ("gpiozero.pins.lgpio", _OURS):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "lgpio", fake)
    monkeypatch.setattr("gpiozero.pins.local.get_pi_revision", lambda: 0xC03115)
    # gpiozero shares the pins of all factories on one machine.
    monkeypatch.setattr("gpiozero.pins.local.LocalPiFactory.pins", {})
    monkeypatch.setattr(
        "gpiozero.pins.local.LocalPiFactory._reservations", collections.defaultdict(list)
    )
    yield fake
    for name in ("gpiozero.pins.lgpio", _OURS):
        sys.modules.pop(name, None)


def _factory() -> Any:
    return importlib.import_module(_OURS).LowAtOnceFactory()


def test_pwm_ends_low_at_once_and_stays_low_when_closed(lgpio: _Lgpio) -> None:
    """Plain gpiozero leaves a pin high for up to 20 ms at 50 Hz, and closes it as an input."""
    from gpiozero import Motor

    factory = _factory()
    motor = Motor(22, 27, pin_factory=factory)
    motor.forward(0.4)
    motor.backward(0.4)
    assert (lgpio.levels[22], lgpio.levels[27]) == (0, 1)
    motor.stop()
    assert (lgpio.levels[22], lgpio.levels[27]) == (0, 0)
    motor.forward(1.0)
    motor.close()
    factory.close()
    assert lgpio.outputs == {22, 27}
    assert (lgpio.levels[22], lgpio.levels[27]) == (0, 0)
    assert lgpio.closed


def test_active_low_output_stays_high_when_opened_and_closed(lgpio: _Lgpio) -> None:
    """A low OE input of a PCA9685 would enable stale pulses."""
    from gpiozero import DigitalOutputDevice

    factory = _factory()
    device = DigitalOutputDevice(26, active_high=False, pin_factory=factory)
    assert lgpio.levels[26] == 1
    device.close()
    factory.close()
    assert (26 in lgpio.outputs, lgpio.levels[26]) == (True, 1)


def test_servo_pulses_are_whole_microseconds_and_end_low(lgpio: _Lgpio) -> None:
    """A width of 0 sets the pin low; lgpio alone would keep the present level."""
    factory = _factory()
    factory.pulse(17, 1503, 50)
    assert (lgpio.pulses[17], lgpio.levels[17]) == (1503, 1)
    factory.pulse(17, 0, 50)
    assert (lgpio.pulses[17], lgpio.levels[17]) == (0, 0)
    factory.close()
    assert (17 in lgpio.outputs, lgpio.levels[17], lgpio.closed) == (True, 0, True)
