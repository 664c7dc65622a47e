"""A rig of seven tendons on a simulated bus, and its driver."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from shapechanger.robot.drivers.dynamixel.bus import ServoBus
from shapechanger.robot.drivers.dynamixel.health import BusState
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings
from shapechanger.twin.servos.bus import SimulatedBus
from shapechanger.twin.servos.port import ServoPort
from shapechanger.twin.servos.servo import ServoPlan, SimulatedServo

NAMES = ("FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI")
"""The tendons; their servos have the ids 1 to 7."""

CYCLE_NS = 10_000_000
"""Time between two cycles."""

MODEL = "XL330-M077"


def servo(name: str, **changes: Any) -> ServoSettings:
    """The settings of one of the seven."""
    plain = ServoSettings(
        name=name,
        id=NAMES.index(name) + 1,
        model=MODEL,
        spool_radius_m=0.005,
        most_tension_n=20.0,
        pretension_n=2.0,
        homing_n=3.0,
    )
    return replace(plain, **changes)


def settings(**changes: Any) -> BusSettings:
    """The settings of the bus."""
    return replace(BusSettings("the twin", tuple(servo(name) for name in NAMES)), **changes)


class FaultyPort(ServoPort):
    """A port of a simulated bus that can fail, and keeps what was sent.

    Attributes:
        is_cut: Whether the cable is cut: bytes arrive nowhere.
        is_gone: Whether the device is gone: every use raises OSError.
        is_closed: Whether it was closed.
        sent: Packets that were written.
    """

    def __init__(self, line: SimulatedBus) -> None:
        super().__init__(self._reach)
        self._line = line
        self.is_cut = self.is_gone = self.is_closed = False
        self.sent: list[bytes] = []

    def inject(self, data: bytes) -> None:
        """Let bytes arrive that no servo has sent."""
        self._arrived += data

    def closePort(self) -> None:
        """Note that the port was closed."""
        self.is_closed = True

    def _reach(self, data: bytes) -> bytes:
        if self.is_gone:
            raise OSError(5, "Input/output error")
        if data:
            self.sent.append(data)
        if self.is_cut:
            return b""
        if data:
            self._line.receive(data)
        return self._line.send()


class Rig:
    """The simulated bus, the port and the driver, on one clock.

    Args:
        bus: Its settings.
        plans: Its servos; None for seven as in the settings.
    """

    def __init__(
        self, bus: BusSettings | None = None, plans: list[ServoPlan] | None = None
    ) -> None:
        self.settings = settings() if bus is None else bus
        if plans is None:
            plans = [ServoPlan(one.id, MODEL, angle=2.0 * one.id) for one in self.settings.servos]
        self.line = SimulatedBus(plans)
        self.port = FaultyPort(self.line)
        self.bus = ServoBus(self.settings, lambda _: self.port)

    def start(self) -> Rig:
        """Set it up and hold it, with the zeros where the spools are."""
        self.bus.set_up()
        self.bus.set_zeros({name: self.twin(name).register(132) for name in NAMES})
        self.bus.hold()
        return self

    def twin(self, name: str) -> SimulatedServo:
        """The simulated servo of a tendon."""
        return self.line.servos[NAMES.index(name) + 1]

    def run(self, tension: float | None, cycles: int = 1, **others: float) -> BusState:
        """Pull all tendons with one tension, except `others`, and return the last state."""
        assert cycles > 0
        for _ in range(cycles):
            tensions = None if tension is None else dict.fromkeys(NAMES, tension) | others
            state = self.bus.cycle(tensions, self.line.now_ns)
            self.line.advance(CYCLE_NS)
        return state

    def pulls(self) -> list[float]:
        """Return the goal current in effect of each simulated servo, A."""
        return [one.pulls_a for one in self.line.servos.values()]
