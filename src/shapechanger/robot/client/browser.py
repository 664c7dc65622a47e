"""The console of a robot in the browser of this machine."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import time
import webbrowser
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError
from shapechanger.robot.client.known_robots import INSECURE, KnownRobot
from shapechanger.robot.link.address import parse_address

_SCREENS: Final = ("DISPLAY", "WAYLAND_DISPLAY")
_OPENED_WITHIN_S: Final = 10.0
_LOOK_EVERY_S: Final = 0.1


def can_open() -> bool:
    """Return whether there is a display and a browser."""
    if sys.platform != "darwin" and not any(os.environ.get(name) for name in _SCREENS):
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True


def console_address(robot: KnownRobot) -> str:
    """Return the address of a robot's console, without the key."""
    scheme = "http" if robot.fingerprint == INSECURE else "https"
    return f"{scheme}://{parse_address(robot.address)}/"


def open_console(robot: KnownRobot) -> str:
    """Open the console of a robot and pass it the key.

    The key is in the fragment of the address, which browsers do not send, and passes through a file
    that only its owner can read, because command lines are visible to all users. The file is
    deleted once the browser has read it, or after some seconds.

    Returns:
        The address without the key.
    """
    address = console_address(robot)
    there = html.escape(f"{address}#key={robot.key}", quote=True)
    fd, name = tempfile.mkstemp(prefix="shapechanger-console-", suffix=".html")
    with os.fdopen(fd, "w", encoding="utf-8") as file:
        file.write(
            f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0;'
            f'url={there}"><title>{html.escape(robot.name)}</title><a href="{there}">Console</a>'
        )
    page = Path(name)
    try:
        if not webbrowser.open(page.as_uri()):
            raise LinkError(
                f"No browser opens here: open {address} in one, or drive with --terminal."
            )
        # If the file system reports access times.
        written_ns, until_s = page.stat().st_atime_ns, time.monotonic() + _OPENED_WITHIN_S
        while page.stat().st_atime_ns == written_ns and time.monotonic() < until_s:
            time.sleep(_LOOK_EVERY_S)
    finally:
        page.unlink(missing_ok=True)
    return address
