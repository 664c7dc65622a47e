"""What waits for a client, bounded."""

from __future__ import annotations

import pytest

from shapechanger.errors import LinkError
from shapechanger.link.messages import Event, Lease, Pong
from shapechanger.robot.daemon.limits import Outbox


def drained(outbox: Outbox) -> list[object]:
    """Everything in it, in order."""
    return [outbox.take() for _ in range(len(outbox))]


def test_only_the_newest_lease_waits() -> None:
    """Who commanded in between is of no use."""
    outbox = Outbox()
    outbox.put(Lease(mine=True, holder="a"))
    outbox.put(Pong(token=1, now_ns=0))
    outbox.put(Lease(mine=False, holder="b"))
    assert drained(outbox) == [Pong(token=1, now_ns=0), Lease(mine=False, holder="b")]


def test_the_newest_events_wait() -> None:
    """Thirty-two of them, in order."""
    outbox = Outbox()
    for number in range(1_000):
        outbox.put(Event(name="bump", text=str(number), at_ns=number))
    assert [event.at_ns for event in drained(outbox)] == list(range(968, 1_000))


def test_too_many_answers_end_it() -> None:
    """A client that asks and does not read is told so."""
    outbox = Outbox()
    for number in range(256):
        outbox.put(Pong(token=number, now_ns=0))
    with pytest.raises(LinkError, match="do not read"):
        outbox.put(Pong(token=256, now_ns=0))
    outbox.put(Event(name="bump", text="", at_ns=0))
    assert len(outbox) == 257
