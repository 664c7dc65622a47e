"""The twin's hardware, for the processes of a robot: pins, buses and time from its board."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from gpiozero import PinInvalidState, PinSetInput
from gpiozero.pins.pi import PiFactory, PiPin

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.robot.hardware import Clock
from shapechanger.twin.board_client import BoardPort, Link
from shapechanger.twin.clock import GrantedClock, SteadyClock
from shapechanger.twin.messages import BoardLink

__all__ = ["TwinBus", "TwinHardware", "TwinPin", "TwinPinFactory", "TwinServoPins", "connect"]


class TwinBus:
    """The part of `smbus2.SMBus` that the drivers use; a chip that is not there raises OSError.

    Args:
        link: The connection to the board.
        clock: Where the time of a write comes from.
        bus: Number of the bus.
    """

    def __init__(self, link: BoardLink, clock: Clock, bus: int) -> None:
        self._link = link
        self._clock = clock
        self._bus = bus

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte: on the wire that is a register that nothing is written to."""
        self.write_i2c_block_data(i2c_addr, value, [])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """One register."""
        return self.read_i2c_block_data(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Set one register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Several bytes, from one register on."""
        answer = self._link.ask(
            op="read", bus=self._bus, address=i2c_addr, register=register, length=length
        )
        return answer["data"]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write several bytes, from one register on."""
        if not all(0 <= byte <= 0xFF for byte in data):
            raise ValueError(f"These are no bytes: {list(data)}.")
        self._link.ask(
            op="write",
            bus=self._bus,
            address=i2c_addr,
            register=register,
            data=list(data),
            t=self._clock.now_ns(),
        )

    def close(self) -> None:
        """Let go of the bus; its chips go on with what they do."""


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


class TwinHardware:
    """Pins, buses and time from a board.

    Args:
        path: The socket at which the board listens.
    """

    def __init__(self, path: str) -> None:
        self._link = Link(path, "hardware")
        self._clock: GrantedClock | SteadyClock = (
            GrantedClock(self._link, path)
            if self._link.clock == "twin"
            else SteadyClock(self._link)
        )
        self._pin_factory: Any = None

    @property
    def clock(self) -> GrantedClock | SteadyClock:
        """The board's clock, or the machine's, as the board was started."""
        return self._clock

    def pin_factory(self) -> Any:
        """What gpiozero's devices take as `pin_factory`."""
        if self._pin_factory is None:
            self._pin_factory = TwinPinFactory(self._link, self._clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """An I2C bus by its number."""
        return TwinBus(self._link, self._clock, bus)

    def servo_pins(self) -> TwinServoPins:
        """Pins that send servo pulses."""
        return TwinServoPins(self._link, self._clock)

    def servo_port(self, settings: BusSettings) -> BoardPort:
        """The port of the servos.

        Raises:
            RobotError: If the board has none there.
        """
        return BoardPort(self._link, self._clock, settings)

    def close(self) -> None:
        """Let go of the pins and say goodbye to the board."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None
        if isinstance(self._clock, GrantedClock):
            self._clock.close()
        self._link.close()


def connect(path: str) -> TwinHardware:
    """The hardware of the board that listens at this path.

    Raises:
        RobotError: If no board answers there.
    """
    return TwinHardware(path)
