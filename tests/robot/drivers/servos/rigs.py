"""A rig of seven tendons on a simulated bus, with its driver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msgspec.structs import replace

from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.serial_port import SerialServoPort
from shapechanger.robot.drivers.servos.servo import TendonServo
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.servos.simulation import Rig as Line
from shapechanger.robot.drivers.servos.simulation import SimulatedServo
from tests.robot.drivers.fakes import FakeHardware
from tests.robot.drivers.servos import wire

NAMES = ("FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI")
"""The tendons; their servos have the ids 1 to 7."""

CYCLE_NS = 10_000_000
"""Time between two cycles."""

MODEL = "XL330-M077"


def servo(name: str, **changes: Any) -> ServoSettings:
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


def feetech(name: str, **changes: Any) -> ServoSettings:
    """Return the settings of one Feetech servo, which controls lengths of 0 to -15 mm."""
    plain: dict[str, Any] = {"model": "STS3215", "control": "length", "shortest_m": -0.015}
    tensions = {"most_tension_n": 60.0, "pretension_n": 12.0, "homing_n": 16.0}
    return servo(name, **(plain | tensions | changes))


def settings(**changes: Any) -> BusSettings:
    return replace(
        BusSettings(device="the twin", servos=tuple(servo(name) for name in NAMES)), **changes
    )


def of(family: str, **changes: Any) -> BusSettings:
    make = feetech if family == "Feetech" else servo
    return settings(servos=tuple(make(name) for name in NAMES), **changes)


class FaultyPort(SerialServoPort):
    """A port of the SDK at a simulated bus, without real time.

    An answer that is late or missing has timed out as soon as the SDK checks the timeout. If
    `is_gone`, every use of the device raises OSError.
    """

    def __init__(self, settings: BusSettings, line: Line) -> None:
        super().__init__(settings)
        self._line = line
        self._arrived = bytearray()
        self._late: list[tuple[int, bytes]] = []
        self.is_gone = self.is_closed = False
        self.late_ns: dict[int, int] = {}  # Delay of the answers of servos, keyed by id.
        self.damaged: set[int] = set()  # Ids of servos whose answers are damaged.
        self.sent: list[bytes] = []
        self.received = 0

    def inject(self, data: bytes) -> None:
        self._arrived += data

    def setBaudRate(self, baudrate: int) -> bool:
        return True

    def clearPort(self) -> None:
        self.getBytesAvailable()
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        self.getBytesAvailable()
        self.sent.append(bytes(packet))
        for servo_id, answer in wire.execute(self._line, bytes(packet)).items():
            if servo_id in self.late_ns:
                self._late.append((self._line.now_ns + self.late_ns[servo_id], answer))
                break  # Later servos wait for this one.
            damage = 0x55 if servo_id in self.damaged else 0
            self._arrived += answer[:-1] + bytes([answer[-1] ^ damage])
            self.received += len(answer)
        return len(packet)

    def readPort(self, length: int) -> bytes:
        self.getBytesAvailable()
        data = bytes(self._arrived[: max(length, 0)])
        del self._arrived[: max(length, 0)]
        return data

    def isPacketTimeout(self) -> bool:
        return not self.getBytesAvailable()

    def getBytesAvailable(self) -> int:
        if self.is_gone:
            raise OSError(5, "Input/output error")
        due = [one for one in self._late if one[0] <= self._line.now_ns]
        self._late = [one for one in self._late if one not in due]
        self._arrived += b"".join(data for _, data in due)
        return len(self._arrived)

    def closePort(self) -> None:
        self.is_closed = True


def line(*servos: ServoSettings) -> Line:
    """Return a simulated bus with these servos; by default with one Dynamixel servo."""
    return Line(settings(servos=servos or (servo("FDP"),)))


class Rig(FakeHardware):
    """A simulated bus, its port and its driver on one clock."""

    def __init__(self, bus: BusSettings | None = None) -> None:
        super().__init__()
        self.settings = settings() if bus is None else bus
        # The servos start at various positions, some turns away from 0.
        self.line = line(*(replace(one, zero=1304 * one.id) for one in self.settings.servos))
        self.port = FaultyPort(self.settings, self.line)
        self.bus = ServoBus(self.settings, self)
        self.bus.open()

    def servo_port(self, settings: BusSettings, open_port: object) -> FaultyPort:
        return self.port

    def one(self, name: str) -> TendonServo:
        return self.bus.servos[NAMES.index(name) + 1]

    def twin(self, name: str) -> SimulatedServo:
        return self.line.servos[NAMES.index(name) + 1]

    def prepare(self) -> Rig:
        self.bus.set_up()
        self.bus.hold()
        return self

    def start(self) -> Rig:
        """Set up and hold the bus, with zeros at the present positions."""
        self.prepare()
        for one in self.bus.servos.values():
            one.zero = one.read("position")
        return self

    def run(
        self, tension: float | None, cycles: int = 1, length: float | None = None, **others: float
    ) -> dict[str, dict[str, float]]:
        """Request a tension, N, of each tendon, but see `others`; return the last readings."""
        assert cycles > 0
        for _ in range(cycles):
            if tension is not None and self.bus.mode == "held":
                for one in self.bus.servos.values():
                    one.request(others.get(one.settings.name, tension), length)
                self.bus.flush(grip=False)
            seen = self.bus.cycle(self.line.now_ns)
            self.line.advance(CYCLE_NS)
        return seen

    def until(self, mode: str) -> str:
        """Pull with 10 N until the bus has a mode, and return the faults."""
        for _ in range(120):
            self.run(10.0)
            if self.bus.mode == mode:
                return self.bus.reason
        raise AssertionError(f"The bus never was {mode}: {self.bus.mode}")

    def pulls(self) -> list[float]:
        """Return the goal current in effect of each simulated servo, A."""
        return [one.pulls_a for one in self.line.servos.values()]

    @property
    def faulty(self) -> list[str]:
        return [one.settings.name for one in self.bus.servos.values() if one.fault]
