"""Discovery of robots on the local network, by mDNS."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

from shapechanger.errors import MissingExtra
from shapechanger.robot.link.address import SERVICE, Address

try:
    from zeroconf import ServiceBrowser, ServiceListener, Zeroconf
except ImportError as error:
    raise MissingExtra("zeroconf", "remote") from error


@dataclass(frozen=True, slots=True)
class FoundRobot:
    """Announcement of a robot, which proves nothing.

    Attributes:
        name: Name of the robot.
        body: Kind of robot, such as "car".
        address: Address of the robot.
        fingerprint: SHA-256 of its certificate in hexadecimal; "" for none.
        version: Version of the messages that it uses.
    """

    name: str
    body: str
    address: Address
    fingerprint: str
    version: str


class _Collector(ServiceListener):
    """Listener that resolves each service, in the one thread of its browser."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_ms = int(timeout_s * 1e3)
        self.found: dict[str, FoundRobot] = {}

    def add_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """Add a robot."""
        info = zc.get_service_info(type_, name, self._timeout_ms)
        addresses = info.parsed_scoped_addresses() if info else []
        if info is None or info.port is None or not addresses:
            return
        properties = {
            key.decode("utf-8", "replace"): (value or b"").decode("utf-8", "replace")
            for key, value in info.properties.items()
        }
        self.found[name] = FoundRobot(
            name=properties.get("id") or name.removesuffix(f".{SERVICE}"),
            body=properties.get("body", ""),
            address=Address(addresses[0], info.port),
            fingerprint=properties.get("fp", ""),
            version=properties.get("v", ""),
        )

    def update_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """Update a robot."""
        self.add_service(zc, type_, name)

    def remove_service(self, zc: Zeroconf, type_: str, name: str) -> None:
        """Remove a robot."""
        self.found.pop(name, None)


def find(timeout_s: float = 2.0, zeroconf: Any = None) -> list[FoundRobot]:
    """Find the robots on the local network, sorted by name.

    A network may block multicast DNS; an address works all the same.

    Args:
        timeout_s: Time to listen, s.
        zeroconf: A `zeroconf.Zeroconf` to use; None for a new one.
    """
    listener = _Collector(timeout_s)
    own = zeroconf or Zeroconf()
    try:
        browser = ServiceBrowser(own, SERVICE, listener)
        threading.Event().wait(timeout_s)
        browser.cancel()  # It waits for the browser's thread.
        return sorted(listener.found.values(), key=lambda found: (found.name, str(found.address)))
    finally:
        if zeroconf is None:
            own.close()
