"""The servo bus of a robot, shared by its outputs and its sensor.

The sensor runs the one cycle of each tick, which hears all servos; the outputs only say what to
pull, and what they said goes out in one packet when all of them have said it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.health import BusState
from shapechanger.robot.drivers.dynamixel.settings import (
    ServoSettings,
    bus_settings,
    servo_settings,
)
from shapechanger.robot.drivers.settings import text, whole
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # It needs the SDK, which is loaded when a bus is opened.
    from shapechanger.robot.drivers.dynamixel.bus import ServoBus

__all__ = ["SharedBus", "bus_at", "join_bus"]


class SharedBus:
    """All servos at one device.

    Args:
        hardware: Where the port is.
        settings: Those of the bus, as every output on it has them.
    """

    def __init__(self, hardware: Hardware, settings: Mapping[str, object]) -> None:
        self.device = text(settings, "device")
        self._hardware = hardware
        self._settings = settings
        self._servos: dict[str, ServoSettings] = {}
        self._zeros: dict[str, int] = {}
        self._tensions: dict[str, float] = {}
        self._bus: ServoBus | None = None

    def add(self, plan: OutputPlan) -> ServoSettings:
        """One more servo.

        Raises:
            RobotError: If it cannot be as its settings say, or the bus is in use already.
        """
        if self._bus is not None:
            raise RobotError(f"The bus at {self.device} is in use: {plan.name} comes too late.")
        servo = servo_settings(plan)
        self._servos[plan.name] = servo
        self._zeros[plan.name] = whole(plan.settings, "zero")
        self._tensions[plan.name] = servo.pretension_n
        return servo

    def begin(self) -> None:
        """Find all servos and make them ready, without torque; see `SharedDevice.begin`."""
        from shapechanger.robot.drivers.dynamixel.bus import ServoBus

        settings = bus_settings(self._settings, tuple(self._servos.values()))
        bus = ServoBus(settings, self._hardware.servo_port)
        try:
            bus.set_up()
        except BaseException:
            bus.close()
            raise
        bus.set_zeros(self._zeros)
        self._bus = bus

    def ready(self) -> None:
        """Forget all faults, if there are any; see `SharedDevice.ready`."""
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

    def stage(self, name: str, tension: float) -> bool:
        """Say what a tendon shall pull from the next `flush` on, N.

        Returns:
            Whether it will; a bus with a fault lets go.
        """
        self._tensions[name] = tension
        return not self._open_bus().faults

    def flush(self, *, grip: bool) -> None:
        """Tell all servos what they shall pull; see `SharedDevice.flush`."""
        bus = self._open_bus()
        if bus.faults:
            return  # It is on its way down, and the cycles go on with that.
        if bus.mode == "off" and grip:
            bus.hold()
        if bus.mode == "held":
            bus.tell(self._tensions)

    def let_go(self) -> None:
        """Take the torque from all servos."""
        bus = self._open_bus()
        if bus.mode not in ("off", "silent"):
            bus.release()

    def cycle(self, now_ns: int) -> BusState:
        """Hear all servos.

        Raises:
            RobotError: If the bus was never begun.
        """
        return self._open_bus().cycle(None, now_ns)

    def leave(self, name: str) -> None:
        """One output less; the last one closes the bus."""
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


# The buses that are open in this process, by hardware and device.
_OPEN: Final[dict[tuple[int, str], tuple[Hardware, SharedBus]]] = {}


def join_bus(plan: OutputPlan, hardware: Hardware) -> tuple[SharedBus, ServoSettings]:
    """The bus of an output, which is one of its servos from now on, and that servo.

    Raises:
        RobotError: If the servo cannot be as its settings say.
    """
    key = (id(hardware), text(plan.settings, "device"))
    _, bus = _OPEN.get(key, (hardware, None))
    if bus is None:
        bus = SharedBus(hardware, plan.settings)
    servo = bus.add(plan)
    _OPEN[key] = (hardware, bus)
    return bus, servo


def bus_at(device: str, hardware: Hardware) -> SharedBus:
    """The bus at a device.

    Raises:
        RobotError: If no output is on it.
    """
    _, bus = _OPEN.get((id(hardware), device), (hardware, None))
    if bus is None:
        raise RobotError(f"No output is on the servo bus at {device}.")
    return bus
