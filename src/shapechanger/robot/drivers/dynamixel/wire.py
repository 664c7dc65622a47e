"""Reads and writes registers over the bus, with the SDK; what goes wrong becomes a sentence."""

from __future__ import annotations

import contextlib
import termios
from collections.abc import Generator, Mapping, Sequence
from typing import Final, NamedTuple

from shapechanger.errors import MissingExtra, RobotError
from shapechanger.robot.drivers.dynamixel.port import Port
from shapechanger.robot.drivers.dynamixel.registers import Register

try:
    from dynamixel_sdk import PacketHandler
except ImportError as error:
    raise MissingExtra("dynamixel-sdk", "finger") from error

__all__ = ["ALERT", "Answer", "Wire"]

ALERT: Final = 0x80
"""Bit of a status packet's error: the hardware error status is worth a look."""

# Results of the SDK (robotis_def.py).
_SUCCESS: Final = 0
_RX_TIMEOUT: Final = -3001
_RX_CORRUPT: Final = -3002
# Damaged packets that are read past while waiting for good ones.
_MOST_JUNK: Final = 8
# A single lost packet must not keep a rig from starting. In a cycle nothing is asked twice.
_TRIES: Final = 3
_BROADCAST: Final = 0xFE
# Bytes of a block of a fast answer besides its data: error, id and CRC.
_FAST_EXTRA: Final = 4

_REFUSALS: Final = {
    1: "it could not do it",
    2: "it does not know the instruction",
    3: "the packet was damaged on its way",
    4: "the value is out of range",
    5: "the value has the wrong length",
    6: "the value is beyond a limit",
    7: "the register cannot be written now",
}


class Answer(NamedTuple):
    """What a servo said.

    Attributes:
        error: The error byte of its status packet.
        data: What was asked for.
    """

    error: int
    data: bytes


class Wire:
    """The bus.

    Args:
        port: What the bytes go over.
        device: What it is called in a sentence.
    """

    def __init__(self, port: Port, device: str) -> None:
        self._port = port
        self._device = device
        self._sdk = PacketHandler(2.0)
        self.has_stray = False
        """Whether bytes lay there when something was said: somebody had answered too late.

        It stays until its reader takes it back.
        """

    def ping(self, servo_id: int) -> int | None:
        """The model number of a servo; None if it does not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        for _ in range(_TRIES):
            with self._speaking():
                model, result, _ = self._sdk.ping(self._port, servo_id)
                if result == _SUCCESS:
                    return model
        return None

    def read(self, servo_id: int, register: Register) -> int:
        """One register of one servo.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        for _ in range(_TRIES):
            with self._speaking():
                data, result, error = self._sdk.readTxRx(
                    self._port, servo_id, register.address, register.size
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"read its {register.name}", error)
                    if len(data) == register.size:
                        return register.decode(bytes(data))
        raise self._silence(servo_id)

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Set one register of one servo, and wait until it says that it has done so.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        data = register.encode(value)
        for _ in range(_TRIES):
            with self._speaking():
                result, error = self._sdk.writeTxRx(
                    self._port, servo_id, register.address, register.size, data
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"set its {register.name} to {value}", error)
                    return
        raise self._silence(servo_id)

    def reboot(self, servo_id: int) -> None:
        """Start a servo afresh.

        Raises:
            RobotError: If it does not answer.
        """
        with self._speaking():
            result, _ = self._sdk.reboot(self._port, servo_id)
            if result == _SUCCESS:
                return
        raise self._silence(servo_id)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Set a register of several servos in one packet. Nobody answers.

        Raises:
            RobotError: If the bus is gone.
        """
        data: list[int] = []
        for servo_id, value in values.items():
            data += [servo_id, *register.encode(value)]
        with self._speaking():
            result = self._sdk.syncWriteTxOnly(
                self._port, register.address, register.size, data, len(data)
            )
            if result == _SUCCESS:
                return
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def sync_read(
        self, register: Register, ids: Sequence[int], *, fast: bool = False
    ) -> dict[int, Answer]:
        """A register of several servos, asked in one packet; who was not heard is not in it.

        Raises:
            RobotError: If the bus is gone.
        """
        with self._speaking():
            result = self._sdk.syncReadTx(
                self._port, register.address, register.size, list(ids), len(ids), fast
            )
            if result == _SUCCESS:
                return self._fast(register, ids) if fast else self._plain(register, ids)
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def close(self) -> None:
        """Let go of the port."""
        with contextlib.suppress(OSError, termios.error):  # A device that is gone is closed.
            self._port.closePort()

    def _plain(self, register: Register, ids: Sequence[int]) -> dict[int, Answer]:
        # The SDK's GroupSyncRead gives up at the first servo that is missing, drops what the others
        # said, and keeps no error byte; so the packets are taken here, one by one.
        heard: dict[int, Answer] = {}
        for _ in range(len(ids) + _MOST_JUNK):
            packet, result = self._receive()
            if result == _RX_TIMEOUT:
                break
            if result != _SUCCESS:
                continue
            end = 5 + int.from_bytes(bytes(packet[5:7]), "little")
            servo_id, error, data = packet[4], packet[8], bytes(packet[9:end])
            if servo_id in ids and len(data) == register.size:
                heard[servo_id] = Answer(error, data)
            if len(heard) == len(ids):
                break
        return heard

    def _fast(self, register: Register, ids: Sequence[int]) -> dict[int, Answer]:
        size = register.size + _FAST_EXTRA
        raw, result, _ = self._sdk.fastSyncReadRx(self._port, _BROADCAST, size * len(ids))
        # The last block's CRC is the packet's.
        if result != _SUCCESS or len(raw) != size * len(ids):
            return {}
        blocks = [raw[i * size : (i + 1) * size] for i in range(len(ids))]
        # Whether servos stuff bytes here nobody says; where one did, the ids would not fit.
        if [block[1] for block in blocks] != list(ids):
            return {}
        return {block[1]: Answer(block[0], bytes(block[2:-2])) for block in blocks}

    def _receive(self) -> tuple[list[int], int]:
        try:
            return self._sdk.rxPacket(self._port, False)
        except IndexError:  # The SDK trusts the length that a packet states.
            return [], _RX_CORRUPT

    @contextlib.contextmanager
    def _speaking(self) -> Generator[None]:
        """Turn what the device raises into words; what the SDK stumbles over is no answer."""
        self._port.is_using = False  # The SDK leaves it set when something was raised.
        try:
            self.has_stray |= self._port.getBytesAvailable() > 0
            yield
        except (OSError, termios.error) as error:
            raise RobotError(f"The bus at {self._device} is gone: {error}.") from error
        except IndexError:
            pass  # As in _receive. Whoever asked goes on as without an answer.

    def _check(self, servo_id: int, what: str, error: int) -> None:
        if number := error & ~ALERT:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")

    def _silence(self, servo_id: int) -> RobotError:
        return RobotError(f"Servo {servo_id} at {self._device} does not answer.")
