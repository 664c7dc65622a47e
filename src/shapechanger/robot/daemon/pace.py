"""When a client gets its next observation."""

from __future__ import annotations

import asyncio
from typing import Final

from shapechanger.link.messages import Observation
from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.daemon.timekeeper import Timekeeper

__all__ = ["Pacer"]

# A camera that is about as fast as commands sets the pace: each observation then has a new picture.
# One that is a little late is worth waiting for, since an observation without it would use up the
# client's credit.
_ABOUT: Final = 1.25


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
        camera = cockpit.plan.camera
        ratio = 0.0 if camera is None else camera.fps / cockpit.plan.control_hz
        self._by_pictures = 1.0 / _ABOUT <= ratio <= _ABOUT
        self._due_s = 0.0

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
        return session.observe()

    def _moves_time(self) -> bool:
        """Whether this client lets time go by: who commands does, and anybody if nobody does."""
        lease = self._cockpit.lease
        return lease.holder is None or lease.holds(self._session.who.session)

    async def _wait_until_due(self) -> None:
        """Wait until one period after the last observation was due, or for the picture in it."""
        loop = asyncio.get_running_loop()
        while (not self._comes_with_picture()) and loop.time() < self._due_s:
            self._session.news.clear()
            try:
                async with asyncio.timeout_at(self._due_s):
                    await self._session.news.wait()
            except TimeoutError:
                break
        now_s = loop.time()
        if self._by_pictures and self._cockpit.newest is not None:
            self._due_s = now_s + _ABOUT * self._period_s
        else:
            # From when it was due and not from now, so that being late does not add up; but a
            # client that was away gets no burst.
            was_s = self._due_s if now_s - self._due_s < self._period_s else now_s
            self._due_s = was_s + self._period_s

    def _comes_with_picture(self) -> bool:
        return self._by_pictures and self._session.has_new_frame
