"""gpiozero's pins on a board."""

from __future__ import annotations

from typing import Any, Final

from gpiozero import PinSetInput
from gpiozero.pins.pi import PiFactory, PiPin

from shapechanger.robot.hardware import Clock
from shapechanger.robot.twin.rpc import BoardClient

_REVISION: Final = 0xC03115  # Raspberry Pi 4B with 4 GB; all newer models have the same header.


class TwinPin(PiPin):
    """One pin of the board; it reports all edges."""

    bounce: float | None = None
    edges = "both"

    def __init__(self, factory: TwinPinFactory, info: Any) -> None:
        super().__init__(factory, info)
        self._board = factory.board
        self._claim("input")

    def close(self) -> None:
        """Leave an output at its level, or low if it has PWM; remove the pull of an input."""
        if self._board.closed:
            return
        if self._function == "output":
            self.frequency = None
        else:
            self.function = "input"

    def output_with_state(self, state: bool) -> None:
        """Make the pin an output, and set its level."""
        if self._function != "output":
            self._disable_event_detect()
            self._claim("output", level=int(state))
        self.state = state

    def _claim(self, function: str, pull: str = "floating", level: int = 0) -> None:
        self._function, self._pull = function, pull
        found = self._board.ask(int, "claim", self._number, function, pull, level)
        self._board.levels[self._number] = found
        self._pwm_hz, self._duty = 0, float(found)

    def _drive(self, duty: float, hz: int) -> None:
        if (duty, hz) != (self._duty, self._pwm_hz):
            self._board.post("drive", self._number, duty, hz)
            self._duty, self._pwm_hz = duty, hz

    def _get_function(self) -> str:
        return self._function

    def _set_function(self, value: str) -> None:
        self._disable_event_detect()
        self._claim(value)

    def _get_state(self) -> float:
        if self._function == "output":
            return self._duty
        if self._board.clock == "real":  # In twin time, levels change only during waits.
            self._board.wait()
        return self._board.levels[self._number]

    def _set_state(self, value: float) -> None:
        if self._function == "input":
            raise PinSetInput(f"cannot set state of pin {self!r}")
        if self._pwm_hz:
            self._drive(int(value * 100) / 100, self._pwm_hz)
        else:
            self._drive(float(bool(value)), 0)

    def _get_frequency(self) -> float | None:
        return self._pwm_hz or None

    def _set_frequency(self, value: float | None) -> None:
        if value:
            self._drive(self._duty if self._pwm_hz else 0.0, int(value))
        elif self._pwm_hz and not self._board.closed:
            self._drive(0.0, 0)

    def _get_pull(self) -> str:
        return self._pull

    def _set_pull(self, value: str) -> None:
        self._claim("input", value)

    def _enable_event_detect(self) -> None:
        self._board.watchers[self._number] = self._report

    def _disable_event_detect(self) -> None:
        self._board.watchers.pop(self._number, None)

    def _report(self, level: int, at_ns: int) -> None:
        self._call_when_changed(at_ns / 1e9, level)


class TwinPinFactory(PiFactory):
    """Factory of the pins of a board.

    It has no thread: edges of inputs are dispatched while the process waits on the clock.
    """

    def __init__(self, board: BoardClient, clock: Clock) -> None:
        super().__init__()
        self.board = board
        self.clock = clock
        self.pin_class = TwinPin
        self._pulsed: set[int] = set()

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send servo pulses; if the process dies, the pin keeps its level at that moment."""
        if pin not in self._pulsed:
            self.board.ask(int, "claim", pin, "output", "floating", 0)
            self._pulsed.add(pin)
        self.board.post("pulse", pin, width_us, frequency_hz)

    def ticks(self) -> float:
        """Return the clock's time in seconds."""
        return self.clock.now_ns() / 1e9

    def ticks_diff(self, later: float, earlier: float) -> float:
        """Return the seconds between two values of `ticks`."""
        return later - earlier

    def _get_revision(self) -> int:
        return _REVISION
