"""Clients: their lease of control, their limits, and the messages that wait for them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.client import Client, ControlLease, MessageRate, SentObservations
from shapechanger.robot.link.messages import Event, Lease, Pong

ANN = Client(1, "Ann", "person")
BOB = Client(2, "Bob", "person")
SAC = Client(3, "sac")
PPO = Client(4, "ppo")
ALL = (ANN, BOB, SAC, PPO)
MS = 1_000_000


def held_by(client: Client) -> ControlLease:
    """Return a lease that a client has taken."""
    lease = ControlLease()
    assert lease.refusal(client) == ""
    assert lease.take(client) is None
    return lease


def test_a_person_takes_control_from_a_program_at_once() -> None:
    lease = held_by(SAC)
    assert lease.refusal(ANN) == ""
    assert lease.take(ANN) is SAC
    assert lease.holder is ANN


@pytest.mark.parametrize(
    ("holder", "other"), [(ANN, SAC), (ANN, BOB), (SAC, PPO)], ids=lambda client: client.name
)
def test_no_other_client_takes_control(holder: Client, other: Client) -> None:
    refusal = held_by(holder).refusal(other)
    assert refusal.startswith(f"{holder.name} has control")
    assert other.role in refusal


def test_taking_control_twice_changes_nothing() -> None:
    lease = held_by(SAC)
    assert lease.take(SAC) is None
    assert lease.number == 1


@given(
    moves=st.lists(
        st.tuples(st.sampled_from(("take", "release")), st.sampled_from(ALL)), max_size=50
    )
)
def test_there_is_one_holder_and_numbers_only_rise(moves: list[tuple[str, Client]]) -> None:
    lease = ControlLease()
    holder: Client | None = None
    of_number: dict[int, Client] = {}
    for move, client in moves:
        before = lease.number
        if move == "release":
            holder = lease.holder = None if holder is client else holder
        elif not lease.refusal(client):
            from_program = holder is not None and holder.role == "program"
            assert holder in (None, client) or (from_program and client.role == "person")
            lease.take(client)
            holder = client
        assert lease.holder == holder
        assert lease.number >= before
        if holder is not None:
            assert of_number.setdefault(lease.number, holder) == holder


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


def drained(client: Client) -> list[object]:
    """Take all messages, in order."""
    return list(iter(client.take, None))


def test_a_client_keeps_only_the_newest_lease() -> None:
    client = Client(1)
    client.post(Lease(mine=True, holder="a"))
    client.post(Pong(token=1, now_ns=0))
    client.post(Lease(mine=False, holder="b"))
    assert drained(client) == [Pong(token=1, now_ns=0), Lease(mine=False, holder="b")]


def test_a_client_keeps_the_newest_events() -> None:
    client = Client(1)
    for number in range(1_000):
        client.post(Event(name="bump", text=str(number), at_ns=number))
    assert [event.at_ns for event in drained(client)] == list(range(968, 1_000))


def test_too_many_unread_answers_do_not_fit() -> None:
    client = Client(1)
    for number in range(256):
        client.post(Pong(token=number, now_ns=0))
    assert not client.is_full
    client.post(Pong(token=256, now_ns=0))
    assert client.is_full
    client.post(Event(name="bump", text="", at_ns=0))
    assert len(drained(client)) == 257


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
