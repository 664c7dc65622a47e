"""Announcement of robots, and their discovery on loopback."""

import asyncio
import logging
from collections.abc import Iterator
from typing import Any

import pytest
from zeroconf import Zeroconf

from shapechanger.robot import discovery
from shapechanger.robot.discovery import FoundRobot, announce, find, withdraw
from shapechanger.robot.link.address import SERVICE, Address
from tests.robot.daemon.plans import car_plan


@pytest.fixture
def network() -> Iterator[Zeroconf]:
    """Multicast restricted to this machine."""
    try:
        network = Zeroconf(interfaces=["127.0.0.1"])
    except OSError as error:
        pytest.skip(f"This machine has no multicast: {error}.")
    yield network
    network.close()


class _Announced:
    def __init__(self) -> None:
        self.services: list[Any] = []
        self.closed = False

    async def async_register_service(self, info: Any, allow_name_change: bool) -> None:
        self.services.append(info)

    async def async_unregister_all_services(self) -> None:
        self.services.clear()

    async def async_close(self) -> None:
        self.closed = True


def test_announced_robots_are_found(network: Zeroconf, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dots in a name are replaced, because a dot would start another label."""
    assert find(0.1, network) == []
    fake = _Announced()
    monkeypatch.setattr(discovery, "AsyncZeroconf", lambda: fake)

    async def play() -> None:
        for name, port in (("tank", 5001), ("New Bright v1.0", 5000)):
            card = car_plan(robot=name).card
            zeroconf = await announce(card, "127.0.0.1", port, b"\xab" * 32)
            assert zeroconf is fake
        for service in fake.services:
            network.register_service(service)
        assert [service.name for service in fake.services] == [
            f"tank.{SERVICE}",
            f"New Bright v1 0.{SERVICE}",
        ]
        await withdraw(fake)  # pyright: ignore[reportArgumentType]
        assert fake.closed

    asyncio.run(play())
    address = Address("127.0.0.1", 5000)
    assert find(1.0, network) == [
        FoundRobot("New Bright v1.0", "car", address, "ab" * 32, "1"),
        FoundRobot("tank", "car", Address("127.0.0.1", 5001), "ab" * 32, "1"),
    ]


def test_a_failed_announcement_is_only_a_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> None:
        raise OSError("Network is unreachable")

    monkeypatch.setattr(discovery, "AsyncZeroconf", broken)
    with caplog.at_level(logging.WARNING):
        assert not asyncio.run(announce(car_plan().card, "127.0.0.1", 5001, b""))
    assert "cannot be announced" in caplog.text
    assert "Network is unreachable" in caplog.text
