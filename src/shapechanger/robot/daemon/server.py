"""The one port of the robot: the link for programs and people, and the console for browsers."""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
import ssl
from collections.abc import Awaitable, Callable
from typing import Final

from aiohttp import web

from shapechanger.errors import LinkError, RobotError, ShapechangerError
from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.daemon.connection import Connection, new_socket
from shapechanger.robot.daemon.doorstep import Doorstep
from shapechanger.robot.daemon.listener import Listener
from shapechanger.robot.daemon.origin import origin_refusal
from shapechanger.robot.daemon.pace import Pacer
from shapechanger.robot.daemon.page import SECURITY_POLICY, add_console
from shapechanger.robot.daemon.session import Door, Session, WrongKey
from shapechanger.robot.daemon.timekeeper import Timekeeper

__all__ = ["Server"]

_log = logging.getLogger(__name__)

# Nobody guesses a key of 128 bits. This keeps a try from costing us more than whoever tries it, and
# shuts out nobody who has the right one and the same address.
_WRONG_KEY_S: Final = 0.5
_GOODBYE_S: Final = 0.2  # A daemon that ends has nothing left to say.
_UNANSWERED_MS: Final = 4_000  # After which what was sent counts as lost.
_ALIVE_NS: Final = 1_000_000_000

_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": SECURITY_POLICY,
    "Referrer-Policy": "no-referrer",
    "Server": "shapechanger",  # And not which versions of what.
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves a robot.

    Args:
        cockpit: What all connections share.
        time: Lets time go by.
        door: What a client must show.
        tls: What to speak TLS with; None for no TLS.
    """

    def __init__(
        self, cockpit: Cockpit, time: Timekeeper, door: Door, tls: ssl.SSLContext | None
    ) -> None:
        self._cockpit = cockpit
        self._time = time
        self._door = door
        self._numbers = itertools.count(1)
        self._doorstep = Doorstep()
        self._runner = web.AppRunner(
            self._app(), access_log=None, handle_signals=False, shutdown_timeout=_GOODBYE_S
        )
        self._listener = Listener(self._doorstep, self._protocol, tls)

    async def start(self) -> int:
        """Begin to listen.

        Returns:
            The port.

        Raises:
            RobotError: If the address cannot be listened at.
        """
        plan = self._cockpit.plan
        await self._runner.setup()
        return await self._listener.start(plan.host, plan.port)

    async def close(self) -> None:
        """Close all connections."""
        await self._listener.close()
        await self._runner.cleanup()

    def _app(self) -> web.Application:
        app = web.Application(
            middlewares=[_add_headers, self._renew_patience], client_max_size=1024
        )
        add_console(app, self._cockpit, self._door)
        app.router.add_get("/healthz", self._health)
        app.router.add_get("/link", self._link)
        return app

    def _protocol(self) -> asyncio.Protocol:
        server = self._runner.server
        if server is None:
            raise RobotError("The server has not begun.")
        return server()

    @web.middleware
    async def _renew_patience(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        response = await handler(request)
        # A slow radio brings the files of the console one by one.
        self._doorstep.renew(request.protocol)
        return response

    async def _health(self, request: web.Request) -> web.Response:
        state = self._cockpit.state
        late = state is None or self._cockpit.now_ns() - state.at_ns > _ALIVE_NS
        # A twin's time stands still while nobody drives, and its guard is silent then.
        well = not late or self._time.in_steps
        return web.json_response(
            {"guard": "well" if well else "silent"}, status=200 if well else 503
        )

    async def _link(self, request: web.Request) -> web.StreamResponse:
        refusal = origin_refusal(
            request.headers.get("Origin"), request.host, is_open=self._door.is_open
        )
        if refusal:
            raise web.HTTPForbidden(text=refusal)
        self._doorstep.keep(request.protocol)
        websocket = new_socket()
        await websocket.prepare(request)
        session = Session(next(self._numbers), self._cockpit, self._door)
        pacer = Pacer(session, self._cockpit, self._time)
        connection = Connection(websocket, session, pacer, self._time, _log)
        reason: ShapechangerError | None = None
        try:
            _tune(request.transport)
            await self._talk(connection, session, request)
        except ShapechangerError as error:
            reason = error
        finally:
            # First of all the robot stops, if this client drove it; then there is time for manners.
            session.close()
        if reason is not None:
            _log.info("%s: %s", session.who.name or request.remote, reason)
            await connection.dismiss(reason)
        await self._time.settle()
        await connection.close()
        self._doorstep.leave(request.protocol)
        return websocket

    async def _talk(self, connection: Connection, session: Session, request: web.Request) -> None:
        try:
            await connection.greet()
        except WrongKey:
            await asyncio.sleep(_WRONG_KEY_S)
            raise
        self._doorstep.leave(request.protocol)
        who = session.who
        _log.info("%s, a %s, is here from %s.", who.name, who.role, request.remote)
        await connection.serve()
        _log.info("%s has left.", session.who.name)


@web.middleware
async def _add_headers(request: web.Request, handler: _Handler) -> web.StreamResponse:
    try:
        response = await handler(request)
    except web.HTTPException as error:
        error.headers.update(_HEADERS)
        raise
    if not response.prepared:
        response.headers.update(_HEADERS)
    return response


def _tune(transport: asyncio.Transport | None) -> None:
    """Send at once, hold little back, and notice when the other side is gone."""
    if transport is None:
        raise LinkError("The connection has ended.")
    # Not 0: asyncio's TLS would then call an empty buffer full at every second look, and a message
    # that has left would wait for the next one before it counts as sent.
    transport.set_write_buffer_limits(high=1, low=0)
    accepted = transport.get_extra_info("socket")
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
