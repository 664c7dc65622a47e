"""The one slot between the thread that receives and the one that decides."""

from __future__ import annotations

import threading

import pytest

from shapechanger.errors import LinkError, RobotRefused, StaleObservation
from shapechanger.link.messages import Observation
from shapechanger.remote.inbox import Inbox


def seen(seq: int, frame_seq: int = 0, frame: bytes | None = None) -> Observation:
    """An observation of which only the number and the picture matter."""
    return Observation(
        seq=seq,
        captured_ns=0,
        state_ns=0,
        sent_ns=0,
        frame=frame,
        frame_seq=frame_seq,
        state=(),
        sources={},
        action_applied=(),
        applied_seq=None,
        applied_ns=None,
        command_ns=None,
        stop_reason="",
        armed=False,
        emergency=False,
        emergencies=0,
        holder="",
        mine=False,
    )


def test_only_the_newest_is_there() -> None:
    """Who is slow skips what is old."""
    inbox = Inbox(lambda: 5.0)
    for seq in (1, 2, 3):
        inbox.put(seen(seq))
    found = inbox.take(0, 0.0)
    assert (found.message.seq, found.received_at) == (3, 5.0)


def test_an_old_one_is_never_new() -> None:
    """What was seen is not served again; the error says how old the newest is."""
    now = [10.0]
    inbox = Inbox(lambda: now[0])
    inbox.put(seen(1))
    now[0] = 12.5
    assert inbox.wait(1, 0.0) is None
    with pytest.raises(StaleObservation, match=r"within 0.00 s \(the last is 2.50 s old\)"):
        inbox.take(1, 0.0)
    with pytest.raises(StaleObservation, match="none ever"):
        Inbox(lambda: 0.0).take(0, 0.0)


@pytest.mark.parametrize("seq", [1, 2])
def test_nothing_is_replayed(seq: int) -> None:
    """A number that is not larger ends the link."""
    inbox = Inbox(lambda: 0.0)
    inbox.put(seen(2))
    with pytest.raises(LinkError, match="as in a replay"):
        inbox.put(seen(seq))


def test_a_picture_survives_the_observation_that_brought_it() -> None:
    """Each picture is sent once, and the slot holds only the last observation."""
    inbox = Inbox(lambda: 0.0)
    inbox.put(seen(1, frame_seq=7, frame=b"seven"))
    inbox.put(seen(2, frame_seq=7))
    assert inbox.take(0, 0.0).jpeg == b"seven"
    inbox.put(seen(3, frame_seq=8))
    assert inbox.take(2, 0.0).jpeg is None


def test_who_waits_learns_of_the_end_at_once() -> None:
    """And everybody later gets the same reason, as an error of their own."""
    inbox = Inbox(lambda: 0.0)
    errors: list[LinkError] = []

    def wait() -> None:
        try:
            inbox.take(0, 60.0)
        except LinkError as error:
            errors.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    inbox.fail(RobotRefused("First."))
    inbox.fail(LinkError("Second."))
    thread.join(10.0)
    with pytest.raises(RobotRefused, match="First"):
        inbox.take(0, 0.0)
    assert [str(error) for error in errors] == ["First."]
