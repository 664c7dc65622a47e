"""Records what is driven, as an episode on the robot's disk; it waits for nothing."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation, RecorderState, Refused, RobotMessage
from shapechanger.robot.daemon.lease import Holder
from shapechanger.robot.daemon.observation import NumberedFrame
from shapechanger.robot.daemon.pairing import Pairing, SeenStep
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.scribe import TOO_SLOW, Scribe

__all__ = ["Recorder"]

_log = logging.getLogger(__name__)

_CLOSED_WITHIN_S: Final = 5.0
_NOT_ON: Final = "Nothing is being recorded."

_Tell = Callable[[RobotMessage], None]


class Recorder:
    """Records one episode at a time, whoever commands meanwhile.

    Steps are recorded while the outputs may move; a robot that stands disarmed teaches nothing.

    Args:
        plan: What the robot is, and where its recordings are.
        tell: Tells everybody something.
        call: Runs a function in the thread of the connections; may be called from any thread.
    """

    def __init__(
        self, plan: DaemonPlan, tell: _Tell, call: Callable[[Callable[[], None]], None]
    ) -> None:
        self._plan = plan
        self._tell = tell
        self._call = call
        self._limits = _limits(Layout.from_json(plan.action_layout))
        self._scribe: Scribe | None = None
        self._pairing: Pairing | None = None
        self._text = ""

    @property
    def can_record(self) -> bool:
        """Whether there is a place to keep recordings."""
        return bool(self._plan.recordings)

    @property
    def on(self) -> bool:
        """Whether it records."""
        return self._pairing is not None

    @property
    def episode(self) -> str:
        """Id of the episode that is being recorded; empty for none, or none yet."""
        return self._scribe.progress.episode if self._scribe is not None and self.on else ""

    def state(self) -> RecorderState:
        """How it goes."""
        if self._scribe is None:
            return RecorderState(text=self._text)
        now = self._scribe.progress
        return RecorderState(
            episode=now.episode,
            recording=self.on,
            steps=now.steps,
            dropped=now.dropped,
            seconds=now.seconds,
            marks=now.marks,
            text=self._text,
        )

    def begin(self, who: Holder, name: str, driver: str, tell: _Tell) -> str:
        """Begin an episode.

        Args:
            who: The person who wants it.
            name: What it is about, for people to read.
            driver: Who commands now, for people to read.
            tell: Tells that person something.

        Returns:
            Why that cannot be, in words; "" if it begins now. What the disk says is told later.
        """
        if not self.can_record:
            return "This robot was served without a folder for recordings."
        if self.on:
            return f"It is being recorded already: {self.episode or 'it begins now'}."
        plan = self._plan
        header = EpisodeHeader(
            action_layout=plan.action_layout,
            state_layout=plan.state_layout,
            image_size=None if plan.camera is None else plan.camera.size,
            control_hz=plan.control_hz,
            robot=plan.robot,
            body=plan.body,
            driver=driver or who.name,
            clock=plan.clock,
            source="shapechanger robot",
            notes={"name": name, "recorded_by": who.name},
        )
        self._text = ""
        self._pairing = Pairing()

        def report(what: Literal["begun", "ended"], trouble: str) -> None:
            self._call(lambda: self._reported(scribe, what, trouble, tell))

        # What it reports is heard in this thread, and so not before it is there.
        scribe = Scribe(Path(plan.recordings), header, report, self._scribe)
        self._scribe = scribe
        return ""

    def end(self, text: str = "") -> str:
        """End the episode.

        Args:
            text: Why it ends by itself, in a sentence; "" where a person ends it.

        Returns:
            Why that cannot be, in words; "" if it ends now.
        """
        if self._scribe is None or self._pairing is None:
            return _NOT_ON
        self._write(self._pairing.complete())
        self._pairing = None
        self._text = self._text or text
        self._scribe.end(text)
        return ""

    def mark(self, text: str, tell: _Tell) -> str:
        """Mark the newest step; returns why that cannot be, or ""."""
        if self._scribe is None or self._pairing is None:
            return _NOT_ON
        self._write(self._pairing.complete())
        self._scribe.mark(text, self._then(tell))
        return ""

    def undo(self, seconds: float, tell: _Tell) -> str:
        """Drop the newest steps; returns why that cannot be, or ""."""
        if self._scribe is None or self._pairing is None:
            return _NOT_ON
        self._write(self._pairing.complete())
        self._scribe.undo(seconds, self._then(tell))
        return ""

    def observed(self, session: int, observation: Observation, frame: NumberedFrame | None) -> None:
        """A client is sent an observation."""
        if self._pairing is not None:
            self._write(self._pairing.observed(session, observation, frame))

    def decided(self, who: Holder, answers: int, values: tuple[float, ...], now_ns: int) -> None:
        """Whoever commands has said what to do, in answer to which observation."""
        if self._pairing is None:
            return
        action = tuple(
            min(max(value, low), high)
            for value, (low, high) in zip(values, self._limits, strict=True)
        )
        self._write(self._pairing.decided(who, answers, action, now_ns))

    def forget(self, session: int) -> None:
        """A client has left."""
        if self._pairing is not None:
            self._pairing.forget(session)

    def tick(self) -> None:
        """Tell everybody how it goes; to be called once a second."""
        if self.on:
            self._tell(self.state())

    def close(self) -> None:
        """End, and wait until the disk has everything, but not for ever."""
        self.end()
        if self._scribe is not None:
            self._scribe.join(_CLOSED_WITHIN_S)

    def _write(self, seen: SeenStep | None) -> None:
        if seen is None or self._scribe is None or self._scribe.add(seen):
            return
        # The thread says so, too, once the disk lets it go.
        self._pairing, self._text = None, TOO_SLOW
        self._tell(self.state())

    def _then(self, tell: _Tell) -> Callable[[str], None]:
        """What is done with the answer of the thread to one person's wish."""

        def answer(refusal: str) -> None:
            if refusal:
                tell(Refused(reason=refusal))
            else:
                self._tell(self.state())

        return lambda refusal: self._call(lambda: answer(refusal))

    def _reported(
        self, scribe: Scribe, what: Literal["begun", "ended"], trouble: str, tell: _Tell
    ) -> None:
        if trouble:
            _log.warning("Recorder: %s", trouble)
        if scribe is not self._scribe:
            return  # The next episode has begun already, and everybody was told.
        if what == "ended":
            self._pairing = None
            self._text = self._text or trouble
            if trouble and not scribe.progress.episode:
                tell(Refused(reason=trouble))  # It did not even begin.
        self._tell(self.state())


def _limits(layout: Layout) -> tuple[tuple[float, float], ...]:
    """The lowest and the highest value of each number of an action: the guard clips to them."""
    return tuple((f.low, f.high) for f in layout.features for _ in range(f.size))
