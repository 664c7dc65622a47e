"""Recorder: pairs commands with observations, and writes the steps as an episode."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client
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


class _Seen(NamedTuple):
    """An observation that a client was sent, and the newest frame at that time."""

    observation: Observation
    frame: Frame | None


class _Decided(NamedTuple):
    """A step whose applied outputs are not known yet."""

    client: Client
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
        write: Callable[[Step, bytes | None], object],
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._limits = limits
        self._write = write
        self._wall_ns = wall_ns
        self._seen: dict[Client, deque[_Seen]] = {}
        self._decided: _Decided | None = None
        self._newest: _Decided | None = None
        self._frame: Frame | None = None

    def observed(self, client: Client, observation: Observation, frame: Frame | None) -> None:
        """Note an observation that is sent to a client, and complete the step before it."""
        self._seen.setdefault(client, deque(maxlen=_WINDOW)).append(_Seen(observation, frame))
        decided = self._decided
        if decided is None or decided.client is not client:
            return
        if observation.mine:
            step = msgspec.structs.replace(
                decided.step,
                applied=observation.action_applied or None,
                stop_reason=observation.stop_reason,
            )
            self._decided = decided._replace(step=step)
        self.complete()

    def decided(self, client: Client, answers: int, values: tuple[float, ...], now_ns: int) -> None:
        """Note a command of a client, and complete a step that answers another observation."""
        window = self._seen.get(client, ())
        seen = next((s for s in reversed(window) if s.observation.seq == answers), None)
        if seen is None or self._is_past(client, seen):
            return
        before = self._decided
        if before is None or before.client is not client or before.seen is not seen:
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
        self._decided = self._newest = _Decided(client, seen, step)

    def complete(self) -> None:
        """Write the pending step, if there is one, with the outputs known so far."""
        decided, self._decided = self._decided, None
        if decided is None:
            return
        frame, jpeg = decided.seen.frame, None
        if frame is not None and frame is not self._frame:
            self._frame, jpeg = frame, frame.jpeg
        self._write(decided.step, jpeg)

    def forget(self, client: Client) -> None:
        """Drop the observations of a client that left."""
        self._seen.pop(client, None)

    def _is_past(self, client: Client, seen: _Seen) -> bool:
        """Return True if an observation is older than the newest step's."""
        newest = self._newest
        if newest is None or newest.seen is seen:
            return False
        ours, theirs = seen.observation, newest.seen.observation
        if client is newest.client and ours.seq < theirs.seq:
            return True
        return ours.captured_ns < theirs.captured_ns


class Worker:
    """Thread that calls functions one after another; a disk that hangs keeps no process alive."""

    def __init__(self, name: str) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def put(self, call: Callable[[], None]) -> None:
        """Call a function after those before it."""
        if self._thread.ident is None:
            self._thread.start()
        self._calls.put(call)

    def close(self, at_most_s: float) -> None:
        """End the thread after the functions so far, and wait for it, up to a limit."""
        if self._thread.ident is not None:
            self._calls.put(None)
            self._thread.join(at_most_s)

    def _run(self) -> None:
        while (call := self._calls.get()) is not None:
            call()


class _Shot(NamedTuple):
    """A step, and its frame; None if it repeats the previous step's."""

    step: Step
    jpeg: bytes | None


_Job = _Shot | Mark | Undo | str | None
"""Something to write: a step, an edit, the outcome that ends an episode, or None to begin it."""


class _Episode:
    """An episode, which the recorder's thread writes; a full one goes on in the next.

    Attributes:
        starter: The client that began it.
        progress: Its newest state that the event loop knows; the text is an error that ended it.
        jobs: Number of jobs that wait for the disk.
        bytes: Size of their frames, bytes.
    """

    def __init__(self, folder: Path, header: EpisodeHeader, starter: Client) -> None:
        self.starter = starter
        self.progress = RecorderState()
        self.jobs = 0
        self.bytes = 0
        self._trouble = ""
        self._create = partial(EpisodeWriter.create, folder, header)
        self._writer: EpisodeWriter | None = None

    def attempt(self, job: _Job) -> str:
        """Do a job unless there was an error, and return the reason for a refusal, or ""."""
        if self._trouble:
            return ""
        try:
            return self._write(job)
        except ShapechangerError as error:
            self._trouble = str(error)
        except Exception as error:  # Whatever it is, the robot drives on.
            self._trouble = f"Recording failed: {error!r}."
        # On a full disk this may fail too. All steps are there all the same, and
        # `shapechanger demos repair` closes the episode.
        with contextlib.suppress(ShapechangerError):
            if self._writer is not None:
                self._writer.close(self._trouble)
        return ""

    def newest(self) -> RecorderState:
        """Return the state of the episode."""
        if (writer := self._writer) is None:
            return RecorderState(text=self._trouble)
        return RecorderState(
            text=self._trouble,
            episode=writer.path.name,
            steps=writer.steps,
            dropped=writer.dropped,
            seconds=writer.seconds,
            marks=writer.marks,
        )

    def _write(self, job: _Job) -> str:
        writer = self._writer = self._writer or self._create()
        match job:
            case _Shot():
                if writer.is_full:
                    writer = self._writer = writer.continued()
                writer.add(*job)
            case Undo():
                return "" if writer.undo(job.seconds) else "There is nothing to undo."
            case Mark():
                if not writer.steps:
                    return "There is no step to mark yet."
                writer.mark(job.text)
            case str():
                writer.close(job)
            case None:
                pass
        return ""


class Recorder:
    """Records one episode at a time, with any client in control. It never waits for the disk.

    Steps are recorded while the robot is armed. A thread writes them; `call` calls a function in
    the event loop's thread.

    Attributes:
        builder: Makes the steps of the episode; None while nothing is recorded.
    """

    def __init__(
        self,
        plan: DaemonPlan,
        broadcast: Callable[[RobotMessage], None],
        call: Callable[[Callable[[], None]], None],
    ) -> None:
        self._plan = plan
        self._broadcast = broadcast
        self._call = call
        features = Layout.from_json(plan.card.action_layout).features
        self._limits = [(f.low, f.high) for f in features for _ in range(f.size)]
        self._worker = Worker("recorder")
        self._episode: _Episode | None = None
        self.builder: StepBuilder | None = None
        self._text = ""

    @property
    def on(self) -> bool:
        """True while an episode is recorded."""
        return self.builder is not None

    def state(self) -> RecorderState:
        """Return the state of the recorder."""
        progress = RecorderState() if self._episode is None else self._episode.progress
        text = self._text or progress.text
        return msgspec.structs.replace(progress, recording=self.on, text=text)

    def begin(self, client: Client, name: str, driver: str) -> str:
        """Begin an episode, and return the reason for a refusal, or ""."""
        if not self._plan.recordings:
            return "This robot was served without a folder for recordings."
        if self.on:
            begun = self.state().episode or "it starts now"
            return f"An episode is being recorded already: {begun}."
        header = EpisodeHeader(
            **{name: getattr(self._plan.card, name) for name in _SHARED},
            driver=driver or client.name,
            source="shapechanger robot",
            notes={"name": name, "recorded_by": client.name},
        )
        self._episode = _Episode(Path(self._plan.recordings), header, client)
        self._text = ""
        self.builder = StepBuilder(self._limits, self._add)
        self._put(self._episode, None)
        return ""

    def end(self, text: str = "") -> str:
        """End the episode, and return the reason for a refusal, or ""."""
        if self._episode is None or self.builder is None:
            return _NOT_RECORDING
        self.builder.complete()
        self._stop(self._episode, text)
        return ""

    def edit(self, request: Mark | Undo, client: Client) -> str:
        """Mark the newest step, or drop the newest ones, after the pending step.

        Returns:
            The reason for a refusal, or "".
        """
        if self._episode is None or self.builder is None:
            return _NOT_RECORDING
        self.builder.complete()

        def answer(refusal: str) -> None:
            if refusal:
                client.post(Refused(reason=refusal))
            else:
                self._broadcast(self.state())

        self._put(self._episode, request, answer)
        return ""

    def tick(self) -> None:
        """Report the state to all clients while recording; called once a second."""
        if self.on:
            self._broadcast(self.state())

    def close(self) -> None:
        """End the episode, and wait for the disk, up to a limit."""
        self.end()
        self._worker.close(_CLOSE_S)

    def _add(self, step: Step, jpeg: bytes | None) -> None:
        episode, size = self._episode, len(jpeg or b"")
        if episode is None:
            return
        if episode.jobs < _MAX_JOBS and episode.bytes + size <= _MAX_BYTES:
            self._put(episode, _Shot(step, jpeg))
        else:
            self._stop(episode, DISK_TOO_SLOW)
            self._broadcast(self.state())  # Again when the disk responds.

    def _stop(self, episode: _Episode, outcome: str) -> None:
        self.builder = None
        self._text = self._text or outcome
        self._put(episode, outcome, lambda _: self._broadcast(self.state()))

    def _put(
        self, episode: _Episode, job: _Job, then: Callable[[str], None] = lambda _: None
    ) -> None:
        """Let the thread do a job, and then call a function with the reason for a refusal."""
        size = len(job.jpeg or b"") if isinstance(job, _Shot) else 0
        episode.jobs += 1
        episode.bytes += size

        def work() -> None:
            refusal = episode.attempt(job)
            self._call(partial(self._done, episode, size, episode.newest(), partial(then, refusal)))

        self._worker.put(work)

    def _done(
        self, episode: _Episode, size: int, progress: RecorderState, then: Callable[[], None]
    ) -> None:
        """Note that the thread has done a job."""
        episode.jobs -= 1
        episode.bytes -= size
        before, episode.progress = episode.progress, progress
        if not progress.text:
            then()
        elif not before.text:
            _log.warning("Recorder: %s", progress.text)
            if not progress.episode:  # It could not even begin.
                episode.starter.post(Refused(reason=progress.text))
        if episode is self._episode and (
            (before.episode, before.text) != (progress.episode, progress.text)
        ):
            self.builder = None if progress.text else self.builder
            self._broadcast(self.state())
