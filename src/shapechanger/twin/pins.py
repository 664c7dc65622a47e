"""The twin's pins, for gpiozero's devices.

A pin does what `LowAtOncePin` does on a Raspberry Pi, which is gpiozero's lgpio pin made to be low
at once (see `shapechanger.robot.drivers.lgpio_pins`):

* Opening a pin makes it an input without a pull, so it floats to the level that its resistors give
  it; it becomes an output straight at the level that it is opened with.
* Software PWM has whole percent (`int(value * 100)`) and a whole frequency.
* An output that is closed stays an output, at its level; one with PWM goes low first. An input that
  is closed loses its pull.
* When the process dies, its outputs keep their level, and software PWM stops where it is.

Two things are simpler than on the Pi: a new duty cycle above 0 acts at once and not from the next
cycle on, and contacts do not bounce, so that `bounce` changes nothing.
"""

from __future__ import annotations

from typing import Any, Final

from gpiozero import PinInvalidState, PinSetInput
from gpiozero.pins.pi import PiFactory, PiPin

from shapechanger.errors import RobotError
from shapechanger.robot.hardware import Clock
from shapechanger.twin.wired import BoardLink

__all__ = ["TwinPin", "TwinPinFactory"]

_REVISION: Final = 0xC03115
"""A Raspberry Pi 4B with 4 GB; its header has the pins of all newer ones."""


class TwinPin(PiPin):
    """One pin of the board."""

    def __init__(self, factory: TwinPinFactory, info: Any) -> None:
        super().__init__(factory, info)
        self._link = factory.link
        self._function = "input"
        self._pull = "floating"
        self._bounce: float | None = None
        self._edges = "both"
        self._watched = False
        self._pwm_hz = 0
        self._duty = 0.0
        self._claim()

    @property
    def number(self) -> int:
        """The BCM number."""
        return self._number

    def close(self) -> None:
        """Leave an output as it is, low if it had PWM; take the pull from an input."""
        if self._link.closed:
            return
        if self._function == "output":
            self.frequency = None
        else:
            self._pull = "floating"
            self._watched = False
            self._claim()

    def output_with_state(self, state: bool) -> None:
        """Become an output at this level, or take it, if it is an output already."""
        if self._function != "output":
            self._function, self._pull, self._watched = "output", "floating", False
            self._claim(int(state))
        self.state = state

    def notice(self, level: int, at_ns: int) -> None:
        """Tell whoever watches this pin that its level has changed."""
        if self._watched and self._edges in ("both", "rising" if level else "falling"):
            self._call_when_changed(at_ns / 1e9, level)

    def _claim(self, level: int = 0) -> None:
        answer = self._link.ask(
            op="claim",
            pin=self._number,
            mode=self._function,
            pull=self._pull,
            level=level,
            t=self.factory.clock.now_ns(),
        )
        self._pwm_hz, self._duty = 0, float(answer["level"])
        self._link.levels[self._number] = answer["level"]

    def _put(self, duty: float, hz: int) -> None:
        if (duty, hz) == (self._duty, self._pwm_hz):
            return
        now_ns = self.factory.clock.now_ns()
        self._link.post(op="pin", pin=self._number, duty=duty, hz=hz, t=now_ns)
        self._duty, self._pwm_hz = duty, hz

    def _get_function(self) -> str:
        return self._function

    def _set_function(self, value: str) -> None:
        if value not in ("input", "output"):
            raise ValueError(f"A pin is an input or an output, not {value!r}.")
        self._function = value
        self._pull = "floating"
        self._watched = False
        self._claim()

    def _get_state(self) -> float:
        if self._pwm_hz or self._function == "output":
            return self._duty
        self._link.drain()
        return self._link.levels[self._number]

    def _set_state(self, value: float) -> None:
        if self._function == "input":
            raise PinSetInput(f"cannot set state of pin {self!r}")
        if not 0 <= value <= 1:
            raise PinInvalidState(f"invalid state {value!r} for pin {self!r}")
        if self._pwm_hz:
            self._put(int(value * 100) / 100, self._pwm_hz)
        else:
            self._put(float(bool(value)), 0)

    def _get_frequency(self) -> float | None:
        return self._pwm_hz or None

    def _set_frequency(self, value: float | None) -> None:
        if not value:
            if self._pwm_hz and not self._link.closed:
                self._put(0.0, 0)
        elif self._function != "output":
            raise RobotError(f"{self!r} is an input, and cannot send PWM.")
        else:
            self._put(self._duty if self._pwm_hz else 0.0, int(value))

    def _get_pull(self) -> str:
        return self._pull

    def _set_pull(self, value: str) -> None:
        if self._function != "input" or value not in ("up", "down", "floating"):
            raise RobotError(f"{self!r} is an {self._function}, and takes no pull {value!r}.")
        self._pull = value
        self._claim()

    def _get_bounce(self) -> float | None:
        return self._bounce

    def _set_bounce(self, value: float | None) -> None:
        self._bounce = value

    def _get_edges(self) -> str:
        return self._edges

    def _set_edges(self, value: str) -> None:
        self._edges = value

    def _enable_event_detect(self) -> None:
        self._watched = True

    def _disable_event_detect(self) -> None:
        self._watched = False


class TwinPinFactory(PiFactory):
    """Makes pins of a board.

    Nothing of it runs by itself: edges of inputs are dispatched while the process waits on the
    clock.

    Args:
        link: The connection to the board.
        clock: Where time comes from.
    """

    def __init__(self, link: BoardLink, clock: Clock) -> None:
        super().__init__()
        self.link = link
        self.clock = clock
        self.pin_class = TwinPin
        self._by_number: dict[int, TwinPin] = {}
        link.on_edge = self._notice

    def pin(self, name: int | str) -> TwinPin:
        """A pin by its name, such as 22, "GPIO22" or "BOARD15"."""
        pin: TwinPin = super().pin(name)
        self._by_number[pin.number] = pin
        return pin

    def close(self) -> None:
        """Close all pins."""
        super().close()
        self._by_number.clear()

    def ticks(self) -> float:
        """The clock's time in seconds."""
        return self.clock.now_ns() / 1e9

    def ticks_diff(self, later: float, earlier: float) -> float:
        """Seconds from one of `ticks` to another."""
        return later - earlier

    def _get_revision(self) -> int:
        return _REVISION

    def _notice(self, pin: int, level: int, at_ns: int) -> None:
        if (noticing := self._by_number.get(pin)) is not None:
            noticing.notice(level, at_ns)
