"""mDNS announcement of the robot, for `shapechanger robot find`."""

from __future__ import annotations

import ipaddress
import logging
import socket

from zeroconf import (
    Error,
    ServiceInfo,
    get_all_addresses,  # pyright: ignore[reportPrivateImportUsage]  # Documented.
)
from zeroconf.asyncio import AsyncZeroconf

from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.link.address import SERVICE
from shapechanger.robot.link.authentication import fingerprint_hex
from shapechanger.robot.link.messages import VERSION

_log = logging.getLogger(__name__)


async def announce(plan: DaemonPlan, port: int, fingerprint: bytes) -> AsyncZeroconf | None:
    """Announce a robot. If that fails, log a warning and return None; the robot serves anyway."""
    zeroconf: AsyncZeroconf | None = None
    try:
        zeroconf = AsyncZeroconf()
        await zeroconf.async_register_service(  # pyright: ignore[reportUnknownMemberType]
            _service(plan, port, fingerprint), allow_name_change=True
        )
    except (Error, OSError, RuntimeError, ValueError) as error:
        _log.warning(
            "%s cannot be announced on the network, so clients need its address: %s",
            plan.card.robot,
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


def _service(plan: DaemonPlan, port: int, fingerprint: bytes) -> ServiceInfo:
    card = plan.card
    name = card.robot.replace(".", " ")  # A dot would start another label.
    label = name.encode()[:63].decode(errors="ignore")  # RFC 6763: 63 bytes.
    # The addresses at which other machines reach it.
    addresses = [ipaddress.ip_address(plan.host)]
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
            "fp": fingerprint_hex(fingerprint),
        },
        server=f"{socket.gethostname().partition('.')[0]}.local.",
    )
