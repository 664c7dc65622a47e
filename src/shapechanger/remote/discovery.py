"""Robots in the same network that say where they are."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, Final

from shapechanger.errors import MissingExtra
from shapechanger.link.address import Address

try:
    from zeroconf import ServiceBrowser, ServiceListener, Zeroconf
except ImportError as error:
    raise MissingExtra("zeroconf", "remote") from error

__all__ = ["SERVICE", "FoundRobot", "find"]

SERVICE: Final = "_shapechanger._tcp.local."
"""Under what robots announce themselves."""


@dataclass(frozen=True, slots=True)
class FoundRobot:
    """What a robot says of itself to everybody; nothing of it is proven.

    Attributes:
        name: Name of the robot.
        body: What it is, such as "car".
        address: Where it is.
        fingerprint: SHA-256 of its certificate in hexadecimal; "" for none.
        version: Version of the messages that it speaks.
    """

    name: str
    body: str
    address: Address
    fingerprint: str
    version: str


class _Collector(ServiceListener):
    """Asks each service that appears for its details."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_ms = int(timeout_s * 1e3)
        self._lock = threading.Lock()
        self._found: dict[str, FoundRobot] = {}

    @property
    def found(self) -> list[FoundRobot]:
        """Those seen so far, by name."""
        with self._lock:
            return sorted(self._found.values(), key=lambda robot: (robot.name, str(robot.address)))

    def add_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """A robot appeared."""
        info = zc.get_service_info(type_, name, self._timeout_ms)
        addresses = info.parsed_scoped_addresses() if info else []
        if info is None or info.port is None or not addresses:
            return
        told = {
            key.decode("utf-8", "replace"): (value or b"").decode("utf-8", "replace")
            for key, value in info.properties.items()
        }
        robot = FoundRobot(
            name=told.get("id") or name.removesuffix(f".{SERVICE}"),
            body=told.get("body", ""),
            address=Address(addresses[0], info.port),
            fingerprint=told.get("fp", ""),
            version=told.get("v", ""),
        )
        with self._lock:
            self._found[name] = robot

    def update_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """A robot changed what it says."""
        self.add_service(zc, type_, name)

    def remove_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """A robot left."""
        with self._lock:
            self._found.pop(name, None)


def find(timeout_s: float = 2.0, zeroconf: Any = None) -> list[FoundRobot]:
    """The robots that answer within a time, by name.

    A network may block what this needs (multicast DNS); connecting by address works all the same.

    Args:
        timeout_s: How long to listen, s.
        zeroconf: The `zeroconf.Zeroconf` to listen with; None for a new one.
    """
    listener = _Collector(timeout_s)
    own = zeroconf or Zeroconf()
    try:
        browser = ServiceBrowser(own, SERVICE, listener)
        threading.Event().wait(timeout_s)
        browser.cancel()
        return listener.found
    finally:
        if zeroconf is None:
            own.close()
