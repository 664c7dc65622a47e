"""Parse the network addresses of robots that people write."""

from __future__ import annotations

import ipaddress
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from shapechanger.errors import LinkError, RobotError

DEFAULT_PORT: Final = 5000
"""Default port of a robot, unchanged since the original release (2017)."""

SERVICE: Final = "_shapechanger._tcp.local."
"""DNS-SD service type of robots."""

_LABEL: Final = r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)"
# Digits and dots alone are an IPv4 address; names have at most 253 characters (RFC 1035).
_HOST_NAME: Final = re.compile(rf"(?=.{{1,253}}\Z)(?![0-9.]+\Z){_LABEL}(\.{_LABEL})*\.?")
_PARTS: Final = re.compile(r"(?:\[([^\]]*)\]|([^:\[\]]*))(?::([0-9]{1,5}))?")


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
    """Parse HOST, HOST:PORT, IPv6, [IPv6] or [IPv6]:PORT.

    Raises:
        LinkError: If the text has another form, or the port is not 1 to 65535.
    """
    text = text.strip()
    if _is_ip(text, 6):
        return Address(text)
    if parts := _PARTS.fullmatch(text):
        bracketed, host, port = parts[1] or "", parts[2] or "", int(parts[3] or DEFAULT_PORT)
        named = _is_ip(host, 4) or _HOST_NAME.fullmatch(host)
        if (_is_ip(bracketed, 6) or named) and 1 <= port <= 65535:
            return Address(bracketed or host, port)
    raise LinkError(
        f"{text!r} is not a valid address, which is HOST or HOST:PORT, with an IPv6 address in "
        "brackets and a port from 1 to 65535. Examples: car.local, 192.168.42.1:5000, "
        "[fe80::1]:5000."
    )


def is_loopback(host: str) -> bool:
    """Return True for "localhost" and loopback IP addresses, which only this machine reaches."""
    ip = _ip(host)
    return host == "localhost" if ip is None else ip.is_loopback


def address_here(host: str, port: int) -> Address:
    """Return the address at which this machine reaches a server that listens at `host`."""
    return Address("127.0.0.1" if host in {"", "0.0.0.0", "::"} else host, port)


def cannot_listen(host: str, port: int, error: OSError) -> RobotError:
    """Return the error of a robot that cannot be served at an address."""
    # Python adds the address to the system's text; errors of the resolver have negative numbers.
    why = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
    return RobotError(f"Cannot listen at {host} port {port}: {why}. Is the robot served already?")


def _is_ip(text: str, version: int) -> bool:
    ip = _ip(text)  # Python accepts any text after a "%" as the zone.
    return ip is not None and ip.version == version and not {"/", "@"} & set(text)


def _ip(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    with suppress(ValueError):
        return ipaddress.ip_address(text)
    return None
