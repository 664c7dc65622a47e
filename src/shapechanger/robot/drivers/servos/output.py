"""Drivers of the tendons of a servo bus: outputs and their sensor.

The sensor runs one cycle of the bus per tick, which reads all servos. The outputs only request
their tensions, which are sent in one packet once all of them are requested.
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

    0 is its pretension in both kinds of control, so that all stops end the same, and 1 its largest
    tension.
    With control "length" values above 0 go from its longest to its shortest length.

    Attributes:
        device: The bus, which acts when all outputs are written.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        place = hardware, plan.settings["device"]
        bus = _OPEN.get(place)
        if bus is None or not bus.users:
            bus = _OPEN[place] = ServoBus(BusSettings.of(plan.settings), hardware)
        self.device = bus
        self._servo = bus.add(ServoSettings.of(plan.settings))
        bus.users.add(self._servo.settings.name)

    def write(self, value: float, now_ns: int) -> float:
        """Request a value, 0 to 1, from the next flush on; negative values count as 0.

        Returns:
            The value in effect: 0 if the bus has a fault and lets go.
        """
        if self.device.reason:
            return 0.0
        value, servo = min(max(value, 0.0), 1.0), self._servo.settings
        if servo.control == "tension":
            tension = servo.pretension_n + value * (servo.most_tension_n - servo.pretension_n)
            self._servo.request(tension)
        elif value > 0.0:
            length = servo.longest_m + value * (servo.shortest_m - servo.longest_m)
            self._servo.request(servo.most_tension_n, length)
        else:
            self._servo.request(servo.pretension_n)
        return value

    def release(self) -> None:
        """Switch the torque of all servos on the bus off."""
        self.device.let_go()

    def close(self) -> None:
        """Close the output; closing the last one closes the bus."""
        self.device.users.discard(self._servo.settings.name)
        if not self.device.users:
            self.device.close()


class TendonSensor:
    """Runs one cycle of the bus per reading; see `SensorDriver`.

    The outputs on the bus must be open.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        device: str = plan.settings["device"]
        bus = _OPEN.get((hardware, device))
        if bus is None or not bus.users:
            raise RobotError(f"No output is on the servo bus at {device}.")
        self._bus = bus

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Run a cycle and return its readings, such as `FDP/length`; see `TendonServo.see`.

        Raises:
            RobotError: If there is a fault.
        """
        seen = self._bus.cycle(now_ns)
        if self._bus.reason:
            raise RobotError(self._bus.reason)
        return {f"{name}/{key}": x for name, found in seen.items() for key, x in found.items()}

    def close(self) -> None:
        """Do nothing, because the outputs close the bus."""


def _features(sensor: SensorPlan) -> list[Feature]:
    """Return length, speed and tension of each tendon."""
    from shapechanger.layout import Element, Feature  # The guard needs no layouts.

    features: dict[str, list[Feature]] = {"length": [], "speed": [], "tension": []}
    for servo in map(ServoSettings.of, sensor.settings["tendons"].values()):
        name, part = servo.name, Element("tendon", servo.name)
        ends = (servo.shortest_m, servo.longest_m)
        low, high = ends if servo.control == "length" else (-math.inf, math.inf)
        features["length"].append(Feature(f"{name}/length", "m", low, high, part))
        features["speed"].append(Feature(f"{name}/speed", "m/s", element=part))
        most = servo.most_tension_n
        features["tension"].append(Feature(f"{name}/tension", "N", 0.0, most, part))
    return [one for kind in features.values() for one in kind]


BUS_SERVO: Final = OutputChip(
    keys=ServoSettings,
    open=TendonOutput,
    # On a bus, no level of a pin determines its state.
    wire=lambda plan, rest, duty: lambda levels: WiredOutput(None, True),
    differs="its bus has a fault and released it",
    # Its own watchdog stops it when the bus is silent, or the enable pin cuts its power; writing to
    # it would only keep it energised.
    stops_itself=True,
)
"""A servo on a bus that winds a tendon."""

TENDONS: Final = SensorChip(measures="tendons", keys=Keys, open=TendonSensor, features=_features)
"""The tendons of a servo bus."""
