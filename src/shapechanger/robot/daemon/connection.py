"""One connection with its WebSocket: reads, answers and observes until one of them ends."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Final

import aiohttp
from aiohttp import WSMsgType, web

from shapechanger.errors import LinkError, ShapechangerError
from shapechanger.link.messages import (
    MAX_CLIENT_MESSAGE,
    Observation,
    Refused,
    RobotMessage,
    encode,
)
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.hardware import Clock

__all__ = ["HELLO_TIMEOUT_S", "ClientConnection", "ObservationPacer", "Timekeeper", "new_socket"]

_log = logging.getLogger(__name__)

_FRAME_WAIT_S: Final = 2.0  # Real seconds that a picture on its way may take.


class Timekeeper:
    """Lets time go by, and makes sure that afterwards everything of that time is known.

    Args:
        clock: Where time comes from.
        cockpit: What all connections share.
        drain: Reads what the guard has said by now.
    """

    def __init__(self, clock: Clock, cockpit: SessionHub, drain: Callable[[], None]) -> None:
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


# A camera that is about as fast as commands sets the pace: each observation then has a new picture.
# One that is a little late is worth waiting for, since an observation without it would use up the
# client's credit.
_ABOUT: Final = 1.25


class ObservationPacer:
    """Waits until an observation is due for one client.

    Args:
        session: The client's connection.
        cockpit: What all connections share.
        time: Lets time go by.
    """

    def __init__(self, session: Session, cockpit: SessionHub, time: Timekeeper) -> None:
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


HELLO_TIMEOUT_S: Final = 3.0
"""Seconds in which a client must say who it is."""

_SEND_S: Final = 2.0  # Who has not read for so long is not there, or does not want to.
_CLOSE_S: Final = 1.0
_HEARTBEAT_S: Final = 4.0  # A dead radio says nothing: after 6 s without a sign it is gone.


def new_socket() -> web.WebSocketResponse:
    """A WebSocket as the link wants it: no compression, and every message sent before the next."""
    return web.WebSocketResponse(
        timeout=_CLOSE_S,
        autoping=False,  # Pings count as messages here, so that they cannot flood the robot.
        heartbeat=_HEARTBEAT_S,
        compress=False,
        # Larger than allowed, so that what is too large can be refused in words, and still bounded.
        max_msg_size=4 * MAX_CLIENT_MESSAGE,
        writer_limit=0,
    )


class ClientConnection:
    """Moves messages between a WebSocket and a session.

    Args:
        socket: The WebSocket, prepared.
        session: The session.
        pacer: Says when an observation is due.
        time: Lets orders take effect.
        log: Takes facts for the log.
    """

    def __init__(
        self,
        socket: web.WebSocketResponse,
        session: Session,
        pacer: ObservationPacer,
        time: Timekeeper,
        log: logging.Logger,
    ) -> None:
        self._socket = socket
        self._session = session
        self._pacer = pacer
        self._time = time
        self._log = log

    async def greet(self) -> None:
        """Challenge the client, and let it in.

        Raises:
            LinkError: If it is not let in, and why.
        """
        await self.send(self._session.challenge())
        try:
            async with asyncio.timeout(HELLO_TIMEOUT_S):
                data = await self._read()
        except TimeoutError:
            raise LinkError(f"You did not say hello within {HELLO_TIMEOUT_S:.0f} s.") from None
        if data is None:
            raise LinkError("You left without a hello.")
        await self.send(self._session.introduce(data))

    async def serve(self) -> None:
        """Talk until the client leaves.

        Raises:
            LinkError: If it must leave, and why.
        """
        tasks = [
            asyncio.create_task(work) for work in (self._listen(), self._answer(), self._observe())
        ]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            ended = await asyncio.gather(*tasks, return_exceptions=True)
        for error in ended:
            if isinstance(error, BaseException) and not isinstance(error, asyncio.CancelledError):
                raise error
        for task in done:
            task.result()

    async def dismiss(self, error: ShapechangerError) -> None:
        """Tell the client why the connection ends, if it still listens."""
        with contextlib.suppress(LinkError):
            await self.send(Refused(reason=str(error), fatal=True))

    async def close(self) -> None:
        """Close the WebSocket."""
        try:
            async with asyncio.timeout(2 * _CLOSE_S):
                await self._socket.close(code=aiohttp.WSCloseCode.OK, drain=False)
        except (TimeoutError, ConnectionError, RuntimeError):
            self._log.info("The connection of %s was cut.", self._session.who.name or "a client")

    async def send(self, message: RobotMessage) -> None:
        """Send a message.

        Raises:
            LinkError: If the client does not take it in time.
        """
        try:
            async with asyncio.timeout(_SEND_S):
                await self._socket.send_bytes(encode(message))
        except TimeoutError:
            raise LinkError("You do not read what you are told.") from None
        except (ConnectionError, RuntimeError) as error:
            raise LinkError(f"The connection has ended: {error}") from error

    async def _listen(self) -> None:
        while (data := await self._read()) is not None:
            self._session.receive(data)
            await self._time.settle()
            if self._session.outbox:
                await asyncio.sleep(0)  # Whoever asks faster than it is answered waits.

    async def _answer(self) -> None:
        session = self._session
        while True:
            await session.told.wait()
            session.told.clear()
            while (message := session.outbox.take()) is not None:
                await self.send(message)
            if session.overflow:
                raise LinkError(session.overflow)

    async def _observe(self) -> None:
        while True:
            await self.send(await self._pacer.next())

    async def _read(self) -> bytes | None:
        """The next message; None when the client has left.

        Raises:
            LinkError: If it is no binary message, or too large.
        """
        while True:
            message = await self._socket.receive()
            if message.type is WSMsgType.BINARY:
                return message.data
            if message.type is WSMsgType.PING:
                await self._pong(message.data)
            elif message.type is WSMsgType.PONG:
                self._session.count()
            elif message.type is WSMsgType.TEXT:
                raise LinkError("You sent text; the link is made of binary messages.")
            elif message.type is WSMsgType.ERROR:
                raise LinkError(f"You sent something that is no message: {message.data}.")
            else:
                return None

    async def _pong(self, data: bytes) -> None:
        self._session.count()
        try:
            async with asyncio.timeout(_SEND_S):
                await self._socket.pong(data)
        except (TimeoutError, ConnectionError, RuntimeError) as error:
            raise LinkError("You do not read what you are told.") from error
