"""mDNS announcement of the robot, for `shapechanger robot find`."""

from __future__ import annotations

import ipaddress
import logging
import socket
from typing import Any

from zeroconf import (
    Error,
    ServiceInfo,
    get_all_addresses,  # pyright: ignore[reportPrivateImportUsage]  # Documented.
)
from zeroconf.asyncio import AsyncZeroconf

from shapechanger.link.address import SERVICE
from shapechanger.link.authentication import fingerprint_hex
from shapechanger.link.messages import VERSION
from shapechanger.robot.daemon.plan import DaemonPlan

_log = logging.getLogger(__name__)


class Announcement:
    """Announcement of one robot; if it fails, a warning is logged and the robot serves anyway.

    Args:
        plan: Description of the robot.
        port: Port of the server.
        fingerprint: Fingerprint of its certificate; empty without TLS.
    """

    def __init__(self, plan: DaemonPlan, port: int, fingerprint: bytes) -> None:
        self._plan = plan
        self._port = port
        self._fingerprint = fingerprint
        self._zeroconf: Any = None  # AsyncZeroconf; its types are only partly known.

    async def start(self) -> bool:
        """Announce the robot. Return False if that failed."""
        try:
            self._zeroconf = AsyncZeroconf()
            await self._zeroconf.async_register_service(self._service(), allow_name_change=True)
        except (Error, OSError, RuntimeError, ValueError) as error:
            _log.warning(
                "%s cannot be announced on the network, so clients need its address: %s",
                self._plan.robot,
                error or type(error).__name__,
            )
            await self.close()
            return False
        return True

    async def close(self) -> None:
        """Withdraw the announcement."""
        zeroconf, self._zeroconf = self._zeroconf, None
        if zeroconf is None:
            return
        try:
            await zeroconf.async_unregister_all_services()
            await zeroconf.async_close()
        except (Error, OSError, RuntimeError) as error:
            _log.warning("The announcement cannot be withdrawn: %s", error)

    def _service(self) -> ServiceInfo:
        name = self._plan.robot.replace(".", " ")  # A dot would start another label.
        label = name.encode()[:63].decode(errors="ignore")  # RFC 6763: 63 bytes.
        return ServiceInfo(
            SERVICE,
            f"{label}.{SERVICE}",
            port=self._port,
            addresses=_addresses(self._plan.host),
            properties={
                "id": self._plan.robot,
                "body": self._plan.body,
                "v": str(VERSION),
                "fp": fingerprint_hex(self._fingerprint),
            },
            server=f"{socket.gethostname().partition('.')[0]}.local.",
        )


def _addresses(host: str) -> list[bytes]:
    """Return the addresses at which other machines reach a robot that listens at `host`."""
    listening = ipaddress.ip_address(host)
    if not listening.is_unspecified:
        return [listening.packed]
    every = [ipaddress.ip_address(text) for text in get_all_addresses()]
    return [address.packed for address in every if not address.is_loopback]
