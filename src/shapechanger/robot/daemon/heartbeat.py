"""Shows the supervisor that the event loop turns, and notices when there is no supervisor."""

from __future__ import annotations

import asyncio
import contextlib
import socket

__all__ = ["beat"]


async def beat(fd: int, period_s: float) -> None:
    """Send a byte each period until the supervisor is gone.

    Args:
        fd: Socket to the supervisor; this function owns it.
        period_s: Real seconds between two bytes.
    """
    with socket.socket(fileno=fd) as heart:
        heart.setblocking(False)
        while True:
            try:
                # A supervisor that does not read has a full socket; that is no reason to end.
                with contextlib.suppress(BlockingIOError):
                    heart.send(b".")
                with contextlib.suppress(BlockingIOError):
                    if not heart.recv(1):
                        return
            except (BrokenPipeError, ConnectionResetError):
                return
            await asyncio.sleep(period_s)
