"""The control period, on a clock set by the test."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.client.env import LATE, Schedule

PERIOD = 0.05


class Clock:
    """A clock set by the test."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        """Return the time, s."""
        return self.now


@given(late=st.lists(st.floats(0.0, 0.99 * LATE * PERIOD), min_size=1, max_size=100))
def test_steps_that_end_a_little_late_keep_the_rate(late: list[float]) -> None:
    clock = Clock()
    schedule = Schedule(PERIOD, clock)
    for each in late:
        arrived_at = clock.now
        clock.now += schedule.left_s + each
        assert not schedule.advance(arrived_at)
    assert abs(clock.now - 100.0 - len(late) * PERIOD - late[-1]) < 1e-9


@given(slower=st.floats(1.0, 1.0 + 0.9 * LATE), steps=st.integers(1, 200))
def test_a_robot_whose_clock_is_slower_is_followed(slower: float, steps: int) -> None:
    clock = Clock()
    schedule = Schedule(PERIOD, clock)
    for i in range(1, steps + 1):
        clock.now = max(clock.now + schedule.left_s, 100.0 + i * slower * PERIOD)
        assert not schedule.advance(100.0 + i * slower * PERIOD)
    assert abs(clock.now - 100.0 - steps * slower * PERIOD) < 1e-9


def test_a_late_step_is_counted_and_not_compensated() -> None:
    clock = Clock()
    schedule = Schedule(PERIOD, clock)
    clock.now += 3.7 * PERIOD
    assert schedule.advance(clock.now)
    assert schedule.left_s == pytest.approx(PERIOD)


def test_a_schedule_starts_with_the_first_step() -> None:
    clock = Clock()
    schedule = Schedule(PERIOD, clock)
    clock.now += 60.0
    schedule.start()
    assert schedule.left_s == pytest.approx(PERIOD)
