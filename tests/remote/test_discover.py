"""Robots that announce themselves, on loopback."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from zeroconf import ServiceInfo, Zeroconf

from shapechanger.link.address import Address
from shapechanger.remote import discovery as discover
from shapechanger.remote.discovery import SERVICE, FoundRobot, find
from shapechanger.robot.daemon import discovery


@pytest.fixture
def network() -> Iterator[Zeroconf]:
    """Multicast that stays on this machine."""
    try:
        network = Zeroconf(interfaces=["127.0.0.1"])
    except OSError as error:
        pytest.skip(f"This machine has no multicast: {error}.")
    yield network
    network.close()


def test_a_robot_is_found_with_what_it_says(network: Zeroconf) -> None:
    """Its name, body, address, fingerprint and version; by name."""
    for name, body, port in (("tank", "tank", 5001), ("car", "car", 5000)):
        network.register_service(
            ServiceInfo(
                SERVICE,
                f"{name}.{SERVICE}",
                port=port,
                addresses=[bytes((127, 0, 0, 1))],
                properties={"id": name, "body": body, "v": "1", "fp": "ab" * 32},
                server="tests.local.",
            )
        )
    assert find(1.0, network) == [
        FoundRobot("car", "car", Address("127.0.0.1", 5000), "ab" * 32, "1"),
        FoundRobot("tank", "tank", Address("127.0.0.1", 5001), "ab" * 32, "1"),
    ]


def test_nobody_there_is_no_error(network: Zeroconf) -> None:
    """Networks may block this; the list is then empty."""
    assert find(0.1, network) == []


def test_both_sides_use_the_same_name() -> None:
    """The robot announces what the workstation looks for."""
    assert discover.SERVICE == discovery.SERVICE
