"""Pins of a Raspberry Pi over lgpio that go low immediately and stay low.

Behaviour of lgpio, from the source of its transmitting thread (lg 0.2.2, `lgPthTx.c` and
`xSetAsPwm` in `lgGpio.c`):

* A new duty cycle, including 0, takes effect in the next cycle, up to 20 ms late at 50 Hz. Cycles
  of two pins start at different times, so both inputs of an H-bridge could be high for a while.
* Ending PWM (`tx_pwm` with 0 Hz) releases the pin without writing it: it keeps its current level.

After a duty of 0 the thread never writes a 1 again, so writing a plain 0 then makes the pin low
immediately.
"""

from __future__ import annotations

from typing import Any

import lgpio
from gpiozero.pins.lgpio import LGPIOFactory, LGPIOPin


class LowAtOncePin(LGPIOPin):
    """Pin that goes low immediately."""

    def close(self) -> None:
        """Leave an output as it is, at its level; an output with PWM goes low first.

        gpiozero would make it an input, which floats without a pull resistor. An output is freed
        when the chip is closed; the kernel then keeps its level or, with
        `dtparam=strict_gpiod`, makes it an input.
        """
        if self.factory._handle is None or self.function != "output":
            super().close()
        elif self._pwm is not None:
            self.frequency = None

    def output_with_state(self, state: bool) -> None:
        """Become an output at this level, without gpiozero's short low pulse first."""
        lgpio.gpio_claim_output(self.factory._handle, self._number, int(state))
        self.state = state

    def _set_state(self, value: float) -> None:
        super()._set_state(value)
        if value == 0:
            lgpio.gpio_write(self.factory._handle, self._number, 0)

    def _set_frequency(self, value: float | None) -> None:
        super()._set_frequency(value)
        if value is None or value == 0:
            lgpio.gpio_write(self.factory._handle, self._number, 0)


class LowAtOnceFactory(LGPIOFactory):
    """Factory of `LowAtOncePin`, which also sends servo pulses."""

    def __init__(self) -> None:
        super().__init__()
        self.pin_class: Any = LowAtOncePin
        self._pulsed: set[int] = set()

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send servo pulses on a pin from the next cycle on; a width of 0 stops them at once.

        Without pulses the pin is a low output until the factory is closed. The timing jitters,
        according to lgpio's documentation; a PCA9685 or the kernel's PWM (`over = "sysfs"`) is
        steadier. Widths are 500 to 2500 us, frequencies 40 to 500 Hz.
        """
        if self._handle is None:
            raise OSError("the pins are closed")
        if pin not in self._pulsed:
            lgpio.gpio_claim_output(self._handle, pin, 0)
            self._pulsed.add(pin)
        lgpio.tx_servo(self._handle, pin, width_us, frequency_hz)
        if width_us == 0:
            # lgpio releases the pin at its current level, see the module's docstring.
            lgpio.gpio_write(self._handle, pin, 0)
