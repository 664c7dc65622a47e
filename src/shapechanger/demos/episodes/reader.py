"""Reads what was recorded."""

from __future__ import annotations

import binascii
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

from shapechanger.demos.episodes.files import FRAMES, HEADER, is_episode
from shapechanger.demos.episodes.header import EpisodeHeader
from shapechanger.demos.episodes.scan import Line, scan
from shapechanger.demos.episodes.step import Step
from shapechanger.errors import BrokenEpisode, DemosError

__all__ = ["Drop", "Episode", "Mark", "episodes_of", "read_episode", "read_header"]


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that somebody wanted to find again.

    Attributes:
        step: Index of the step.
        text: Their words.
    """

    step: int
    text: str


@dataclass(frozen=True, slots=True)
class Drop:
    """Steps that do not count, or count again.

    Attributes:
        first: Index of the first.
        last: Index of the last.
        why: Such as "undo", "cut" or "bad".
        keep: Whether they count again.
    """

    first: int
    last: int
    why: str
    keep: bool = False


@dataclass(frozen=True)
class Episode:
    """What was recorded.

    Attributes:
        path: Its folder.
        header: What it is of.
        steps: All its steps.
        marks: In the order in which they were set.
        drops: In the order in which they were said; a later one overrules an earlier one.
        closed: Whether it was ended, and not cut off.
        outcome: How it ended; "" for just so.
    """

    path: Path
    header: EpisodeHeader
    steps: tuple[Step, ...]
    marks: tuple[Mark, ...]
    drops: tuple[Drop, ...]
    closed: bool
    outcome: str

    @cached_property
    def kept(self) -> tuple[Step, ...]:
        """The steps that count."""
        gone: set[int] = set()
        for drop in self.drops:
            # Not beyond the steps that there are, whatever a line says.
            reach = (s.index for s in self.steps if drop.first <= s.index <= drop.last)
            (gone.difference_update if drop.keep else gone.update)(reach)
        return tuple(step for step in self.steps if step.index not in gone)

    @property
    def seconds(self) -> float:
        """How long the steps that count last, s."""
        return len(self.kept) / self.header.control_hz

    def jpeg(self, step: Step) -> bytes | None:
        """The picture of a step, as it was received; None for none.

        Raises:
            BrokenEpisode: If it is not the one that was recorded.
        """
        if not step.frame:
            return None
        try:
            data = (self.path / FRAMES / step.frame).read_bytes()
        except OSError as error:
            raise _broken(self.path, f"the picture {step.frame} cannot be read") from error
        if binascii.crc32(data) != step.frame_crc:
            raise _broken(self.path, f"the picture {step.frame} was changed")
        return data


def read_episode(path: Path) -> Episode:
    """Read an episode; the bytes of pictures stay where they are.

    Raises:
        DemosError: If this is no episode, or of another format.
        BrokenEpisode: If something in it is not whole.
    """
    header, closed = read_header(path)
    lines = scan(path, header, thorough=False)
    for number, line in enumerate(lines, 1):
        if line.wrong:
            raise _broken(path, f"line {number} does not count, because {line.wrong}")
    return _put_together(path, header, closed, lines)


def read_header(path: Path) -> tuple[EpisodeHeader, dict[str, Any] | None]:
    """The header of an episode, and how it was closed; None if it was not.

    Raises:
        DemosError: If there is none, or it cannot be read.
    """
    file = path / HEADER
    try:
        plain = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DemosError(f"{path} is no episode: there is no {HEADER} in it.") from None
    except (OSError, ValueError) as error:
        raise DemosError(f"{file} cannot be read: {error}.") from error
    if not isinstance(plain, dict):
        raise DemosError(f"{file} is no header.")
    fields = cast("dict[str, Any]", plain)
    closed = fields.get("closed")
    try:
        header = EpisodeHeader.from_json(fields)
    except DemosError as error:
        raise DemosError(f"{file}: {error}") from error
    return header, cast("dict[str, Any]", closed) if isinstance(closed, dict) else None


def episodes_of(data: Path) -> tuple[Path, ...]:
    """The folders of the episodes of a recording, the oldest first.

    Args:
        data: Folder of a recording, or of one episode.

    Raises:
        DemosError: If there is none.
    """
    if is_episode(data):
        return (data,)
    if not data.exists():
        raise DemosError(f"There is no recording {data}.")
    if not data.is_dir():
        raise DemosError(f"{data} is a file, and a recording is a folder of episodes.")
    found = sorted(p for p in data.iterdir() if not p.name.startswith(".") and is_episode(p))
    if not found:
        raise DemosError(f"There is no episode in {data}: one is a folder with {HEADER}.")
    return tuple(found)


def _put_together(
    path: Path, header: EpisodeHeader, closed: dict[str, Any] | None, lines: list[Line]
) -> Episode:
    marks: list[Mark] = []
    drops: list[Drop] = []
    for line in lines:
        said = line.fields
        try:
            match said.get("kind"):
                case "mark":
                    marks.append(Mark(int(said["step"]), str(said.get("text", ""))))
                case "drop" | "keep":
                    first, last = int(said["first"]), int(said["last"])
                    drops.append(
                        Drop(first, last, str(said.get("why", "")), said["kind"] == "keep")
                    )
                case _:  # A step, or what a later version has to say.
                    pass
        except (LookupError, TypeError, ValueError) as error:
            raise _broken(path, f"a line says {said}") from error
    return Episode(
        path=path,
        header=header,
        steps=tuple(line.step for line in lines if line.step is not None),
        marks=tuple(marks),
        drops=tuple(drops),
        closed=closed is not None,
        outcome="" if closed is None else str(closed.get("outcome", "")),
    )


def _broken(path: Path, why: str) -> BrokenEpisode:
    return BrokenEpisode(
        f"{path} is not whole: {why}. `shapechanger demos repair {path}` keeps every step that is."
    )
