"""Discovery of robots on the local network, by mDNS."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

from shapechanger.errors import MissingExtra
from shapechanger.robot.link.address import SERVICE, Address

try:
    from zeroconf import ServiceBrowser, ServiceStateChange, Zeroconf
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


def find(timeout_s: float = 2.0, zeroconf: Any = None) -> list[FoundRobot]:
    """Find the robots on the local network, sorted by name.

    A network may block multicast DNS; an address works all the same.

    Args:
        timeout_s: Time to listen, s.
        zeroconf: A `zeroconf.Zeroconf` to use; None for a new one.
    """
    names: set[str] = set()

    def changed(name: str, state_change: ServiceStateChange, **_: Any) -> None:
        (names.discard if state_change is ServiceStateChange.Removed else names.add)(name)

    own = zeroconf or Zeroconf()
    try:
        browser = ServiceBrowser(own, SERVICE, handlers=[changed])
        threading.Event().wait(timeout_s)
        browser.cancel()  # It waits for the browser's thread.
        found = [_resolved(own, name, timeout_s) for name in names]
    finally:
        if zeroconf is None:
            own.close()
    robots = [robot for robot in found if robot is not None]
    return sorted(robots, key=lambda robot: (robot.name, str(robot.address)))


def _resolved(zeroconf: Zeroconf, name: str, timeout_s: float) -> FoundRobot | None:
    info = zeroconf.get_service_info(SERVICE, name, int(timeout_s * 1e3))
    addresses = info.parsed_scoped_addresses() if info else []
    if info is None or info.port is None or not addresses:
        return None
    properties = {
        key.decode("utf-8", "replace"): (value or b"").decode("utf-8", "replace")
        for key, value in info.properties.items()
    }
    return FoundRobot(
        name=properties.get("id") or name.removesuffix(f".{SERVICE}"),
        body=properties.get("body", ""),
        address=Address(addresses[0], info.port),
        fingerprint=properties.get("fp", ""),
        version=properties.get("v", ""),
    )
