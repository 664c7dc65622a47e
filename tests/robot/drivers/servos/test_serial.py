"""`dynamixel_sdk`, pyserial and the driver over a pseudo-terminal."""

from collections.abc import Iterator

import pytest
from dynamixel_sdk import PacketHandler, PortHandler

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.rig import SimulatedBus
from shapechanger.robot.drivers.servos.serial_port import PromptPort, open_serial_port
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.drivers.servos.simulation import ServoPlan
from tests.robot.drivers.servos.pty import ServoPty
from tests.robot.drivers.servos.rigs import CYCLE_NS, MODEL, NAMES, of, settings

# Long enough that a busy machine does not look like a mute servo.
_PATIENT_MS = 20_000.0


@pytest.fixture
def feetech_pty() -> Iterator[ServoPty]:
    """Seven Feetech servos behind a terminal."""
    with ServoPty(SimulatedBus([ServoPlan(i, "STS3215", angle=2.0 * i) for i in range(1, 8)])) as p:
        yield p


@pytest.fixture
def pty() -> Iterator[ServoPty]:
    """Seven servos behind a terminal; the first is at -3 counts."""
    plans = [ServoPlan(i, MODEL, angle=-0.004 if i == 1 else 2.0 * i) for i in range(1, 8)]
    with ServoPty(SimulatedBus(plans)) as line:
        yield line


def _settings(pty: ServoPty, **changes: float) -> BusSettings:
    return settings(device=pty.device, **({"answer_ms": _PATIENT_MS} | changes))


def _open(bus: BusSettings) -> ServoBus:
    return ServoBus(bus, open_serial_port(bus))


def test_the_plain_sdk_reads_and_writes(pty: ServoPty) -> None:
    """The unmodified SDK talks to the simulated servos."""
    port, sdk = PortHandler(pty.device), PacketHandler(2.0)
    assert port.setBaudRate(1_000_000)
    # Its own 34 ms would be too short on a busy machine.
    port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(_PATIENT_MS)
    assert sdk.readTxRx(port, 5, 0, 2) == ([0xA6, 4], 0, 0)
    assert sdk.readTxRx(port, 5, 6, 1) == ([52], 0, 0)
    assert sdk.writeTxRx(port, 5, 64, 1, [1]) == (0, 0)
    assert sdk.writeTxRx(port, 5, 11, 1, [0]) == (0, 7)  # Locked while it has torque.
    port.closePort()


def test_byte_stuffing_round_trips(pty: ServoPty) -> None:
    """FF FF FD in the data of a reply is stuffed on the wire and restored by the SDK."""
    port, sdk = PortHandler(pty.device), PacketHandler(2.0)
    assert port.setBaudRate(1_000_000)
    port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(_PATIENT_MS)
    data, result, _ = sdk.readTxRx(port, 1, 132, 4)
    assert (bytes(data), result) == (b"\xfd\xff\xff\xff", 0)
    port.closePort()


def test_the_driver_works_over_a_real_serial_port(pty: ServoPty) -> None:
    """Set up, hold, cycle and close through pyserial."""
    bus = _open(_settings(pty))
    bus.set_up()
    bus.hold()
    for i in range(20):
        bus.send(dict.fromkeys(NAMES, 5.0))
        state = bus.cycle(i * CYCLE_NS)
        assert set(state.servos) == set(NAMES)
        pty.advance(CYCLE_NS)
    assert state.reason == ""
    assert state.servos["PI"].tension_n == pytest.approx(5.0, abs=0.03)
    bus.close()


def test_feetech_servos_work_over_a_real_serial_port(feetech_pty: ServoPty) -> None:
    """Set up, hold, cycle and close with the packets of protocol 1.0."""
    bus = _open(of("Feetech", device=feetech_pty.device, answer_ms=_PATIENT_MS))
    bus.set_up()
    bus.hold()
    for i in range(20):
        bus.send(dict.fromkeys(NAMES, 20.0))
        state = bus.cycle(i * CYCLE_NS)
        assert set(state.servos) == set(NAMES)
        feetech_pty.advance(CYCLE_NS)
    assert state.reason == ""
    assert state.servos["PI"].goal_n == pytest.approx(20.0, abs=0.4)
    assert state.servos["PI"].tension_n > 5.0
    bus.close()
    assert not any(servo.has_torque for servo in feetech_pty.bus.servos.values())


def test_a_mute_servo_is_named_over_a_real_serial_port(pty: ServoPty) -> None:
    """Waiting for a missing answer times out."""
    with pty.lock:
        pty.bus.servos[3].mute = True
    with pytest.raises(RobotError, match=r"no servo answers as EIP \(id 3\); those that do: FDP"):
        _open(_settings(pty, answer_ms=300.0)).set_up()


class _Noise:
    """A serial device that returns bytes without end."""

    def __init__(self) -> None:
        self.taken = 0

    def read(self, length: int) -> bytes:
        """Return `length` bytes."""
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
    """RobotError replaces the exception of pyserial."""
    with pytest.raises(RobotError, match="The bus at /dev/nowhere cannot be opened: "):
        open_serial_port(settings(device="/dev/nowhere"))


def test_an_unsupported_baud_rate_is_refused(pty: ServoPty) -> None:
    """The XM430 supports 4.5 Mbaud, but the SDK does not."""
    with pytest.raises(RobotError, match="cannot have 4500000 baud; 57600"):
        open_serial_port(settings(device=pty.device, baud=4_500_000))
