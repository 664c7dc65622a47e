"""Episode writer: a crash of the program costs at most the step being written."""

from __future__ import annotations

import io
import math
import os
import shutil
import threading
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import takewhile
from pathlib import Path
from queue import SimpleQueue
from typing import Final, Self

import msgspec

from shapechanger.demos.episodes.records import (
    FRAMES,
    MAX_TEXT_BYTES,
    STEPS,
    Drop,
    EpisodeHeader,
    EpisodeMark,
    Step,
    StepPicture,
    append,
    encode_line,
    free_path,
    lock,
    parse_line,
    write_header,
)
from shapechanger.errors import DemosError, OutputError
from shapechanger.files import writing

SPARE_BYTES: Final = 64 << 20
"""Disk space to leave free by default."""

FULL_BYTES: Final = MAX_TEXT_BYTES * 3 // 4
"""Size of `steps.jsonl` from which recorders begin the next episode, bytes; the rest of the limit
is for marks and edits that are added later."""

_LOCK: Final = ".recording"
_JPEG: Final = b"\xff\xd8"
_SPACE_CHECK_STEPS: Final = 20  # Free space changes slowly.
_SYNC_PERIOD_S: Final = 1.0
_NS_PER_S: Final = 1e9


class EpisodeWriter:
    """Writer of one episode; use `create` to construct one.

    Readers refuse files above a limit, so a recorder calls `continued` once the episode `is_full`.
    A thread flushes files to disk once a second, because a memory card may take longer than a
    control period: a power cut costs about a second. A crash of the program alone costs no written
    step, because the kernel already has the bytes.

    Attributes:
        path: Folder of the episode.
        steps: Number of steps written.
        dropped: Number of written steps that were undone.
        marks: Number of marks set.
    """

    def __init__(
        self,
        path: Path,
        header: EpisodeHeader,
        files: tuple[io.FileIO, io.FileIO],
        spare_bytes: int,
    ) -> None:
        self.path = path
        self.steps = self.dropped = self.marks = 0
        self._header = header
        self._sizes = header.action_layout.size, header.state_layout.size
        self._held, self._file = files
        self._spare_bytes = spare_bytes
        self._bytes = 0
        self._jpeg: bytes | None = None
        self._before: Step | None = None
        # Index and time, ns, of each kept step, for `undo`. Floats of seconds since 1970 would be
        # too coarse.
        self._times: list[tuple[int, int]] = []
        self._unsynced: SimpleQueue[Path] = SimpleQueue()
        self._closed = threading.Event()
        self._syncer = threading.Thread(target=self._sync, name="episode sync", daemon=True)
        self._syncer.start()

    @classmethod
    def create(
        cls,
        recording: Path,
        header: EpisodeHeader,
        *,
        spare_bytes: int = SPARE_BYTES,
        now: datetime | None = None,
        created: str | None = None,
    ) -> EpisodeWriter:
        """Begin an episode in a recording; create the recording if it is missing.

        Args:
            recording: Folder of the recording.
            header: Metadata of the episode.
            spare_bytes: Disk space to leave free, because other programs of a robot need it.
            now: Time that the folder is named after, UTC; None for the present.
            created: Start time of an episode that was recorded before, ISO 8601; "" if unknown;
                None for `now`.

        Raises:
            DemosError: If the header is invalid, or another process is recording there.
            OutputError: If the folder cannot be written to, or the disk is full.
        """
        now = datetime.now(UTC) if now is None else now
        created = now.isoformat(timespec="milliseconds") if created is None else created
        header = replace(header, created=created, version=version("shapechanger"))
        EpisodeHeader.from_json(header.to_json())  # Readers refuse an invalid one.
        with writing(recording):
            recording.mkdir(parents=True, exist_ok=True)
        _require_space(recording, spare_bytes)
        busy = f"{recording} is in use by another recorder: choose another folder."
        held, name = lock(recording / _LOCK, busy), f"{now:%Y%m%dT%H%M%SZ}"
        part = recording / f".{name}.{os.getpid()}"  # Complete before readers see it.
        try:
            with writing(part):
                (part / FRAMES).mkdir(parents=True, exist_ok=True)
                write_header(part, header, None)
                file = lock(part / STEPS, busy)
                path = part.rename(free_path(recording, f"{name}-0001"))
        except BaseException:
            held.close()
            raise
        return cls(path, header, (held, file), spare_bytes)

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the episode."""
        self.close()

    @property
    def is_full(self) -> bool:
        """Whether the next step should begin another episode, so that readers accept both."""
        return self._bytes >= FULL_BYTES

    def continued(self) -> EpisodeWriter:
        """Close the episode, and return the writer of the next one, which may reuse its last image.

        Raises:
            OutputError: If the next episode cannot be created; this one is closed then.
        """
        self.close("continued")
        # The next episode does not begin with a reset of the env.
        notes = self._header.notes | {"continues": self.path.name}
        header = replace(self._header, seed=None, notes=notes)
        writer = EpisodeWriter.create(self.path.parent, header, spare_bytes=self._spare_bytes)
        writer._jpeg = self._jpeg
        return writer

    @property
    def seconds(self) -> float:
        """Time from the first to the last kept step, s."""
        return (self._times[-1][1] - self._times[0][1]) / _NS_PER_S if self._times else 0.0

    def add(self, step: Step, jpeg: bytes | None = None) -> int:
        """Append a step.

        Args:
            step: The step; its index and frame fields are filled in here.
            jpeg: Its image; None to reuse the previous step's image, or without a camera. An image
                that equals the previous one is not stored again.

        Returns:
            Index of the step.

        Raises:
            DemosError: If the step does not fit the header, its image is not a JPEG, or time runs
                backwards.
            OutputError: If it cannot be written; earlier steps are intact.
        """
        self._require_open()
        if self.steps % _SPACE_CHECK_STEPS == 0:
            _require_space(self.path, self._spare_bytes)
        before, jpeg = self._before, self._jpeg if jpeg is None else jpeg
        picture, is_new = before and before.picture, False
        if jpeg is not None and (before is None or jpeg != self._jpeg):
            picture, is_new = StepPicture.of(f"{self.steps:06d}.jpg", jpeg), True
        step = msgspec.structs.replace(step, index=self.steps, picture=picture)
        line = encode_line(step)
        try:
            parse_line(line)  # Readers refuse an invalid one.
            refusal = step.refusal(*self._sizes)
        except ValueError as error:
            refusal = str(error)
        for name in ("captured_ns", "decided_ns"):
            earlier, later = getattr(before, name, None), getattr(step, name)
            if earlier is not None and later is not None and later < earlier:
                refusal = f"time runs backwards, from {earlier} to {later} ns ({name})"
        if jpeg is not None and not jpeg.startswith(_JPEG):
            refusal = "its image is not a JPEG"
        if refusal:
            raise DemosError(f"Step {self.steps} of {self.path} cannot be recorded: {refusal}.")
        if jpeg is not None and is_new:
            path = self.path / FRAMES / step.frame
            with writing(path):
                path.write_bytes(jpeg)
            self._unsynced.put(path)
        self._append(line)
        self._before, self._jpeg = step, jpeg
        at_ns = step.clock_ns
        if at_ns is None:
            at_ns = round(step.index * _NS_PER_S / self._header.control_hz)
        self._times.append((step.index, at_ns))
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
        self._append(encode_line(EpisodeMark(self.steps - 1, text)))
        self.marks += 1

    def undo(self, seconds: float = 5.0) -> int:
        """Exclude the newest kept step and steps less than `seconds` before it; they stay on disk.

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
        self._append(encode_line(Drop(self._times[-count][0], self.steps - 1, "undo")))
        del self._times[-count:]
        self.dropped += count
        return count

    def close(self, outcome: str = "") -> None:
        """Close the episode; further calls do nothing.

        Args:
            outcome: How it ended, such as "collision" or "time"; "" if unspecified.

        Raises:
            OutputError: If the header cannot be written; all steps are on disk nevertheless.
        """
        if self._closed.is_set():
            return
        self._closed.set()
        self._syncer.join()
        with self._held, self._file:
            write_header(self.path, self._header, {"steps": self.steps, "outcome": outcome})

    def _append(self, line: bytes) -> None:
        with writing(self.path / STEPS):
            append(self._file, line)
        self._bytes += len(line)

    def _sync(self) -> None:
        """Flush images and then the lines that name them, once a second until the end."""
        # The next write reports a failing disk; an error here would have no recipient.
        is_last = False
        while not is_last:
            is_last = self._closed.wait(_SYNC_PERIOD_S)
            while not self._unsynced.empty():
                with suppress(OSError), self._unsynced.get().open("rb") as file:
                    os.fsync(file.fileno())
            with suppress(OSError):
                os.fsync(self._file.fileno())

    def _require_open(self) -> None:
        if self._closed.is_set():
            raise DemosError(f"The episode {self.path} is closed.")


def _require_space(folder: Path, spare_bytes: int) -> None:
    """Refuse to fill the disk."""
    with writing(folder):
        free = shutil.disk_usage(folder).free
    if free < spare_bytes:
        raise OutputError(
            f"Cannot write to {folder}: only {free >> 20} MB of the disk are free, and at least "
            f"{spare_bytes >> 20} MB must stay free."
        )
