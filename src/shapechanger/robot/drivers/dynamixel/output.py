"""Driver of a tendon as an output, and the servo bus that all tendons of a robot share.

The sensor runs the one cycle of each tick, which reads all servos. The outputs only stage their
tensions, which are sent in one packet when all of them are staged.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.bus import ServoBus
from shapechanger.robot.drivers.dynamixel.health import BusState
from shapechanger.robot.drivers.dynamixel.settings import (
    ServoSettings,
    bus_settings,
    servo_settings,
)
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware


class SharedBus:
    """All servos at one device; see `SharedDevice`.

    Args:
        hardware: Hardware of the bus.
        settings: Settings of any output on it, which include those of the bus.
    """

    def __init__(self, hardware: Hardware, settings: Mapping[str, Any]) -> None:
        self.device: str = settings["device"]
        self._hardware = hardware
        self._settings = settings
        self._servos: dict[str, ServoSettings] = {}
        self._zeros: dict[str, int] = {}
        self._tensions: dict[str, float] = {}
        self._lengths: dict[str, float] = {}
        self._bus: ServoBus | None = None

    def add(self, plan: OutputPlan) -> ServoSettings:
        """Add a servo.

        Raises:
            RobotError: If a setting is out of range, or the bus is already in use.
        """
        if self._bus is not None:
            raise RobotError(f"The bus at {self.device} is in use: {plan.name} comes too late.")
        servo = servo_settings(plan)
        self._servos[plan.name] = servo
        self._zeros[plan.name] = plan.settings["zero"]
        self._tensions[plan.name] = servo.pretension_n
        return servo

    def begin(self) -> None:
        """Set up all servos, without torque; see `SharedDevice.begin`."""
        settings = bus_settings(self._settings, tuple(self._servos.values()))
        bus = ServoBus(settings, self._hardware.servo_port(settings))
        try:
            bus.set_up()
        except BaseException:
            bus.close()
            raise
        bus.set_zeros(self._zeros)
        self._bus = bus

    def ready(self) -> None:
        """Clear all faults; see `SharedDevice.ready`."""
        bus = self._open_bus()
        if bus.faults or not bus.is_ready:
            if bus.mode not in ("off", "silent"):
                bus.release()
            bus.set_up()
        if lost := [name for name in self._servos if name not in bus.zeros]:
            raise RobotError(
                f"{', '.join(lost)} lost the power, and so the zero of its tendon: find the zeros "
                "with `shapechanger robot home`, and serve the robot afresh."
            )

    def stage(self, name: str, tension: float, length: float | None = None) -> bool:
        """Set the tension or the length of a tendon from the next `flush` on.

        Args:
            name: Name of the tendon.
            tension: Tension, N; with a length its limit.
            length: Length beyond the zero, m; None to pull with the tension.

        Returns:
            Whether it will be pulled; a bus with a fault lets go.
        """
        self._tensions[name] = tension
        self._lengths.pop(name, None)
        if length is not None:
            self._lengths[name] = length
        return not self._open_bus().faults

    def flush(self, *, grip: bool) -> None:
        """Send the tensions of all servos; see `SharedDevice.flush`."""
        bus = self._open_bus()
        if bus.faults:
            return  # The bus is stopping, which its cycles complete.
        if bus.mode == "off" and grip:
            bus.hold()
        if bus.mode == "held":
            bus.send(self._tensions, self._lengths)

    def let_go(self) -> None:
        """Switch the torque of all servos off."""
        bus = self._open_bus()
        if bus.mode not in ("off", "silent"):
            bus.release()

    def cycle(self, now_ns: int) -> BusState:
        """Run a cycle of the bus.

        Raises:
            RobotError: If the bus is not in use.
        """
        return self._open_bus().cycle(None, now_ns)

    def leave(self, name: str) -> None:
        """Remove a servo; the last one closes the bus."""
        self._servos.pop(name, None)
        if not self._servos:
            _OPEN.pop((id(self._hardware), self.device), None)
            if self._bus is not None:
                self._bus.close()
                self._bus = None

    def _open_bus(self) -> ServoBus:
        if self._bus is None:
            raise RobotError(f"The bus at {self.device} is not in use.")
        return self._bus


# Open buses of this process, by hardware and device.
_OPEN: Final[dict[tuple[int, str], tuple[Hardware, SharedBus]]] = {}


def _join_bus(plan: OutputPlan, hardware: Hardware) -> tuple[SharedBus, ServoSettings]:
    """Add the servo of an output to its bus, and return both.

    Raises:
        RobotError: If a setting is out of range.
    """
    device: str = plan.settings["device"]
    key = (id(hardware), device)
    _, bus = _OPEN.get(key, (hardware, None))
    if bus is None:
        bus = SharedBus(hardware, plan.settings)
    servo = bus.add(plan)
    _OPEN[key] = (hardware, bus)
    return bus, servo


def bus_at(device: str, hardware: Hardware) -> SharedBus:
    """Return the bus at a device.

    Args:
        device: Serial device.
        hardware: Hardware of the bus.

    Raises:
        RobotError: If no output is on it.
    """
    _, bus = _OPEN.get((id(hardware), device), (hardware, None))
    if bus is None:
        raise RobotError(f"No output is on the servo bus at {device}.")
    return bus


class TendonOutput:
    """A tendon as an output; see `OutputDriver`.

    0 is its pretension in every control, so that a stop ends alike, and 1 its largest tension. With
    control "length" values above 0 go from its longest to its shortest length.

    Args:
        plan: The output.
        hardware: Hardware of its bus.

    Attributes:
        device: The bus, which acts when all outputs are written.

    Raises:
        RobotError: If a setting is out of range.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        self.device: SharedBus
        self.device, servo = _join_bus(plan, hardware)
        self._name = plan.name
        self._servo = servo

    def write(self, value: float, now_ns: int) -> float:
        """Set the value from the next flush on.

        Args:
            value: From 0, the pretension, to 1; negative values count as 0.
            now_ns: Not used.

        Returns:
            The value in effect: 0 if the bus has a fault and lets go.
        """
        value = min(max(value, 0.0), 1.0)
        servo = self._servo
        tension, length = servo.pretension_n, None
        if servo.control == "tension":
            tension += value * (servo.most_tension_n - servo.pretension_n)
        elif value > 0.0:
            tension = servo.most_tension_n
            length = servo.longest_m + value * (servo.shortest_m - servo.longest_m)
        return value if self.device.stage(self._name, tension, length) else 0.0

    def release(self) -> None:
        """Switch the torque of all servos on the bus off."""
        self.device.let_go()

    def close(self) -> None:
        """Leave the bus."""
        self.device.leave(self._name)


def open_driver(plan: OutputPlan, hardware: Hardware) -> TendonOutput:
    """Join the bus, without sending anything yet.

    Args:
        plan: The output; outputs with the same device share a bus.
        hardware: Hardware of the bus.
    """
    return TendonOutput(plan, hardware)
