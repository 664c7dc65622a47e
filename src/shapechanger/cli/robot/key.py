"""`shapechanger robot key`: show a local robot's key and fingerprint."""

from __future__ import annotations

import html
import os
import socket
import sys
import tempfile
import time
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from shapechanger.cli.console import say
from shapechanger.errors import LinkError, MissingExtra, UnknownName
from shapechanger.robot.client.known_robots import INSECURE, KnownRobot
from shapechanger.robot.daemon.credentials import Credentials, credentials_folder, load_credentials
from shapechanger.robot.link.address import parse_address
from shapechanger.robot.link.authentication import fingerprint_hex, fingerprint_short


@dataclass(frozen=True)
class Key:
    """Show the key and fingerprint of a robot that was set up on this machine."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name of the robot."""
    credentials: Path | None = None
    """Folder of its key and certificate; by default the one that `init` made."""
    qr: bool = False
    """Show a QR code that opens the console on a phone. It contains the key, so keep it private."""
    address: str = ""
    """With --qr: address of the robot for the phone, HOST or HOST:PORT; by default this machine's
    name."""

    def run(self) -> None:
        """Print them, and the command that stores them on another computer."""
        folder = self.credentials or credentials_folder(self.name)
        if not folder.exists() and self.credentials is None:
            there = folder.parent.iterdir() if folder.parent.is_dir() else ()
            raise UnknownName(
                "robot of this machine", self.name, sorted(path.name for path in there)
            )
        credentials = load_credentials(folder)
        say(f"{shown_credentials(credentials)}\n\n{how_to_remember(self.name, credentials)}")
        if self.qr:
            self._show_qr(credentials)

    def _show_qr(self, credentials: Credentials) -> None:
        """Print the console's address with the key as a QR code."""
        try:
            import segno
        except ImportError as error:
            raise MissingExtra("segno", "robot") from error

        robot = robot_at(self.address or f"{socket.gethostname()}.local", self.name, credentials)
        console = _console_address(robot)
        say(f"\nThe console is at {console}; this brings a phone there:\n")
        # Printed verbatim: wrapping would break the code.
        segno.make(f"{console}#key={robot.key}", micro=False).terminal(sys.stdout, compact=True)


def robot_at(address: str, name: str, credentials: Credentials) -> KnownRobot:
    """Return a robot as its clients know it.

    Args:
        address: Its address, HOST or HOST:PORT.
        name: Its name.
        credentials: Its key and certificate.
    """
    key = credentials.key_file.read_text().strip()
    return KnownRobot(name, address, key, fingerprint_hex(credentials.fingerprint))


def shown_credentials(credentials: Credentials) -> str:
    """Format the key and the fingerprint for people to compare."""
    key = credentials.key_file.read_text().strip()
    fingerprint = credentials.fingerprint
    return (
        f"key          {key}\n"
        f"fingerprint  {fingerprint_hex(fingerprint)}\n"
        f"in short     {fingerprint_short(fingerprint)}"
    )


def how_to_remember(name: str, credentials: Credentials) -> str:
    """Return the command for the computer that is to drive the robot.

    Args:
        name: Name of the robot.
        credentials: Its key and certificate.
    """
    return (
        "On the workstation, with the key from above:\n"
        f"      shapechanger robot remember {name} {socket.gethostname()}.local "
        f"--fingerprint {fingerprint_hex(credentials.fingerprint)}"
    )


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


def _console_address(robot: KnownRobot) -> str:
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

    Raises:
        LinkError: If no browser opens.
    """
    address = _console_address(robot)
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
    """Wait shortly until a file has been read, if the file system reports access times."""
    written_ns = page.stat().st_atime_ns
    until_s = time.monotonic() + _OPENED_WITHIN_S
    while page.stat().st_atime_ns == written_ns and time.monotonic() < until_s:
        time.sleep(_LOOK_EVERY_S)
