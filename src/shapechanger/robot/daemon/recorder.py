"""Records what is driven, as an episode on the robot's disk; it waits for nothing."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation, RecorderState, Refused, RobotMessage
from shapechanger.robot.daemon.control import ClientIdentity
from shapechanger.robot.daemon.observation import NumberedFrame
from shapechanger.robot.daemon.plan import DaemonPlan

__all__ = [
    "DISK_TOO_SLOW",
    "EpisodeProgress",
    "EpisodeThread",
    "Recorder",
    "StepBuilder",
    "StepWithFrame",
]

_WINDOW: Final = 64  # Observations of one client; a command answers one that is younger.


@dataclass(frozen=True, slots=True)
class StepWithFrame:
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


class StepBuilder:
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
    ) -> StepWithFrame | None:
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
        self, who: ClientIdentity, answers: int, action: tuple[float, ...], now_ns: int
    ) -> StepWithFrame | None:
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

    def complete(self) -> StepWithFrame | None:
        """The step that waits for what the outputs did, with what is known of that."""
        decided, self._decided = self._decided, None
        if decided is None:
            return None
        frame, jpeg = decided.seen.frame, None
        if frame is not None and frame.seq != self._frame_seq:
            self._frame_seq, jpeg = frame.seq, frame.frame.jpeg
        return StepWithFrame(decided.step, jpeg)

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


DISK_TOO_SLOW: Final = "The disk is too slow: recording has ended, and what was recorded is kept."

_MAX_JOBS: Final = 256
"""Steps that may wait: more than ten seconds at 20 Hz, since memory cards pause for seconds."""

_MAX_BYTES: Final = 16 << 20
"""Bytes of pictures that may wait."""

_Job = Callable[[EpisodeWriter], str]
_Then = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class EpisodeProgress:
    """How far it is.

    Attributes:
        episode: Id of the episode; empty before it has begun.
        steps: Steps that were written.
        dropped: How many of them were undone.
        seconds: From the first step to the newest that counts, s.
        marks: Marks that were set.
    """

    episode: str = ""
    steps: int = 0
    dropped: int = 0
    seconds: float = 0.0
    marks: int = 0


class EpisodeThread:
    """Writes one episode, from its beginning to its end, in the order in which it was told.

    Args:
        folder: Folder of the recordings.
        header: What the episode is of.
        report: Called in the thread when it has "begun" and when it has "ended"; with what went
            wrong, in a sentence, or "".
        after: The one before, which is waited for; None for none.
    """

    def __init__(
        self,
        folder: Path,
        header: EpisodeHeader,
        report: Callable[[Literal["begun", "ended"], str], None],
        after: EpisodeThread | None = None,
    ) -> None:
        self.progress = EpisodeProgress()
        """How far it is; a new object each time."""
        self._folder = folder
        self._header = header
        self._report = report
        self._after = after
        self._outcome = ""
        self._ending = False
        self._jobs: deque[tuple[_Job, int, _Then | None]] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def add(self, seen: StepWithFrame) -> bool:
        """Write a step; whether the disk keeps up. If not, the episode ends here."""

        def write(writer: EpisodeWriter) -> str:
            writer.add(seen.step, seen.jpeg)
            return ""

        return self._put(write, len(seen.jpeg or b""))

    def mark(self, text: str, then: _Then) -> None:
        """Mark the newest step.

        Args:
            text: What the mark says.
            then: Called in the thread with why that cannot be done, or "".
        """

        def write(writer: EpisodeWriter) -> str:
            if not writer.steps:
                return "There is no step yet that could be marked."
            writer.mark(text)
            return ""

        self._put(write, len(text), then)

    def undo(self, seconds: float, then: _Then) -> None:
        """Drop the newest steps; arguments as those of `mark`."""
        self._put(lambda w: "" if w.undo(seconds) else "There is nothing to undo.", 0, then)

    def end(self, outcome: str = "") -> None:
        """Close the episode once everything is written."""
        with self._changed:
            if not self._ending:
                self._outcome, self._ending = outcome, True
                self._changed.notify()

    def join(self, timeout_s: float | None = None) -> bool:
        """Wait until it has ended; whether it has."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _put(self, job: _Job, size: int, then: _Then | None = None) -> bool:
        with self._changed:
            if self._ending:
                return True
            fits = len(self._jobs) < _MAX_JOBS and self._bytes + size <= _MAX_BYTES
            if fits:
                self._jobs.append((job, size, then))
                self._bytes += size
            else:
                self._outcome, self._ending = DISK_TOO_SLOW, True
            self._changed.notify()
            return fits

    def _next(self) -> tuple[_Job, int, _Then | None] | None:
        """The next job; None when all are done and no more come."""
        with self._changed:
            self._changed.wait_for(lambda: self._jobs or self._ending)
            if not self._jobs:
                return None
            job = self._jobs.popleft()
            self._bytes -= job[1]
            return job

    def _run(self) -> None:
        if self._after is not None:
            self._after.join()
            self._after = None
        trouble = ""
        try:
            self._write(EpisodeWriter.create(self._folder, self._header))
        except ShapechangerError as error:
            trouble = str(error)
        except Exception as error:
            trouble = f"Recording broke: {error!r}."
            raise
        finally:
            with self._changed:
                self._ending = True
                self._jobs.clear()
            self._report("ended", trouble)

    def _write(self, writer: EpisodeWriter) -> None:
        try:
            self._note(writer)
            self._report("begun", "")
            while (job := self._next()) is not None:
                work, _, then = job
                refusal = work(writer)
                self._note(writer)
                if then is not None:
                    then(refusal)
        except BaseException as error:
            # On a disk that is full this may fail, too; every step is there all the same, and
            # `shapechanger demos repair` closes the episode.
            with contextlib.suppress(ShapechangerError):
                writer.close(str(error) or "an error")
            raise
        writer.close(self._outcome)

    def _note(self, writer: EpisodeWriter) -> None:
        self.progress = EpisodeProgress(
            writer.path.name, writer.steps, writer.dropped, writer.seconds, writer.marks
        )


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
        self._scribe: EpisodeThread | None = None
        self._pairing: StepBuilder | None = None
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

    def begin(self, who: ClientIdentity, name: str, driver: str, tell: _Tell) -> str:
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
        self._pairing = StepBuilder()

        def report(what: Literal["begun", "ended"], trouble: str) -> None:
            self._call(lambda: self._reported(scribe, what, trouble, tell))

        # What it reports is heard in this thread, and so not before it is there.
        scribe = EpisodeThread(Path(plan.recordings), header, report, self._scribe)
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

    def decided(
        self, who: ClientIdentity, answers: int, values: tuple[float, ...], now_ns: int
    ) -> None:
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

    def _write(self, seen: StepWithFrame | None) -> None:
        if seen is None or self._scribe is None or self._scribe.add(seen):
            return
        # The thread says so, too, once the disk lets it go.
        self._pairing, self._text = None, DISK_TOO_SLOW
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
        self, scribe: EpisodeThread, what: Literal["begun", "ended"], trouble: str, tell: _Tell
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
