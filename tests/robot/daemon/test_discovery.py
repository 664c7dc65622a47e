"""Announcement on the local network."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import pytest

from shapechanger.robot.daemon import discovery
from shapechanger.robot.daemon.discovery import announce, withdraw
from shapechanger.robot.link.address import SERVICE
from tests.robot.daemon.plans import car_plan


class FakeZeroconf:
    """Records announced services."""

    def __init__(self) -> None:
        self.announced: list[Any] = []
        self.closed = False

    async def async_register_service(self, info: Any, allow_name_change: bool) -> None:
        self.announced.append(info)

    async def async_unregister_all_services(self) -> None:
        self.announced.clear()

    async def async_close(self) -> None:
        """Record the call."""
        self.closed = True


def test_the_announcement_describes_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeZeroconf()
    monkeypatch.setattr(discovery, "AsyncZeroconf", lambda: fake)

    async def play() -> None:
        plan = car_plan(robot="New Bright v1.0", host="192.0.2.7")
        zeroconf = await announce(plan, 5001, b"\xab" * 32)
        assert zeroconf is fake
        (info,) = fake.announced
        assert info.type == SERVICE
        assert info.name == f"New Bright v1 0.{SERVICE}"
        assert (info.port, info.parsed_addresses()) == (5001, ["192.0.2.7"])
        assert info.properties == {
            b"id": b"New Bright v1.0",
            b"body": b"car",
            b"v": b"1",
            b"fp": b"ab" * 32,
        }
        await withdraw(zeroconf)
        assert fake.closed

    asyncio.run(play())


def test_a_failed_announcement_is_only_a_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> None:
        raise OSError("Network is unreachable")

    monkeypatch.setattr(discovery, "AsyncZeroconf", broken)
    with caplog.at_level(logging.WARNING):
        assert not asyncio.run(announce(car_plan(), 5001, b""))
    assert "cannot be announced" in caplog.text
    assert "Network is unreachable" in caplog.text
