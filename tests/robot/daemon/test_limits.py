"""Limits for one client: message rate, outbox, age of observations."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.session import MessageRate, Outbox, SentObservations
from shapechanger.robot.link.messages import Event, Lease, Pong

MS = 1_000_000


class Seconds:
    """A clock set by the test."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """Return the time, s."""
        return self.now


def test_the_message_rate_allows_one_second_of_messages_at_once() -> None:
    clock = Seconds()
    rate = MessageRate(10.0, clock)
    assert [rate.spend() for _ in range(11)] == [True] * 10 + [False]
    clock.now = 0.25
    assert [rate.spend() for _ in range(3)] == [True, True, False]
    rate.give_back()
    assert rate.spend()
    assert not rate.spend()


def drained(outbox: Outbox) -> list[object]:
    """Take all messages, in order."""
    return [outbox.take() for _ in range(len(outbox))]


def test_the_outbox_keeps_only_the_newest_lease() -> None:
    outbox = Outbox()
    outbox.put(Lease(mine=True, holder="a"))
    outbox.put(Pong(token=1, now_ns=0))
    outbox.put(Lease(mine=False, holder="b"))
    assert drained(outbox) == [Pong(token=1, now_ns=0), Lease(mine=False, holder="b")]


def test_the_outbox_keeps_the_newest_events() -> None:
    outbox = Outbox()
    for number in range(1_000):
        outbox.put(Event(name="bump", text=str(number), at_ns=number))
    assert [event.at_ns for event in drained(outbox)] == list(range(968, 1_000))


def test_too_many_unread_answers_do_not_fit() -> None:
    outbox = Outbox()
    for number in range(256):
        outbox.put(Pong(token=number, now_ns=0))
    assert not outbox.is_full
    outbox.put(Pong(token=256, now_ns=0))
    assert outbox.is_full
    outbox.put(Event(name="bump", text="", at_ns=0))
    assert len(outbox) == 257


def test_an_observation_may_be_answered_up_to_its_age_limit() -> None:
    sent = SentObservations(400)
    sent.add(1, 1_000)
    assert sent.refusal(1, 1_000 + 400 * MS) == ""
    assert "400 ms" in sent.refusal(1, 1_000 + 400 * MS + 1)


def test_an_observation_that_was_not_sent_cannot_be_answered() -> None:
    assert "not sent to this client" in SentObservations(400).refusal(0, 0)


@given(gaps=st.lists(st.integers(0, 200 * MS), min_size=1, max_size=40), answers=st.integers(0, 45))
def test_the_window_agrees_with_an_unbounded_list(gaps: list[int], answers: int) -> None:
    sent, times, now = SentObservations(400, window=8), dict[int, int](), 0
    for seq, gap in enumerate(gaps, start=1):
        now += gap
        sent.add(seq, now)
        times[seq] = now
    fresh = answers in times and now - times[answers] <= 400 * MS and answers > len(gaps) - 8
    assert (sent.refusal(answers, now) == "") == fresh
