"""Reads what was recorded."""

from __future__ import annotations

import binascii
import json
import os
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes.files import (
    FRAMES,
    HEADER,
    LOST,
    STEPS,
    cannot_write,
    is_episode,
    lock,
    write_all,
    write_header,
)
from shapechanger.demos.episodes.records import (
    EpisodeHeader,
    Step,
    decode_line,
    encode_line,
    split_lines,
)
from shapechanger.errors import BrokenEpisode, DemosError

__all__ = [
    "CUT_OFF",
    "Drop",
    "Episode",
    "EpisodeMark",
    "Repair",
    "StepLine",
    "drop",
    "episodes_of",
    "keep",
    "mark",
    "read_episode",
    "read_header",
    "repair",
    "scan",
]

# A name that leads nowhere else.
_FRAME_NAME: Final = re.compile(r"[0-9]{6,}\.jpg")


@dataclass(frozen=True, slots=True)
class StepLine:
    """One line of the file of steps.

    Attributes:
        raw: Its bytes.
        fields: What it says; nothing if it is not whole.
        step: The step, if it is one.
        wrong: Why it does not count, in words; "" if it does.
    """

    raw: bytes
    fields: dict[str, Any]
    step: Step | None
    wrong: str


def scan(path: Path, header: EpisodeHeader, *, thorough: bool) -> list[StepLine]:
    """Look at every line, and at the picture that it names.

    Args:
        path: Folder of the episode.
        header: Its header.
        thorough: Whether to read each picture, and not only look at its size.

    Raises:
        DemosError: If the file cannot be read.
    """
    try:
        content = (path / STEPS).read_bytes()
    except OSError as error:
        raise DemosError(f"{path / STEPS} cannot be read: {error.strerror or error}.") from error
    sizes = header.action_size, header.state_size
    lines: list[StepLine] = []
    seen: dict[tuple[str, int, int], str] = {}
    newest = -1
    for raw in split_lines(content):
        try:
            fields = decode_line(raw)
            step = Step.from_json(fields) if fields.get("kind") == "step" else None
        except ValueError as error:
            lines.append(StepLine(raw, {}, None, str(error)))
            continue
        wrong = ""
        if step is not None:
            wrong = step.refusal(*sizes)
            if not wrong and step.index <= newest:
                wrong = f"it comes after step {newest}"
            if not wrong and step.frame:
                picture = (step.frame, step.frame_bytes, step.frame_crc)
                if picture not in seen:
                    seen[picture] = _wrong_with(path / FRAMES, step, thorough=thorough)
                wrong = seen[picture]
            newest = max(newest, step.index)
        lines.append(StepLine(raw, fields, step, wrong))
    return lines


def _wrong_with(frames: Path, step: Step, *, thorough: bool) -> str:
    """What is wrong with the picture of a step, in words; empty for nothing."""
    if not _FRAME_NAME.fullmatch(step.frame):
        return f"its picture is called {step.frame!r}"
    try:
        size = (frames / step.frame).stat().st_size
        if size != step.frame_bytes:
            return f"its picture {step.frame} has {size} bytes in place of {step.frame_bytes}"
        if thorough and binascii.crc32((frames / step.frame).read_bytes()) != step.frame_crc:
            return f"its picture {step.frame} was changed"
    except FileNotFoundError:
        return f"its picture {step.frame} is missing"
    except OSError as error:
        return f"its picture {step.frame} cannot be read ({error.strerror})"
    return ""


@dataclass(frozen=True, slots=True)
class EpisodeMark:
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
    marks: tuple[EpisodeMark, ...]
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
    path: Path, header: EpisodeHeader, closed: dict[str, Any] | None, lines: list[StepLine]
) -> Episode:
    marks: list[EpisodeMark] = []
    drops: list[Drop] = []
    for line in lines:
        said = line.fields
        try:
            match said.get("kind"):
                case "mark":
                    marks.append(EpisodeMark(int(said["step"]), str(said.get("text", ""))))
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


CUT_OFF: Final = "cut off"
"""Outcome of an episode that nobody closed."""


@dataclass(frozen=True, slots=True)
class Repair:
    """What was done.

    Attributes:
        kept: How many steps there are.
        lost: Why each line that does not count any more does not, in words.
        pictures: How many pictures belong to no step.
        was_closed: Whether it had been closed.
    """

    kept: int
    lost: tuple[str, ...]
    pictures: int
    was_closed: bool

    @property
    def changed(self) -> bool:
        """Whether anything was wrong."""
        return bool(self.lost or self.pictures or not self.was_closed)


def repair(path: Path) -> Repair:
    """Keep every complete step of an episode, and close it.

    What does not count is not deleted: lines and pictures are moved to the folder `lost`.

    Args:
        path: Folder of the episode.

    Raises:
        DemosError: If it is no episode, or is being recorded now.
        OutputError: If it cannot be written to; it is as it was then.
    """
    header, closed = read_header(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        lines = scan(path, header, thorough=True)
        good = [line for line in lines if not line.wrong]
        bad = [line for line in lines if line.wrong]
        strays = _strays(path, good)
        try:
            if bad or strays:
                (path / LOST).mkdir(exist_ok=True)
            if bad:
                _move_lines(path, good, bad)
            for stray in strays:
                stray.rename(_free_name(path / LOST, stray.name))
        except OSError as error:
            raise cannot_write(path, error) from error
        kept = sum(line.step is not None for line in good)
        if closed is None:
            ending = {"steps": kept, "outcome": CUT_OFF}
            write_header(path, header.to_json() | {"closed": ending})
    finally:
        os.close(fd)
    return Repair(kept, tuple(line.wrong for line in bad), len(strays), closed is not None)


def _strays(path: Path, good: list[StepLine]) -> list[Path]:
    """Pictures that no good step names."""
    named = {line.step.frame for line in good if line.step is not None}
    return sorted(p for p in (path / FRAMES).glob("*") if p.name not in named)


def _move_lines(path: Path, good: list[StepLine], bad: list[StepLine]) -> None:
    """Leave the good lines only; the bad ones are on the disk before they are taken out."""
    _write(_free_name(path / LOST, STEPS), b"".join(line.raw for line in bad))
    part = path / f".{STEPS}.part"
    _write(part, b"".join(line.raw for line in good))
    part.replace(path / STEPS)


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _free_name(folder: Path, name: str) -> Path:
    """A name in a folder that nothing has yet."""
    stem, dot, ending = name.partition(".")
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}{dot}{ending}"
    return path


def drop(path: Path, first: int, last: int, why: str) -> None:
    """Let steps of an episode no longer count.

    Args:
        path: Folder of the episode.
        first: Index of the first step.
        last: Index of the last step, which is dropped, too.
        why: Such as "cut" or "bad".

    Raises:
        DemosError: If there are no such steps, or the episode is being recorded.
        BrokenEpisode: If it is not whole.
        OutputError: If it cannot be written.
    """
    _append(path, {"kind": "drop", "first": first, "last": last, "why": why}, first, last)


def keep(path: Path, first: int, last: int, why: str = "") -> None:
    """Let steps of an episode count again; arguments and errors as those of `drop`."""
    _append(path, {"kind": "keep", "first": first, "last": last, "why": why}, first, last)


def mark(path: Path, step: int, text: str = "") -> None:
    """Mark a step of an episode with a few words; errors as those of `drop`."""
    _append(path, {"kind": "mark", "step": step, "text": text}, step, step)


def _append(path: Path, fields: dict[str, Any], first: int, last: int) -> None:
    episode = read_episode(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        _require_steps(episode, first, last)
        write_all(fd, encode_line(fields))
    except OSError as error:
        raise cannot_write(path / STEPS, error) from error
    finally:
        os.close(fd)


def _require_steps(episode: Episode, first: int, last: int) -> None:
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    least, most = episode.steps[0].index, episode.steps[-1].index
    if not least <= first <= last <= most:
        raise DemosError(
            f"{episode.path} has the steps {least} to {most}, and not {first} to {last}."
        )
