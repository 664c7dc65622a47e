"""Episode writer: a crash at any time costs at most the step being written."""

from __future__ import annotations

import contextlib
import json
import math
import os
import threading
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import takewhile
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final, Self

import msgspec

from shapechanger.demos.episodes.files import (
    FRAMES,
    FULL_BYTES,
    HEADER,
    MAX_PICTURE_BYTES,
    STEPS,
    free_path,
    lock,
    write_all,
)
from shapechanger.demos.episodes.records import (
    Drop,
    Edit,
    EpisodeHeader,
    EpisodeMark,
    Step,
    StepPicture,
    encode_line,
)
from shapechanger.errors import DemosError, OutputError
from shapechanger.files import write_atomic, writing

_SYNC_PERIOD_S: Final = 1.0


class Syncer(threading.Thread):
    """Flush files to disk once a second, so that a power cut costs at most a second.

    A crash of the program alone costs nothing, because the kernel has the bytes by then. The work
    is done in a thread, because a memory card may take longer than a control period.

    Args:
        fd: A growing file, which stays open until `close`.
    """

    def __init__(self, fd: int) -> None:
        super().__init__(name="episode sync", daemon=True)
        self._fd = fd
        self._waiting: SimpleQueue[Path] = SimpleQueue()
        self._ended = threading.Event()
        self.start()

    def add(self, path: Path) -> None:
        """Schedule a finished file for the next flush."""
        self._waiting.put(path)

    def sync(self) -> None:
        """Flush now; a file that is missing or fails does not keep the others from it."""
        # The next write reports a failing disk; an error here would have no recipient.
        while not self._waiting.empty():
            with contextlib.suppress(OSError), self._waiting.get().open("rb") as file:
                os.fsync(file.fileno())
        with contextlib.suppress(OSError):
            os.fsync(self._fd)

    def close(self) -> None:
        """Stop the thread, and flush one last time."""
        self._ended.set()
        self.join()
        self.sync()

    def run(self) -> None:
        """Flush until `close`."""
        while not self._ended.wait(_SYNC_PERIOD_S):
            self.sync()


SPARE_BYTES: Final = 64 << 20
"""Disk space to leave free by default."""

_CONTINUED: Final = "continued"
"""Outcome of an episode that was full, and goes on in the next one."""

_LOCK: Final = ".recording"
_JPEG: Final = b"\xff\xd8"
_SPACE_CHECK_STEPS: Final = 20  # Free space changes slowly.
_NS_PER_S: Final = 1e9


class EpisodeWriter:
    """Writer of one episode; use `create` to construct one.

    Readers refuse files above a limit. A recorder therefore goes on with `continued`, once the
    episode `is_full`.

    Attributes:
        path: Folder of the episode.
        steps: Number of steps written.
        dropped: Number of those that were undone.
        marks: Number of marks set.
    """

    def __init__(
        self, path: Path, header: EpisodeHeader, locks: tuple[int, int], spare_bytes: int
    ) -> None:
        self.path = path
        self.steps = 0
        self.dropped = 0
        self.marks = 0
        self._header = header
        self._sizes = header.action_size, header.state_size
        self._lock, self._fd = locks
        self._spare_bytes = spare_bytes
        self._bytes = 0
        self._jpeg: bytes | None = None
        self._before: Step | None = None
        # Index and time, ns, of each kept step, for `undo`. Floats of seconds since 1970 would be
        # too coarse.
        self._times: list[tuple[int, int]] = []
        self._syncer: Syncer | None = Syncer(self._fd)

    @classmethod
    def create(
        cls,
        recording: Path,
        header: EpisodeHeader,
        *,
        spare_bytes: int = SPARE_BYTES,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
        created: str | None = None,
    ) -> EpisodeWriter:
        """Begin an episode in a recording; create the recording if it is missing.

        Args:
            recording: Folder of the recording.
            header: Metadata of the episode.
            spare_bytes: Disk space to leave free. A full disk would harm the robot.
            now: Returns the time that the folder is named after, UTC.
            created: Start time of an episode that was recorded before, ISO 8601; "" if unknown;
                None for now.

        Raises:
            DemosError: If the header is invalid, or another process is recording there.
            OutputError: If the folder cannot be written to, or the disk is full.
        """
        began = now()
        header = replace(
            header,
            created=began.isoformat(timespec="milliseconds") if created is None else created,
            version=version("shapechanger"),
        )
        EpisodeHeader.from_json(header.to_json())  # Readers refuse an invalid one.
        with writing(recording):
            recording.mkdir(parents=True, exist_ok=True)
        _require_space(recording, spare_bytes)
        held = lock(
            recording / _LOCK, f"{recording} is in use by another recorder: choose another folder."
        )
        try:
            path = _new_folder(recording, header, f"{began:%Y%m%dT%H%M%SZ}")
            fd = lock(path / STEPS, f"{path} is in use by another recorder.")
        except BaseException:
            os.close(held)
            raise
        return cls(path, header, (held, fd), spare_bytes)

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the episode."""
        self.close()

    @property
    def is_full(self) -> bool:
        """Whether the next step should be that of another episode, so that readers accept both."""
        return self._bytes >= FULL_BYTES

    def continued(self) -> EpisodeWriter:
        """Close the episode, and return the writer of the next one, with the newest image.

        Raises:
            OutputError: If the next one cannot be created; this one is closed then.
        """
        self.close(_CONTINUED)
        # The next episode does not begin with a reset of the env.
        header = replace(
            self._header, seed=None, notes=self._header.notes | {"continues": self.path.name}
        )
        writer = EpisodeWriter.create(self.path.parent, header, spare_bytes=self._spare_bytes)
        writer._jpeg = self._jpeg
        return writer

    @property
    def seconds(self) -> float:
        """Duration of the kept steps, s."""
        return (self._times[-1][1] - self._times[0][1]) / _NS_PER_S if self._times else 0.0

    def add(self, step: Step, jpeg: bytes | None = None) -> int:
        """Append a step.

        Args:
            step: The step; its index and frame fields are filled in here.
            jpeg: Its image; None to reuse the previous step's image, or without a camera.

        Returns:
            Index of the step.

        Raises:
            DemosError: If the step does not fit the header, or time runs backwards.
            OutputError: If it cannot be written; earlier steps are intact.
        """
        self._require_open()
        refusal = step.refusal(*self._sizes) or self._disorder(step)
        if jpeg is not None and len(jpeg) > MAX_PICTURE_BYTES:
            refusal = f"its image has {len(jpeg)} bytes, more than the limit of {MAX_PICTURE_BYTES}"
        elif jpeg is not None and not jpeg.startswith(_JPEG):
            refusal = "its image is not a JPEG"
        if refusal:
            raise DemosError(f"Step {self.steps} of {self.path} cannot be recorded: {refusal}.")
        if self.steps % _SPACE_CHECK_STEPS == 0:
            _require_space(self.path, self._spare_bytes)
        step = msgspec.structs.replace(step, index=self.steps, picture=self._frame(jpeg))
        self._append(step)
        self._before = step
        self._times.append((step.index, self._time_ns(step)))
        self.steps += 1
        return step.index

    def mark(self, text: str = "") -> None:
        """Mark the newest step, with free text.

        Raises:
            DemosError: If there is no step yet.
            OutputError: If it cannot be written.
        """
        self._require_open()
        if not self.steps:
            raise DemosError("There is no step yet that could be marked.")
        self._append(EpisodeMark(self.steps - 1, text))
        self.marks += 1

    def undo(self, seconds: float = 5.0) -> int:
        """Exclude the newest kept step, and those less than `seconds` before it.

        They stay in the file.

        Args:
            seconds: How far to go back from the newest kept step, s; positive and finite.

        Returns:
            Number of excluded steps.

        Raises:
            DemosError: If `seconds` is not positive and finite.
            OutputError: If it cannot be written.
        """
        self._require_open()
        if not 0.0 < seconds < math.inf:
            raise DemosError(f"seconds to undo must be positive and finite, got {seconds}.")
        if not self._times:
            return 0
        newest_ns = self._times[-1][1]
        later = (newest_ns - at_ns < seconds * _NS_PER_S for _, at_ns in reversed(self._times))
        count = sum(takewhile(bool, later))
        self._append(Drop(self._times[-count][0], self.steps - 1, "undo"))
        del self._times[-count:]
        self.dropped += count
        return count

    def close(self, outcome: str = "") -> None:
        """Close the episode; further calls do nothing.

        Args:
            outcome: How it ended, such as "collision" or "time"; "" if unspecified.

        Raises:
            OutputError: If the header cannot be written; all steps are on disk all the same.
        """
        if self._syncer is None:
            return
        self._syncer.close()
        self._syncer = None
        try:
            write_header(self.path, self._header, {"steps": self.steps, "outcome": outcome})
        finally:
            os.close(self._fd)
            os.close(self._lock)

    def _append(self, line: Step | Edit) -> None:
        content = encode_line(line)
        with writing(self.path / STEPS):
            write_all(self._fd, content)
        self._bytes += len(content)

    def _frame(self, jpeg: bytes | None) -> StepPicture | None:
        """Write an image, and return its record; without a new one, keep that before."""
        before = self._before
        jpeg = self._jpeg if jpeg is None and before is None else jpeg
        if jpeg is None:
            return None if before is None else before.picture
        self._jpeg = jpeg
        frame = StepPicture.of(f"{self.steps:06d}.jpg", jpeg)
        path = self.path / FRAMES / frame.name
        try:
            with writing(path), path.open("wb", buffering=0) as file:
                write_all(file.fileno(), jpeg)
        except OutputError:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
            raise
        if self._syncer is not None:
            self._syncer.add(path)
        return frame

    def _disorder(self, step: Step) -> str:
        """Return which time runs backwards, as part of a sentence; "" for none."""
        if self._before is None:
            return ""
        for name in ("captured_ns", "decided_ns"):
            earlier, later = getattr(self._before, name), getattr(step, name)
            if earlier is not None and later is not None and later < earlier:
                return f"time runs backwards, from {earlier} to {later} ns ({name})"
        return ""

    def _time_ns(self, step: Step) -> int:
        at_ns = step.clock_ns
        return round(step.index * _NS_PER_S / self._header.control_hz) if at_ns is None else at_ns

    def _require_open(self) -> None:
        if self._syncer is None:
            raise DemosError(f"The episode {self.path} is closed.")


def _new_folder(recording: Path, header: EpisodeHeader, began: str) -> Path:
    """Create the folder of an episode with its empty files, atomically."""
    part = recording / f".{began}.{os.getpid()}"
    with writing(part):
        (part / FRAMES).mkdir(parents=True, exist_ok=True)
        (part / STEPS).touch()
        write_header(part, header, None)
        return part.rename(free_path(recording, f"{began}-0001"))  # No race: it is locked.


def write_header(folder: Path, header: EpisodeHeader, closed: dict[str, Any] | None) -> None:
    """Write the header of an episode atomically, with how it was closed."""
    text = json.dumps(header.to_json() | {"closed": closed}, indent=1, ensure_ascii=False)
    write_atomic(folder / HEADER, f"{text}\n".encode())


def _require_space(folder: Path, spare_bytes: int) -> None:
    """Refuse to fill the disk."""
    with writing(folder):
        found = os.statvfs(folder)
        free = found.f_bavail * found.f_frsize
        if free < spare_bytes:
            raise OutputError(
                f"Cannot write to {folder}: only {free >> 20} MB of the disk are free, and at "
                f"least {spare_bytes >> 20} MB must stay free."
            )
