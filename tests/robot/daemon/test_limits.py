"""How much a client may ask."""

from __future__ import annotations

from shapechanger.robot.daemon.limits import MessageRate, WrongKeys


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


def test_the_sixth_wrong_key_within_a_minute_waits() -> None:
    """For each address on its own."""
    clock = Seconds()
    keys = WrongKeys(clock)
    for second in range(5):
        assert keys.wait_s("10.0.0.1") == 0.0
        clock.now = float(second)
        keys.add("10.0.0.1")
    assert keys.wait_s("10.0.0.1") == 56.0
    assert keys.wait_s("10.0.0.2") == 0.0
    clock.now = 60.0
    assert keys.wait_s("10.0.0.1") == 0.0


def test_the_list_of_addresses_is_bounded() -> None:
    """Whoever has a million addresses does not fill the robot's memory."""
    keys = WrongKeys(Seconds())
    for number in range(3_000):
        for _ in range(5):
            keys.add(f"address {number}")
    assert keys.wait_s("address 0") == 0.0
    assert keys.wait_s("address 2999") > 0.0
