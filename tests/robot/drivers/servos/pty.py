"""A simulated servo bus behind a pseudo-terminal, for drivers that open a serial device."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import tty
from typing import Final

from shapechanger.robot.drivers.servos.simulation import Rig
from tests.robot.drivers.servos import wire

_CHUNK: Final = 4096
_HEADER: Final = 6  # No packet is shorter, and its size is known by then or soon.


class ServoPty:
    """Serve a simulated bus at a pseudo-terminal from a thread.

    The caller advances the time of the bus. A packet without an answer, such as a sync write, has
    certainly arrived once a later one was answered, so read an answer before advancing the time.

    Args:
        bus: The bus; it must only be used through `advance`, or with `lock` held.

    Attributes:
        device: Path to open, such as "/dev/pts/3".
        bus: The bus.
        lock: Lock of the bus.
    """

    def __init__(self, bus: Rig) -> None:
        self.bus = bus
        self.lock = threading.Lock()
        self._host, self._far = os.openpty()
        tty.setraw(self._far)  # No echo and no special characters.
        os.set_blocking(self._host, False)
        self.device = os.ttyname(self._far)
        self._wake_in, self._wake_out = os.pipe()
        self._thread = threading.Thread(target=self._run, name="servo line", daemon=True)
        self._thread.start()

    def advance(self, ns: int) -> None:
        with self.lock:
            self.bus.advance(ns)

    def close(self) -> None:
        os.write(self._wake_out, b"x")
        self._thread.join()
        for fd in (self._host, self._far, self._wake_in, self._wake_out):
            os.close(fd)

    def _run(self) -> None:
        data = b""
        while True:
            ready, _, _ = select.select([self._host, self._wake_in], [], [])
            if self._wake_in in ready:
                return
            data += os.read(self._host, _CHUNK)
            family = wire.family_of(self.bus)
            while len(data) >= _HEADER and len(data) >= (size := wire.size_of(data, family)):
                with self.lock:
                    answers = wire.execute(self.bus, data[:size])
                self._send(b"".join(answers.values()))
                data = data[size:]

    def _send(self, data: bytes) -> None:
        """Send bytes; as on a serial line, unread ones are lost."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._host, data)
