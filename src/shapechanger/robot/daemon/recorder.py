"""Recorder: pairs commands with observations, and writes the steps as an episode."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client, Declined, Sent
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.link import messages
from shapechanger.robot.link.card import RobotCard

_log = logging.getLogger(__name__)

DISK_TOO_SLOW: Final = "The disk is too slow: recording ended, and the steps so far are kept."

_MAX_JOBS: Final = 256  # Over ten seconds of steps at 20 Hz: memory cards pause for seconds.
_MAX_BYTES: Final = 16 << 20  # Bytes of queued frames.
_CLOSE_S: Final = 5.0

# Fields of the card that are copied to the header of an episode.
_SHARED: Final = tuple(
    field.name
    for field in fields(EpisodeHeader)
    if hasattr(RobotCard, field.name) and not field.name.endswith("_layout")
)

_T = TypeVar("_T")


class _Decided(NamedTuple):
    """A step whose applied outputs are not known yet, and the observation that it answers."""

    client: Client
    sent: Sent
    step: Step


class Worker:
    """Thread that runs jobs in order. A daemon thread: a disk that hangs cannot block the exit.

    `call` calls a function in the event loop's thread.
    """

    def __init__(self, name: str, call: Callable[[Callable[[], None]], None]) -> None:
        self._call = call
        self._jobs: queue.SimpleQueue[Callable[[], Callable[[], None]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def put(self, job: Callable[[], _T], then: Callable[[_T], None]) -> None:
        """Queue a job, and pass its result to a function in the event loop."""
        if self._thread.ident is None:
            self._thread.start()
        self._jobs.put(lambda: partial(then, job()))

    def close(self) -> None:
        """End the thread after the queued jobs, and wait for it, up to a time limit."""
        if self._thread.ident is not None:
            self._jobs.put(None)
            self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            self._call(job())


class _Episode:
    """An episode that the recorder's thread writes; a full episode is continued in a new one."""

    def __init__(self, folder: Path, header: EpisodeHeader, starter: Client) -> None:
        self.starter = starter
        # Used in the event loop only: the newest state, with the text of an error that ended the
        # episode, the number of queued jobs, and the number of bytes of their frames.
        self.progress = messages.RecorderState()
        self.jobs = self.bytes = 0
        self._trouble = ""
        self._create = partial(EpisodeWriter.create, folder, header)
        self._writer: EpisodeWriter | None = None

    def attempt(self, job: Callable[[EpisodeWriter], object]) -> tuple[str, messages.RecorderState]:
        """Run a job unless there was an error; return the reason of a refusal, and the state."""
        declined = ""
        try:
            if not self._trouble:
                self._writer = self._writer or self._create()
                job(self._writer)
        except Declined as error:
            declined = str(error)
        except Exception as error:  # No error of a recording may stop the robot.
            is_ours = isinstance(error, ShapechangerError)
            self._trouble = str(error) if is_ours else f"Recording failed: {error!r}."
            # On a full disk this may fail too. All steps are on disk nevertheless, and
            # `shapechanger demos repair` closes the episode.
            with contextlib.suppress(ShapechangerError):
                if self._writer is not None:
                    self._writer.close(self._trouble)
        if (writer := self._writer) is None:
            return declined, messages.RecorderState(text=self._trouble)
        return declined, messages.RecorderState(
            text=self._trouble,
            episode=writer.path.name,
            steps=writer.steps,
            dropped=writer.dropped,
            seconds=writer.seconds,
            marks=writer.marks,
        )

    def add(self, step: Step, jpeg: bytes | None, writer: EpisodeWriter) -> None:
        """Write a step with its frame; `jpeg` is None if the previous step has the same frame."""
        if writer.is_full:
            self._writer = writer = writer.continued()
        writer.add(step, jpeg)


class Recorder:
    """Records one episode at a time, with any client in control. Only `close` waits for the disk.

    While the robot is armed, each observation that is answered by a command becomes a step. The
    next observation of the same client completes it, because it reports the applied outputs. If two
    commands answer the same observation, the later one counts. A command that answers an older
    observation than the last step is ignored, so that time never runs backwards in an episode.
    """

    def __init__(
        self,
        plan: DaemonPlan,
        broadcast: Callable[[messages.RobotMessage], None],
        call: Callable[[Callable[[], None]], None],
    ) -> None:
        self.on = False  # Whether an episode is recorded.
        self._plan = plan
        self._broadcast = broadcast
        features = Layout.from_json(plan.card.action_layout).features
        self._limits = [(f.low, f.high) for f in features for _ in range(f.size)]
        self._worker = Worker("recorder", call)
        self._episode: _Episode | None = None
        self._text = ""
        self._decided: _Decided | None = None
        self._newest: _Decided | None = None
        self._frame: Frame | None = None

    def state(self) -> messages.RecorderState:
        """Return the state of the recorder."""
        progress = messages.RecorderState() if self._episode is None else self._episode.progress
        text = self._text or progress.text
        return msgspec.structs.replace(progress, recording=self.on, text=text)

    def observed(self, client: Client, observation: messages.Observation) -> None:
        """Complete the pending step of a client with the next observation sent to it."""
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
        self._complete()

    def decided(self, client: Client, sent: Sent, values: tuple[float, ...], now_ns: int) -> None:
        """Start a step with a command; first complete a step that answers another observation."""
        newest, seen = self._newest, sent.observation
        if not self.on:
            return
        if newest is not None and newest.sent is not sent:
            before = newest.sent.observation
            is_past = newest.client is client and seen.seq < before.seq
            if is_past or seen.captured_ns < before.captured_ns:
                return
            self._complete()
        step = Step(
            action=tuple(
                min(max(value, low), high)
                for value, (low, high) in zip(values, self._limits, strict=True)
            ),
            driver=client.role,
            wanted=seen.suggested or None,
            state=seen.state,
            captured_ns=seen.captured_ns,
            decided_ns=now_ns,
            wall_ns=time.time_ns(),
        )
        self._decided = self._newest = _Decided(client, sent, step)

    def begin(self, client: Client, name: str, driver: str) -> None:
        """Begin an episode."""
        if self.on:
            begun = self.state().episode or "it starts now"
            raise Declined(f"An episode is being recorded already: {begun}.")
        card = self._plan.card
        header = EpisodeHeader(
            **{name: getattr(card, name) for name in _SHARED},
            action_layout=Layout.from_json(card.action_layout),
            state_layout=Layout.from_json(card.state_layout),
            driver=driver or client.name,
            source="shapechanger robot",
            notes={"name": name, "recorded_by": client.name},
        )
        self._episode = _Episode(Path(self._plan.recordings), header, client)
        self.on, self._text = True, ""
        self._decided = self._newest = self._frame = None
        self._put(self._episode, lambda _: None)

    def end(self, text: str = "") -> None:
        """End the episode."""
        self._stop(self._recorded(), text)

    def edit(self, request: messages.Mark | messages.Undo, client: Client) -> None:
        """Mark the newest step, or drop the newest steps; the pending step is written first."""

        def write(writer: EpisodeWriter) -> None:
            if isinstance(request, messages.Undo):
                if not writer.undo(request.seconds):
                    raise Declined("There is nothing to undo.")
            elif not writer.steps:
                raise Declined("There is no step to mark yet.")
            else:
                writer.mark(request.text)

        self._put(self._recorded(), write, reports=True, client=client)

    def tick(self) -> None:
        """Report the state to all clients while recording; called once a second."""
        if self.on:
            self._broadcast(self.state())

    def close(self) -> None:
        """End the episode, and wait for the disk, up to a limit."""
        if self.on:
            self.end()
        self._worker.close()

    def _recorded(self) -> _Episode:
        """Complete the pending step of the episode that is being recorded, and return it."""
        if self._episode is None or not self.on:
            raise Declined("No episode is being recorded.")
        self._complete()
        return self._episode

    def _complete(self) -> None:
        """Write the pending step, if there is one, with the outputs known so far."""
        decided, self._decided = self._decided, None
        if decided is None:
            return
        frame, jpeg = decided.sent.frame, None
        if frame is not None and frame is not self._frame:
            self._frame, jpeg = frame, frame.jpeg
        self._add(decided.step, jpeg)

    def _add(self, step: Step, jpeg: bytes | None) -> None:
        episode, size = self._episode, len(jpeg or b"")
        if episode is None or not self.on:
            return
        if episode.jobs < _MAX_JOBS and episode.bytes + size <= _MAX_BYTES:
            self._put(episode, partial(episode.add, step, jpeg), size=size)
        else:
            self._stop(episode, DISK_TOO_SLOW)
            self._broadcast(self.state())  # The state is sent again when the disk responds.

    def _stop(self, episode: _Episode, outcome: str) -> None:
        self.on, self._decided = False, None
        self._text = self._text or outcome
        self._put(episode, lambda writer: writer.close(outcome), reports=True)

    def _put(
        self,
        episode: _Episode,
        job: Callable[[EpisodeWriter], object],
        *,
        size: int = 0,
        reports: bool = False,
        client: Client | None = None,
    ) -> None:
        """Queue a job with a frame of `size` bytes; report the new state, or a refusal."""
        episode.jobs += 1
        episode.bytes += size

        def done(result: tuple[str, messages.RecorderState]) -> None:
            episode.jobs -= 1
            episode.bytes -= size
            before, (declined, now) = episode.progress, result
            episode.progress = now
            if now.text and not before.text:
                _log.warning("Recorder: %s", now.text)
                if not now.episode:  # The episode could not begin.
                    episode.starter.post(messages.Refused(reason=now.text))
            elif declined and client is not None:
                client.post(messages.Refused(reason=declined))
            elif reports and not now.text:
                self._broadcast(self.state())
            is_news = (before.episode, before.text) != (now.episode, now.text)
            if is_news and episode is self._episode:
                self.on = self.on and not now.text
                self._broadcast(self.state())

        self._worker.put(partial(episode.attempt, job), done)
