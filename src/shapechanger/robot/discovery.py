"""Announcement and discovery of robots on the local network, by mDNS."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import socket
import threading
from dataclasses import dataclass
from typing import Any

from shapechanger.errors import MissingExtra, translate_errors
from shapechanger.robot.link.address import SERVICE, Address
from shapechanger.robot.link.card import RobotCard
from shapechanger.robot.link.messages import VERSION

with translate_errors(ImportError, to=lambda _: MissingExtra("zeroconf", "remote")):
    from zeroconf import (
        Error,
        ServiceBrowser,
        ServiceInfo,
        ServiceStateChange,
        Zeroconf,
        get_all_addresses,  # pyright: ignore[reportPrivateImportUsage]  # Documented.
    )
    from zeroconf.asyncio import AsyncZeroconf

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class FoundRobot:
    """Announcement of a robot; it is not authenticated.

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

    A network may block multicast DNS; connecting by address works nevertheless.

    Args:
        timeout_s: Time to listen, and time limit to resolve each robot's address, s.
        zeroconf: A `zeroconf.Zeroconf` to use; None for a new one.
    """
    names: set[str] = set()

    def changed(name: str, state_change: ServiceStateChange, **_: Any) -> None:
        (names.discard if state_change is ServiceStateChange.Removed else names.add)(name)

    with contextlib.ExitStack() as stack:
        own = zeroconf or stack.enter_context(Zeroconf())
        browser = ServiceBrowser(own, SERVICE, handlers=[changed])
        threading.Event().wait(timeout_s)
        browser.cancel()  # It waits for the browser's thread.
        robots: list[FoundRobot] = []
        for name in names:
            info = own.get_service_info(SERVICE, name, int(timeout_s * 1e3))
            addresses = info.parsed_scoped_addresses() if info else []
            if info is None or info.port is None or not addresses:
                continue
            said = info.decoded_properties
            robots.append(
                FoundRobot(
                    name=said.get("id") or name.removesuffix(f".{SERVICE}"),
                    body=said.get("body") or "",
                    address=Address(addresses[0], info.port),
                    fingerprint=said.get("fp") or "",
                    version=said.get("v") or "",
                )
            )
    return sorted(robots, key=lambda robot: (robot.name, str(robot.address)))


async def announce(
    card: RobotCard, host: str, port: int, fingerprint: bytes
) -> AsyncZeroconf | None:
    """Announce a robot. If that fails, log a warning and return None; the robot serves anyway."""
    zeroconf: AsyncZeroconf | None = None
    try:
        zeroconf = AsyncZeroconf()
        await zeroconf.async_register_service(  # pyright: ignore[reportUnknownMemberType]
            _service(card, host, port, fingerprint), allow_name_change=True
        )
    except (Error, OSError, RuntimeError, ValueError) as error:
        _log.warning(
            "%s cannot be announced on the network, so clients need its address: %s",
            card.robot,
            error or type(error).__name__,
        )
        if zeroconf is not None:
            await withdraw(zeroconf)
        return None
    return zeroconf


async def withdraw(zeroconf: AsyncZeroconf) -> None:
    """Withdraw an announcement."""
    try:
        await zeroconf.async_unregister_all_services()
        await zeroconf.async_close()
    except (Error, OSError, RuntimeError) as error:
        _log.warning("The announcement cannot be withdrawn: %s", error)


def _service(card: RobotCard, host: str, port: int, fingerprint: bytes) -> ServiceInfo:
    name = card.robot.replace(".", " ")  # A dot would start another label.
    label = name.encode()[:63].decode(errors="ignore")  # RFC 6763: 63 bytes.
    # The addresses at which other machines reach the robot.
    addresses = [ipaddress.ip_address(host)]
    if addresses[0].is_unspecified:
        every = map(ipaddress.ip_address, get_all_addresses())
        addresses = [address for address in every if not address.is_loopback]
    return ServiceInfo(
        SERVICE,
        f"{label}.{SERVICE}",
        port=port,
        addresses=[address.packed for address in addresses],
        properties={
            "id": card.robot,
            "body": card.body,
            "v": str(VERSION),
            "fp": fingerprint.hex(),
        },
        server=f"{socket.gethostname().partition('.')[0]}.local.",
    )
