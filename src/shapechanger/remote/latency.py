"""How late things are, from differences of times of one clock each."""

from __future__ import annotations

from typing import Final, Literal

from shapechanger.link.messages import Observation
from shapechanger.remote.inbox import Received

__all__ = ["frame_age_s", "latencies"]

_NS_PER_S: Final = 1e9


def latencies(
    answered: Observation,
    seq: int,
    sent_at: float,
    received: Received,
    clock: Literal["real", "twin"] = "real",
) -> dict[str, float]:
    """What can be said about the delays of a step, s; what cannot be measured is left out.

    Args:
        answered: The observation that the command was decided on.
        seq: Number of the command.
        sent_at: When it was sent, s of this machine's clock.
        received: The observation after it.
        clock: The robot's clock; a twin's seconds are not ours, so nothing is said of both.

    Returns:
        `capture_to_send`: from the picture to its departure, by the robot's clock. If the robot
        acted on this very command, also `round_trip`: on the way there and back, without the time
        that the robot had it; `observation_age_at_action`: how old the picture was that the command
        answers when the command arrived; `command_to_pin`: from its arrival to the outputs.
    """
    seen = received.message
    known = {"capture_to_send": (seen.sent_ns - seen.captured_ns) / _NS_PER_S}
    if seen.applied_seq != seq or not seen.mine:
        return known
    if seen.command_ns is not None:
        on_robot = (seen.sent_ns - seen.command_ns) / _NS_PER_S
        if clock == "real":
            known["round_trip"] = received.received_at - sent_at - on_robot
        known["observation_age_at_action"] = (seen.command_ns - answered.captured_ns) / _NS_PER_S
    if seen.command_ns is not None and seen.applied_ns is not None:
        known["command_to_pin"] = (seen.applied_ns - seen.command_ns) / _NS_PER_S
    return known


def frame_age_s(received: Received, now: float) -> float:
    """How old the picture of an observation is, s, without its time on the way.

    Args:
        received: The observation.
        now: This machine's clock, s.
    """
    seen = received.message
    return (seen.sent_ns - seen.captured_ns) / _NS_PER_S + now - received.received_at
