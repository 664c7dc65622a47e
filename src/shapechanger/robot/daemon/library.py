"""Library of recordings: list episodes, read parts of them, and keep or drop steps."""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import Drop, Keep, Step, edit, read_outline, records
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.files import read_file
from shapechanger.robot.daemon.recorder import Worker
from shapechanger.robot.link import messages

Question = messages.Browse | messages.Fetch | messages.Judge
Answer = messages.Recordings | messages.Piece | messages.Refused

_EPISODE_ID: Final = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]{0,127}")
_MAX_TEXT: Final = 200


class RecordingLibrary:
    """Answers requests about a folder of episodes, one after another, in a separate thread.

    The summary of an episode is kept until the episode changes.
    """

    def __init__(self, folder: Path, call: Callable[[Callable[[], None]], None]) -> None:
        self._folder = folder
        self._worker = Worker("library", call)
        self._known: dict[str, tuple[object, messages.EpisodeSummary]] = {}
        self._index = LineIndex(Path())

    def ask(self, question: Question, then: Callable[[Answer], None]) -> None:
        """Queue a request; the caller limits the number of open requests."""
        self._worker.put(partial(self._answer, question), then)

    def close(self) -> None:
        """End the thread, and wait for a request in progress, up to a time limit."""
        self._worker.close()

    def _answer(self, question: Question) -> Answer:
        """Answer a request; an error becomes a refusal."""
        try:
            match question:
                case messages.Browse():
                    return self._newest(question.before)
                case messages.Fetch():
                    return self._piece(self._path(question.episode), question)
                case messages.Judge():
                    path = self._path(question.episode)
                    span = question.first, question.last
                    edit(path, Keep(*span) if question.keep else Drop(*span, "bad"))
                    return messages.Recordings(episodes=(self.summary(question.episode),))
        except (ShapechangerError, OSError, ValueError) as error:
            return messages.Refused(reason=str(error))

    def summary(self, name: str) -> messages.EpisodeSummary:
        """Summarise one episode; if it is unreadable, its outcome is the error."""
        path = self._folder / name
        try:
            # These values change whenever the episode changes.
            found = ((path / records.STEPS).stat(), (path / records.HEADER).stat())
            stamp = tuple((one.st_mtime_ns, one.st_size, one.st_ino) for one in found)
            known = self._known.get(name)
            if known is not None and known[0] == stamp:
                return known[1]
            outline = read_outline(path)
        except (DemosError, OSError) as error:
            return messages.EpisodeSummary(id=name, outcome=str(error)[:_MAX_TEXT])
        summary = messages.EpisodeSummary(
            id=name,
            steps=len(outline.steps),
            kept=len(outline.kept),
            seconds=outline.seconds,
            closed=outline.closed,
            created=outline.header.created[:_MAX_TEXT],
            driver=outline.header.driver[:_MAX_TEXT],
            outcome=outline.outcome[:_MAX_TEXT],
        )
        self._known[name] = stamp, summary
        return summary

    def _newest(self, before: str) -> messages.Recordings:
        """List up to `MAX_EPISODES` episodes, newest first; ids before `before`, or any for ""."""
        paths = list(self._folder.iterdir()) if self._folder.exists() else []
        found = sorted((path.name for path in paths if _is_listed(path)), reverse=True)
        self._known = {name: self._known[name] for name in found if name in self._known}
        found = [name for name in found if not before or name < before]
        listed = tuple(self.summary(name) for name in found[: messages.MAX_EPISODES])
        return messages.Recordings(episodes=listed, more=len(found) > messages.MAX_EPISODES)

    def _path(self, name: str) -> Path:
        """Return the folder of an episode, directly inside the folder of recordings."""
        path = self._folder / name
        if not _EPISODE_ID.fullmatch(name) or not _is_listed(path):
            raise DemosError(f"There is no episode {name!r} on this robot.")
        return path

    def _piece(self, path: Path, question: messages.Fetch) -> messages.Piece:
        steps = path / records.STEPS
        if self._index.path != steps:
            self._index = LineIndex(steps)
        index, header = self._index, (path / records.HEADER).read_bytes().decode()
        lines: list[str] = []
        frames: list[bytes | None] = []
        size, frame_before = len(header), ""
        for number, line in enumerate(index.lines(question.first, question.count), question.first):
            try:
                parsed = records.parse_line(line.encode() + b"\n")
            except ValueError as error:
                raise DemosError(
                    f"Line {number + 1} of {steps} is damaged, because {error}."
                ) from error
            name = parsed.frame if isinstance(parsed, Step) else ""
            frame = None
            if name and name != frame_before:
                frame = read_file(path / records.FRAMES / name, records.MAX_PICTURE_BYTES)
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
        self._ends: array[int] = array("Q", [0])  # 0, and the end of each complete line.
        self._inode = -1

    def __len__(self) -> int:
        """Return the number of complete lines at the last call of `lines`."""
        return len(self._ends) - 1

    def lines(self, first: int, count: int) -> Iterator[str]:
        r"""Read up to `count` lines from number `first` on, and return them without their `\n`.

        Lines that were appended are indexed first, or all lines if the file was replaced.
        """
        with self.path.open("rb") as file:
            found = os.fstat(file.fileno())
            if found.st_ino != self._inode or found.st_size < self._ends[-1]:
                self._ends, self._inode = array("Q", [0]), found.st_ino
            file.seek(self._ends[-1])
            for line in file:
                if line.endswith(b"\n"):
                    self._ends.append(self._ends[-1] + len(line))
            file.seek(self._ends[min(first, len(self))])
            for _ in range(first, min(first + count, len(self))):
                yield file.readline()[:-1].decode()


def _is_listed(path: Path) -> bool:
    """Return True for the folder of an episode, but not for a link to another folder."""
    return (
        bool(_EPISODE_ID.fullmatch(path.name))
        and not path.is_symlink()
        and records.is_episode(path)
    )
