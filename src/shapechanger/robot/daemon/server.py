"""HTTP server of the robot: the link at `/link`, and the console for browsers."""

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
from shapechanger.robot.console import ENTRY, console_files
from shapechanger.robot.daemon.connection import (
    ClientConnection,
    ObservationPacer,
    Timekeeper,
    new_socket,
)
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.pre_auth import Listener, PreAuthConnections
from shapechanger.robot.daemon.session import Authenticator, Session, WrongKey
from shapechanger.robot.link.address import is_loopback, parse_address
from shapechanger.robot.link.authentication import fingerprint_hex
from shapechanger.robot.link.messages import VERSION

_log = logging.getLogger(__name__)

# A key of 128 bits cannot be guessed. The pause keeps an attempt from costing the robot more than
# its sender, and does not delay a client with the right key at the same address.
_WRONG_KEY_S: Final = 0.5
_SHUTDOWN_S: Final = 0.2  # A daemon that ends has nothing left to send.
_UNANSWERED_MS: Final = 4_000  # Unacknowledged data then ends the connection.
_GUARD_SILENT_NS: Final = 1_000_000_000
_CONSOLE: Final = "/console/"

_HEADERS: Final = {
    "Cache-Control": "no-store",
    # Nothing inline, and nothing from another server.
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "Server": "shapechanger",  # Without the versions of the libraries.
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def origin_refusal(origin: str | None, host: str, *, is_open: bool) -> str:
    """Return the reason why a web page must not open a connection, or "" if it may.

    A robot that accepts every client (`is_open`) must be opened under a name that a foreign name
    server cannot point at it (DNS rebinding).
    """
    if origin is None:
        return ""
    if urlsplit(origin).netloc.lower() != host.lower():
        return "A page of another server must not drive this robot."
    try:
        name = parse_address(host).host
    except LinkError as error:
        return str(error)
    is_ip = ":" in name or name.replace(".", "").isdecimal()
    if is_open and not (is_loopback(name) or name.endswith(".local") or is_ip):
        return "Without a key, open the page of this robot by its IP address."
    return ""


class Server:
    """Serves the robot on one port."""

    def __init__(
        self,
        hub: SessionHub,
        time: Timekeeper,
        authenticator: Authenticator,
        tls: ssl.SSLContext | None,
    ) -> None:
        self._hub = hub
        self._time = time
        self._authenticator = authenticator
        self._numbers = itertools.count(1)
        self._pre_auth = PreAuthConnections()
        self._runner = web.AppRunner(
            self._app(), access_log=None, handle_signals=False, shutdown_timeout=_SHUTDOWN_S
        )
        self._listener = Listener(self._pre_auth, self._protocol, tls)

    async def start(self) -> int:
        """Start listening, and return the port."""
        plan = self._hub.plan
        await self._runner.setup()
        return await self._listener.start(plan.host, plan.port)

    async def close(self) -> None:
        """Close all connections."""
        await self._listener.close()
        await self._runner.cleanup()

    def _app(self) -> web.Application:
        app = web.Application(middlewares=[_add_headers, self._renew_timeout], client_max_size=1024)
        files = console_files()
        app.router.add_get("/", _serve_file(*files[ENTRY]))
        for name, file in files.items():
            app.router.add_get(f"{_CONSOLE}{name}", _serve_file(*file))
        app.router.add_get(f"{_CONSOLE}robot.json", self._robot)
        app.router.add_get("/healthz", self._health)
        app.router.add_get("/link", self._link)
        return app

    def _protocol(self) -> asyncio.Protocol:
        server = self._runner.server
        if server is None:
            raise RobotError("The server has not started.")
        return server()

    @web.middleware
    async def _renew_timeout(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        response = await handler(request)
        # A slow radio loads the files of the console one by one.
        self._pre_auth.renew(request.protocol)
        return response

    async def _robot(self, _: web.Request) -> web.Response:
        """Describe the robot to a page before authentication."""
        # A page cannot see the certificate of its own connection, and the proof needs its
        # fingerprint, which is not secret.
        return web.json_response(
            {
                "robot": self._hub.plan.card.robot,
                "version": VERSION,
                "certificate": fingerprint_hex(self._authenticator.certificate),
                "open": self._authenticator.is_open,
            }
        )

    async def _health(self, _: web.Request) -> web.Response:
        state = self._hub.state
        silent = state is None or self._hub.now_ns() - state.at_ns > _GUARD_SILENT_NS
        # A twin's time stands still while no client drives, and its guard is silent then.
        well = not silent or self._time.in_steps
        return web.json_response(
            {"guard": "well" if well else "silent"}, status=200 if well else 503
        )

    async def _link(self, request: web.Request) -> web.StreamResponse:
        refusal = origin_refusal(
            request.headers.get("Origin"), request.host, is_open=self._authenticator.is_open
        )
        if refusal:
            raise web.HTTPForbidden(text=refusal)
        self._pre_auth.stop_timer(request.protocol)
        websocket = new_socket()
        await websocket.prepare(request)
        session = Session(next(self._numbers), self._hub, self._authenticator)
        pacer = ObservationPacer(session, self._hub, self._time)
        connection = ClientConnection(websocket, session, pacer, self._time)
        reason: ShapechangerError | None = None
        try:
            _tune(request.transport)
            await self._serve(connection, session, request)
        except ShapechangerError as error:
            reason = error
        finally:
            # If this client was in control, the robot stops before anything else happens.
            session.close()
        if reason is not None:
            _log.info("%s: %s", session.client.name or request.remote, reason)
            await connection.dismiss(reason)
        await self._time.settle()
        await connection.close()
        self._pre_auth.remove(request.protocol)
        return websocket

    async def _serve(
        self, connection: ClientConnection, session: Session, request: web.Request
    ) -> None:
        try:
            await connection.greet()
        except WrongKey:
            await asyncio.sleep(_WRONG_KEY_S)
            raise
        self._pre_auth.remove(request.protocol)
        client = session.client
        _log.info("%s, a %s, connected from %s.", client.name, client.role, request.remote)
        await connection.serve()
        _log.info("%s disconnected.", client.name)


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


def _serve_file(content_type: str, body: bytes) -> _Handler:
    async def serve(_: web.Request) -> web.Response:
        return web.Response(body=body, content_type=content_type, charset="utf-8")

    return serve


def _tune(transport: asyncio.Transport | None) -> None:
    """Send at once, buffer little, and notice when the other end is gone."""
    if transport is None:
        raise LinkError("The connection ended.")
    # Not 0: asyncio's TLS would then call an empty buffer full every second time, and a message
    # that was sent would wait for the next one before it counts as sent.
    transport.set_write_buffer_limits(high=1, low=0)
    accepted = transport.get_extra_info("socket")
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
