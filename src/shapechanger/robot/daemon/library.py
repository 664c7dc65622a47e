"""Library of recordings: the list of episodes, pieces of them, and judgements."""

from __future__ import annotations

import math
import os
import queue
import re
import threading
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Final

import msgspec
from msgspec import Meta

from shapechanger.demos.episodes import drop, keep
from shapechanger.demos.episodes.files import (
    FRAMES,
    HEADER,
    MAX_PICTURE_BYTES,
    STEPS,
    is_episode,
    read_file,
)
from shapechanger.demos.episodes.reader import read_header
from shapechanger.demos.episodes.records import durations_s
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.robot.link import messages

Question = messages.Browse | messages.Fetch | messages.Judge
Answer = messages.Recordings | messages.Piece | messages.Refused

_EPISODE_ID: Final = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]{0,127}")
_MAX_TEXT: Final = 200
_CHUNK: Final = 1 << 16
_JOIN_S: Final = 2.0


class _Line(msgspec.Struct, frozen=True):
    """What the library needs of a line of `steps.jsonl`; an hour of steps has 72 000."""

    kind: str
    step: int = -1
    first: int = 0
    last: int = -1
    captured_ns: int | None = None
    decided_ns: int | None = None
    # File, size and checksum. Such a name never leads to another folder.
    frame: tuple[Annotated[str, Meta(pattern=r"^[0-9]{6,}\.jpg\Z")], Any, Any] | None = None


_LINES: Final = msgspec.json.Decoder(_Line)


class RecordingLibrary:
    """Answers questions about recordings, one after another, in its own thread."""

    def __init__(self, folder: Path | None, call: Callable[[Callable[[], None]], None]) -> None:
        self._recordings = None if folder is None else RecordingFolder(folder)
        self._call = call
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def ask(self, question: Question, then: Callable[[Answer], None]) -> None:
        """Ask a question; the caller bounds how many are open."""
        recordings = self._recordings
        if recordings is None:
            then(messages.Refused(reason="This robot was served without a folder for recordings."))
            return

        def work() -> None:
            answer = recordings.answer(question)
            self._call(lambda: then(answer))

        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="library", daemon=True)
            self._thread.start()
        self._work.put(work)

    def close(self) -> None:
        """End the thread, without waiting for a disk that hangs."""
        if self._thread is not None:
            self._work.put(None)
            self._thread.join(_JOIN_S)

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()


class RecordingFolder:
    """Folder of episodes; an unchanged episode is read once for the list."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, tuple[object, messages.EpisodeSummary]] = {}
        self._index: LineIndex | None = None

    def answer(self, question: Question) -> Answer:
        """Answer a question; errors of the disk are refusals."""
        try:
            match question:
                case messages.Browse():
                    return self._newest(question.before)
                case messages.Fetch():
                    return self._piece(self._path(question.episode), question)
                case messages.Judge():
                    path = self._path(question.episode)
                    if question.keep:
                        keep(path, question.first, question.last)
                    else:
                        drop(path, question.first, question.last, "bad")
                    return messages.Recordings(episodes=(self.summary(question.episode),))
        except (ShapechangerError, OSError, ValueError) as error:
            return messages.Refused(reason=str(error))

    def summary(self, name: str) -> messages.EpisodeSummary:
        """Summarise one episode; the outcome of an unreadable one is the error."""
        path = self._folder / name
        try:
            # Numbers that change when the episode does.
            found = ((path / STEPS).stat(), (path / HEADER).stat())
            stamp = tuple((one.st_mtime_ns, one.st_size, one.st_ino) for one in found)
            known = self._known.get(name)
            if known is not None and known[0] == stamp:
                return known[1]
            summary = _summary(path)
        except (DemosError, OSError) as error:
            return messages.EpisodeSummary(id=name, outcome=str(error)[:_MAX_TEXT])
        self._known[name] = stamp, summary
        return summary

    def _newest(self, before: str) -> messages.Recordings:
        """List the newest episodes with ids before `before`, or all for ""; newest first."""
        paths = list(self._folder.iterdir()) if self._folder.exists() else []
        found = sorted((path.name for path in paths if _is_listed(path)), reverse=True)
        self._known = {name: self._known[name] for name in found if name in self._known}
        found = [name for name in found if not before or name < before]
        listed = tuple(self.summary(name) for name in found[: messages.MAX_EPISODES])
        return messages.Recordings(episodes=listed, more=len(found) > messages.MAX_EPISODES)

    def _path(self, name: str) -> Path:
        """Return the folder of an episode, directly inside that of the recordings."""
        path = self._folder / name
        if not _EPISODE_ID.fullmatch(name) or not _is_listed(path):
            raise DemosError(f"There is no episode {name!r} on this robot.")
        return path

    def _piece(self, path: Path, question: messages.Fetch) -> messages.Piece:
        """Read a part of an episode."""
        steps = path / STEPS
        index = self._index
        if index is None or index.path != steps:
            index = self._index = LineIndex(steps)
        header = (path / HEADER).read_bytes().decode()
        lines: list[str] = []
        frames: list[bytes | None] = []
        with steps.open("rb") as file:
            index.refresh(file)
            last = min(question.first + question.count, len(index))
            size, frame_before = len(header), ""
            for number in range(question.first, last):
                line = index.read(file, number)[:-1].decode()
                try:
                    named = _LINES.decode(line).frame
                except msgspec.MsgspecError as error:
                    raise DemosError(f"Line {number + 1} of {steps} is damaged: {error}.") from None
                name = "" if named is None else named[0]
                frame = None
                if name and name != frame_before:
                    frame = read_file(path / FRAMES / name, MAX_PICTURE_BYTES)
                size += len(line.encode()) + len(frame or b"")
                if lines and size > messages.MAX_PIECE:
                    break
                lines.append(line)
                frames.append(frame)
                frame_before = name
        piece = messages.Piece(
            episode=question.episode,
            first=question.first,
            total=len(index),
            lines=tuple(lines),
            frames=tuple(frames),
            header=header,
        )
        if size > messages.MAX_PIECE and len(messages.encode(piece)) > messages.MAX_ROBOT_MESSAGE:
            raise DemosError(f"Line {question.first + 1} of {steps} is too large to send.")
        return piece


class LineIndex:
    r"""Offsets of the complete lines of a growing file: those that end with `\n`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: array[int] = array("Q")  # Offset behind each complete line.
        self._read_to = 0
        self._inode = -1

    def __len__(self) -> int:
        """Return the number of complete lines at the last `refresh`."""
        return len(self._ends)

    def refresh(self, file: BinaryIO) -> None:
        """Read what was appended, or all of it if the file was replaced or truncated."""
        found = os.fstat(file.fileno())
        if found.st_ino != self._inode or found.st_size < self._read_to:
            self._ends, self._read_to, self._inode = array("Q"), 0, found.st_ino
        file.seek(self._read_to)
        while chunk := file.read(_CHUNK):
            at = -1
            while (at := chunk.find(b"\n", at + 1)) != -1:
                self._ends.append(self._read_to + at + 1)
            self._read_to += len(chunk)

    def read(self, file: BinaryIO, number: int) -> bytes:
        r"""Read a line with its `\n`."""
        start = self._ends[number - 1] if number else 0
        file.seek(start)
        return file.read(self._ends[number] - start)


def _is_listed(path: Path) -> bool:
    """Return True for the folder of an episode, and never for a link to another place."""
    return bool(_EPISODE_ID.fullmatch(path.name)) and not path.is_symlink() and is_episode(path)


def _summary(path: Path) -> messages.EpisodeSummary:
    """Summarise an episode; an incomplete or damaged line is left out."""
    header, closed = read_header(path)
    steps: dict[int, int | None] = {}
    edits: list[_Line] = []
    with (path / STEPS).open("rb") as lines:
        for raw in lines:
            try:
                line = _LINES.decode(raw)
            except (msgspec.MsgspecError, UnicodeDecodeError):
                continue
            if line.kind == "step" and raw.endswith(b"\n"):
                at_ns = line.decided_ns if line.captured_ns is None else line.captured_ns
                steps[line.step] = at_ns
            elif line.kind in {"drop", "keep"}:
                edits.append(line)
    dropped: set[int] = set()
    for edit in edits:
        # Only existing steps, whatever range the line names.
        reach = {index for index in steps if edit.first <= index <= edit.last}
        (dropped.difference_update if edit.kind == "keep" else dropped.update)(reach)
    lasted = zip(steps, durations_s([*steps.values()], header.control_hz), strict=True)
    return messages.EpisodeSummary(
        id=path.name,
        steps=len(steps),
        kept=len(steps) - len(dropped),
        seconds=math.fsum(seconds for index, seconds in lasted if index not in dropped),
        closed=closed is not None,
        created=header.created[:_MAX_TEXT],
        driver=header.driver[:_MAX_TEXT],
        outcome="" if closed is None else str(closed.get("outcome", ""))[:_MAX_TEXT],
    )
