"""The thread that writes an episode, so that nobody else waits for a disk."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter
from shapechanger.errors import ShapechangerError
from shapechanger.robot.daemon.pairing import SeenStep

__all__ = ["TOO_SLOW", "Progress", "Scribe"]

TOO_SLOW: Final = "The disk is too slow: recording has ended, and what was recorded is kept."

_MOST_JOBS: Final = 256
"""Steps that may wait: more than ten seconds at 20 Hz, since memory cards pause for seconds."""

_MOST_BYTES: Final = 16 << 20
"""Bytes of pictures that may wait."""

_Job = Callable[[EpisodeWriter], str]
_Then = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Progress:
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


class Scribe:
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
        after: Scribe | None = None,
    ) -> None:
        self.progress = Progress()
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

    def add(self, seen: SeenStep) -> bool:
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
            fits = len(self._jobs) < _MOST_JOBS and self._bytes + size <= _MOST_BYTES
            if fits:
                self._jobs.append((job, size, then))
                self._bytes += size
            else:
                self._outcome, self._ending = TOO_SLOW, True
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
        self.progress = Progress(
            writer.path.name, writer.steps, writer.dropped, writer.seconds, writer.marks
        )
