"""The inbox between the receiving thread and callers."""

import pytest

from shapechanger.errors import LinkError, RobotRefused, StaleObservation
from shapechanger.robot.client.connection import Inbox
from shapechanger.robot.link.messages import Observation
from tests.robot.client.robot import observation


def seen(seq: int, frame_seq: int = 0, frame: bytes | None = None) -> Observation:
    return observation(seq=seq, frame_seq=frame_seq, frame=frame)


def test_the_inbox_holds_only_the_newest_observation() -> None:
    inbox = Inbox(lambda: 5.0, 1.0)
    for seq in (1, 2, 3):
        inbox.put(seen(seq))
    found = inbox.observation(0, 0.0)
    assert (found.message.seq, found.received_at) == (3, 5.0)


def test_an_observation_is_returned_once() -> None:
    now = [10.0]
    inbox = Inbox(lambda: now[0], 1.0)
    inbox.put(seen(1))
    now[0] = 12.5
    with pytest.raises(StaleObservation, match=r"within 0.00 s \(the last is 2.50 s old\)"):
        inbox.observation(1, 0.0)
    with pytest.raises(StaleObservation, match="none ever"):
        Inbox(lambda: 0.0, 1.0).observation(0, 0.0)


def test_a_frame_outlives_its_observation() -> None:
    inbox = Inbox(lambda: 0.0, 1.0)
    inbox.put(seen(1, frame_seq=7, frame=b"seven"))
    inbox.put(seen(2, frame_seq=7))
    assert inbox.observation(0, 0.0).jpeg == b"seven"
    inbox.put(seen(3, frame_seq=8))
    assert inbox.observation(2, 0.0).jpeg is None


def test_the_first_failure_counts() -> None:
    inbox = Inbox(lambda: 0.0, 1.0)
    inbox.fail(RobotRefused("First."))
    inbox.fail(LinkError("Second."))
    with pytest.raises(RobotRefused, match="First"):
        inbox.observation(0, 0.0)


def test_an_old_observation_ends_the_link() -> None:
    inbox = Inbox(lambda: 0.0, 1.0)
    inbox.put(seen(10))
    for seq in (10, 5):
        with pytest.raises(LinkError, match="as in a replay"):
            inbox.put(seen(seq))
