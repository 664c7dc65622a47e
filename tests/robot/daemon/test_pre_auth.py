"""Limits on connections before authentication."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.server import Listener

pytestmark = pytest.mark.realtime


_listener = partial(Listener, asyncio.Protocol, None)


@dataclass
class Fake:
    """A socket that counts how often it is dropped."""

    address: str
    is_gone: bool = False
    dropped: int = 0

    def drop(self) -> None:
        """Count the call."""
        self.dropped += 1


async def test_the_oldest_connection_of_a_crowded_address_is_dropped() -> None:
    connections = _listener(max_total=10, max_per_address=2)
    other, crowd = Fake("a"), [Fake("b") for _ in range(5)]
    for number, sock in enumerate([other, *crowd]):
        connections.add(number, sock)
    assert [sock.dropped for sock in crowd] == [1, 1, 1, 0, 0]
    assert other.dropped == 0


async def test_a_full_set_drops_from_the_most_crowded_address() -> None:
    connections = _listener(max_total=4, max_per_address=4)
    crowd, other = [Fake("b") for _ in range(4)], Fake("a")
    for number, sock in enumerate([*crowd, other]):
        connections.add(number, sock)
    assert [sock.dropped for sock in crowd] == [1, 0, 0, 0]
    connections.drop_one()
    assert [sock.dropped for sock in crowd] == [1, 1, 0, 0]
    assert other.dropped == 0


async def test_a_served_request_restarts_the_timeout() -> None:
    connections = _listener(max_total=2, max_per_address=2, timeout_s=0.05)
    page, silent = Fake("a"), Fake("a")
    for sock in (page, silent):
        connections.add(id(sock), sock)
    async with asyncio.timeout(20.0):
        while not silent.dropped:
            connections.renew(id(page))
            await asyncio.sleep(0.002)
    assert not page.dropped
    connections.add("next", Fake("a"))
    connections.renew(id(page))
    connections.add("newest", Fake("a"))
    assert not page.dropped
    connections.renew("gone")
    await connections.close()
    assert page.dropped == 1


async def test_a_silent_connection_is_dropped_after_the_timeout() -> None:
    connections = _listener(timeout_s=0.01)
    silent, asks, known = Fake("a"), Fake("a"), Fake("a")
    for sock in (silent, asks, known):
        connections.add(id(sock), sock)
    connections.stop_timer(id(asks))
    connections.remove(id(known))
    async with asyncio.timeout(20.0):
        while not silent.dropped:
            await asyncio.sleep(0.002)
    assert len(connections._waiting) == 1
    await connections.close()
    assert [sock.dropped for sock in (silent, asks, known)] == [1, 1, 0]


@given(
    arrivals=st.lists(st.tuples(st.sampled_from("abcd"), st.booleans()), max_size=40),
    max_total=st.integers(1, 6),
    max_per_address=st.integers(1, 4),
)
def test_a_new_connection_always_fits_and_the_limits_hold(
    arrivals: list[tuple[str, bool]], max_total: int, max_per_address: int
) -> None:
    async def play() -> None:
        connections = _listener(max_total, max_per_address)
        sockets: list[Fake] = []
        for number, (address, goes) in enumerate(arrivals):
            here = [v for v in sockets if not v.dropped and not v.is_gone]
            sock = Fake(address)
            connections.add(number, sock)
            sockets.append(sock)
            left = [v for v in here if v.dropped]
            same = [v for v in here if v.address == address]
            assert not sock.dropped
            assert len(left) == (len(here) >= max_total or len(same) >= max_per_address)
            assert len(connections._waiting) <= max_total
            assert all(v.dropped <= 1 for v in sockets)
            sock.is_gone = goes
        await connections.close()
        assert len(connections._waiting) == 0

    asyncio.run(play())
