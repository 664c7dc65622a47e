"""`shapechanger robot key`: show a local robot's key and fingerprint."""

from __future__ import annotations

import socket
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import say
from shapechanger.errors import MissingExtra, UnknownName
from shapechanger.robot.client.known_robots import console_address
from shapechanger.robot.daemon.credentials import Credentials, credentials_folder, load_credentials
from shapechanger.robot.link.authentication import fingerprint_short
from shapechanger.robot.serve import robot_at


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
        console = console_address(robot)
        say(f"\nThe console is at {console}; this brings a phone there:\n")
        # Printed verbatim: wrapping would break the code.
        segno.make(f"{console}#key={robot.key}", micro=False).terminal(sys.stdout, compact=True)


def shown_credentials(credentials: Credentials) -> str:
    """Format the key and the fingerprint for people to compare."""
    key = credentials.key_file.read_text().strip()
    fingerprint = credentials.fingerprint
    return (
        f"key          {key}\n"
        f"fingerprint  {fingerprint.hex()}\n"
        f"in short     {fingerprint_short(fingerprint)}"
    )


def how_to_remember(name: str, credentials: Credentials) -> str:
    """Return the command for the computer that is to drive the robot."""
    return (
        "On the workstation, with the key from above:\n"
        f"      shapechanger robot remember {name} {socket.gethostname()}.local "
        f"--fingerprint {credentials.fingerprint.hex()}"
    )
