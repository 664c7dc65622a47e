"""`shapechanger robot key`: what another computer must know of a robot of this one."""

from __future__ import annotations

import socket
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import MissingExtra, UnknownName

if TYPE_CHECKING:
    from shapechanger.robot.daemon.credentials import Credentials

__all__ = ["Key", "how_to_remember", "shown_credentials"]


@dataclass(frozen=True)
class Key:
    """Show the key and the fingerprint of a robot that `init` or `serve` set up on this machine."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name of the robot."""
    credentials: Path | None = None
    """Folder of its key and certificate, if not the one that `init` made."""
    qr: bool = False
    """Show the picture that brings a phone to the console. It holds the key: show it to nobody who
    must not drive."""
    address: str = ""
    """With --qr: where the phone reaches the robot, HOST or HOST:PORT; this machine's name if not
    given."""

    def run(self) -> None:
        """Print them, and how another computer remembers them."""
        from shapechanger.robot.daemon.credentials import credentials_folder, load_credentials

        folder = self.credentials or credentials_folder(self.name)
        if not folder.exists() and self.credentials is None:
            there = folder.parent.iterdir() if folder.parent.is_dir() else ()
            raise UnknownName(
                "robot of this machine", self.name, sorted(path.name for path in there)
            )
        credentials = load_credentials(folder)
        plain_console().print(
            f"{shown_credentials(credentials)}\n\n{how_to_remember(self.name, credentials)}",
            soft_wrap=True,
        )
        if self.qr:
            self._show_qr(credentials)

    def _show_qr(self, credentials: Credentials) -> None:
        """The console's address with the key as a QR code."""
        try:
            import segno
        except ImportError as error:
            raise MissingExtra("segno", "robot") from error
        from shapechanger.cli.robot.opening import console_address
        from shapechanger.link.authentication import fingerprint_hex
        from shapechanger.remote.known_robots import KnownRobot

        key = credentials.key_file.read_text().strip()
        address = self.address or f"{socket.gethostname()}.local"
        robot = KnownRobot(self.name, address, key, fingerprint_hex(credentials.fingerprint))
        console = console_address(robot)
        plain_console().print(f"\nThe console is at {console}; this brings a phone there:\n")
        # Printed as it is: what measures and wraps text would take the picture apart.
        segno.make(f"{console}#key={key}", micro=False).terminal(sys.stdout, compact=True)


def shown_credentials(credentials: Credentials) -> str:
    """The key and the fingerprint, whole and in short, for people to read and to compare."""
    from shapechanger.link.authentication import fingerprint_hex, fingerprint_short

    key = credentials.key_file.read_text().strip()
    fingerprint = credentials.fingerprint
    return (
        f"key          {key}\n"
        f"fingerprint  {fingerprint_hex(fingerprint)}\n"
        f"in short     {fingerprint_short(fingerprint)}"
    )


def how_to_remember(name: str, credentials: Credentials) -> str:
    """What to type on the computer that shall drive the robot."""
    from shapechanger.link.authentication import fingerprint_hex

    return (
        "On the workstation, with the key from above:\n"
        f"      shapechanger robot remember {name} {socket.gethostname()}.local "
        f"--fingerprint {fingerprint_hex(credentials.fingerprint)}"
    )
