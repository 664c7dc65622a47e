"""The control period: when the next step begins."""

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.client.env import LATE, next_tick

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
def test_a_robot_whose_clock_is_slower_is_followed(slower: float, steps: int) -> None:
    now = begins = 100.0
    for i in range(1, steps + 1):
        arrived_at = 100.0 + i * slower * PERIOD
        now = max(begins + PERIOD, arrived_at)
        begins, missed = next_tick(begins + PERIOD, PERIOD, arrived_at, now)
        assert not missed
    assert abs(now - 100.0 - steps * slower * PERIOD) < 1e-9


def test_a_late_step_is_counted_and_not_compensated() -> None:
    assert next_tick(100.0, PERIOD, 102.7, 103.7) == (103.7, True)
