"""How time goes by for the connections: by itself, or in steps that the daemon asks for."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Final

from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.hardware import Clock

__all__ = ["Timekeeper"]

_log = logging.getLogger(__name__)

_FRAME_WAIT_S: Final = 2.0  # Real seconds that a picture on its way may take.


class Timekeeper:
    """Lets time go by, and makes sure that afterwards everything of that time is known.

    Args:
        clock: Where time comes from.
        cockpit: What all connections share.
        drain: Reads what the guard has said by now.
    """

    def __init__(self, clock: Clock, cockpit: Cockpit, drain: Callable[[], None]) -> None:
        self._clock = clock
        self._cockpit = cockpit
        self._drain = drain
        self._in_steps = cockpit.plan.clock == "twin"
        self._one_at_a_time = asyncio.Lock()

    @property
    def in_steps(self) -> bool:
        """Whether time stands still until somebody lets it go by."""
        return self._in_steps

    async def step(self, seconds: float) -> None:
        """Let so much time go by."""
        if not self._in_steps:
            await self._clock.sleep(seconds)
            self._drain()
            return
        # A step that has begun goes on when its client leaves: the clock would lose count else.
        await asyncio.shield(asyncio.ensure_future(self._one_step(seconds)))

    async def settle(self) -> None:
        """Let the guard look at an order that was just given; on a real clock it does so anyhow."""
        if self._in_steps and self._cockpit.unsettled:
            self._cockpit.unsettled = False
            await self.step(1.0 / self._cockpit.plan.tick_hz)

    async def _one_step(self, seconds: float) -> None:
        async with self._one_at_a_time:
            captured_ns = await self._clock.sleep(seconds)
            self._drain()
            if captured_ns is not None:
                await self._wait_for_frame(captured_ns)

    async def _wait_for_frame(self, captured_ns: int) -> None:
        """Wait for a picture that was sent, and is still on its way through the camera's driver."""
        cockpit = self._cockpit
        try:
            async with asyncio.timeout(_FRAME_WAIT_S):
                while cockpit.newest is None or cockpit.newest.frame.captured_ns < captured_ns:
                    cockpit.pictured.clear()
                    await cockpit.pictured.wait()
        except TimeoutError:
            _log.warning("The picture of %d ns did not come.", captured_ns)
