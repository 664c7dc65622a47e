"""Chips: sensors, outputs and sources of pulses, each with keys, driver and simulation in one file.

The module of a chip has its keys in a profile, its driver and its simulation, and a `SensorChip`,
`OutputChip` or `PulseSource` that names them. Other packages add chips by entry points of the group
`shapechanger.drivers`, named as the driver in a profile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from itertools import chain
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.keys import Keys
from shapechanger.robot.drivers.simulation import (
    DutyOf,
    I2cChips,
    Levels,
    SimulatedSensor,
    WiredOutput,
)
from shapechanger.robot.hardware import Hardware, load

if TYPE_CHECKING:  # The guard loads neither.
    from shapechanger.contract.world import World
    from shapechanger.layout import Feature

_GROUP: Final = "shapechanger.drivers"


class OutputDriver(Protocol):
    """Driver of one motor, servo or controller."""

    def write(self, value: float, now_ns: int) -> float:
        """Write a value.

        Args:
            value: From -1, full left or backward, to 1, full right or forward; 0 is rest.
            now_ns: Monotonic time, ns, for controllers with sequences.

        Returns:
            The applied value.
        """
        ...

    def release(self) -> None:
        """Release the output: no torque, no pulse."""
        ...

    def close(self) -> None:
        """Set the safest level and close the pins."""
        ...


class SharedDevice(Protocol):
    """Device shared by several outputs and written once for all of them: a servo bus.

    Its drivers refer to it in their attribute `device`.
    """

    def begin(self) -> None:
        """Start the device once all of its outputs are open, without moving anything.

        Raises:
            RobotError: If it does not respond, or is not the expected device.
        """
        ...

    def ready(self, alive: Callable[[], object]) -> None:
        """Clear faults before the robot is armed, without moving anything.

        Args:
            alive: Feeds the enable line and the supervisor; called at least every 50 ms.

        Raises:
            RobotError: If a fault persists.
        """
        ...

    def flush(self, *, grip: bool) -> None:
        """Send what was written to its outputs.

        Args:
            grip: Whether released outputs are energised again.

        Raises:
            RobotError: If an output does not obey.
        """
        ...


class SensorDriver(Protocol):
    """Driver of one sensor, without threads, that blocks for at most a few milliseconds."""

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the measurements in SI units, keyed like `GuardState.quantities`.

        Args:
            now_ns: Monotonic time, ns.
            direction: Sign of the propulsion, for a sensor that cannot tell forward from backward.

        Raises:
            RobotError: If the sensor does not respond.
        """
        ...

    def close(self) -> None:
        """Close the pins."""
        ...


class PulseChannel(Protocol):
    """Source of the pulses of one servo."""

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width from now on, and return the applied width."""
        ...

    def release(self) -> None:
        """Stop the pulses."""
        ...

    def close(self) -> None:
        """Stop the pulses and close."""
        ...


@dataclass(frozen=True, slots=True)
class SensorChip:
    """A kind of sensor.

    Attributes:
        measures: Its quantities; see `SensorPlan.measures`.
        keys: Its keys in a profile, besides `driver`.
        open: Opens its driver.
        simulate: Its simulation; None where a twin's board has the real one, such as a file.
        features: Features of a state that it alone measures; None where `measures` tells them.
        rows: Keys of each nested table, such as a joint's; None without any. `keys` has them
            as `rows`, keyed by name.
    """

    measures: str
    keys: type[Keys]
    open: Callable[[SensorPlan, Hardware], SensorDriver]
    simulate: Callable[[SensorPlan, World], SimulatedSensor] | None = None
    features: Callable[[SensorPlan], list[Feature]] | None = None
    rows: type[Keys] | None = None


@dataclass(frozen=True, slots=True)
class OutputChip:
    """A kind of motor, servo or controller.

    Attributes:
        keys: Its keys in a profile, besides those of every output and of its pulse source.
        open: Opens its driver.
        wire: Its wiring on a twin, which reads its state from the levels of the board's outputs;
            called with the output, its value at rest, and the duty of a pin.
        unpowered: State without power, if power goes through the one-shot of the enable line, as
            it does for motors; None for a steering servo or a joint.
        obeys: The value that a controller makes of its pulses, with its own memory; None for
            the value of the pulses.
        pulses: Keys of the pulse widths at -1, 0 and 1; empty for an output without pulses.
        differs: Why its value may differ from the one that was asked for.
        drives: Whether it can propel a robot, whatever part it moves.
        stops_itself: Whether it stops by itself without the guard, and must be left alone then.
    """

    keys: type[Keys]
    open: Callable[[OutputPlan, Hardware], OutputDriver]
    wire: Callable[[OutputPlan, float, DutyOf], Callable[[Levels], WiredOutput]]
    unpowered: WiredOutput | None = None
    obeys: Callable[[OutputPlan], Callable[[float | None, int], float]] | None = None
    pulses: tuple[str, ...] = ()
    differs: str = "it does not follow"
    drives: bool = False
    stops_itself: bool = False


@dataclass(frozen=True, slots=True)
class PulseSource:
    """A source of the pulses of servos and controllers, named by their key `over`.

    Attributes:
        keys: Its keys in a profile.
        open: Opens a channel, from the settings of an output, without sending any pulses.
        pulse_of: Reads the width of its pulses on a twin, µs; None for a source that no twin has.
        chips: Its chips on I2C buses, from the settings of an output.
    """

    keys: type[Keys]
    open: Callable[[Mapping[str, Any], Hardware], PulseChannel]
    pulse_of: Callable[[Mapping[str, Any], DutyOf], Callable[[Levels], float]] | None = None
    chips: Callable[[Mapping[str, Any]], I2cChips] = lambda settings: {}


_Chip = TypeVar("_Chip", SensorChip, OutputChip, PulseSource)


@cache
def _others() -> dict[str, SensorChip | OutputChip | PulseSource]:
    """Return the chips of other packages.

    Raises:
        RobotError: If an entry point names no chip.
    """
    found = {point.name: point.load() for point in entry_points(group=_GROUP)}
    for name, chip in found.items():
        if not isinstance(chip, SensorChip | OutputChip | PulseSource):
            raise RobotError(
                f"The entry point {name} in {_GROUP} must name a SensorChip, an OutputChip or a "
                f"PulseSource, not {chip!r}."
            )
    return found


class Chips(Mapping[str, _Chip]):
    """Chips of one kind by driver, loaded on demand, so that a guard loads only its own.

    Args:
        kind: Class of the chips.
        own: MODULE:NAME of each of ours, by the name of its driver; other packages cannot replace
            one.
    """

    def __init__(self, kind: type[_Chip], own: Mapping[str, str]) -> None:
        self._kind = kind
        self._own = own

    def __getitem__(self, name: str) -> _Chip:
        if name in self._own:
            return load(self._own[name])
        if isinstance(chip := _others().get(name), self._kind):
            return chip
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        others = (name for name, chip in _others().items() if isinstance(chip, self._kind))
        return chain(self._own, (name for name in others if name not in self._own))

    def __len__(self) -> int:
        return sum(1 for _ in self)


_HERE: Final = "shapechanger.robot.drivers"

SENSORS: Final = Chips(
    SensorChip,
    {
        "encoder": f"{_HERE}.encoder:ENCODER",
        "switch": f"{_HERE}.switch:SWITCH",
        "hcsr04": f"{_HERE}.hcsr04:HCSR04",
        "mpu6050": f"{_HERE}.mpu6050:MPU6050",
        "ina219": f"{_HERE}.ina219:INA219",
        "cpu_temperature": f"{_HERE}.cpu_temperature:CPU_TEMPERATURE",
        "bus_servo": f"{_HERE}.servos.output:TENDONS",
        "as5600": f"{_HERE}.as5600:AS5600",
    },
)
"""Kinds of sensors."""

OUTPUTS: Final = Chips(
    OutputChip,
    {
        "hbridge": f"{_HERE}.motors:HBRIDGE",
        "phase_enable": f"{_HERE}.motors:PHASE_ENABLE",
        "servo": f"{_HERE}.servo:SERVO",
        "esc": f"{_HERE}.esc:ESC",
        "bus_servo": f"{_HERE}.servos.output:BUS_SERVO",
    },
)
"""Kinds of outputs."""

PULSES: Final = Chips(
    PulseSource,
    {
        "pca9685": f"{_HERE}.pca9685:PCA9685",
        "lgpio": f"{_HERE}.pulse:LGPIO",
        "sysfs": f"{_HERE}.pulse:SYSFS",
    },
)
"""Sources of pulses."""


def open_output(plan: OutputPlan, hardware: Hardware) -> OutputDriver:
    """Open an output at rest.

    Args:
        plan: The output.
        hardware: The pins and buses of this robot.

    Raises:
        RobotError: If the device does not respond.
    """
    return OUTPUTS[plan.driver].open(plan, hardware)


def open_sensor(plan: SensorPlan, hardware: Hardware) -> SensorDriver:
    """Open a sensor.

    Args:
        plan: The sensor.
        hardware: The pins and buses of this robot.

    Raises:
        RobotError: If the device does not respond.
    """
    return SENSORS[plan.driver].open(plan, hardware)
