"""A line behind a pseudo-terminal, for whoever opens a serial device."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import tty
from types import TracebackType
from typing import Final, Self

from shapechanger.twin.servos.line import Line

__all__ = ["LinePty"]

_CHUNK: Final = 4096


class LinePty:
    """Answers at a pseudo-terminal from a thread of its own; the line's time is the caller's.

    What was written without being answered, such as a sync write, is sure to have arrived once
    something after it was answered. So whoever lets time go by should have heard an answer before.

    Args:
        line: The bus. From now on only `advance` may be used, or `lock` be held.

    Attributes:
        device: Path to open, such as "/dev/pts/3".
        line: The bus.
        lock: Held while the line is used.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self.lock = threading.Lock()
        self._host, self._far = os.openpty()
        tty.setraw(self._far)  # No echo, and no byte means anything.
        os.set_blocking(self._host, False)
        self.device = os.ttyname(self._far)
        self._wake_in, self._wake_out = os.pipe()
        self._thread = threading.Thread(target=self._run, name="servo line", daemon=True)
        self._thread.start()

    def advance(self, ns: int) -> None:
        """Let time go by."""
        with self.lock:
            self.line.advance(ns)
            late = self.line.send()
        self._give(late)

    def close(self) -> None:
        """End the thread and the device."""
        if self._thread.is_alive():
            os.write(self._wake_out, b"x")
            self._thread.join()
            for fd in (self._host, self._far, self._wake_in, self._wake_out):
                os.close(fd)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._host, self._wake_in], [], [])
            if self._wake_in in ready:
                return
            data = os.read(self._host, _CHUNK)
            with self.lock:
                self.line.receive(data)
                answer = self.line.send()
            self._give(answer)

    def _give(self, data: bytes) -> None:
        """Send bytes; a serial line loses what nobody takes."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._host, data)
