"""Who it is that answers: the fingerprint is checked, or it is shown to a person to compare.

Nothing is trusted on first use. A program cannot tell the robot from somebody who stands in
between; a person who looks at both fingerprints can.
"""

from __future__ import annotations

import json
import os
import re
import ssl
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError, OutputError, UnknownName
from shapechanger.link.address import Address, parse_address
from shapechanger.link.authentication import (
    fingerprint_hex,
    fingerprint_of,
    fingerprint_short,
    parse_key,
)
from shapechanger.link.authentication import parse_fingerprint as _parse_fingerprint

__all__ = [
    "INSECURE",
    "KnownRobot",
    "check_name",
    "forget",
    "known_folder",
    "known_names",
    "parse_trust",
    "recall",
    "remember",
    "shown_fingerprint",
    "untrusted",
]

INSECURE: Final = "insecure"
"""In the place of a fingerprint: no encryption, and no proof of who answers."""


def parse_trust(fingerprint: str) -> bytes | None:
    """SHA-256 of the certificate to expect; None for "insecure".

    Raises:
        LinkError: If it is neither a fingerprint nor that word.
    """
    return None if fingerprint == INSECURE else _parse_fingerprint(fingerprint)


def shown_fingerprint(address: Address, timeout_s: float) -> bytes:
    """SHA-256 of the certificate that is shown at an address, whoever shows it.

    Raises:
        LinkError: If nobody shows one.
    """
    try:
        shown = ssl.get_server_certificate((address.host, address.port), timeout=timeout_s)
    except OSError as error:
        raise LinkError(f"Nobody shows a certificate at {address}: {error}.") from None
    return fingerprint_of(ssl.PEM_cert_to_DER_cert(shown))


def untrusted(address: Address, timeout_s: float) -> LinkError:
    """What to say to somebody who connects without a fingerprint.

    Raises:
        LinkError: If nobody shows one.
    """
    shown = shown_fingerprint(address, timeout_s)
    digits = fingerprint_hex(shown)
    return LinkError(
        f"Nothing says that the robot at {address} is yours. It shows the fingerprint\n"
        f"  {digits}  (in short {fingerprint_short(shown)})\n"
        "Compare it with the one that `shapechanger robot key NAME` shows on the robot. If they "
        f"are the same, run\n  shapechanger robot remember NAME {address} --fingerprint {digits}"
    )


_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FIELDS: Final = ("address", "key", "fingerprint")
_OTHERS: Final = 0o077


def check_name(name: str) -> None:
    """Refuse a name that no robot can be remembered under.

    Raises:
        LinkError: If it is none.
    """
    if not _NAME.fullmatch(name):
        raise LinkError(
            f"{name!r} is no name for a robot: up to 64 letters, digits, '-', '_' and '.'."
        )


@dataclass(frozen=True, slots=True)
class KnownRobot:
    """What it takes to reach a robot.

    Attributes:
        name: Name of the robot.
        address: Host, or HOST:PORT.
        key: The robot's key, as its `init` wrote it.
        fingerprint: SHA-256 of its certificate in hexadecimal, or "insecure"; then the key may be
            empty.

    Raises:
        LinkError: If one of them cannot be meant.
    """

    name: str
    address: str
    key: str
    fingerprint: str

    def __post_init__(self) -> None:
        check_name(self.name)
        parse_address(self.address)
        parse_trust(self.fingerprint)
        if self.key or self.fingerprint != INSECURE:
            parse_key(self.key)

    def __repr__(self) -> str:
        """Without the key, which belongs in no log."""
        return f"KnownRobot({self.name!r}, {self.address!r}, fingerprint={self.fingerprint!r})"


def known_folder() -> Path:
    """Where they are."""
    config = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(config) / "shapechanger" / "known"


def known_names() -> tuple[str, ...]:
    """The names of all robots that are remembered, in order."""
    return tuple(sorted(path.stem for path in known_folder().glob("*.toml")))


def remember(robot: KnownRobot) -> Path:
    """Write a robot down; one of the same name is replaced.

    Returns:
        The file.

    Raises:
        OutputError: If it cannot be written; it is then as it was.
    """
    folder = known_folder()
    # The strings of JSON are strings of TOML, but for one character, which no field holds.
    lines = [
        f"{field} = {json.dumps(getattr(robot, field), ensure_ascii=False)}\n" for field in _FIELDS
    ]
    path = folder / f"{robot.name}.toml"
    written: Path | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        # A temporary file is made for its owner alone.
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, delete=False) as file:
            written = Path(file.name)
            file.writelines(lines)
        written.replace(path)
    except OSError as error:
        if written is not None:
            written.unlink(missing_ok=True)
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from None
    return path


def recall(name: str) -> KnownRobot:
    """A robot that was remembered.

    Raises:
        UnknownName: If there is none of this name.
        LinkError: If its file cannot be read, or others can read it too.
    """
    path = known_folder() / f"{name}.toml"
    if name not in known_names():
        raise UnknownName("known robot", name, known_names())
    if os.name == "posix" and path.stat().st_mode & _OTHERS:
        raise LinkError(f"Others may read the key in {path}: run `chmod 600 {path}`.")
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LinkError(f"{path} cannot be read: {error}.") from None
    if set(told) != set(_FIELDS) or not all(isinstance(value, str) for value in told.values()):
        raise LinkError(f"{path} must hold {', '.join(_FIELDS)}, each a text.")
    return KnownRobot(name, **told)


def forget(name: str) -> None:
    """Remove a robot.

    Raises:
        UnknownName: If there is none of this name.
    """
    if name not in known_names():
        raise UnknownName("known robot", name, known_names())
    (known_folder() / f"{name}.toml").unlink()
