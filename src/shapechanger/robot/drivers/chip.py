"""Base classes and registries of chips: sensors, outputs and sources of pulses.

The module of a chip has its keys in a profile, its driver and its simulation, and a `SensorChip`,
`OutputChip` or `PulseSource` that names them. Other packages add chips by entry points of the group
`shapechanger.drivers`, whose names are the drivers in a profile.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple, Protocol, Self, TypeVar, cast

import msgspec
from msgspec import Meta

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.pins import I2C_PINS, NO_PIN, Pin
from shapechanger.robot.drivers.simulation import (
    DutyOf,
    I2cChips,
    Levels,
    SimulatedChip,
    SimulatedSensor,
    WiredOutput,
)
from shapechanger.robot.hardware import Hardware, load

if TYPE_CHECKING:  # The guard must not load these modules.
    from shapechanger.contract.world import World
    from shapechanger.layout import Feature

_GROUP: Final = "shapechanger.drivers"


def _printable(longest: int) -> Meta:
    return Meta(
        min_length=1,
        max_length=longest,
        pattern=r"\A(?=.*\S)[\x20-\x7e\xa0-\U0010ffff]+\Z",
        description=f"a text of 1 to {longest} characters that can be printed",
    )


Text = Annotated[str, _printable(64)]
"""A name that fits into messages; see `shapechanger.robot.link.messages`."""

FilePath = Annotated[str, _printable(4096)]
"""Path of a file or a device."""


class KeyMistake(ValueError):
    """A value of a key contradicts other keys of its table.

    `text` is the reason, as the end of a sentence that begins with the key and its table.
    """

    def __init__(self, key: str, text: str) -> None:
        super().__init__(text)
        self.key = key


class Claim(NamedTuple):
    """A resource that only one key of a profile may use."""

    key: str  # Name of the key that claims it.
    resource: str  # A pin, a channel or an address.
    group: str = ""  # Users of one group may share it; "" for exclusive use.
    use: str = ""  # Addition in messages, such as ", a wire of I2C bus 1,"; "" for none.


class Keys(msgspec.Struct, frozen=True):
    """Keys of one table; a subclass raises `KeyMistake` for values that contradict each other."""

    def settings(self) -> dict[str, Any]:
        """Return the settings of a plan, as JSON values."""
        return cast("dict[str, Any]", msgspec.to_builtins(self, enc_hook=int))

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Return the keys from the settings of a plan; other settings are ignored."""
        return msgspec.convert(settings, cls, dec_hook=lambda kind, pin: kind(pin))

    def connected(self) -> Iterator[tuple[str, Pin]]:
        """Return the connected pins, each with its key."""
        for key, value in msgspec.structs.asdict(self).items():
            for pin in cast("list[Any]", value) if isinstance(value, list) else [value]:
                if isinstance(pin, Pin) and pin != NO_PIN:
                    yield key, pin

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the keys: by default their pins."""
        return (Claim(key, f"GPIO{pin}") for key, pin in self.connected())


BusNumber = Annotated[int, Meta(ge=0, le=99)]
"""Number of an I2C bus; 1 is GPIO2 and GPIO3."""


class I2cKeys(Keys, frozen=True, kw_only=True):
    """Keys of a chip on an I2C bus.

    Attributes:
        bus: Number of the bus; 1 is GPIO2 and GPIO3.
        address: Address of the chip.
    """

    bus: BusNumber = 1
    address: int

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the bus and the address."""
        return i2c_claims(self.bus, "address", self.address)


def i2c_claims(bus: int, key: str, address: int, group: str = "") -> Iterator[Claim]:
    """Return the claims of an address and its bus; `key` is the key of the address."""
    yield Claim(key, f"address {address:#x} of I2C bus {bus}", group)
    for pin in I2C_PINS.get(bus, ()):
        yield Claim("bus", f"GPIO{pin}", f"I2C bus {bus}", f", a wire of I2C bus {bus},")


@contextmanager
def device_errors(device: str) -> Generator[None]:
    """Turn the errors of imports, gpiozero, lgpio and the kernel into a `RobotError`."""
    try:
        yield
    except _kinds() as error:
        # A device that could not be opened frees its pins once it has no more references. In
        # Python 3.13 the frame that opened it would live until a garbage collection.
        traceback.clear_frames(error.__traceback__)
        raise RobotError(f"{device} does not answer: {str(error).rstrip('.')}.") from error


def _kinds() -> tuple[type[BaseException], ...]:
    """Return errors of the kernel and of imports, and of gpiozero and lgpio if they are loaded."""
    theirs = (("gpiozero", "GPIOZeroError"), ("lgpio", "error"))
    loaded = ((sys.modules.get(module), name) for module, name in theirs)
    return (OSError, ImportError, *(getattr(module, name) for module, name in loaded if module))


class I2cDevice:
    """Base class of the drivers of chips on an I2C bus, whose errors name the chip.

    The `name`, such as "Sensor 'imu'", gets the address appended for messages.
    """

    def __init__(self, name: str, keys: I2cKeys, hardware: Hardware) -> None:
        self.name = f"{name} at 0x{keys.address:02x} on I2C bus {keys.bus}"
        self._address = keys.address
        with device_errors(self.name):
            self._bus = hardware.i2c(keys.bus)

    def read_registers(self, register: int, length: int = 1) -> bytes:
        """Read consecutive registers."""
        with device_errors(self.name):
            return bytes(self._bus.read_i2c_block_data(self._address, register, length))

    def write_registers(self, register: int, *data: int) -> None:
        """Write consecutive registers, one byte each."""
        with device_errors(self.name):
            self._bus.write_i2c_block_data(self._address, register, data)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


class OutputDriver(Protocol):
    """Driver of one motor, servo or controller."""

    def write(self, value: float, now_ns: int) -> float:
        """Write a value, and return the applied one.

        Args:
            value: From -1, full left or backward, to 1, full right or forward; 0 is neutral.
            now_ns: Monotonic time, ns, for controllers with sequences.
        """
        ...

    def release(self) -> None:
        """Release the output: no pulses, and no torque unless its driver can only brake."""

    def close(self) -> None:
        """Set the safest level and close the pins."""


class SensorDriver(Protocol):
    """Driver of one sensor, without threads, that blocks for at most a few milliseconds."""

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the measurements in SI units, with the keys of `GuardState.quantities`.

        Args:
            now_ns: Monotonic time, ns.
            direction: Sign of the propulsion, for a sensor that cannot tell forward from backward.

        Raises:
            RobotError: If the sensor does not respond.
        """
        ...

    def close(self) -> None:
        """Close the pins."""


class PulseChannel:
    """Source of the pulses of one servo, in whole microseconds, sent only when they change.

    A subclass defines `_pulse`, or overrides `write_us` and `release` if its pulses are not whole
    microseconds.
    """

    _width_us: int | None = None

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width from now on, and return the applied width."""
        self._send(round(width_us))
        return float(round(width_us))

    def release(self) -> None:
        """Stop the pulses."""
        self._send(0)

    def close(self) -> None:
        """Stop the pulses and close."""
        self.release()

    def _send(self, width_us: int) -> None:
        if width_us != self._width_us:
            self._width_us = None  # A failed write may still have taken effect.
            self._pulse(width_us)
            self._width_us = width_us

    def _pulse(self, width_us: int) -> None:
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class SensorChip:
    """A kind of sensor.

    Attributes:
        measures: Its quantities; see `SensorPlan.measures`.
        keys: Its keys in a profile, in addition to `driver`.
        open: Opens its driver.
        simulate: Its simulation; None if its driver uses neither a pin nor an I2C bus.
        features: State features that only this sensor measures; None if `measures` determines them.
        rows: Keys of each nested table, such as the table of a joint; None if the sensor has no
            nested tables. They are decoded into the field `rows` of `keys`, keyed by table name.
    """

    measures: str
    keys: type[Keys]
    open: Callable[[SensorPlan, Hardware], SensorDriver]
    simulate: Callable[[SensorPlan, World], SimulatedSensor] | None = None
    features: Callable[[SensorPlan], list[Feature]] | None = None
    rows: type[Keys] | None = None


def simulated_at_address(
    chip: Callable[[World], SimulatedChip],
) -> Callable[[SensorPlan, World], SimulatedSensor]:
    """Return the simulation of a sensor that is one chip, at the address in its settings."""
    return lambda plan, world: SimulatedSensor(
        {(plan.settings["bus"], plan.settings["address"]): chip(world)}
    )


@dataclass(frozen=True, slots=True)
class OutputChip:
    """A kind of motor, servo or controller.

    Attributes:
        keys: Its keys in a profile, in addition to the keys of all outputs and of its pulse source.
        open: Opens its driver.
        wire: Called with the output, its value at rest, and a function for the duty of a pin;
            returns a function that reads the state of the output from a twin's levels.
        unpowered: State without power, if the enable line switches the power, as it does for
            motors; None for a steering servo or a joint.
        obeys: Creates a stateful function from the value of the pulses to the value of the motor;
            None if both are equal.
        pulses: Keys of the pulse widths at -1, 0 and 1; empty for an output without pulses.
        differs: Why the applied value may differ from the requested one.
        lights: LEDs that replace it on a bench: the key of each pin, a label after the name of the
            output, and the value that lights it; empty if LEDs cannot replace it.
        drives: Whether it can propel a robot, regardless of its part.
        stops_itself: Whether it stops by itself when the guard ends, so that `make_safe` skips it.
    """

    keys: type[Keys]
    open: Callable[[OutputPlan, Hardware], OutputDriver]
    wire: Callable[[OutputPlan, float, DutyOf], Callable[[Levels], WiredOutput]]
    unpowered: WiredOutput | None = None
    obeys: Callable[[OutputPlan], Callable[[float | None, int], float]] | None = None
    pulses: tuple[str, ...] = ()
    differs: str = "it does not follow"
    lights: tuple[tuple[str, str, float], ...] = ()
    drives: bool = False
    stops_itself: bool = False


@dataclass(frozen=True, slots=True)
class PulseSource:
    """A source of the pulses of servos and controllers, selected by their key `over`.

    Attributes:
        keys: Its keys in a profile.
        open: Opens the channel of an output, without sending any pulses.
        pulse_us: Reads the width of its pulses on a twin, µs; None if it has no simulation.
        chips: Its chips on I2C buses.
    """

    keys: type[Keys]
    open: Callable[[OutputPlan, Hardware], PulseChannel]
    pulse_us: Callable[[OutputPlan, DutyOf, Levels], float] | None = None
    chips: Callable[[OutputPlan], I2cChips] = lambda plan: {}


_Chip = TypeVar("_Chip", SensorChip, OutputChip, PulseSource)


@cache
def _others() -> dict[str, SensorChip | OutputChip | PulseSource]:
    """Return the chips of other packages."""
    from importlib.metadata import entry_points  # Takes 2 MB, and most guards do not need it.

    found = {point.name: point.load() for point in entry_points(group=_GROUP)}
    for name, chip in found.items():
        if not isinstance(chip, SensorChip | OutputChip | PulseSource):
            raise RobotError(
                f"The entry point {name} in {_GROUP} must name a SensorChip, an OutputChip or a "
                f"PulseSource, not {chip!r}."
            )
    return found


class Chips(Mapping[str, _Chip]):
    """Chips of one kind, keyed by driver and loaded on demand, because a guard needs only few.

    `own` has MODULE:NAME of each chip in this folder; other packages cannot replace these.
    """

    def __init__(self, kind: type[_Chip], **own: str) -> None:
        self._kind = kind
        self._own = own

    def __getitem__(self, name: str) -> _Chip:
        if name in self._own:
            return load(f"shapechanger.robot.drivers.{self._own[name]}")
        if isinstance(chip := _others().get(name), self._kind):
            return chip
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        others = (name for name, chip in _others().items() if isinstance(chip, self._kind))
        return chain(self._own, (name for name in others if name not in self._own))

    def __len__(self) -> int:
        return sum(1 for _ in self)


SENSORS: Final = Chips(
    SensorChip,
    encoder="encoder:ENCODER",
    switch="switch:SWITCH",
    hcsr04="hcsr04:HCSR04",
    mpu6050="mpu6050:MPU6050",
    ina219="ina219:INA219",
    cpu_temperature="cpu_temperature:CPU_TEMPERATURE",
    bus_servo="servos.bus:TENDONS",
    as5600="as5600:AS5600",
)
"""Kinds of sensors."""

OUTPUTS: Final = Chips(
    OutputChip,
    hbridge="motors:HBRIDGE",
    phase_enable="motors:PHASE_ENABLE",
    servo="pulse:SERVO",
    esc="pulse:ESC",
    bus_servo="servos.bus:BUS_SERVO",
)
"""Kinds of outputs."""

PULSES: Final = Chips(
    PulseSource, pca9685="pca9685:PCA9685", lgpio="pulse:LGPIO", sysfs="pulse:SYSFS"
)
"""Sources of pulses."""
