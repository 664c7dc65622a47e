"""Drivers of the tendons of a servo bus: outputs and their sensor.

The sensor runs the one cycle of each tick, which reads all servos. The outputs only stage their
tensions, which are sent in one packet when all of them are staged.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final
from weakref import WeakValueDictionary

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import Keys, OutputChip, SensorChip
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.simulation import WiredOutput
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # The guard loads none.
    from shapechanger.layout import Feature

# Buses of this process, by hardware and device, while a driver has them.
_OPEN: Final = WeakValueDictionary[tuple[Hardware, str], ServoBus]()


class TendonOutput:
    """A tendon as an output; see `OutputDriver`.

    0 is its pretension in every control, so that all stops end the same, and 1 its largest tension.
    With control "length" values above 0 go from its longest to its shortest length.

    Attributes:
        device: The bus, which acts when all outputs are written.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        place = hardware, plan.settings["device"]
        bus = _OPEN.get(place)
        if bus is None or not bus.in_use:
            bus = _OPEN[place] = ServoBus(BusSettings.of(plan.settings), hardware)
        self.device = bus
        self._servo = ServoSettings.of(plan.settings)
        bus.add(self._servo)

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
        return 0.0 if bus.faults else value

    def release(self) -> None:
        """Switch the torque of all servos on the bus off."""
        self.device.let_go()

    def close(self) -> None:
        """Leave the bus."""
        self.device.leave(self._servo.name)


class TendonSensor:
    """Runs one cycle of the bus per reading; see `SensorDriver`.

    The outputs on the bus must be open.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        device: str = plan.settings["device"]
        bus = _OPEN.get((hardware, device))
        if bus is None or not bus.in_use:
            raise RobotError(f"No output is on the servo bus at {device}.")
        self._bus = bus

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Run a cycle and return its readings, without servos that did not answer.

        Returns:
            For each tendon, such as FDP, `FDP/length`, its length beyond its zero, m, if it has
            one; `FDP/speed`, m/s, positive while it gets longer; and `FDP/tension`, N, at least 0.

        Raises:
            RobotError: If there is a fault.
        """
        state = self._bus.cycle(now_ns)
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

    servos = [ServoSettings.of(one) for one in sensor.settings["tendons"].values()]
    parts = [(one, one.name, Element("tendon", one.name)) for one in servos]
    free = (-math.inf, math.inf)
    ends = {s.name: (s.shortest_m, s.longest_m) if s.control == "length" else free for s in servos}
    return [
        *(Feature(f"{name}/length", "m", *ends[name], element=part) for _, name, part in parts),
        *(Feature(f"{name}/speed", "m/s", element=part) for _, name, part in parts),
        *(
            Feature(f"{name}/tension", "N", 0.0, one.most_tension_n, part)
            for one, name, part in parts
        ),
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
