"""Control lease and pending commands."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.control import ClientIdentity, ControlLease, PendingCommands

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
    """The program that lost the lease is returned."""
    lease = held_by(SAC)
    assert lease.refusal(ANN) == ""
    assert lease.take(ANN) == SAC
    assert lease.holds(1)
    assert not lease.holds(3)


@pytest.mark.parametrize(
    ("holder", "other"), [(ANN, SAC), (ANN, BOB), (SAC, PPO)], ids=lambda client: client.name
)
def test_no_other_client_takes_control(holder: ClientIdentity, other: ClientIdentity) -> None:
    """A program cannot take it from a person, nor any client from one of its own role."""
    refusal = held_by(holder).refusal(other)
    assert refusal.startswith(f"{holder.name} has control")
    assert other.role in refusal


def test_taking_control_twice_changes_nothing() -> None:
    """Commands on their way still belong to the lease."""
    lease = held_by(SAC)
    assert lease.take(SAC) is None
    assert lease.number == 1


@given(
    moves=st.lists(
        st.tuples(st.sampled_from(("take", "release")), st.sampled_from(ALL)), max_size=50
    )
)
def test_there_is_one_holder_and_numbers_only_rise(moves: list[tuple[str, ClientIdentity]]) -> None:
    """Each number belongs to one holder, and no person loses control to another client."""
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
    """The limits are its own time to live and the robot's deadline."""
    pending = PendingCommands(deadline_ms=250)
    pending.command(ANN, (0.5,), ttl_ms, now_ns=0)
    assert pending.commanded(age_ms * MS) == ((0.5,) if age_ms <= min(ttl_ms, 250) else ())


def test_a_cleared_command_is_gone() -> None:
    """Its time to live does not matter."""
    pending = PendingCommands(deadline_ms=250)
    assert pending.commanded(0) == ()
    pending.command(ANN, (0.5,), 1_000, now_ns=0)
    pending.clear_command()
    assert pending.commanded(0) == ()


def test_the_newest_suggestion_counts_until_it_expires_or_its_sender_leaves() -> None:
    """The departure of another client changes nothing."""
    pending = PendingCommands(deadline_ms=250)
    pending.suggest(ANN, (0.1,), now_ns=0)
    pending.suggest(SAC, (0.2,), now_ns=10 * MS)
    pending.forget(ANN.session)
    shown = pending.suggested(260 * MS)
    assert shown is not None
    assert (shown.client, shown.values) == (SAC, (0.2,))
    assert pending.suggested(261 * MS) is None
    pending.forget(SAC.session)
    assert pending.suggested(20 * MS) is None
