"""Control lease, and expiry of commands and suggestions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.control import ClientIdentity, ControlLease
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.link.messages import Command
from tests.robot.daemon.plans import car_plan, guard_state

ANN = ClientIdentity(1, "Ann", "person")
BOB = ClientIdentity(2, "Bob", "person")
SAC = ClientIdentity(3, "sac", "program")
PPO = ClientIdentity(4, "ppo", "program")
ALL = (ANN, BOB, SAC, PPO)
MS = 1_000_000


def held_by(client: ClientIdentity) -> ControlLease:
    """Return a lease that a client has taken."""
    lease = ControlLease()
    assert lease.refusal(client) == ""
    assert lease.take(client) is None
    return lease


def test_a_person_takes_control_from_a_program_at_once() -> None:
    lease = held_by(SAC)
    assert lease.refusal(ANN) == ""
    assert lease.take(ANN) == SAC
    assert lease.holds(1)
    assert not lease.holds(3)


@pytest.mark.parametrize(
    ("holder", "other"), [(ANN, SAC), (ANN, BOB), (SAC, PPO)], ids=lambda client: client.name
)
def test_no_other_client_takes_control(holder: ClientIdentity, other: ClientIdentity) -> None:
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
def test_there_is_one_holder_and_numbers_only_rise(moves: list[tuple[str, ClientIdentity]]) -> None:
    lease = ControlLease()
    holder: ClientIdentity | None = None
    of_number: dict[int, ClientIdentity] = {}
    for move, client in moves:
        before = lease.number
        if move == "release":
            assert lease.release(client.session) == (holder == client)
            holder = None if holder == client else holder
        elif not lease.refusal(client):
            from_program = holder is not None and holder.role == "program"
            assert holder in (None, client) or (from_program and client.role == "person")
            lease.take(client)
            holder = client
        assert lease.holder == holder
        assert lease.number >= before
        if holder is not None:
            assert of_number.setdefault(lease.number, holder) == holder


@given(ttl_ms=st.integers(1, 1_000), age_ms=st.integers(0, 1_200))
def test_a_command_expires_at_the_shorter_of_both_limits(ttl_ms: int, age_ms: int) -> None:
    now_ns = 0
    hub = SessionHub(car_plan(deadline_ms=250), lambda: now_ns, lambda order: None)
    assert hub.commanded() == ()
    hub.on_state(guard_state(armed=True))
    hub.lease.take(ANN)
    hub.command(ANN, Command(seq=1, answers=1, values=(0.0, 0.5), ttl_ms=ttl_ms), now_ns)
    now_ns = age_ms * MS
    assert hub.commanded() == ((0.0, 0.5) if age_ms <= min(ttl_ms, 250) else ())
    now_ns = 0
    hub.halt()
    assert hub.commanded() == ()


def test_the_newest_suggestion_counts_until_it_expires() -> None:
    now_ns = 0
    hub = SessionHub(car_plan(deadline_ms=250), lambda: now_ns, lambda order: None)
    assert hub.suggested() is None
    hub.suggest(ANN, (0.1, 0.0))
    now_ns = 10 * MS
    hub.suggest(SAC, (0.2, 0.0))
    now_ns = 260 * MS
    shown = hub.suggested()
    assert shown is not None
    assert (shown.client, shown.values) == (SAC, (0.2, 0.0))
    now_ns = 260 * MS + 1
    assert hub.suggested() is None
