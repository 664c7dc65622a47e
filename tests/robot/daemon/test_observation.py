"""Observations built for one client."""

from __future__ import annotations

import math
from typing import Any

from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.control import NumberedFrame, StateReader, build_observation
from tests.robot.daemon.plans import ACTIONS, STATE, guard_state

READER = StateReader(STATE, ACTIONS)


def observation(**changes: Any) -> Any:
    """Build an observation of a robot at rest."""
    fields: dict[str, Any] = {
        "seq": 7,
        "now_ns": 50,
        "reader": READER,
        "state": guard_state(at_ns=40),
        "newest": NumberedFrame(3, Frame(b"jpeg", 30)),
        "frame_sent": 0,
        "lease": 1,
        "command_ns": None,
        "holder": None,
        "mine": False,
    }
    return build_observation(**(fields | changes))


def test_an_absent_quantity_is_nan() -> None:
    seen = observation(state=guard_state(applied=(0.1, 0.5)))
    assert seen.state[0] == 0.25
    assert math.isnan(seen.state[1])
    assert seen.state[2] == 0.5
    assert seen.sources == {"speed": "wheel", "distance": "absent"}


def test_without_a_state_of_the_guard_all_is_unknown() -> None:
    seen = observation(state=None)
    assert all(map(math.isnan, seen.state))
    assert "guard" in seen.stop_reason
    assert not seen.armed
    assert seen.state_ns == 50


def test_a_frame_is_sent_once() -> None:
    assert observation().frame == b"jpeg"
    again = observation(frame_sent=3)
    assert (again.frame, again.frame_seq, again.captured_ns) == (None, 3, 30)


def test_a_client_may_decline_frames() -> None:
    seen = observation(frame_sent=None)
    assert (seen.frame, seen.captured_ns) == (None, 30)


def test_without_a_camera_the_time_is_that_of_the_state() -> None:
    seen = observation(newest=None)
    assert (seen.frame, seen.frame_seq, seen.captured_ns) == (None, 0, 40)


def test_a_command_of_an_earlier_lease_is_not_reported() -> None:
    state = guard_state(applied=(0.0, 0.5), applied_session=1, applied_seq=9, applied_ns=39)
    own = observation(state=state, command_ns=38)
    assert (own.applied_seq, own.applied_ns, own.command_ns) == (9, 39, 38)
    other = observation(state=state, command_ns=38, lease=2)
    assert (other.applied_seq, other.applied_ns, other.command_ns) == (None, None, None)
    assert other.action_applied == (0.0, 0.5)
