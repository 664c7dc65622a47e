"""Through a pseudo-terminal: `dynamixel_sdk` and pyserial as they come, and the driver on top."""

from collections.abc import Iterator

import pytest
from dynamixel_sdk import PacketHandler, PortHandler

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.bus import ServoBus
from shapechanger.robot.drivers.dynamixel.serial_port import PromptPort, open_serial_port
from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.twin.servos.bus import SimulatedBus
from shapechanger.twin.servos.servo import ServoPlan
from tests.robot.drivers.dynamixel.pty import ServoPty
from tests.robot.drivers.dynamixel.rigs import CYCLE_NS, MODEL, NAMES, settings

# So long that a busy machine is never taken for a silent servo.
_PATIENT_MS = 20_000.0


@pytest.fixture
def pty() -> Iterator[ServoPty]:
    """Seven servos behind a terminal; the first stands at -3 counts."""
    plans = [ServoPlan(i, MODEL, angle=-0.004 if i == 1 else 2.0 * i) for i in range(1, 8)]
    with ServoPty(SimulatedBus(plans)) as line:
        yield line


def _settings(pty: ServoPty, **changes: float) -> BusSettings:
    return settings(device=pty.device, **({"answer_ms": _PATIENT_MS} | changes))


def _open(bus: BusSettings) -> ServoBus:
    return ServoBus(bus, open_serial_port(bus))


def test_the_plain_sdk_pings_and_reads(pty: ServoPty) -> None:
    """Nothing of ours is between the SDK and the bytes."""
    port, sdk = PortHandler(pty.device), PacketHandler(2.0)
    assert port.setBaudRate(1_000_000)
    # Its own 34 ms would be too short on a busy machine.
    port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(_PATIENT_MS)
    assert sdk.ping(port, 5) == (1190, 0, 0)
    assert sdk.readTxRx(port, 5, 6, 1) == ([52], 0, 0)
    assert sdk.writeTxRx(port, 5, 64, 1, [1]) == (0, 0)
    assert sdk.writeTxRx(port, 5, 11, 1, [0]) == (0, 7)  # Locked while it has torque.
    port.closePort()


def test_stuffed_bytes_come_back_as_they_were(pty: ServoPty) -> None:
    """FD FF FF FF behind FF FF cannot go over the bus as it is: position -3 behind velocity -1."""
    port, sdk = PortHandler(pty.device), PacketHandler(2.0)
    assert port.setBaudRate(1_000_000)
    port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(_PATIENT_MS)
    data, result, _ = sdk.readTxRx(port, 1, 132, 4)
    assert (bytes(data), result) == (b"\xfd\xff\xff\xff", 0)
    port.closePort()


def test_the_driver_pulls_over_a_real_serial_port(pty: ServoPty) -> None:
    """From the first ping to the last byte."""
    bus = _open(_settings(pty))
    bus.set_up()
    bus.hold()
    for i in range(20):
        state = bus.cycle(dict.fromkeys(NAMES, 5.0), i * CYCLE_NS)
        assert set(state.servos) == set(NAMES)
        pty.advance(CYCLE_NS)
    assert state.reason == ""
    assert state.servos["PI"].tension_n == pytest.approx(5.0, abs=0.03)
    bus.close()


def test_a_silent_servo_is_named_over_a_real_serial_port(pty: ServoPty) -> None:
    """The wait for an answer that never comes has an end."""
    with pty.lock:
        pty.bus.servos[3].mute = True
    with pytest.raises(RobotError, match=r"no servo answers as EIP \(id 3\); those that do: FDP"):
        _open(_settings(pty, answer_ms=300.0)).set_up()


class _Noise:
    """A serial device from which bytes come without end."""

    def __init__(self) -> None:
        self.taken = 0

    def read(self, length: int) -> bytes:
        """So many of them."""
        self.taken += length
        return b"\xff" * length


def test_noise_without_end_does_not_hold_the_driver() -> None:
    """The SDK looks at its time only where nothing has come, and would read for ever."""
    port = PromptPort("noise", 0.0)
    port.ser = noise = _Noise()
    port.setPacketTimeoutMillis(0.0)
    _, result = PacketHandler(2.0).rxPacket(port, False)
    assert result == -3002  # Corrupt.
    assert noise.taken == 1024


def test_a_device_that_is_not_there_has_its_sentence() -> None:
    """Instead of a trace from pyserial."""
    with pytest.raises(RobotError, match="The bus at /dev/nowhere cannot be opened: "):
        open_serial_port(settings(device="/dev/nowhere"))


def test_a_speed_that_the_sdk_does_not_know_has_its_sentence(pty: ServoPty) -> None:
    """4.5 Mbaud is one of the XM430, and not of the SDK."""
    with pytest.raises(RobotError, match="cannot have 4500000 baud; 57600"):
        open_serial_port(settings(device=pty.device, baud=4_500_000))
