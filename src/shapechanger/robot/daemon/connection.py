"""WebSocket of one client: receives, answers, and sends observations when they are due."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from typing import Final

import aiohttp
from aiohttp import WSMsgType, web

from shapechanger.errors import LinkError, ShapechangerError
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import NOT_READING, Session
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link.messages import (
    MAX_CLIENT_MESSAGE,
    Observation,
    Refused,
    RobotMessage,
    encode,
)

HELLO_TIMEOUT_S: Final = 3.0
"""Time that a client has for its hello, s."""

_log = logging.getLogger(__name__)

_SEND_S: Final = 2.0  # A client that does not read for so long is disconnected.
_CLOSE_S: Final = 1.0
# A dead radio sends nothing: the connection ends 6 s after it fell silent.
_HEARTBEAT_S: Final = 4.0
_FRAME_WAIT_S: Final = 2.0  # Real time that a frame may spend in the camera's driver.

# A camera that is about as fast as the commands sets the pace, so that each observation has a new
# frame. It is worth waiting for a frame that is a little late: an observation without it would use
# up the client's credit.
_FRAME_PACE: Final = 1.25


class Timekeeper:
    """Advances the robot's time, and collects all that happened meanwhile.

    Attributes:
        in_steps: True if time stands still between calls of `step`.
    """

    def __init__(self, clock: Clock, hub: SessionHub, drain: Callable[[], None]) -> None:
        self._clock = clock
        self._hub = hub
        self._drain = drain
        self.in_steps = hub.plan.card.clock == "twin"
        self._one_at_a_time = asyncio.Lock()

    async def step(self, seconds: float) -> None:
        """Let `seconds` pass."""
        if not self.in_steps:
            await self._clock.sleep(seconds)
            self._drain()
            return
        # Finish a step whose client disconnects: the clock would lose count otherwise.
        await asyncio.shield(asyncio.ensure_future(self._one_step(seconds)))

    async def settle(self) -> None:
        """Let the guard handle an order that was just given; a real clock needs no help."""
        if self.in_steps and self._hub.unsettled:
            self._hub.unsettled = False
            await self.step(1.0 / self._hub.plan.card.tick_hz)

    async def _one_step(self, seconds: float) -> None:
        async with self._one_at_a_time:
            captured_ns = await self._clock.sleep(seconds)
            self._drain()
            if captured_ns is not None:
                await self._wait_for_frame(captured_ns)

    async def _wait_for_frame(self, captured_ns: int) -> None:
        """Wait for a frame that is still in the camera's driver."""
        hub = self._hub
        try:
            async with asyncio.timeout(_FRAME_WAIT_S):
                while hub.newest is None or hub.newest.frame.captured_ns < captured_ns:
                    hub.frame_arrived.clear()
                    await hub.frame_arrived.wait()
        except TimeoutError:
            _log.warning("The frame of %d ns did not arrive.", captured_ns)


class ObservationPacer:
    """Waits until an observation is due for one client."""

    def __init__(self, session: Session, hub: SessionHub, time: Timekeeper) -> None:
        self._session = session
        self._hub = hub
        self._time = time
        self._period_s = 1.0 / hub.plan.card.control_hz
        camera = hub.plan.camera
        ratio = 0.0 if camera is None else camera.fps / hub.plan.card.control_hz
        self._by_frames = 1.0 / _FRAME_PACE <= ratio <= _FRAME_PACE
        self._due_s = 0.0

    async def next(self) -> Observation:
        """Return the next observation, once it is due and the client has credit for it."""
        session, lease = self._session, self._hub.lease
        while not session.credit:
            session.updated.clear()
            await session.updated.wait()
        if session.pace == "lockstep" and not self._time.in_steps:
            await self._time.step(self._period_s)
        # The lease holder advances time, or any client without a holder.
        elif self._time.in_steps and (lease.holder is None or lease.holds(session.client.session)):
            await self._time.step(self._period_s)
            if session.pace == "realtime":
                await self._wait_until_due()
        else:
            await self._wait_until_due()
        return session.observe()

    async def _wait_until_due(self) -> None:
        """Wait until one period after the last observation was due, or for its frame."""
        loop = asyncio.get_running_loop()
        while not (self._by_frames and self._session.has_new_frame) and loop.time() < self._due_s:
            self._session.updated.clear()
            try:
                async with asyncio.timeout_at(self._due_s):
                    await self._session.updated.wait()
            except TimeoutError:
                break
        now_s = loop.time()
        if self._by_frames and self._hub.newest is not None:
            self._due_s = now_s + _FRAME_PACE * self._period_s
        else:
            # Counted from the time it was due, so that delays do not add up; but a client that
            # was away gets no burst.
            was_s = self._due_s if now_s - self._due_s < self._period_s else now_s
            self._due_s = was_s + self._period_s


def new_socket() -> web.WebSocketResponse:
    """Make a WebSocket for the link: uncompressed, and without a send queue."""
    return web.WebSocketResponse(
        timeout=_CLOSE_S,
        autoping=False,  # Pings count as messages here, so that they cannot flood the robot.
        heartbeat=_HEARTBEAT_S,
        compress=False,
        # Above the limit, so that an oversized message gets an error message, and still bounded.
        max_msg_size=4 * MAX_CLIENT_MESSAGE,
        writer_limit=0,
    )


class ClientConnection:
    """Moves messages between a WebSocket and a session."""

    def __init__(
        self,
        socket: web.WebSocketResponse,
        session: Session,
        pacer: ObservationPacer,
        time: Timekeeper,
    ) -> None:
        self._socket = socket
        self._session = session
        self._pacer = pacer
        self._time = time

    async def greet(self) -> None:
        """Authenticate the client."""
        await self._send(self._session.challenge())
        try:
            async with asyncio.timeout(HELLO_TIMEOUT_S):
                data = await self._read()
        except TimeoutError:
            raise LinkError(f"No hello was received within {HELLO_TIMEOUT_S:.0f} s.") from None
        if data is None:
            raise LinkError("The client left without a hello.")
        await self._send(self._session.introduce(data))

    async def serve(self) -> None:
        """Exchange messages until the client disconnects."""
        tasks = [
            asyncio.create_task(work) for work in (self._listen(), self._answer(), self._observe())
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, BaseException) and not isinstance(result, asyncio.CancelledError):
                raise result

    async def dismiss(self, error: ShapechangerError) -> None:
        """Send the reason why the connection ends, if the client still reads."""
        with contextlib.suppress(LinkError):
            await self._send(Refused(reason=str(error), fatal=True))

    async def close(self) -> None:
        """Close the WebSocket."""
        try:
            async with asyncio.timeout(2 * _CLOSE_S):
                await self._socket.close(code=aiohttp.WSCloseCode.OK, drain=False)
        except (TimeoutError, ConnectionError, RuntimeError):
            _log.info("The connection of %s was cut.", self._session.client.name or "a client")

    async def _send(self, message: RobotMessage) -> None:
        await self._in_time(self._socket.send_bytes(encode(message)))

    async def _in_time(self, sending: Awaitable[None]) -> None:
        """Wait for a message to be sent."""
        try:
            async with asyncio.timeout(_SEND_S):
                await sending
        except TimeoutError:
            raise LinkError(NOT_READING) from None
        except (ConnectionError, RuntimeError) as error:
            raise LinkError(f"The connection ended: {error}") from error

    async def _listen(self) -> None:
        while (data := await self._read()) is not None:
            self._session.receive(data)
            await self._time.settle()
            if self._session.outbox:
                await asyncio.sleep(0)  # A client that asks faster than it is answered waits.

    async def _answer(self) -> None:
        session = self._session
        while True:
            await session.posted.wait()
            session.posted.clear()
            while (message := session.outbox.take()) is not None:
                await self._send(message)
            if session.outbox.is_full:
                raise LinkError(NOT_READING)
            if session.expelled:
                raise LinkError(session.expelled)

    async def _observe(self) -> None:
        while True:
            await self._send(await self._pacer.next())

    async def _read(self) -> bytes | None:
        """Return the next message, or None when the client has disconnected."""
        while True:
            message = await self._socket.receive()
            if message.type is WSMsgType.BINARY:
                return message.data
            if message.type is WSMsgType.PING:
                self._session.count()
                await self._in_time(self._socket.pong(message.data))
            elif message.type is WSMsgType.PONG:
                self._session.count()
            elif message.type is WSMsgType.TEXT:
                raise LinkError("The link takes binary messages, got text.")
            elif message.type is WSMsgType.ERROR:
                raise LinkError(f"The message cannot be read: {message.data}.")
            else:
                return None
