"""What was recorded on the robot: the list of episodes, pieces of them, and judgements."""

from __future__ import annotations

import json
import os
import queue
import re
import threading
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

from shapechanger.demos.episodes import drop, keep
from shapechanger.demos.episodes.files import FRAMES, HEADER, STEPS, is_episode
from shapechanger.demos.episodes.reader import read_header
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.link.messages import (
    MAX_EPISODES,
    MAX_PIECE,
    MAX_ROBOT_MESSAGE,
    Browse,
    EpisodeSummary,
    Fetch,
    Judge,
    Piece,
    Recordings,
    Refused,
    encode,
)

__all__ = [
    "EPISODE_ID",
    "Answer",
    "LineIndex",
    "Question",
    "RecordingLibrary",
    "Summaries",
    "Worker",
]

EPISODE_ID: Final = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]{0,127}")
"""Names of folders that a client may ask for."""

# As `Step.to_json` begins. Only these are told apart without reading the line as JSON: there are
# 1200 a minute.
_STEP: Final = re.compile(rb'\{"kind":"step","step":(\d{1,15}),')
_MOST_WORDS: Final = 200


class Summaries:
    """The list of the episodes of a folder; what has not changed is read once.

    Args:
        folder: Folder of the recordings.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, tuple[tuple[int, ...], EpisodeSummary]] = {}

    def newest(self, before: str) -> Recordings:
        """The newest episodes, newest first.

        Args:
            before: Only those whose id sorts before this one; "" for all.

        Raises:
            OSError: If the folder cannot be read.
        """
        found = sorted(self._ids(), reverse=True)
        self._known = {name: self._known[name] for name in found if name in self._known}
        found = [name for name in found if not before or name < before]
        listed = tuple(self.summary(name) for name in found[:MAX_EPISODES])
        return Recordings(episodes=listed, more=len(found) > MAX_EPISODES)

    def summary(self, name: str) -> EpisodeSummary:
        """One episode."""
        path = self._folder / name
        try:
            stamp = _stamp(path)
            known = self._known.get(name)
            if known is not None and known[0] == stamp:
                return known[1]
            summary = _summary(path)
        except (DemosError, OSError) as error:
            return EpisodeSummary(
                id=name,
                steps=0,
                kept=0,
                seconds=0.0,
                closed=False,
                created="",
                driver="",
                outcome=str(error)[:_MOST_WORDS],
            )
        self._known[name] = stamp, summary
        return summary

    def _ids(self) -> list[str]:
        if not self._folder.exists():
            return []
        return [
            path.name
            for path in self._folder.iterdir()
            if EPISODE_ID.fullmatch(path.name) and not path.is_symlink() and is_episode(path)
        ]


def _stamp(path: Path) -> tuple[int, ...]:
    """What changes when an episode does."""
    numbers: list[int] = []
    for file in (path / STEPS, path / "episode.json"):
        found = file.stat()
        numbers += [found.st_mtime_ns, found.st_size, found.st_ino]
    return tuple(numbers)


def _summary(path: Path) -> EpisodeSummary:
    header, closed = read_header(path)
    steps, dropped = _steps(path / STEPS)
    kept = len(steps) - len(dropped)
    return EpisodeSummary(
        id=path.name,
        steps=len(steps),
        kept=kept,
        seconds=kept / header.control_hz,
        closed=closed is not None,
        created=header.created[:_MOST_WORDS],
        driver=header.driver[:_MOST_WORDS],
        outcome="" if closed is None else str(closed.get("outcome", ""))[:_MOST_WORDS],
    )


def _steps(file: Path) -> tuple[set[int], set[int]]:
    """The indices of all steps, and of those that do not count.

    Raises:
        OSError: If the file cannot be read.
    """
    steps: set[int] = set()
    dropped: set[int] = set()
    said: list[dict[str, Any]] = []
    with file.open("rb") as lines:
        for line in lines:
            step = _STEP.match(line)
            if step is not None and line.endswith(b"\n"):
                steps.add(int(step[1]))
            elif step is None:
                said += _drop(line)
    for drop in said:
        # Not beyond the steps that there are, whatever a line says.
        reach = {index for index in steps if drop["first"] <= index <= drop["last"]}
        (dropped.difference_update if drop["kind"] == "keep" else dropped.update)(reach)
    return steps, dropped


def _drop(line: bytes) -> list[dict[str, Any]]:
    """The line, if it drops steps or keeps them; one that is cut off does not count."""
    try:
        fields = json.loads(line)
    except ValueError:
        return []
    if not isinstance(fields, dict):
        return []
    said = cast("dict[str, Any]", fields)
    numbers = isinstance(said.get("first"), int) and isinstance(said.get("last"), int)
    return [said] if said.get("kind") in ("drop", "keep") and numbers else []


_CHUNK: Final = 1 << 16


class LineIndex:
    r"""The complete lines of a file: those that end with `\n`.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Where each complete line ends; 8 bytes a line.
        self._ends: array[int] = array("Q")
        self._read_to = 0
        self._inode = -1

    def __len__(self) -> int:
        """How many complete lines were there at the last `refresh`."""
        return len(self._ends)

    def refresh(self, file: BinaryIO) -> None:
        """Look at what has come since; from the beginning, if the file is another or shorter one.

        Args:
            file: The file, open for reading.

        Raises:
            OSError: If it cannot be read.
        """
        found = os.fstat(file.fileno())
        if found.st_ino != self._inode or found.st_size < self._read_to:
            self._ends, self._read_to, self._inode = array("Q"), 0, found.st_ino
        file.seek(self._read_to)
        while chunk := file.read(_CHUNK):
            at = -1
            while (at := chunk.find(b"\n", at + 1)) != -1:
                self._ends.append(self._read_to + at + 1)
            self._read_to += len(chunk)

    def begins(self, number: int) -> int:
        """Where a line begins, in bytes."""
        return self._ends[number - 1] if number else 0

    def read(self, file: BinaryIO, number: int) -> bytes:
        r"""A line with its `\n`.

        Raises:
            OSError: If it cannot be read.
        """
        began = self.begins(number)
        file.seek(began)
        return file.read(self._ends[number] - began)


_JOIN_S: Final = 2.0


class Worker:
    """Does one thing after the other in a thread that begins with the first."""

    def __init__(self) -> None:
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def do(self, work: Callable[[], None]) -> None:
        """Do something once everything before is done; whoever asks keeps the number bounded."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="library", daemon=True)
            self._thread.start()
        self._work.put(work)

    def close(self) -> None:
        """End the thread, but do not wait for a disk that is stuck."""
        if self._thread is not None:
            self._work.put(None)
            self._thread.join(_JOIN_S)

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()


Question = Browse | Fetch | Judge
Answer = Recordings | Piece | Refused

# A name that leads nowhere else.
_FRAME_NAME: Final = re.compile(r"[0-9]{6,}\.jpg")


class RecordingLibrary:
    """Answers questions about recordings, in a thread of its own.

    Args:
        folder: Folder of the recordings; None for none.
        call: Runs a function in the thread of the connections; may be called from any thread.
    """

    def __init__(self, folder: Path | None, call: Callable[[Callable[[], None]], None]) -> None:
        self._folder = folder
        self._call = call
        self._worker = Worker()
        self._summaries = Summaries(Path() if folder is None else folder)
        self._index: LineIndex | None = None

    def ask(self, question: Question, then: Callable[[Answer], None]) -> None:
        """Ask something.

        Args:
            question: What to ask; a judgement by a person.
            then: Gets the answer, in the thread of the connections.
        """
        folder = self._folder
        if folder is None:
            then(Refused(reason="This robot was served without a folder for recordings."))
            return

        def work() -> None:
            answer = self._answer(folder, question)
            self._call(lambda: then(answer))

        self._worker.do(work)

    def close(self) -> None:
        """Answer nothing any more."""
        self._worker.close()

    def _answer(self, folder: Path, question: Question) -> Answer:
        try:
            match question:
                case Browse():
                    return self._summaries.newest(question.before)
                case Fetch():
                    return self._piece(_episode(folder, question.episode), question)
                case Judge():
                    path = _episode(folder, question.episode)
                    if question.keep:
                        keep(path, question.first, question.last)
                    else:
                        drop(path, question.first, question.last, "bad")
                    return Recordings(episodes=(self._summaries.summary(question.episode),))
        except (ShapechangerError, OSError, ValueError) as error:
            return Refused(reason=str(error))

    def _piece(self, path: Path, question: Fetch) -> Piece:
        """A part of an episode, as it is on the disk.

        Raises:
            DemosError: If it is not whole, or one step would be too large a message.
            OSError: If it cannot be read.
            ValueError: If it is no text.
        """
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
                line = _line(file, index, number)
                name = _frame_of(line, steps, number)
                frame = _frame(path, name) if name and name != frame_before else None
                size += len(line.encode()) + len(frame or b"")
                if lines and size > MAX_PIECE:
                    break
                lines.append(line)
                frames.append(frame)
                frame_before = name
        piece = Piece(
            episode=question.episode,
            first=question.first,
            total=len(index),
            lines=tuple(lines),
            frames=tuple(frames),
            header=header,
        )
        if size > MAX_PIECE and len(encode(piece)) > MAX_ROBOT_MESSAGE:
            raise DemosError(f"Line {question.first + 1} of {steps} is too large to be sent.")
        return piece


def _episode(folder: Path, name: str) -> Path:
    """The folder of an episode, which lies in that of the recordings and nowhere else.

    Raises:
        DemosError: If there is none.
    """
    path = folder / name
    if not EPISODE_ID.fullmatch(name) or path.is_symlink() or not is_episode(path):
        raise DemosError(f"There is no episode {name!r} on this robot.")
    return path


def _line(file: BinaryIO, index: LineIndex, number: int) -> str:
    return index.read(file, number)[:-1].decode("utf-8")


def _frame(path: Path, name: str) -> bytes:
    """A picture.

    Raises:
        DemosError: If it cannot be read.
    """
    try:
        return (path / FRAMES / name).read_bytes()
    except OSError as error:
        raise DemosError(
            f"The picture {name} of {path.name} cannot be read: {error.strerror or error}."
        ) from error


def _frame_of(line: str, steps: Path, number: int) -> str:
    """Name of the picture of a line; "" for none.

    Raises:
        DemosError: If the line is damaged.
    """
    try:
        fields = json.loads(line)
    except ValueError as error:
        raise DemosError(f"Line {number + 1} of {steps} is damaged: {error}.") from error
    frame = cast("dict[str, Any]", fields).get("frame") if isinstance(fields, dict) else None
    if frame is None:
        return ""
    name = cast("list[Any]", frame)[0] if isinstance(frame, list) and frame else None
    if not isinstance(name, str) or not _FRAME_NAME.fullmatch(name):
        raise DemosError(f"Line {number + 1} of {steps} is damaged: its picture is {name!r}.")
    return name
