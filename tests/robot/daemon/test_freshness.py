"""Which observation a command answers, and how old that is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.limits import SentObservations

MS = 1_000_000


def test_an_observation_is_fresh_up_to_its_age() -> None:
    """To the nanosecond."""
    sent = SentObservations(400)
    sent.add(1, 1_000)
    assert sent.refusal(1, 1_000 + 400 * MS) == ""
    assert "400 ms" in sent.refusal(1, 1_000 + 400 * MS + 1)


def test_what_was_not_sent_is_not_answered() -> None:
    """Nor what was sent to another client, which has its own numbers."""
    assert "not sent to this client" in SentObservations(400).refusal(0, 0)


@given(gaps=st.lists(st.integers(0, 200 * MS), min_size=1, max_size=40), answers=st.integers(0, 45))
def test_it_agrees_with_a_list_that_forgets_nothing(gaps: list[int], answers: int) -> None:
    """A bounded memory refuses at most what is refused anyway, or older than its window."""
    sent, times, now = SentObservations(400, window=8), dict[int, int](), 0
    for seq, gap in enumerate(gaps, start=1):
        now += gap
        sent.add(seq, now)
        times[seq] = now
    fresh = answers in times and now - times[answers] <= 400 * MS and answers > len(gaps) - 8
    assert (sent.refusal(answers, now) == "") == fresh
