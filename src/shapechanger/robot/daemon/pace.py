"""When a client gets its next observation."""

from __future__ import annotations

import asyncio
from typing import Final

from shapechanger.link.messages import Observation
from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.daemon.timekeeper import Timekeeper

__all__ = ["Pacer"]

# A picture that comes as often as commands do may be a little late; it is worth waiting for, since
# an observation without it would use up the client's credit.
_GRACE: Final = 1.25


class Pacer:
    """Waits until an observation is due for one client.

    Args:
        session: The client's connection.
        cockpit: What all connections share.
        time: Lets time go by.
    """

    def __init__(self, session: Session, cockpit: Cockpit, time: Timekeeper) -> None:
        self._session = session
        self._cockpit = cockpit
        self._time = time
        self._period_s = 1.0 / cockpit.plan.control_hz
        self._sent_s = float("-inf")

    async def next(self) -> Observation:
        """The next observation, once it is due and the client has credit for it."""
        session = self._session
        while not session.credit:
            session.news.clear()
            await session.news.wait()
        if session.pace == "lockstep" and not self._time.in_steps:
            await self._time.step(self._period_s)
        elif self._time.in_steps and self._moves_time():
            await self._time.step(self._period_s)
            if session.pace == "realtime":
                await self._wait_until_due()
        else:
            await self._wait_until_due()
        self._sent_s = asyncio.get_running_loop().time()
        return session.observe()

    def _moves_time(self) -> bool:
        """Whether this client lets time go by: who commands does, and anybody if nobody does."""
        lease = self._cockpit.lease
        return lease.holder is None or lease.holds(self._session.who.session)

    async def _wait_until_due(self) -> None:
        """Wait for a new picture, or until one period has gone by."""
        grace = 1.0 if self._cockpit.newest is None else _GRACE
        due_s = self._sent_s + grace * self._period_s
        loop = asyncio.get_running_loop()
        while not self._session.has_new_frame and loop.time() < due_s:
            self._session.news.clear()
            try:
                async with asyncio.timeout_at(due_s):
                    await self._session.news.wait()
            except TimeoutError:
                return
