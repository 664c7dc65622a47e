"""One connection with its WebSocket: reads, answers and observes until one of them ends."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from typing import Final

import aiohttp
from aiohttp import WSMsgType, web

from shapechanger.errors import LinkError, ShapechangerError
from shapechanger.link.messages import MAX_CLIENT_MESSAGE, Refused, RobotMessage, encode
from shapechanger.robot.daemon.pace import Pacer
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.daemon.timekeeper import Timekeeper

__all__ = ["HELLO_S", "Connection", "new_socket"]

HELLO_S: Final = 3.0
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


class Connection:
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
        pacer: Pacer,
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
            async with asyncio.timeout(HELLO_S):
                data = await self._read()
        except TimeoutError:
            raise LinkError(f"You did not say hello within {HELLO_S:.0f} s.") from None
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
