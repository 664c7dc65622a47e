"""Servo pulses on the twin's pins, as `lgpio.tx_servo` makes them."""

from __future__ import annotations

from shapechanger.robot.hardware import Clock
from shapechanger.twin.wired import BoardLink

__all__ = ["TwinServoPins"]


class TwinServoPins:
    """Pins that send pulses of whole microseconds.

    The pulses come from a thread of the process, so they end with it, and the pin keeps whatever
    level it has at that moment.

    Args:
        link: The connection to the board.
        clock: Where the time of a change comes from.
    """

    def __init__(self, link: BoardLink, clock: Clock) -> None:
        self._link = link
        self._clock = clock
        self._pulses: dict[int, tuple[int, int]] = {}

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses of this width on a BCM pin from now on; 0 for none."""
        if pin not in self._pulses:
            now_ns = self._clock.now_ns()
            claim = {"op": "claim", "pin": pin, "mode": "output", "pull": "floating", "level": 0}
            self._link.ask(**claim, t=now_ns)
        pulse = (int(width_us), int(frequency_hz))
        if self._pulses.get(pin) != pulse:
            self._link.post(op="pulse", pin=pin, us=pulse[0], hz=pulse[1], t=self._clock.now_ns())
            self._pulses[pin] = pulse

    def close(self) -> None:
        """End all pulses; the pins stay low."""
        if not self._link.closed:
            for pin, (_, frequency_hz) in list(self._pulses.items()):
                self.pulse(pin, 0, frequency_hz)
        self._pulses.clear()
