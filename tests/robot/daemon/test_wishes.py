"""The command that is in force, and what others would do: each only as long as it counts."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.control import ClientIdentity, PendingCommands

ADA, GRACE = ClientIdentity(1, "Ada", "person"), ClientIdentity(2, "Grace", "program")
MS = 1_000_000


@given(ttl_ms=st.integers(1, 1_000), age_ms=st.integers(0, 1_200))
def test_a_command_is_in_force_until_the_shorter_of_both_limits(ttl_ms: int, age_ms: int) -> None:
    """Its own time to live, and the robot's deadline."""
    wishes = PendingCommands(deadline_ms=250)
    wishes.command(ADA, (0.5,), ttl_ms, now_ns=0)
    assert wishes.commanded(age_ms * MS) == ((0.5,) if age_ms <= min(ttl_ms, 250) else ())


def test_what_is_taken_back_is_not_in_force() -> None:
    """Whatever its time to live was."""
    wishes = PendingCommands(deadline_ms=250)
    assert wishes.commanded(0) == ()
    wishes.command(ADA, (0.5,), 1_000, now_ns=0)
    wishes.end_command()
    assert wishes.commanded(0) == ()


def test_the_newest_suggestion_counts_until_it_is_old_or_its_sender_leaves() -> None:
    """That somebody else leaves changes nothing."""
    wishes = PendingCommands(deadline_ms=250)
    wishes.suggest(ADA, (0.1,), now_ns=0)
    wishes.suggest(GRACE, (0.2,), now_ns=10 * MS)
    wishes.forget(ADA.session)
    shown = wishes.suggested(260 * MS)
    assert shown is not None
    assert (shown.who, shown.values) == (GRACE, (0.2,))
    assert wishes.suggested(261 * MS) is None
    wishes.forget(GRACE.session)
    assert wishes.suggested(20 * MS) is None
