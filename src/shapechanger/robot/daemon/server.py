"""HTTP server of the robot: acceptance of connections, the link, and the console."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import socket
import ssl
from collections import Counter
from collections.abc import Awaitable, Callable, Hashable
from functools import partial
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from aiohttp import web

from shapechanger.errors import LinkError, RobotError, translate_errors
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.link.address import cannot_listen, is_loopback, parse_address
from shapechanger.robot.link.messages import VERSION

_log = logging.getLogger(__name__)

_PRE_AUTH_TIMEOUT_S: Final = 3.0  # Time limit for each request before authentication.
_MAX_TOTAL: Final = 48
_MAX_PER_ADDRESS: Final = 16  # A browser opens six connections, and two pages may be open.
_BACKLOG: Final = 32
_SEND_BUFFER: Final = 32 * 1024  # Bytes that the kernel holds for one client: a few frames.
_ACCEPT_PAUSE_S: Final = 0.05  # Pause after a failed accept, usually a lack of descriptors.


class Listener:
    """Accepts connections, and limits the number and time of unauthenticated ones.

    A connection is registered before its TLS handshake. A new connection is never refused, because
    it may come from the person who wants to stop the robot. At the limit per address it replaces
    the oldest one from its address; at the total limit, from the address with the most of them.
    """

    def __init__(
        self,
        protocol: Callable[[], web.RequestHandler],
        tls: ssl.SSLContext | None,
        max_total: int = _MAX_TOTAL,
        max_per_address: int = _MAX_PER_ADDRESS,
        timeout_s: float = _PRE_AUTH_TIMEOUT_S,
    ) -> None:
        self._protocol = protocol
        self._tls = tls
        self._max_total = max_total
        self._max_per_address = max_per_address
        self._timeout_s = timeout_s
        self._sockets = contextlib.ExitStack()
        self._tasks: list[asyncio.Task[None]] = []
        self._waiting: dict[Hashable, AcceptedSocket] = {}  # Oldest first.

    async def start(self, host: str, port: int) -> int:
        """Start listening, and return the port."""
        loop = asyncio.get_running_loop()
        with (
            translate_errors(OSError, to=lambda error: cannot_listen(host, port, error)),
            contextlib.ExitStack() as undo,
        ):
            found = await loop.getaddrinfo(
                host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )
            listening = [
                undo.enter_context(socket.create_server(address, family=family, backlog=_BACKLOG))
                for family, *_, address in dict.fromkeys(found)
            ]
            self._sockets = undo.pop_all()
        self._tasks = [asyncio.create_task(self._accept(each)) for each in listening]
        return listening[0].getsockname()[1]

    async def close(self) -> None:
        """Stop listening, and drop all connections that have not authenticated."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._sockets.close()
        for key in list(self._waiting):
            self._drop(key)

    def add(self, key: Hashable, connection: AcceptedSocket) -> None:
        """Add a connection, and drop another one if there are too many."""
        for other in [k for k, known in self._waiting.items() if known.is_gone]:
            self.remove(other)
        here = [k for k, c in self._waiting.items() if c.address == connection.address]
        if len(here) >= self._max_per_address:
            self._drop(here[0])
        elif len(self._waiting) >= self._max_total:
            self.drop_one()
        loop = asyncio.get_running_loop()
        connection.timer = loop.call_later(self._timeout_s, self._drop, key)
        self._waiting[key] = connection

    def renew(self, key: Hashable) -> None:
        """Restart the timeout after a request was served; the connection becomes the youngest."""
        if connection := self.remove(key):
            self.add(key, connection)

    def stop_timer(self, key: Hashable) -> None:
        """End the timeout of a connection that opened the link: a hello has its own timeout."""
        if connection := self._waiting.get(key):
            connection.timer.cancel()

    def remove(self, key: Hashable) -> AcceptedSocket | None:
        """Remove and return a connection that has authenticated or ended; None if unknown."""
        if connection := self._waiting.pop(key, None):
            connection.timer.cancel()
        return connection

    def drop_one(self) -> None:
        """Drop the oldest connection from the address with the most connections."""
        counts = Counter(connection.address for connection in self._waiting.values())
        if self._waiting:  # If keys have equal counts, the first one is the oldest.
            self._drop(max(self._waiting, key=lambda key: counts[self._waiting[key].address]))

    def _drop(self, key: Hashable) -> None:
        if connection := self.remove(key):
            connection.drop()

    async def _accept(self, listening: socket.socket) -> None:
        listening.setblocking(False)
        loop, fails = asyncio.get_running_loop(), False
        while True:
            try:
                accepted, address = await loop.sock_accept(listening)
                accepted.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            except OSError as error:
                if not fails:
                    _log.warning("Cannot accept connections: %s", error)
                fails = True
                self.drop_one()
                await asyncio.sleep(_ACCEPT_PAUSE_S)
                continue
            fails = False
            protocol = self._protocol()
            self.add(protocol, AcceptedSocket(accepted, address[0], protocol, self._tls))
            await asyncio.sleep(0)  # Let other tasks run, even if connections arrive very fast.


class AcceptedSocket:
    """A connection from its acceptance on, through the TLS handshake."""

    timer: asyncio.TimerHandle  # Drops the connection after the time limit.

    def __init__(
        self,
        accepted: socket.socket,
        address: str,
        protocol: web.RequestHandler,
        tls: ssl.SSLContext | None,
    ) -> None:
        self.address = address
        self._socket, self._protocol = accepted, protocol
        self._task = asyncio.create_task(self._connect(tls))

    @property
    def is_gone(self) -> bool:
        """True once the socket is closed."""
        return self._socket.fileno() < 0

    def drop(self) -> None:
        """Close the connection without a message."""
        if self._protocol.transport is not None:
            self._protocol.transport.abort()
            return
        with contextlib.suppress(OSError):  # The end of the data ends a handshake.
            self._socket.shutdown(socket.SHUT_RDWR)

    async def _connect(self, tls: ssl.SSLContext | None) -> None:
        loop = asyncio.get_running_loop()
        with contextlib.suppress(OSError):  # The other end does not use TLS, or has disconnected.
            await loop.connect_accepted_socket(lambda: self._protocol, self._socket, ssl=tls)


_SHUTDOWN_S: Final = 0.2  # Short, because no messages remain to be sent.
_GUARD_SILENT_NS: Final = 1_000_000_000
_CONSOLE: Final = "/console/"

_HEADERS: Final = {
    "Cache-Control": "no-store",
    # No inline scripts or styles, and no content from other servers.
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "Server": "shapechanger",  # Hides the versions of the libraries.
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

ENTRY: Final = "index.html"
"""Page of the console, on which a person drives and records."""
_FOLDER: Final = Path(__file__).parents[1] / "console"
# Media types to serve; other files in the folder are not served.
_KINDS: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}


def console_files(folder: Path = _FOLDER) -> dict[str, tuple[str, bytes]]:
    """Return the media type and the content (UTF-8) of each file of the console."""
    failed = f"Cannot read the console in {folder}"
    with translate_errors(OSError, to=lambda error: RobotError(f"{failed}: {error}.")):
        files = {
            path.name: (_KINDS[path.suffix], path.read_bytes())
            for path in sorted(folder.iterdir())
            if path.suffix in _KINDS
        }
    if ENTRY not in files:
        raise RobotError(f"{folder} has no {ENTRY}: install shapechanger again.")
    return files


def origin_refusal(origin: str | None, host: str, *, is_open: bool) -> str:
    """Return the reason why a web page must not open a connection, or "" if it may.

    If the robot accepts every client (`is_open`), its console must be opened by an address that no
    foreign name server controls (DNS rebinding).
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
        self, hub: SessionHub, authenticator: Authenticator, tls: ssl.SSLContext | None
    ) -> None:
        self._hub = hub
        self._authenticator = authenticator
        self._numbers = itertools.count(1)
        app = web.Application(middlewares=[self._renew_timeout], client_max_size=1024)
        app.on_response_prepare.append(_add_headers)
        files = console_files()
        app.router.add_get("/", partial(_serve_file, *files[ENTRY]))
        for name, file in files.items():
            app.router.add_get(f"{_CONSOLE}{name}", partial(_serve_file, *file))
        app.router.add_get(f"{_CONSOLE}robot.json", self._robot)
        app.router.add_get("/healthz", self._health)
        app.router.add_get("/link", self._link)
        self._runner = web.AppRunner(
            app, access_log=None, handle_signals=False, shutdown_timeout=_SHUTDOWN_S
        )
        self._listener = Listener(self._protocol, tls)

    async def start(self) -> int:
        """Start listening, and return the port."""
        await self._runner.setup()
        return await self._listener.start(self._hub.plan.host, self._hub.plan.port)

    async def close(self) -> None:
        """Close all connections."""
        await self._listener.close()
        await self._runner.cleanup()

    def _protocol(self) -> web.RequestHandler:
        server = self._runner.server
        if server is None:
            raise RobotError("The server has not started.")
        return server()

    @web.middleware
    async def _renew_timeout(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        response = await handler(request)
        # Over a slow radio, the timeout applies to each file of the console separately.
        self._listener.renew(request.protocol)
        return response

    async def _robot(self, _: web.Request) -> web.Response:
        """Describe the robot to a page before authentication."""
        # The proof needs the certificate's fingerprint, which a page cannot read from its
        # connection. The fingerprint is not secret.
        return web.json_response(
            {
                "robot": self._hub.plan.card.robot,
                "version": VERSION,
                "certificate": self._authenticator.certificate.hex(),
                "open": self._authenticator.is_open,
            }
        )

    async def _health(self, _: web.Request) -> web.Response:
        at_ns = self._hub.state.at_ns
        heard = at_ns and self._hub.now_ns() - at_ns <= _GUARD_SILENT_NS
        # A twin's time stands still while no client drives, and its guard then reports no state.
        if heard or self._hub.in_steps:
            return web.json_response({"guard": "well"})
        return web.json_response({"guard": "silent"}, status=503)

    async def _link(self, request: web.Request) -> web.StreamResponse:
        refusal = origin_refusal(
            request.headers.get("Origin"), request.host, is_open=self._authenticator.is_open
        )
        if refusal:
            raise web.HTTPForbidden(text=refusal)
        self._listener.stop_timer(request.protocol)
        forget = partial(self._listener.remove, request.protocol)
        session = Session(next(self._numbers), self._hub, self._authenticator)
        with contextlib.ExitStack() as leaving:
            leaving.callback(forget)
            return await session.run(request, forget)


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(_HEADERS)


async def _serve_file(content_type: str, body: bytes, _: web.Request) -> web.Response:
    return web.Response(body=body, content_type=content_type, charset="utf-8")
