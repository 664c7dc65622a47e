"""The routes of the console: its files, and what its page must know before it has a key."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Final

from aiohttp import web

from shapechanger.link.fingerprint import fingerprint_hex
from shapechanger.link.messages import VERSION
from shapechanger.robot.console.files import ENTRY, ConsoleFile, console_files
from shapechanger.robot.daemon.cockpit import Cockpit
from shapechanger.robot.daemon.session import Door

__all__ = ["SECURITY_POLICY", "add_console"]

SECURITY_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'none'"
)
"""What a browser may do with a page of the robot: nothing inline, nothing from elsewhere."""

_FOLDER: Final = "/console/"

_Handler = Callable[[web.Request], Awaitable[web.Response]]


def add_console(app: web.Application, cockpit: Cockpit, door: Door) -> None:
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
