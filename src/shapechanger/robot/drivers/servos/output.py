"""Drivers of the tendons of a servo bus: outputs, their sensor, and the bus that they share.

The sensor runs the one cycle of each tick, which reads all servos. The outputs only stage their
tensions, which are sent in one packet when all of them are staged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OutputChip, SensorChip
from shapechanger.robot.drivers.keys import Keys
from shapechanger.robot.drivers.servos.bus import ServoBus, open_bus
from shapechanger.robot.drivers.servos.settings import ServoSettings, bus_settings, servo_settings
from shapechanger.robot.drivers.simulation import WiredOutput
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # The guard loads none.
    from shapechanger.layout import Feature


class SharedBus:
    """All servos at one device; see `SharedDevice`.

    Servos without a watchdog get their power from a switch that the guard feeds while it runs, so
    they are only set up when the robot is armed. If one of them cannot be released, `flush` and
    `let_go` raise errors, so that the guard stops to feed the switch, until that has cut the power.

    Args:
        hardware: Hardware of the bus.
        device: Its device.

    Attributes:
        device: Its device.
        tensions: Tension of each tendon from the next `flush` on, N; with a length its limit.
        lengths: Length beyond its zero of each tendon that is to have one, m.
    """

    def __init__(self, hardware: Hardware, device: str) -> None:
        self.device = device
        self.tensions: dict[str, float] = {}
        self.lengths: dict[str, float] = {}
        self._hardware = hardware
        self._plans: dict[str, OutputPlan] = {}
        self._bus: ServoBus | None = None
        self._silent_since_ns: int | None = None

    @property
    def bus(self) -> ServoBus:
        """The bus, while it is in use."""
        if self._bus is None:
            raise RobotError(f"The bus at {self.device} is not in use.")
        return self._bus

    def add(self, plan: OutputPlan) -> ServoSettings:
        """Add a servo."""
        servo = servo_settings(plan)
        self._plans[plan.name] = plan
        self.tensions[plan.name] = servo.pretension_n
        return servo

    def begin(self) -> None:
        """Set up all servos that have power, without torque; see `SharedDevice.begin`."""
        self._settings = settings = bus_settings([*self._plans.values()])
        self._zeros: dict[str, int] = {n: p.settings["zero"] for n, p in self._plans.items()}
        self._has_watchdog = settings.family.has_watchdog
        bus = open_bus(settings, self._hardware)
        if self._has_watchdog:
            try:
                bus.set_up()
            except BaseException:
                bus.close()
                raise
            bus.set_zeros(self._zeros)
        self._bus = bus

    def ready(self, alive: Callable[[], object] = lambda: None) -> None:
        """Clear all faults; see `SharedDevice.ready`."""
        bus = self.bus
        if bus.faults or not bus.is_ready:
            self.let_go()
            bus.set_up(alive)
            self._silent_since_ns = None
            if not self._has_watchdog:
                bus.set_zeros(self._zeros, knows_turns=False)
        if lost := [name for name in self._plans if name not in bus.zeros]:
            raise RobotError(
                f"{', '.join(lost)} lost the power, and so the zero of its tendon: find the zeros "
                "with `shapechanger robot home`, and serve the robot afresh."
            )

    def flush(self, *, grip: bool) -> None:
        """Send the tensions of all servos; see `SharedDevice.flush`."""
        self._require_release()
        bus = self.bus
        if bus.faults:
            return  # The bus is stopping, which its cycles complete.
        if bus.mode == "off" and grip:
            bus.hold()
        if bus.mode == "held":
            bus.send(self.tensions, self.lengths)

    def let_go(self) -> None:
        """Switch the torque of all servos off."""
        if self.bus.mode not in ("off", "silent"):
            self.bus.release()
        self._require_release()

    def leave(self, name: str) -> None:
        """Remove a servo; the last one closes the bus."""
        self._plans.pop(name, None)
        if not self._plans:
            _OPEN.pop((id(self._hardware), self.device), None)
            if self._bus is not None:
                self._bus.close()
                self._bus = None

    def _require_release(self) -> None:
        """Raise RobotError while a servo pulls that only the power switch can stop."""
        if self.bus.mode != "silent" or self._has_watchdog:
            return
        now_ns = self._hardware.clock.now_ns()
        if self._silent_since_ns is None:
            self._silent_since_ns = now_ns
        if now_ns - self._silent_since_ns < self._settings.cut_ms * 1_000_000:
            raise RobotError(" ".join(self.bus.faults.values()))


# Open buses of this process, by hardware and device.
_OPEN: Final[dict[tuple[int, str], SharedBus]] = {}


class TendonOutput:
    """A tendon as an output; see `OutputDriver`.

    0 is its pretension in every control, so that all stops end the same, and 1 its largest tension.
    With control "length" values above 0 go from its longest to its shortest length.

    Args:
        plan: The output.
        hardware: Hardware of its bus.

    Attributes:
        device: The bus, which acts when all outputs are written.

    Raises:
        RobotError: If a setting is out of range.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        key = (id(hardware), plan.settings["device"])
        self.device = _OPEN.get(key) or SharedBus(hardware, plan.settings["device"])
        self._servo = self.device.add(plan)
        _OPEN[key] = self.device

    def write(self, value: float, now_ns: int) -> float:
        """Set the value from the next flush on.

        Args:
            value: From 0, the pretension, to 1; negative values count as 0.
            now_ns: Not used.

        Returns:
            The value in effect: 0 if the bus has a fault and lets go.
        """
        value = min(max(value, 0.0), 1.0)
        servo, bus = self._servo, self.device
        bus.lengths.pop(servo.name, None)
        tension = servo.pretension_n
        if servo.control == "tension":
            tension += value * (servo.most_tension_n - servo.pretension_n)
        elif value > 0.0:
            tension = servo.most_tension_n
            bus.lengths[servo.name] = servo.longest_m + value * (servo.shortest_m - servo.longest_m)
        bus.tensions[servo.name] = tension
        return 0.0 if bus.bus.faults else value

    def release(self) -> None:
        """Switch the torque of all servos on the bus off."""
        self.device.let_go()

    def close(self) -> None:
        """Leave the bus."""
        self.device.leave(self._servo.name)


class TendonSensor:
    """Runs one cycle of the bus per reading; see `SensorDriver`.

    Args:
        plan: The sensor.
        hardware: Hardware of the bus, the same as that of the outputs, which are open.

    Raises:
        RobotError: If no output is on that bus.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        device: str = plan.settings["device"]
        if (id(hardware), device) not in _OPEN:
            raise RobotError(f"No output is on the servo bus at {device}.")
        self._bus = _OPEN[id(hardware), device]

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Run a cycle and return its readings, without servos that did not answer.

        Returns:
            For each tendon, such as FDP, `FDP/length`, its length beyond its zero, m, if it has
            one; `FDP/speed`, m/s, positive while it gets longer; and `FDP/tension`, N, at least 0.

        Raises:
            RobotError: If there is a fault.
        """
        state = self._bus.bus.cycle(now_ns)
        if state.reason:
            raise RobotError(state.reason)
        readings: dict[str, float] = {}
        for name, servo in state.servos.items():
            if servo.length_m is not None:
                readings[f"{name}/length"] = servo.length_m
            readings[f"{name}/speed"] = servo.lengthening_m_per_s
            readings[f"{name}/tension"] = max(servo.tension_n, 0.0)
        return readings

    def close(self) -> None:
        """Do nothing: the bus belongs to the outputs."""


def _features(sensor: SensorPlan) -> list[Feature]:
    """Return length, speed and tension of each tendon."""
    from shapechanger.layout import Element, Feature  # The guard needs no layouts.

    tendons: dict[str, dict[str, Any]] = sensor.settings["tendons"]
    parts = {name: Element("tendon", name) for name in tendons}
    ends = {
        name: (one["shortest_m"], one["longest_m"])
        if one["control"] == "length"
        else (-math.inf, math.inf)
        for name, one in tendons.items()
    }
    most_n = {name: one["most_tension_n"] for name, one in tendons.items()}
    return [
        *(Feature(f"{n}/length", "m", *ends[n], element=part) for n, part in parts.items()),
        *(Feature(f"{n}/speed", "m/s", element=part) for n, part in parts.items()),
        *(Feature(f"{n}/tension", "N", 0.0, most_n[n], part) for n, part in parts.items()),
    ]


BUS_SERVO: Final = OutputChip(
    keys=ServoSettings,
    open=TendonOutput,
    # On a bus, no level of a pin determines its state.
    wire=lambda plan, rest, duty: lambda levels: WiredOutput(None, True),
    differs="its bus has a fault and released it",
    # By its own watchdog when the bus is silent, or without power by the enable pin; talking to it
    # would only keep it energised.
    stops_itself=True,
)
"""A servo on a bus that winds a tendon."""

TENDONS: Final = SensorChip(measures="tendons", keys=Keys, open=TendonSensor, features=_features)
"""The tendons of a servo bus."""
