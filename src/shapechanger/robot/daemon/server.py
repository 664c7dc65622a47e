"""The one port of the robot: the link for programs and people, and the console for browsers."""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
import ssl
from collections.abc import Awaitable, Callable
from typing import Final
from urllib.parse import urlsplit

from aiohttp import web

from shapechanger.errors import LinkError, RobotError, ShapechangerError
from shapechanger.link.address import is_loopback, parse_address
from shapechanger.link.authentication import fingerprint_hex
from shapechanger.link.messages import VERSION
from shapechanger.robot.console.files import ENTRY, ConsoleFile, console_files
from shapechanger.robot.daemon.connection import (
    ClientConnection,
    ObservationPacer,
    Timekeeper,
    new_socket,
)
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.pre_auth import Listener, PreAuthConnections
from shapechanger.robot.daemon.session import Authenticator, Session, WrongKey

__all__ = ["SECURITY_POLICY", "Server", "add_console", "origin_refusal"]


def origin_refusal(origin: str | None, host: str, *, is_open: bool) -> str:
    """Why a connection must not be opened, in words; empty if it may.

    Args:
        origin: The header `Origin`; None from a program that is no browser.
        host: The header `Host`.
        is_open: Whether the robot asks for no key. Then the name must be one that no stranger's
            name server can point at the robot (DNS rebinding).
    """
    if origin is None:
        return ""
    if urlsplit(origin).netloc.lower() != host.lower():
        return "A page of another server must not drive this robot."
    try:
        name = parse_address(host).host
    except LinkError as error:
        return str(error)
    if is_open and not (is_loopback(name) or name.endswith(".local") or _is_ip(name)):
        return "Without a key, open the page of this robot by its IP address."
    return ""


def _is_ip(name: str) -> bool:
    return ":" in name or name.replace(".", "").isdecimal()


SECURITY_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'none'"
)
"""What a browser may do with a page of the robot: nothing inline, nothing from elsewhere."""

_FOLDER: Final = "/console/"

_Handler = Callable[[web.Request], Awaitable[web.Response]]


def add_console(app: web.Application, cockpit: SessionHub, door: Authenticator) -> None:
    """Serve the console.

    Args:
        app: What serves.
        cockpit: The robot.
        door: What a client must show.

    Raises:
        RobotError: If the files of the console cannot be read.
    """
    files = console_files()
    app.router.add_get("/", _giving(files[ENTRY]))
    for name, file in files.items():
        app.router.add_get(f"{_FOLDER}{name}", _giving(file))

    async def introduce(request: web.Request) -> web.Response:
        # Only what somebody without the key may know. A page cannot see the certificate of its own
        # connection, so the fingerprint that enters the proof is told; it is no secret.
        return web.json_response(
            {
                "robot": cockpit.plan.robot,
                "version": VERSION,
                "certificate": fingerprint_hex(door.certificate),
                "open": door.is_open,
            }
        )

    app.router.add_get(f"{_FOLDER}robot.json", introduce)


def _giving(file: ConsoleFile) -> _Handler:
    async def give(request: web.Request) -> web.Response:
        return web.Response(body=file.body, content_type=file.content_type, charset="utf-8")

    return give


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

_ServerHandler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves a robot.

    Args:
        cockpit: What all connections share.
        time: Lets time go by.
        door: What a client must show.
        tls: What to speak TLS with; None for no TLS.
    """

    def __init__(
        self, cockpit: SessionHub, time: Timekeeper, door: Authenticator, tls: ssl.SSLContext | None
    ) -> None:
        self._cockpit = cockpit
        self._time = time
        self._door = door
        self._numbers = itertools.count(1)
        self._doorstep = PreAuthConnections()
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
    async def _renew_patience(
        self, request: web.Request, handler: _ServerHandler
    ) -> web.StreamResponse:
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
        pacer = ObservationPacer(session, self._cockpit, self._time)
        connection = ClientConnection(websocket, session, pacer, self._time, _log)
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

    async def _talk(
        self, connection: ClientConnection, session: Session, request: web.Request
    ) -> None:
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
async def _add_headers(request: web.Request, handler: _ServerHandler) -> web.StreamResponse:
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
