"""How much a client may say."""

from __future__ import annotations

from shapechanger.robot.daemon.limits import MessageRate


class Seconds:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """The time."""
        return self.now


def test_one_second_of_messages_may_come_at_once_and_no_more() -> None:
    """Then as many as time brings."""
    clock = Seconds()
    rate = MessageRate(10.0, clock)
    assert [rate.spend() for _ in range(11)] == [True] * 10 + [False]
    clock.now = 0.25
    assert [rate.spend() for _ in range(3)] == [True, True, False]
    rate.give_back()
    assert rate.spend()
    assert not rate.spend()
