"""Hardware of a robot's process on a twin: its connection to the board, pins, buses and time."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from shapechanger.errors import translate_errors
from shapechanger.robot.hardware import Clock, Hardware, ServoReply
from shapechanger.robot.twin import rpc


class SteadyClock(Clock):
    """The machine's monotonic clock; its `wait` dispatches edges of inputs."""

    is_real: ClassVar = False

    def __init__(self, client: rpc.BoardClient) -> None:
        self._client = client

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait until a descriptor can be read or it is `until_ns`; see `Clock.wait`."""
        latest_ns = min(until_ns, time.monotonic_ns() + int(at_most_s * 1e9))
        board = self._client.fileno()
        poll = select.poll()
        for fd in {*readable, board}:
            poll.register(fd, select.POLLIN)
        self._take_edges()
        while True:
            left_ms = max(0.0, (latest_ns - time.monotonic_ns()) / 1e6)
            ready = {fd for fd, _ in poll.poll(left_ms)} - {board}
            self._take_edges()
            now_ns = time.monotonic_ns()
            if ready or now_ns >= latest_ns:
                return bool(ready) or now_ns >= until_ns

    def _take_edges(self) -> None:
        """Dispatch the edges that have arrived, and request further ones from the board."""
        while self._client.wait():
            pass
        self._client.dispatch()

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Call `beat` while the board does not reply; see `Clock.keep_alive`."""
        self._client.while_held_up = beat


class GrantedClock(SteadyClock):
    """The twin's own clock, which the board advances.

    Time advances only while a client sleeps and each process that has called `wait` is waiting.
    """

    def __init__(self, client: rpc.BoardClient, path: str) -> None:
        super().__init__(client)
        self._path = path

    def now_ns(self) -> int:
        """Return the newest twin time that this process has received."""
        return self._client.now_ns

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait until the board ends all waits, see `TwinTimeBoard`, for at most `at_most_s`."""
        granted = self._client.wait(until_ns, at_most_s)
        self._client.dispatch()
        return granted

    async def sleep(self, seconds: float) -> int | None:
        """Let twin time advance, and return when the newest image was taken."""
        import asyncio  # Only the daemon sleeps, and the guard must not load asyncio.

        loop = asyncio.get_running_loop()
        with (
            translate_errors(OSError, to=rpc.board_gone),
            socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection,
        ):
            connection.setblocking(False)
            await loop.sock_connect(connection, self._path)
            call = rpc.encode_call("sleep", max(0, round(seconds * 1e9)), id=0)
            await loop.sock_sendall(connection, call)
            reply = rpc.decode_reply(await loop.sock_recv(connection, rpc.MAX_MESSAGE))
        slept = reply.decode(rpc.Slept)
        self._client.now_ns = max(self._client.now_ns, slept.t)
        return slept.captured_ns


class TwinBus:
    """The part of `smbus2.SMBus` that the drivers use; a missing chip raises OSError."""

    def __init__(self, board: rpc.BoardClient, bus: int) -> None:
        self._board = board
        self._bus = bus

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte, which is a register without data."""
        self.write_i2c_block_data(i2c_addr, value, [])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read several bytes, starting at one register."""
        return self._board.ask(list[int], "read_chip", self._bus, i2c_addr, register, length)

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write several bytes, starting at one register."""
        if not all(0 <= byte <= 0xFF for byte in data):
            raise ValueError(f"Bytes must be 0 to 255, got {list(data)}.")
        self._board.ask(None, "write_chip", self._bus, i2c_addr, register, list(data))

    def close(self) -> None:
        """Close the bus; its chips keep running."""


class TwinServoPort:
    """Port of the servo bus; see `ServoPort`. Its servos reply at once or never."""

    def __init__(self, board: rpc.BoardClient, device: str) -> None:
        self._board = board
        self._device = device
        self.has_stray = False

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of several servos; see `ServoPort.read`."""
        replies = dict[int, ServoReply]
        return self._board.ask(replies, "read_servos", self._device, list(ids), at, size)

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of several servos, or of one; see `ServoPort.write`."""
        return self._board.ask(dict[int, ServoReply], "write_servos", self._device, dict(data), at)

    def close(self) -> None:
        """Do nothing, because the bus outlives the port."""


class TwinHardware(Hardware):
    """Pins, buses and time of a board; see `shapechanger.robot.hardware.Hardware`."""

    def __init__(self, board: rpc.BoardClient, clock: SteadyClock) -> None:
        self.board = board
        self.clock = clock
        self._pin_factory: Any = None

    def pin_factory(self) -> Any:
        """Return the `pin_factory` of gpiozero's devices."""
        if self._pin_factory is None:
            from shapechanger.robot.twin.gpio_pins import TwinPinFactory  # gpiozero is an extra.

            self._pin_factory = TwinPinFactory(self.board, self.clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """Return the I2C bus of a number."""
        return TwinBus(self.board, bus)

    def servo_port(self, settings: Any, open_port: object) -> TwinServoPort:
        """Return the port of the servo bus; its first use fails if the board has no such bus."""
        return TwinServoPort(self.board, settings.device)

    def close(self) -> None:
        """Release the pins and disconnect from the board."""
        super().close()
        self.board.close()


def connect(path: str) -> TwinHardware:
    """Connect to the board that listens on a socket."""
    client = rpc.BoardClient(path, "hardware")
    clock = GrantedClock(client, path) if client.clock == "twin" else SteadyClock(client)
    return TwinHardware(client, clock)
