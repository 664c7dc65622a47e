"""Servo pulses by lgpio: software timing, in whole microseconds."""

from __future__ import annotations

from contextlib import ExitStack

import lgpio

from shapechanger.robot.drivers.lgpio_pins import open_gpio_chip

__all__ = ["LgpioServoPins"]


class LgpioServoPins:
    """Pins that send servo pulses; see `ServoPins`.

    Their timing jitters, as lgpio's own documentation says; a PCA9685 or the kernel's PWM
    (`over = "sysfs"`) is steadier. lgpio takes 500 to 2500 us at 40 to 500 Hz.
    """

    def __init__(self) -> None:
        self._handle: int | None = open_gpio_chip()
        self._pins: set[int] = set()

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses of this width from the next cycle on; 0 for none, at once."""
        if self._handle is None:
            raise OSError("the servo pins are closed")
        if pin not in self._pins:
            lgpio.gpio_claim_output(self._handle, pin, 0)
            self._pins.add(pin)
        lgpio.tx_servo(self._handle, pin, width_us, frequency_hz)
        if width_us == 0:
            # lgpio forgets the pin at the level of that moment, see `lgpio_pins`.
            lgpio.gpio_write(self._handle, pin, 0)

    def close(self) -> None:
        """End all pulses; the pins stay low outputs until the chip is closed."""
        if self._handle is None:
            return
        with ExitStack() as stack:
            stack.callback(self._let_go, self._handle)
            for pin in self._pins:
                stack.callback(self.pulse, pin, 0, 50)

    def _let_go(self, handle: int) -> None:
        self._handle = None
        lgpio.gpiochip_close(handle)
