"""Puts what was seen and what was decided on seeing it together, as the steps of an episode."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from shapechanger.demos.episodes import Step
from shapechanger.link.messages import Observation
from shapechanger.robot.daemon.lease import Holder
from shapechanger.robot.daemon.observation import NumberedFrame

__all__ = ["Pairing", "SeenStep"]

_WINDOW: Final = 64  # Observations of one client; a command answers one that is younger.


@dataclass(frozen=True, slots=True)
class SeenStep:
    """A step and its picture.

    Attributes:
        step: The step.
        jpeg: The picture; None for that of the step before, or without a camera.
    """

    step: Step
    jpeg: bytes | None


@dataclass(frozen=True, slots=True)
class _Seen:
    """What one client was sent.

    Attributes:
        observation: The observation.
        frame: The newest picture then, whether or not it was sent to this client just then.
    """

    observation: Observation
    frame: NumberedFrame | None


@dataclass(frozen=True, slots=True)
class _Decided:
    """A step of which nobody knows yet what the outputs did.

    Attributes:
        session: Number of the connection that decided it.
        seen: What it was decided on.
        step: The step so far.
    """

    session: int
    seen: _Seen
    step: Step


class Pairing:
    """Makes a step of each observation that is answered by a command.

    A step is complete with the next observation of the same client, which tells what the outputs
    did. Of two commands that answer the same observation the later one counts. A command that
    answers something older than the step before makes none: time never runs backwards in an
    episode.

    Args:
        wall_ns: Gives the Unix time.
    """

    def __init__(self, wall_ns: Callable[[], int] = time.time_ns) -> None:
        self._wall_ns = wall_ns
        self._seen: dict[int, deque[_Seen]] = {}
        self._decided: _Decided | None = None
        self._newest: _Decided | None = None
        self._frame_seq = 0

    def observed(
        self, session: int, observation: Observation, frame: NumberedFrame | None
    ) -> SeenStep | None:
        """A client is sent an observation.

        Args:
            session: Number of its connection.
            observation: What it is sent.
            frame: The newest picture.

        Returns:
            The step that this completes; None for none.
        """
        window = self._seen.setdefault(session, deque(maxlen=_WINDOW))
        window.append(_Seen(observation, frame))
        decided = self._decided
        if decided is None or decided.session != session:
            return None
        if observation.mine:
            self._decided = replace(
                decided,
                step=replace(
                    decided.step,
                    applied=observation.action_applied or None,
                    stop_reason=observation.stop_reason,
                ),
            )
        return self.complete()

    def decided(
        self, who: Holder, answers: int, action: tuple[float, ...], now_ns: int
    ) -> SeenStep | None:
        """A client has commanded.

        Args:
            who: Who it is.
            answers: `seq` of the observation that it was decided on.
            action: What was decided.
            now_ns: When it arrived, of the robot's time.

        Returns:
            The step before, which this completes; None for none.
        """
        window = self._seen.get(who.session, ())
        seen = next((s for s in reversed(window) if s.observation.seq == answers), None)
        if seen is None or self._is_past(who.session, seen):
            return None
        before = self._decided
        again = before is not None and before.session == who.session and before.seen is seen
        completed = None if again else self.complete()
        observation = seen.observation
        step = Step(
            action=action,
            driver=who.role,
            wanted=observation.suggested or None,
            state=observation.state,
            captured_ns=observation.captured_ns,
            decided_ns=now_ns,
            wall_ns=self._wall_ns(),
        )
        self._decided = self._newest = _Decided(who.session, seen, step)
        return completed

    def complete(self) -> SeenStep | None:
        """The step that waits for what the outputs did, with what is known of that."""
        decided, self._decided = self._decided, None
        if decided is None:
            return None
        frame, jpeg = decided.seen.frame, None
        if frame is not None and frame.seq != self._frame_seq:
            self._frame_seq, jpeg = frame.seq, frame.frame.jpeg
        return SeenStep(decided.step, jpeg)

    def forget(self, session: int) -> None:
        """A client has left."""
        self._seen.pop(session, None)

    def _is_past(self, session: int, seen: _Seen) -> bool:
        """Whether something was seen before what the newest step was decided on."""
        newest = self._newest
        if newest is None or newest.seen is seen:
            return False
        ours, theirs = seen.observation, newest.seen.observation
        if session == newest.session and ours.seq < theirs.seq:
            return True
        return ours.captured_ns < theirs.captured_ns
