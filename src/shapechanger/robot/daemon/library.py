"""What was recorded on the robot: the list of episodes, pieces of them, and judgements."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

from shapechanger.demos.episodes import drop, keep
from shapechanger.demos.episodes.files import FRAMES, HEADER, STEPS, is_episode
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.link.messages import (
    MAX_PIECE,
    MAX_ROBOT_MESSAGE,
    Browse,
    Fetch,
    Judge,
    Piece,
    Recordings,
    Refused,
    encode,
)
from shapechanger.robot.daemon.line_index import LineIndex
from shapechanger.robot.daemon.summaries import EPISODE_ID, Summaries
from shapechanger.robot.daemon.worker import Worker

__all__ = ["Answer", "Library", "Question"]

Question = Browse | Fetch | Judge
Answer = Recordings | Piece | Refused

# A name that leads nowhere else.
_FRAME_NAME: Final = re.compile(r"[0-9]{6,}\.jpg")


class Library:
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
