"""Recorder: pairs commands with observations, and writes the steps as an episode."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Final, Literal, NamedTuple

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Layout
from shapechanger.robot.daemon.control import ClientIdentity, NumberedFrame
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.link.card import RobotCard
from shapechanger.robot.link.messages import (
    Mark,
    Observation,
    RecorderState,
    Refused,
    RobotMessage,
    Undo,
)

_log = logging.getLogger(__name__)

DISK_TOO_SLOW: Final = "The disk is too slow: recording ended, and the steps so far are kept."

_WINDOW: Final = 64  # Observations of one client; a command answers a younger one.
_MAX_JOBS: Final = 256  # Over ten seconds of steps at 20 Hz: memory cards pause for seconds.
_MAX_BYTES: Final = 16 << 20  # Bytes of queued frames.
_CLOSE_S: Final = 5.0
_NOT_RECORDING: Final = "Nothing is being recorded."

# Facts of the card that an episode keeps, under the same names.
_SHARED: Final = tuple(f.name for f in fields(EpisodeHeader) if hasattr(RobotCard, f.name))

_Post = Callable[[RobotMessage], None]

_Job = Callable[[EpisodeWriter], EpisodeWriter]
"""Writes to an episode, and returns the writer of the episode that is open after that."""

_Write = Callable[[Step, bytes | None], object]
"""Writes a step and its frame, which is None if it repeats the previous step's."""


class _Seen(NamedTuple):
    """An observation that one client was sent, and the newest frame at that time."""

    observation: Observation
    frame: NumberedFrame | None


class _Decided(NamedTuple):
    """A step whose applied outputs are not known yet, by the number of its session."""

    session: int
    seen: _Seen
    step: Step


class StepBuilder:
    """Makes a step of each observation that is answered by a command.

    The next observation of the same client completes a step, because it reports the applied
    outputs. Of two commands that answer the same observation the later one counts. A command that
    answers an observation older than the last step's is ignored, so that time never runs
    backwards in an episode.
    """

    def __init__(
        self,
        limits: Sequence[tuple[float, float]],
        write: _Write,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._limits = limits
        self._write = write
        self._wall_ns = wall_ns
        self._seen: dict[int, deque[_Seen]] = {}
        self._decided: _Decided | None = None
        self._newest: _Decided | None = None
        self._frame_seq = 0

    def observed(self, session: int, observation: Observation, frame: NumberedFrame | None) -> None:
        """Note an observation that is sent to a client, and complete the step before it."""
        self._seen.setdefault(session, deque(maxlen=_WINDOW)).append(_Seen(observation, frame))
        decided = self._decided
        if decided is None or decided.session != session:
            return
        if observation.mine:
            step = msgspec.structs.replace(
                decided.step,
                applied=observation.action_applied or None,
                stop_reason=observation.stop_reason,
            )
            self._decided = decided._replace(step=step)
        self.complete()

    def decided(
        self, client: ClientIdentity, answers: int, values: tuple[float, ...], now_ns: int
    ) -> None:
        """Note a command of a client, and complete a step that answers another observation."""
        window = self._seen.get(client.session, ())
        seen = next((s for s in reversed(window) if s.observation.seq == answers), None)
        if seen is None or self._is_past(client.session, seen):
            return
        before = self._decided
        if before is None or before.session != client.session or before.seen is not seen:
            self.complete()
        step = Step(
            action=tuple(
                min(max(value, low), high)
                for value, (low, high) in zip(values, self._limits, strict=True)
            ),
            driver=client.role,
            wanted=seen.observation.suggested or None,
            state=seen.observation.state,
            captured_ns=seen.observation.captured_ns,
            decided_ns=now_ns,
            wall_ns=self._wall_ns(),
        )
        self._decided = self._newest = _Decided(client.session, seen, step)

    def complete(self) -> None:
        """Write the pending step, if there is one, with the outputs known so far."""
        decided, self._decided = self._decided, None
        if decided is None:
            return
        frame, jpeg = decided.seen.frame, None
        if frame is not None and frame.seq != self._frame_seq:
            self._frame_seq, jpeg = frame.seq, frame.frame.jpeg
        self._write(decided.step, jpeg)

    def forget(self, session: int) -> None:
        """Drop the observations of a client that left."""
        self._seen.pop(session, None)

    def _is_past(self, session: int, seen: _Seen) -> bool:
        """Return True if an observation is older than the newest step's."""
        newest = self._newest
        if newest is None or newest.seen is seen:
            return False
        ours, theirs = seen.observation, newest.seen.observation
        if session == newest.session and ours.seq < theirs.seq:
            return True
        return ours.captured_ns < theirs.captured_ns


class EpisodeThread:
    """Thread that writes one episode, in the order of the calls; a full one goes on in the next.

    Attributes:
        progress: State of the episode; `recording` and `text` are the recorder's to set.
    """

    def __init__(
        self,
        folder: Path,
        header: EpisodeHeader,
        report: Callable[[Literal["begun", "ended"], str], None],
        after: EpisodeThread | None = None,
    ) -> None:
        self.progress = RecorderState()
        self._folder = folder
        self._header = header
        self._report = report
        self._after = after
        self._outcome = ""
        self._ending = False
        self._jobs: deque[tuple[_Job, int]] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def add(self, step: Step, jpeg: bytes | None) -> bool:
        """Write a step.

        Returns:
            False if the disk is too slow, which ends the episode.
        """

        def write(writer: EpisodeWriter) -> EpisodeWriter:
            if writer.is_full:
                writer = writer.continued()
                self._report("begun", "")
            writer.add(step, jpeg)
            self._note(writer)
            return writer

        return self._put(write, len(jpeg or b""))

    def edit(self, request: Mark | Undo, then: Callable[[str], None]) -> None:
        """Mark the newest step, or drop the newest ones."""

        def edit(writer: EpisodeWriter) -> EpisodeWriter:
            refusal = ""
            if isinstance(request, Undo):
                refusal = "" if writer.undo(request.seconds) else "There is nothing to undo."
            elif writer.steps:
                writer.mark(request.text)
            else:
                refusal = "There is no step to mark yet."
            self._note(writer)
            then(refusal)
            return writer

        self._put(edit, 0)

    def end(self, outcome: str = "") -> None:
        """Close the episode once all steps are written."""
        with self._changed:
            if not self._ending:
                self._outcome, self._ending = outcome, True
                self._changed.notify()

    def join(self, timeout_s: float | None = None) -> bool:
        """Wait for the end. Return False on a timeout."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _put(self, job: _Job, size: int) -> bool:
        with self._changed:
            if self._ending:
                return True
            fits = len(self._jobs) < _MAX_JOBS and self._bytes + size <= _MAX_BYTES
            if fits:
                self._jobs.append((job, size))
                self._bytes += size
            else:
                self._outcome, self._ending = DISK_TOO_SLOW, True
            self._changed.notify()
            return fits

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
            trouble = f"Recording failed: {error!r}."
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
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._jobs or self._ending)
                    if not self._jobs:
                        break
                    job, size = self._jobs.popleft()
                    self._bytes -= size
                writer = job(writer)
        except BaseException as error:
            # On a full disk this may fail too. All steps are there all the same, and
            # `shapechanger demos repair` closes the episode.
            with contextlib.suppress(ShapechangerError):
                writer.close(str(error) or "an error")
            raise
        writer.close(self._outcome)

    def _note(self, writer: EpisodeWriter) -> None:
        self.progress = RecorderState(
            episode=writer.path.name,
            steps=writer.steps,
            dropped=writer.dropped,
            seconds=writer.seconds,
            marks=writer.marks,
        )


class Recorder:
    """Records one episode at a time, with any client in control. It never waits for the disk.

    Steps are recorded while the robot is armed.

    Attributes:
        builder: Makes the steps of the episode; None while nothing is recorded.
    """

    def __init__(
        self, plan: DaemonPlan, broadcast: _Post, call: Callable[[Callable[[], None]], None]
    ) -> None:
        self._plan = plan
        self._broadcast = broadcast
        self._call = call
        features = Layout.from_json(plan.card.action_layout).features
        self._limits = [(f.low, f.high) for f in features for _ in range(f.size)]
        self._thread: EpisodeThread | None = None
        self.builder: StepBuilder | None = None
        self._text = ""

    @property
    def on(self) -> bool:
        """True while an episode is recorded."""
        return self.builder is not None

    def state(self) -> RecorderState:
        """Return the state of the recorder."""
        progress = RecorderState() if self._thread is None else self._thread.progress
        return msgspec.structs.replace(progress, recording=self.on, text=self._text)

    def begin(self, client: ClientIdentity, name: str, driver: str, post: _Post) -> str:
        """Begin an episode.

        Returns:
            The reason for a refusal, or "".
        """
        if not self._plan.recordings:
            return "This robot was served without a folder for recordings."
        if self.on:
            return (
                f"An episode is being recorded already: {self.state().episode or 'it starts now'}."
            )
        plan = self._plan
        card = plan.card
        header = EpisodeHeader(
            **{name: getattr(card, name) for name in _SHARED},
            driver=driver or client.name,
            source="shapechanger robot",
            notes={"name": name, "recorded_by": client.name},
        )
        self._text = ""
        self.builder = StepBuilder(self._limits, self._write)

        def report(what: Literal["begun", "ended"], trouble: str) -> None:
            self._call(lambda: self._reported(thread, what, trouble, post))

        # Reports are handled in the event loop's thread, and so after this assignment.
        thread = EpisodeThread(Path(plan.recordings), header, report, self._thread)
        self._thread = thread
        return ""

    def end(self, text: str = "") -> str:
        """End the episode.

        Returns:
            The reason for a refusal, or "".
        """
        if self._thread is None or self.builder is None:
            return _NOT_RECORDING
        self.builder.complete()
        self.builder = None
        self._text = self._text or text
        self._thread.end(text)
        return ""

    def edit(self, request: Mark | Undo, post: _Post) -> str:
        """Mark the newest step, or drop the newest ones, after the pending step.

        Returns:
            The reason for a refusal, or "".
        """
        if self._thread is None or self.builder is None:
            return _NOT_RECORDING
        self.builder.complete()

        def answer(refusal: str) -> None:
            if refusal:
                post(Refused(reason=refusal))
            else:
                self._broadcast(self.state())

        self._thread.edit(request, lambda refusal: self._call(lambda: answer(refusal)))
        return ""

    def tick(self) -> None:
        """Report the state to all clients while recording; called once a second."""
        if self.on:
            self._broadcast(self.state())

    def close(self) -> None:
        """End the episode, and wait for the disk, up to a limit."""
        self.end()
        if self._thread is not None:
            self._thread.join(_CLOSE_S)

    def _write(self, step: Step, jpeg: bytes | None) -> None:
        if self._thread is None or self._thread.add(step, jpeg):
            return
        # The thread reports this too, once the disk responds.
        self.builder, self._text = None, DISK_TOO_SLOW
        self._broadcast(self.state())

    def _reported(
        self, thread: EpisodeThread, what: Literal["begun", "ended"], trouble: str, post: _Post
    ) -> None:
        if trouble:
            _log.warning("Recorder: %s", trouble)
        if thread is not self._thread:
            return  # The next episode has begun already, and its state was reported.
        if what == "ended":
            self.builder = None
            self._text = self._text or trouble
            if trouble and not thread.progress.episode:
                post(Refused(reason=trouble))  # The episode could not even begin.
        self._broadcast(self.state())
