"""The place before the door: whoever comes finds a place, and whoever waits loses it in time."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.pre_auth import PreAuthConnections


@dataclass
class Fake:
    """Somebody at the door."""

    address: str
    is_gone: bool = False
    dropped: int = 0

    def drop(self) -> None:
        """Be ended."""
        self.dropped += 1


def test_the_oldest_of_an_address_with_too_many_makes_room() -> None:
    """And nobody of another address."""

    async def play() -> None:
        doorstep = PreAuthConnections(most=10, most_of_one=2)
        friend, crowd = Fake("a"), [Fake("b") for _ in range(5)]
        for number, visitor in enumerate([friend, *crowd]):
            doorstep.enter(number, visitor)
        assert [visitor.dropped for visitor in crowd] == [1, 1, 1, 0, 0]
        assert friend.dropped == 0

    asyncio.run(play())


def test_a_crowd_of_one_address_costs_only_itself() -> None:
    """However late the others come."""

    async def play() -> None:
        doorstep = PreAuthConnections(most=4, most_of_one=4)
        crowd, friend = [Fake("b") for _ in range(4)], Fake("a")
        for number, visitor in enumerate([*crowd, friend]):
            doorstep.enter(number, visitor)
        assert [visitor.dropped for visitor in crowd] == [1, 0, 0, 0]
        doorstep.drop_one()
        assert [visitor.dropped for visitor in crowd] == [1, 1, 0, 0]
        assert friend.dropped == 0

    asyncio.run(play())


def test_who_was_given_something_waits_anew() -> None:
    """A page comes in many parts, and its sockets must not be dropped between two of them."""

    async def play() -> None:
        doorstep = PreAuthConnections(most=2, most_of_one=2, patience_s=0.05)
        page, silent = Fake("a"), Fake("a")
        for visitor in (page, silent):
            doorstep.enter(id(visitor), visitor)
        async with asyncio.timeout(20.0):
            while not silent.dropped:
                doorstep.renew(id(page))
                await asyncio.sleep(0.002)
        assert not page.dropped
        doorstep.enter("next", Fake("a"))
        doorstep.renew(id(page))
        doorstep.enter("newest", Fake("a"))
        assert not page.dropped
        doorstep.renew("gone")
        doorstep.close()
        assert page.dropped == 1

    asyncio.run(play())


def test_who_asks_for_nothing_is_dropped_in_time() -> None:
    """And who asked, or has shown the key, or has gone, is not."""

    async def play() -> None:
        doorstep = PreAuthConnections(patience_s=0.01)
        silent, asks, known = Fake("a"), Fake("a"), Fake("a")
        for visitor in (silent, asks, known):
            doorstep.enter(id(visitor), visitor)
        doorstep.keep(id(asks))
        doorstep.leave(id(known))
        async with asyncio.timeout(20.0):
            while not silent.dropped:
                await asyncio.sleep(0.002)
        assert len(doorstep) == 1
        doorstep.close()
        assert [visitor.dropped for visitor in (silent, asks, known)] == [1, 1, 0]

    asyncio.run(play())


@given(
    arrivals=st.lists(st.tuples(st.sampled_from("abcd"), st.booleans()), max_size=40),
    most=st.integers(1, 6),
    most_of_one=st.integers(1, 4),
)
def test_there_is_always_a_place_and_never_too_many(
    arrivals: list[tuple[str, bool]], most: int, most_of_one: int
) -> None:
    """Whoever comes stays until somebody else comes; who is gone costs nobody a place."""

    async def play() -> None:
        doorstep = PreAuthConnections(most, most_of_one)
        visitors: list[Fake] = []
        for number, (address, goes) in enumerate(arrivals):
            here = [v for v in visitors if not v.dropped and not v.is_gone]
            visitor = Fake(address)
            doorstep.enter(number, visitor)
            visitors.append(visitor)
            left = [v for v in here if v.dropped]
            same = [v for v in here if v.address == address]
            assert not visitor.dropped
            assert len(left) == (len(here) >= most or len(same) >= most_of_one)
            assert len(doorstep) <= most
            assert all(v.dropped <= 1 for v in visitors)
            visitor.is_gone = goes
        doorstep.close()
        assert len(doorstep) == 0

    asyncio.run(play())
