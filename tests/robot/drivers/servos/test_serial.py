"""`dynamixel_sdk`, pyserial and the driver over a pseudo-terminal."""

import contextlib
import os
import threading
import tty
from collections.abc import Iterator
from contextlib import closing

import pytest
from dynamixel_sdk import PacketHandler

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.serial_port import SerialServoPort
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.hardware import Hardware
from tests.robot.drivers.servos import wire
from tests.robot.drivers.servos.rigs import CYCLE_NS, NAMES, feetech, line, of, servo, settings

# Long enough that a busy machine does not look like a mute servo.
_PATIENT_MS = 20_000.0


class ServoPty:
    """Serve a simulated bus at a pseudo-terminal from a thread.

    A packet without an answer, such as a sync write, has certainly arrived once a later packet was
    answered, so read an answer before advancing the time of the bus.
    """

    def __init__(self, bus: Rig) -> None:
        self.bus = bus
        self._host, self._far = os.openpty()
        tty.setraw(self._far)  # No echo and no special characters.
        self.device = os.ttyname(self._far)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        os.close(self._far)
        self._thread.join()
        os.close(self._host)

    def _run(self) -> None:
        data, family = b"", wire.family_of(self.bus)
        with contextlib.suppress(OSError):  # The other ends are closed.
            while True:
                data += os.read(self._host, 4096)
                # Six bytes give the size of a Feetech packet. For Dynamixel, `size_of` is above six
                # until the seventh byte gives it.
                while len(data) >= 6 and len(data) >= (size := wire.size_of(data, family)):
                    answers = wire.execute(self.bus, data[:size])
                    os.write(self._host, b"".join(answers.values()))
                    data = data[size:]


@pytest.fixture(params=["Dynamixel"])
def pty(request: pytest.FixtureRequest) -> Iterator[ServoPty]:
    """Seven servos of a family behind a terminal; the first is at -3 counts."""
    make = feetech if request.param == "Feetech" else servo
    servos = [make(name, zero=-3 if name == "FDP" else 1304) for name in NAMES]
    with closing(ServoPty(line(*servos))) as made:
        yield made


def _open(bus: BusSettings) -> ServoBus:
    opened = ServoBus(bus, Hardware())
    opened.open()
    return opened


@pytest.mark.parametrize("pty", ["Dynamixel", "Feetech"], indirect=True)
def test_the_driver_works_over_a_real_serial_port(pty: ServoPty) -> None:
    family = wire.family_of(pty.bus).name
    tension = 20.0 if family == "Feetech" else 5.0
    bus = _open(of(family, device=pty.device, answer_ms=_PATIENT_MS))
    bus.set_up()
    bus.hold()
    for one in bus.servos.values():
        one.request(tension)
    for i in range(20):
        bus.flush(grip=False)
        seen = bus.cycle(i * CYCLE_NS)
        assert set(seen) == set(NAMES)
        pty.bus.advance(CYCLE_NS)
    assert bus.reason == ""
    assert bus.servos[7].goal_n == pytest.approx(tension, abs=0.4)
    assert seen["PI"]["tension"] > 0.9 * tension or family == "Feetech"
    bus.close()
    assert not any(one.has_torque for one in pty.bus.servos.values())


class _Noise:
    def __init__(self) -> None:
        self.taken = 0

    def read(self, length: int) -> bytes:
        self.taken += length
        return b"\xff" * length


@pytest.mark.parametrize("family", ["Dynamixel", "Feetech"])
def test_endless_noise_does_not_block_the_driver(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The SDK checks its timeout only when no byte is available; the port bounds the read."""
    monkeypatch.setattr(SerialServoPort, "setBaudRate", lambda self, baudrate: True)
    port = SerialServoPort(of(family))
    port.ser = noise = _Noise()
    port.setPacketTimeoutMillis(0.0)
    options = {"Dynamixel": (2.0, False), "Feetech": (1.0,)}[family]
    _, result = PacketHandler(options[0]).rxPacket(port, *options[1:])
    assert result == -3002  # Corrupt.
    assert noise.taken == 1024


def test_a_missing_device_is_named() -> None:
    with pytest.raises(RobotError, match="The bus at /dev/nowhere cannot be opened: "):
        SerialServoPort(settings(device="/dev/nowhere"))


def test_an_unsupported_baud_rate_is_refused(pty: ServoPty) -> None:
    """The XM430 supports 4.5 Mbaud, but the SDK does not."""
    with pytest.raises(RobotError, match="cannot have 4500000 baud; 57600"):
        SerialServoPort(settings(device=pty.device, baud=4_500_000))
