"""Discovery of announced robots, on loopback."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from zeroconf import ServiceInfo, Zeroconf

from shapechanger.robot.client.discovery import FoundRobot, find
from shapechanger.robot.link.address import SERVICE, Address


@pytest.fixture
def network() -> Iterator[Zeroconf]:
    """Multicast restricted to this machine."""
    try:
        network = Zeroconf(interfaces=["127.0.0.1"])
    except OSError as error:
        pytest.skip(f"This machine has no multicast: {error}.")
    yield network
    network.close()


def test_announced_robots_are_found(network: Zeroconf) -> None:
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


def test_an_empty_network_gives_an_empty_list(network: Zeroconf) -> None:
    assert find(0.1, network) == []
