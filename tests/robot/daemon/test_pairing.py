"""Observations and the commands that answer them become steps, in order and once each."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.link.messages import Observation
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.control import ClientIdentity
from shapechanger.robot.daemon.observation import NumberedFrame
from shapechanger.robot.daemon.recorder import StepBuilder, StepWithFrame

ADA, NET = ClientIdentity(1, "Ada", "person"), ClientIdentity(2, "net", "program")


def seen(seq: int, at_ns: int, **changes: Any) -> Observation:
    """What a client is sent."""
    fields: dict[str, Any] = {
        "seq": seq,
        "captured_ns": at_ns,
        "state_ns": at_ns,
        "sent_ns": at_ns,
        "frame": None,
        "frame_seq": 0,
        "state": (float(at_ns),),
        "sources": {},
        "action_applied": (0.25,),
        "applied_seq": None,
        "applied_ns": None,
        "command_ns": None,
        "stop_reason": "",
        "armed": True,
        "emergency": False,
        "emergencies": 0,
        "holder": "",
        "mine": True,
    }
    return Observation(**(fields | changes))


def frame(seq: int) -> NumberedFrame:
    """A picture that tells its number."""
    return NumberedFrame(seq, Frame(b"jpeg %d" % seq, seq))


def test_what_the_outputs_did_comes_with_the_next_observation() -> None:
    """And why they did not do what they were told."""
    pairing = StepBuilder(lambda: 7)
    assert pairing.observed(1, seen(1, 100, suggested=(0.9,)), frame(1)) is None
    assert pairing.decided(ADA, 1, (0.5,), 110) is None
    done = pairing.observed(1, seen(2, 120, stop_reason="A bump."), frame(2))
    assert done is not None
    assert done.jpeg == b"jpeg 1"
    step = done.step
    assert (step.action, step.applied, step.wanted) == ((0.5,), (0.25,), (0.9,))
    assert (step.captured_ns, step.decided_ns, step.wall_ns) == (100, 110, 7)
    assert (step.driver, step.state, step.stop_reason) == ("person", (100.0,), "A bump.")
    assert pairing.complete() is None


def test_of_two_decisions_on_one_observation_the_later_one_counts() -> None:
    """A key that is let go at once."""
    pairing = StepBuilder()
    pairing.observed(1, seen(1, 100), None)
    pairing.decided(ADA, 1, (0.5,), 110)
    assert pairing.decided(ADA, 1, (0.0,), 115) is None
    done = pairing.complete()
    assert done is not None
    assert (done.step.action, done.step.decided_ns, done.step.applied) == ((0.0,), 115, None)


def test_what_answers_nothing_that_was_seen_is_no_step() -> None:
    """Such as something that was seen before recording began, or by somebody else."""
    pairing = StepBuilder()
    pairing.observed(1, seen(1, 100), None)
    for who, answers in ((ADA, 2), (NET, 1)):
        pairing.decided(who, answers, (0.5,), 110)
    pairing.forget(1)
    pairing.decided(ADA, 1, (0.5,), 110)
    assert pairing.complete() is None


def test_who_lost_the_command_does_not_tell_what_its_command_did() -> None:
    """By then the outputs follow somebody else."""
    pairing = StepBuilder()
    pairing.observed(2, seen(1, 100), None)
    pairing.decided(NET, 1, (0.5,), 110)
    done = pairing.observed(2, seen(2, 120, mine=False), None)
    assert done is not None
    assert done.step.applied is None


@given(
    said=st.lists(
        st.tuples(st.booleans(), st.sampled_from((ADA, NET)), st.integers(0, 4)), max_size=60
    )
)
def test_time_never_runs_backwards_and_no_picture_is_given_twice(
    said: list[tuple[bool, ClientIdentity, int]],
) -> None:
    """Whatever is answered, by whom, and however late."""
    pairing = StepBuilder()
    steps: list[StepWithFrame | None] = []
    newest = {ADA.session: 0, NET.session: 0}
    for now_ns, (looks, who, back) in enumerate(said):
        if looks:
            newest[who.session] += 1
            picture = frame(1 + now_ns // 3)  # Each picture is seen a few times.
            sent = seen(newest[who.session], picture.seq)
            steps.append(pairing.observed(who.session, sent, picture))
        else:
            steps.append(pairing.decided(who, newest[who.session] - back, (0.5,), now_ns))
    steps.append(pairing.complete())
    made = [step for step in steps if step is not None]
    for times in ("captured_ns", "decided_ns"):
        found = [getattr(one.step, times) for one in made]
        assert found == sorted(found)
    pictures = [one.jpeg for one in made if one.jpeg is not None]
    assert len(pictures) == len(set(pictures))
    shown = b""
    for one in made:
        shown = one.jpeg or shown
        assert shown == b"jpeg %d" % one.step.captured_ns  # Its own, or the one before it.
