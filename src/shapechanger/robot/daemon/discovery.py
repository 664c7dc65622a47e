"""Announces the robot on the local network, so that `shapechanger robot find` sees it."""

from __future__ import annotations

import ipaddress
import logging
import socket
from typing import Any, Final

from zeroconf import (
    Error,
    ServiceInfo,
    get_all_addresses,  # pyright: ignore[reportPrivateImportUsage]  # Documented.
)
from zeroconf.asyncio import AsyncZeroconf

from shapechanger.link.authentication import fingerprint_hex
from shapechanger.link.messages import VERSION
from shapechanger.robot.daemon.plan import DaemonPlan

__all__ = ["SERVICE", "Announcement"]

SERVICE: Final = "_shapechanger._tcp.local."
"""What the robot is announced as."""

_log = logging.getLogger(__name__)


class Announcement:
    """One robot's announcement; that it fails is said in words, and the robot serves all the same.

    Args:
        plan: The robot.
        port: Port that it listens at.
        fingerprint: Fingerprint of its certificate; empty without TLS.
    """

    def __init__(self, plan: DaemonPlan, port: int, fingerprint: bytes) -> None:
        self._plan = plan
        self._port = port
        self._fingerprint = fingerprint
        self._zeroconf: Any = None  # AsyncZeroconf; its types are only partly known.

    async def start(self) -> bool:
        """Announce the robot; whether that went well."""
        try:
            self._zeroconf = AsyncZeroconf()
            await self._zeroconf.async_register_service(self._service(), allow_name_change=True)
        except (Error, OSError, RuntimeError, ValueError) as error:
            _log.warning(
                "%s is not announced on the network, so it is found by its address only: %s",
                self._plan.robot,
                error or type(error).__name__,
            )
            await self.close()
            return False
        return True

    async def close(self) -> None:
        """Say that the robot is gone."""
        zeroconf, self._zeroconf = self._zeroconf, None
        if zeroconf is None:
            return
        try:
            await zeroconf.async_unregister_all_services()
            await zeroconf.async_close()
        except (Error, OSError, RuntimeError) as error:
            _log.warning("The announcement could not be taken back: %s", error)

    def _service(self) -> ServiceInfo:
        name = self._plan.robot.replace(".", " ")  # A dot would begin another label.
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
    """The addresses under which others reach a robot that listens at a host's address."""
    listening = ipaddress.ip_address(host)
    if not listening.is_unspecified:
        return [listening.packed]
    every = [ipaddress.ip_address(text) for text in get_all_addresses()]
    return [address.packed for address in every if not address.is_loopback]
