"""`dynamixel_sdk`, pyserial and the driver over a pseudo-terminal."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from dynamixel_sdk import PacketHandler

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.serial_port import PromptPort, open_serial_port
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.hardware import Hardware
from tests.robot.drivers.servos.pty import ServoPty
from tests.robot.drivers.servos.rigs import CYCLE_NS, NAMES, feetech, line, of, servo, settings

# Long enough that a busy machine does not look like a mute servo.
_PATIENT_MS = 20_000.0


@pytest.fixture
def feetech_pty() -> Iterator[ServoPty]:
    """Seven Feetech servos behind a terminal."""
    with closing(ServoPty(line(*(feetech(name, zero=1304) for name in NAMES)))) as made:
        yield made


@pytest.fixture
def pty() -> Iterator[ServoPty]:
    """Seven servos behind a terminal; the first is at -3 counts."""
    servos = [servo(name, zero=-3 if name == "FDP" else 1304) for name in NAMES]
    with closing(ServoPty(line(*servos))) as made:
        yield made


def _open(bus: BusSettings) -> ServoBus:
    opened = ServoBus(bus, Hardware())
    opened.open()
    return opened


@pytest.mark.parametrize(("family", "tension"), [("Dynamixel", 5.0), ("Feetech", 20.0)])
def test_the_driver_works_over_a_real_serial_port(
    pty: ServoPty, feetech_pty: ServoPty, family: str, tension: float
) -> None:
    far = feetech_pty if family == "Feetech" else pty
    bus = _open(of(family, device=far.device, answer_ms=_PATIENT_MS))
    bus.set_up()
    bus.hold()
    for i in range(20):
        bus.send(dict.fromkeys(NAMES, tension))
        state = bus.cycle(i * CYCLE_NS)
        assert set(state.servos) == set(NAMES)
        far.advance(CYCLE_NS)
    assert state.reason == ""
    assert state.servos["PI"].goal_n == pytest.approx(tension, abs=0.4)
    assert state.servos["PI"].tension_n > 0.9 * tension or family == "Feetech"
    bus.close()
    assert not any(one.has_torque for one in far.bus.servos.values())


def test_a_mute_servo_is_named_over_a_real_serial_port(pty: ServoPty) -> None:
    """Waiting for a missing answer times out."""
    with pty.lock:
        pty.bus.servos[3].mute = True
    with pytest.raises(RobotError, match=r"no servo answers as EIP \(id 3\); those that do: FDP"):
        _open(settings(device=pty.device, answer_ms=300.0)).set_up()


class _Noise:
    def __init__(self) -> None:
        self.taken = 0

    def read(self, length: int) -> bytes:
        self.taken += length
        return b"\xff" * length


@pytest.mark.parametrize("options", [(2.0, False), (1.0,)])
def test_endless_noise_does_not_block_the_driver(options: tuple[float, ...]) -> None:
    """The SDK checks its timeout only when no byte is available; `PromptPort` bounds the read."""
    port = PromptPort("noise", 0.0)
    port.ser = noise = _Noise()
    port.setPacketTimeoutMillis(0.0)
    _, result = PacketHandler(options[0]).rxPacket(port, *options[1:])
    assert result == -3002  # Corrupt.
    assert noise.taken == 1024


def test_a_missing_device_is_named() -> None:
    with pytest.raises(RobotError, match="The bus at /dev/nowhere cannot be opened: "):
        open_serial_port(settings(device="/dev/nowhere"))


def test_an_unsupported_baud_rate_is_refused(pty: ServoPty) -> None:
    """The XM430 supports 4.5 Mbaud, but the SDK does not."""
    with pytest.raises(RobotError, match="cannot have 4500000 baud; 57600"):
        open_serial_port(settings(device=pty.device, baud=4_500_000))
