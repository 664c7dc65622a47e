"""Network addresses of robots, as people write them."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from typing import Final

from shapechanger.errors import LinkError

DEFAULT_PORT: Final = 5000
"""Default port of a robot, as in the original release (2017)."""

SERVICE: Final = "_shapechanger._tcp.local."
"""DNS-SD service type of robots."""

_LABEL: Final = r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)"
_HOST_NAME: Final = re.compile(rf"{_LABEL}(\.{_LABEL})*\.?")
_LONGEST_NAME: Final = 253  # RFC 1035.
_EXAMPLES: Final = "Examples: car.local, 192.168.42.1:5000, [fe80::1]:5000."


@dataclass(frozen=True, slots=True)
class Address:
    """A host and a port.

    Attributes:
        host: Name or IP address, without brackets.
        port: 1 to 65535.
    """

    host: str
    port: int = DEFAULT_PORT

    def __str__(self) -> str:
        """Return HOST:PORT, or [HOST]:PORT for IPv6."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(text: str) -> Address:
    """Parse HOST, HOST:PORT, [IPv6] or [IPv6]:PORT.

    Raises:
        LinkError: If the text has none of these forms.
    """
    text = text.strip()
    if not text:
        raise LinkError(f"The address is empty. {_EXAMPLES}")
    if "/" in text or "@" in text:
        raise LinkError(f"{text!r} is not a valid address. {_EXAMPLES}")
    if text.startswith("["):
        host, closed, rest = text[1:].partition("]")
        if not closed or not _is_ip(host, 6) or (rest and not rest.startswith(":")):
            raise LinkError(f"{text!r} is not an IPv6 address in brackets. {_EXAMPLES}")
        return Address(host, _port(rest[1:], text) if rest else DEFAULT_PORT)
    if _is_ip(text, 6):
        return Address(text)
    host, colon, port = text.partition(":")
    if len(host) > _LONGEST_NAME or not _HOST_NAME.fullmatch(host) or _is_broken_ip(host):
        raise LinkError(f"{text!r} is not a valid address. {_EXAMPLES}")
    return Address(host, _port(port, text) if colon else DEFAULT_PORT)


def is_loopback(host: str) -> bool:
    """Return True if only this machine reaches the address of `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _is_ip(text: str, version: int) -> bool:
    try:
        return ipaddress.ip_address(text).version == version
    except ValueError:
        return False


def _is_broken_ip(host: str) -> bool:
    """Return True for numbers and dots that do not form an IPv4 address."""
    return bool(re.fullmatch(r"[0-9.]+", host)) and not _is_ip(host, 4)


def _port(text: str, whole: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:6]) <= 65535 and len(text) < 6):
        raise LinkError(f"{text!r} in {whole!r} must be a port from 1 to 65535. {_EXAMPLES}")
    return int(text)
