"""Who commands."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.control import ClientIdentity, ControlLease

ANN = ClientIdentity(1, "Ann", "person")
BOB = ClientIdentity(2, "Bob", "person")
SAC = ClientIdentity(3, "sac", "program")
PPO = ClientIdentity(4, "ppo", "program")
ALL = (ANN, BOB, SAC, PPO)


def held_by(who: ClientIdentity) -> ControlLease:
    """A desk whose lease is taken."""
    desk = ControlLease()
    assert desk.refusal(who) == ""
    assert desk.take(who) is None
    return desk


def test_a_person_takes_the_command_from_a_program_at_once() -> None:
    """And whoever lost it is told."""
    desk = held_by(SAC)
    assert desk.refusal(ANN) == ""
    assert desk.take(ANN) == SAC
    assert desk.holds(1)
    assert not desk.holds(3)


@pytest.mark.parametrize(
    ("holder", "other"), [(ANN, SAC), (ANN, BOB), (SAC, PPO)], ids=lambda who: who.name
)
def test_nobody_else_takes_it(holder: ClientIdentity, other: ClientIdentity) -> None:
    """Not a program from a person, and not one from its equal; in words."""
    refusal = held_by(holder).refusal(other)
    assert refusal.startswith(f"{holder.name} commands")
    assert other.role in refusal


def test_taking_it_twice_changes_nothing() -> None:
    """Commands on their way stay those of the lease."""
    desk = held_by(SAC)
    assert desk.take(SAC) is None
    assert desk.number == 1


@given(
    moves=st.lists(
        st.tuples(st.sampled_from(("take", "give up")), st.sampled_from(ALL)), max_size=50
    )
)
def test_there_is_one_holder_and_numbers_only_rise(moves: list[tuple[str, ClientIdentity]]) -> None:
    """A model: a number stands for one holder's time, and a person is never pushed aside."""
    desk = ControlLease()
    holder: ClientIdentity | None = None
    of_number: dict[int, ClientIdentity] = {}
    for move, who in moves:
        before = desk.number
        if move == "give up":
            assert desk.give_up(who.session) == (holder == who)
            holder = None if holder == who else holder
        elif not desk.refusal(who):
            assert (
                holder is None
                or holder == who
                or (holder.role, who.role)
                == (
                    "program",
                    "person",
                )
            )
            desk.take(who)
            holder = who
        assert desk.holder == holder
        assert desk.number >= before
        if holder is not None:
            assert of_number.setdefault(desk.number, holder) == holder
