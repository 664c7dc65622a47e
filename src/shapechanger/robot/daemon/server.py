"""The one port of the robot: the link for programs and people, and a page for browsers."""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
import ssl
from collections.abc import Awaitable, Callable
from typing import Final, cast

from aiohttp import web

from shapechanger.errors import LinkError, RobotError, RobotRefused, ShapechangerError
from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.daemon.connection import Connection, new_socket
from shapechanger.robot.daemon.limits import WrongKeys
from shapechanger.robot.daemon.origin import origin_refusal
from shapechanger.robot.daemon.pace import Pacer
from shapechanger.robot.daemon.page import status_page
from shapechanger.robot.daemon.session import Door, Session, WrongKey
from shapechanger.robot.daemon.timekeeper import Timekeeper

__all__ = ["Server"]

_log = logging.getLogger(__name__)

_MAX_STRANGERS: Final = 8  # Connections that have not said hello yet.
_MAX_SOCKETS: Final = 64  # Connections of any kind, pages too.
_WRONG_KEY_S: Final = 0.5
_HANDSHAKE_S: Final = 5.0
_GOODBYE_S: Final = 0.2  # A daemon that ends has nothing left to say.
_SEND_BUFFER: Final = 32 * 1024  # Bytes that the kernel holds for one client: a few pictures.
_UNANSWERED_MS: Final = 4_000  # After which what was sent counts as lost.
_ALIVE_NS: Final = 1_000_000_000

_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'; form-action 'none'",
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
        self._tls = tls
        self._numbers = itertools.count(1)
        self._strangers = 0
        self._wrong_keys = WrongKeys()
        self._runner = web.AppRunner(
            self._app(), access_log=None, handle_signals=False, shutdown_timeout=_GOODBYE_S
        )
        self._listener: asyncio.Server | None = None

    async def start(self) -> int:
        """Begin to listen.

        Returns:
            The port.

        Raises:
            RobotError: If the address cannot be listened at.
        """
        plan = self._cockpit.plan
        await self._runner.setup()
        handshake_s = None if self._tls is None else _HANDSHAKE_S
        try:
            self._listener = await asyncio.get_running_loop().create_server(
                self._protocol,
                plan.host,
                plan.port,
                ssl=self._tls,
                ssl_handshake_timeout=handshake_s,
                backlog=32,
            )
        except OSError as error:
            raise RobotError(
                f"{plan.host} port {plan.port} cannot be listened at: {error.strerror or error}. "
                "Does the robot run already?"
            ) from error
        for listening in self._listener.sockets:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        return self._listener.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Close all connections."""
        if self._listener is not None:
            self._listener.close()
        await self._runner.cleanup()

    def _app(self) -> web.Application:
        app = web.Application(middlewares=[_add_headers], client_max_size=1024)
        app.router.add_get("/", self._page)
        app.router.add_get("/healthz", self._health)
        app.router.add_get("/link", self._link)
        return app

    def _protocol(self) -> asyncio.BaseProtocol:
        server = self._runner.server
        if server is None or len(server.connections) >= _MAX_SOCKETS:
            return _TurnedAway()
        return cast("asyncio.BaseProtocol", server())

    async def _page(self, request: web.Request) -> web.Response:
        return web.Response(text=status_page(self._cockpit, request.host), content_type="text/html")

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
        websocket = new_socket()
        await websocket.prepare(request)
        _tune(request.transport)
        session = Session(next(self._numbers), self._cockpit, self._door)
        pacer = Pacer(session, self._cockpit, self._time)
        connection = Connection(websocket, session, pacer, self._time, _log)
        reason: ShapechangerError | None = None
        try:
            await self._talk(connection, session, request.remote or "")
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
        return websocket

    async def _talk(self, connection: Connection, session: Session, address: str) -> None:
        wait_s = self._wrong_keys.wait_s(address)
        if wait_s > 0.0:
            raise RobotRefused(f"Too many wrong keys from {address}; wait {wait_s:.0f} s.")
        if self._strangers >= _MAX_STRANGERS:
            raise RobotRefused("Too many are at the door; try again in a few seconds.")
        self._strangers += 1
        try:
            await connection.greet()
        except WrongKey:
            self._wrong_keys.add(address)
            await asyncio.sleep(_WRONG_KEY_S)
            raise
        finally:
            self._strangers -= 1
        _log.info("%s, a %s, is here from %s.", session.who.name, session.who.role, address)
        await connection.serve()
        _log.info("%s has left.", session.who.name)


class _TurnedAway(asyncio.Protocol):
    """For a connection too many."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        cast("asyncio.Transport", transport).abort()


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
    transport.set_write_buffer_limits(high=0)
    accepted = transport.get_extra_info("socket")
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
