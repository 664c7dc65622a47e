"""Opens the console of a robot in a browser of this machine."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import time
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.errors import LinkError
from shapechanger.link.address import parse_address
from shapechanger.remote.known_robots import INSECURE

if TYPE_CHECKING:
    from shapechanger.remote.known_robots import KnownRobot

__all__ = ["can_open", "console_address", "open_console"]

_SCREENS: Final = ("DISPLAY", "WAYLAND_DISPLAY")
_OPENED_WITHIN_S: Final = 10.0
_LOOK_EVERY_S: Final = 0.1


def can_open() -> bool:
    """Whether there is a screen, and a browser to show something on it."""
    if sys.platform != "darwin" and not any(os.environ.get(name) for name in _SCREENS):
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True


def console_address(robot: KnownRobot) -> str:
    """Where a browser finds the console of a robot, without its key."""
    scheme = "http" if robot.fingerprint == INSECURE else "https"
    return f"{scheme}://{parse_address(robot.address)}/"


def open_console(robot: KnownRobot) -> str:
    """Open the console of a robot, which then knows the key.

    The key goes into the part of the address that no browser sends anywhere, and by way of a file
    that only its owner may read: what stands on a command line can be read by everybody here. The
    file is gone once the browser has read it, or after some seconds.

    Returns:
        The address without the key.

    Raises:
        LinkError: If no browser opens.
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
        _wait_until_read(page)
    finally:
        page.unlink(missing_ok=True)
    return address


def _wait_until_read(page: Path) -> None:
    """Wait until somebody has read a file, where the file system says so, but not for long."""
    written_ns = page.stat().st_atime_ns
    until_s = time.monotonic() + _OPENED_WITHIN_S
    while page.stat().st_atime_ns == written_ns and time.monotonic() < until_s:
        time.sleep(_LOOK_EVERY_S)
