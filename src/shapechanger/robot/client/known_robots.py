"""Known robots: address, key and fingerprint of each, in a file that only the user can read.

The files are `~/.config/shapechanger/known/NAME.toml`, or below `$XDG_CONFIG_HOME` if that is set.

No robot is trusted on first use. A program cannot tell the robot from a man in the middle; a
person who compares the fingerprints can.
"""

from __future__ import annotations

import contextlib
import html
import json
import os
import re
import ssl
import sys
import tempfile
import time
import tomllib
import webbrowser
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError, UnknownName, translate_errors
from shapechanger.files import cannot_write, read_text, write_atomic
from shapechanger.robot.daemon.credentials import user_folder
from shapechanger.robot.link import authentication
from shapechanger.robot.link.address import Address, parse_address

INSECURE: Final = "insecure"
"""Value instead of a fingerprint for no encryption and no proof of the robot's identity."""

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FIELDS: Final = ("address", "key", "fingerprint")
_OPENED_WITHIN_S: Final = 10.0
_LOOK_EVERY_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class KnownRobot:
    """A robot that the user trusts.

    Attributes:
        name: Name of the robot.
        address: HOST, or HOST:PORT.
        key: The robot's key, from `shapechanger robot init`.
        fingerprint: SHA-256 of its certificate in hexadecimal; or "insecure", and then the key may
            be empty.

    Raises:
        LinkError: If an attribute is invalid.
    """

    name: str
    address: str
    key: str = field(repr=False)  # Keep the key out of logs.
    fingerprint: str

    def __post_init__(self) -> None:
        check_name(self.name)
        parse_address(self.address)
        parse_trust(self.fingerprint)
        if self.key or self.fingerprint != INSECURE:
            authentication.parse_key(self.key)


def check_name(name: str) -> None:
    """Check the name of a robot.

    Raises:
        LinkError: If it is not a valid name.
    """
    if not _NAME.fullmatch(name):
        raise LinkError(
            "A robot's name must have 1 to 64 letters, digits, '-', '_' and '.', and begin with a "
            f"letter or digit, got {name!r}."
        )


def known_folder() -> Path:
    """Return the folder of the known robots' files."""
    return user_folder("XDG_CONFIG_HOME", ".config") / "known"


def known_names() -> tuple[str, ...]:
    """Return the names of all known robots, sorted."""
    return tuple(sorted(path.stem for path in known_folder().glob("*.toml")))


def remember(robot: KnownRobot) -> Path:
    """Save a robot; one of the same name is replaced.

    Returns:
        The file.

    Raises:
        OutputError: If it cannot be written; an existing file is unchanged.
    """
    path = known_folder() / f"{robot.name}.toml"
    # JSON strings without DEL (U+007F) are TOML strings; no field contains DEL.
    lines = [
        f"{field} = {json.dumps(getattr(robot, field), ensure_ascii=False)}\n" for field in _FIELDS
    ]
    with translate_errors(OSError, to=lambda error: cannot_write(path, error)):
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    write_atomic(path, "".join(lines).encode(), mode=0o600)
    return path


def recall(name: str) -> KnownRobot:
    """Load a known robot.

    Raises:
        UnknownName: If there is no robot of this name.
        LinkError: If its file is invalid, or other users can access it.
    """
    path = _file(name)
    if os.name == "posix" and path.stat().st_mode & 0o077:
        raise LinkError(f"Other users can access {path}, which has a key: run `chmod 600 {path}`.")
    with translate_errors(ValueError, to=lambda error: LinkError(f"Cannot read {path}: {error}.")):
        fields = tomllib.loads(read_text(path))
    if set(fields) != set(_FIELDS) or not all(isinstance(v, str) for v in fields.values()):
        raise LinkError(f"{path} must have the strings {', '.join(_FIELDS)}.")
    return KnownRobot(name, **fields)


def forget(name: str) -> None:
    """Delete a known robot.

    Raises:
        UnknownName: If there is no robot of this name.
    """
    _file(name).unlink()


def parse_trust(fingerprint: str) -> bytes | None:
    """Return the SHA-256 of the expected certificate; None for "insecure"."""
    return None if fingerprint == INSECURE else authentication.parse_fingerprint(fingerprint)


def untrusted(address: Address, timeout_s: float) -> LinkError:
    """Return the error for a connection without a fingerprint; it shows the robot's fingerprint."""
    with translate_errors(
        OSError, to=lambda error: LinkError(f"No server shows a certificate at {address}: {error}.")
    ):
        shown = ssl.get_server_certificate((address.host, address.port), timeout=timeout_s)
    fingerprint = authentication.fingerprint_of(ssl.PEM_cert_to_DER_cert(shown))
    digits = fingerprint.hex()
    return LinkError(
        f"The robot at {address} is not trusted yet. Its fingerprint is\n"
        f"  {digits}  (in short {authentication.fingerprint_short(fingerprint)})\n"
        "Compare it with the one that `shapechanger robot key NAME` shows on the robot. If they "
        f"are the same, run\n  shapechanger robot remember NAME {address} --fingerprint {digits}"
    )


def _file(name: str) -> Path:
    names = known_names()
    if name not in names:
        serve = "`shapechanger robot serve PROFILE --twin` serves a twin and makes it known."
        raise UnknownName("known robot", name, names, serve)
    return known_folder() / f"{name}.toml"


def can_open() -> bool:
    """Return whether there is a display and a browser."""
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform != "darwin" and not screen:
        return False
    with contextlib.suppress(webbrowser.Error):
        return bool(webbrowser.get())
    return False


def console_address(robot: KnownRobot) -> str:
    """Return the address of a robot's console, without the key."""
    scheme = "http" if robot.fingerprint == INSECURE else "https"
    return f"{scheme}://{parse_address(robot.address)}/"


def open_console(robot: KnownRobot) -> str:
    """Open the console of a robot and pass it the key.

    The key is in the fragment of the address, which browsers do not send, and passes through a file
    that only its owner can read, because command lines are visible to all users. The file is
    deleted once the browser has read it, or after 10 s.

    Returns:
        The address without the key.
    """
    address = console_address(robot)
    there = html.escape(f"{address}#key={robot.key}", quote=True)
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", prefix="shapechanger-console-", suffix=".html"
    ) as file:
        file.write(
            f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0;'
            f'url={there}"><title>{html.escape(robot.name)}</title><a href="{there}">Console</a>'
        )
        file.flush()
        page = Path(file.name)
        if not webbrowser.open(page.as_uri()):
            raise LinkError(
                f"No browser opens here: open {address} in one, or drive with --terminal."
            )
        # Reading the file changes its access time, if the file system records access times.
        written_ns, until_s = page.stat().st_atime_ns, time.monotonic() + _OPENED_WITHIN_S
        while page.stat().st_atime_ns == written_ns and time.monotonic() < until_s:
            time.sleep(_LOOK_EVERY_S)
    return address
