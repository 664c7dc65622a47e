"""The inbox between the receiving thread and callers, and the time at which a step begins."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError, RobotRefused, StaleObservation
from shapechanger.robot.client.connection import Inbox
from shapechanger.robot.client.env import LATE, next_tick
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


def test_without_a_newer_observation_the_error_states_the_age() -> None:
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


def test_the_first_failure_is_raised() -> None:
    inbox = Inbox(lambda: 0.0, 1.0)
    inbox.fail(RobotRefused("First."))
    inbox.fail(LinkError("Second."))
    with pytest.raises(RobotRefused, match="First"):
        inbox.observation(0, 0.0)


def test_an_old_observation_ends_the_link() -> None:
    inbox = Inbox(lambda: 0.0, 1.0)
    inbox.put(seen(10))
    for seq in (10, 5):
        with pytest.raises(LinkError, match=": a replay"):
            inbox.put(seen(seq))


PERIOD = 0.05


@given(late=st.lists(st.floats(0.0, 0.99 * LATE * PERIOD), min_size=1, max_size=100))
def test_steps_that_end_a_little_late_keep_the_rate(late: list[float]) -> None:
    now = begins = 100.0
    for each in late:
        end, arrived_at = begins + PERIOD, now
        now = max(now, end) + each
        begins, missed = next_tick(end, PERIOD, arrived_at, now)
        assert not missed
    assert abs(begins - 100.0 - len(late) * PERIOD) < 1e-9


@given(slower=st.floats(1.0, 1.0 + 0.9 * LATE), steps=st.integers(1, 200))
def test_steps_follow_a_robot_whose_clock_is_slower(slower: float, steps: int) -> None:
    now = begins = 100.0
    for i in range(1, steps + 1):
        arrived_at = 100.0 + i * slower * PERIOD
        now = max(begins + PERIOD, arrived_at)
        begins, missed = next_tick(begins + PERIOD, PERIOD, arrived_at, now)
        assert not missed
    assert abs(now - 100.0 - steps * slower * PERIOD) < 1e-9


def test_a_late_step_is_counted_and_not_compensated() -> None:
    assert next_tick(100.0, PERIOD, 102.7, 103.7) == (103.7, True)
