"""Limits on connections before authentication."""

import asyncio
from collections import Counter
from dataclasses import dataclass
from functools import partial
from unittest.mock import MagicMock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.server import Listener

pytestmark = pytest.mark.realtime


_listener = partial(Listener, MagicMock, None)


@dataclass(eq=False)
class Fake:
    """A socket that counts how often it is dropped."""

    address: str
    is_gone: bool = False
    dropped: int = 0

    def drop(self) -> None:
        self.dropped += 1


async def test_a_silent_connection_is_dropped_after_the_timeout() -> None:
    """A served request restarts the timeout; an open link ends it."""
    connections = _listener(max_total=4, max_per_address=2, timeout_s=0.05)
    page, silent, asking, known = (Fake(name) for name in "aabc")
    for sock in (page, silent, asking, known):
        connections.add(id(sock), sock)
    connections.stop_timer(id(asking))
    connections.remove(id(known))
    async with asyncio.timeout(20.0):
        while not silent.dropped:
            connections.renew(id(page))
            await asyncio.sleep(0.002)
    assert not page.dropped
    connections.add("next", Fake("a"))
    connections.renew(id(page))
    connections.add("newest", Fake("a"))
    connections.renew("gone")
    assert [sock.dropped for sock in (page, asking)] == [0, 0]
    await connections.close()
    assert [sock.dropped for sock in (page, silent, asking, known)] == [1, 1, 1, 0]


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
            same = [v for v in here if v.address == address]
            most = Counter(v.address for v in here).most_common(1)
            crowd = [v for v in here if v.address == most[0][0]] if most else []
            first = same[:1] if len(same) >= max_per_address else crowd[: len(here) >= max_total]
            # The dropped connection is the oldest of its address, or of the address with the most.
            assert [v for v in here if v.dropped] == first
            assert not sock.dropped
            assert len(connections._waiting) <= max_total
            assert all(v.dropped <= 1 for v in sockets)
            sock.is_gone = goes
        await connections.close()
        assert len(connections._waiting) == 0

    asyncio.run(play())
