"""Read, repair and edit recorded episodes."""

from __future__ import annotations

import json
import math
import os
import re
import stat
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, cast

import msgspec

from shapechanger.demos.episodes.files import (
    FRAMES,
    HEADER,
    LOST,
    MAX_PICTURE_BYTES,
    MAX_TEXT_BYTES,
    STEPS,
    free_path,
    is_episode,
    lock,
    read_file,
    write_all,
    write_header,
)
from shapechanger.demos.episodes.records import (
    EpisodeHeader,
    Step,
    StepPicture,
    decode_line,
    durations_s,
    encode_line,
    split_lines,
)
from shapechanger.errors import BrokenEpisode, DemosError, OutputError, UnknownName
from shapechanger.files import cannot_write, write_atomic

# Such a name cannot lead out of the folder.
_FRAME_NAME: Final = re.compile(r"[0-9]{6,}\.jpg")


class StepLine(NamedTuple):
    """One line of `steps.jsonl`.

    Attributes:
        raw: Its bytes.
        fields: The decoded object; empty if the line is damaged.
        step: The step; None for a line of another kind.
        wrong: Why the line is ignored, as part of a sentence; "" if it is valid.
    """

    raw: bytes
    fields: dict[str, Any]
    step: Step | None
    wrong: str


def _scan(path: Path, header: EpisodeHeader, *, thorough: bool) -> list[StepLine]:
    """Check every line of an episode, and the image that it names."""
    try:
        content = read_file(path / STEPS, MAX_TEXT_BYTES)
    except OSError as error:
        raise DemosError(f"{path / STEPS} cannot be read: {error.strerror or error}.") from error
    sizes = header.action_size, header.state_size
    lines: list[StepLine] = []
    seen: dict[StepPicture, str] = {}
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
            if not wrong and step.picture is not None:
                if step.picture not in seen:
                    seen[step.picture] = _wrong_with(path / FRAMES, step.picture, thorough=thorough)
                wrong = seen[step.picture]
            newest = max(newest, step.index)
        lines.append(StepLine(raw, fields, step, wrong))
    return lines


def _wrong_with(frames: Path, picture: StepPicture, *, thorough: bool) -> str:
    """Return what is wrong with the image of a step, as part of a sentence; "" for nothing."""
    name, size = picture.name, picture.size
    if not _FRAME_NAME.fullmatch(name):
        return f"its image has the invalid name {name!r}"
    try:
        found = (frames / name).stat()
        if not stat.S_ISREG(found.st_mode):
            return f"its image {name} is not a regular file"
        if found.st_size > MAX_PICTURE_BYTES:
            return f"its image {name} has more than {MAX_PICTURE_BYTES} bytes"
        if found.st_size != size:
            return f"its image {name} has {found.st_size} bytes instead of {size}"
        if thorough and not picture.fits(read_file(frames / name, MAX_PICTURE_BYTES)):
            return f"its image {name} was changed"
    except FileNotFoundError:
        return f"its image {name} is missing"
    except OSError as error:
        return f"its image {name} cannot be read ({error.strerror})"
    return ""


class EpisodeMark(msgspec.Struct, frozen=True):
    """A bookmark set by the operator, at the step with an index."""

    step: int
    text: str = ""


class Drop(msgspec.Struct, frozen=True):
    """A range of steps to exclude, or to include again.

    Attributes:
        first: Index of the first step.
        last: Index of the last step, inclusive.
        why: Such as "undo", "cut" or "bad".
        kind: Whether the steps are excluded, or included again.
    """

    first: int
    last: int
    why: str = ""
    kind: Literal["drop", "keep"] = "drop"

    @property
    def keep(self) -> bool:
        """Whether the steps are included again."""
        return self.kind == "keep"


@dataclass(frozen=True)
class Episode:
    """A recorded episode.

    Attributes:
        path: Its folder.
        header: Its metadata.
        steps: All steps, including excluded ones.
        marks: In the order in which they were set.
        drops: In the order in which they were written; later ones override earlier ones.
        closed: Whether the episode was closed properly.
        outcome: How it ended; "" if unspecified.
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
        """The steps that were not excluded."""
        gone: set[int] = set()
        for drop in self.drops:
            # A line may name a range far beyond the steps that exist.
            reach = (s.index for s in self.steps if drop.first <= s.index <= drop.last)
            (gone.difference_update if drop.keep else gone.update)(reach)
        return tuple(step for step in self.steps if step.index not in gone)

    @cached_property
    def durations_s(self) -> tuple[float, ...]:
        """How long each step lasted by its time, s; pauses count as one period."""
        times_ns = [step.clock_ns for step in self.steps]
        return tuple(durations_s(times_ns, self.header.control_hz))

    @property
    def seconds(self) -> float:
        """Duration of the kept steps, s."""
        kept = {step.index for step in self.kept}
        lasted = zip(self.steps, self.durations_s, strict=True)
        return math.fsum(seconds for step, seconds in lasted if step.index in kept)

    def jpeg(self, step: Step) -> bytes | None:
        """Return the image of a step as it was received; None for none.

        Raises:
            BrokenEpisode: If the file is missing or was modified.
        """
        if step.picture is None:
            return None
        try:
            data = read_file(self.path / FRAMES / step.frame, MAX_PICTURE_BYTES)
        except OSError as error:
            raise _broken(self.path, f"the image {step.frame} cannot be read") from error
        if not step.picture.fits(data):
            raise _broken(self.path, f"the image {step.frame} was changed")
        return data


def read_episode(path: Path) -> Episode:
    """Read an episode; images are read on demand.

    Raises:
        DemosError: If the folder is not an episode, or has another version of the format.
        BrokenEpisode: If a line or an image is damaged or missing.
    """
    header, closed = read_header(path)
    lines = _scan(path, header, thorough=False)
    for number, line in enumerate(lines, 1):
        if line.wrong:
            raise _broken(path, f"line {number} is invalid, because {line.wrong}")
    return _assemble(path, header, closed, lines)


def read_header(path: Path) -> tuple[EpisodeHeader, dict[str, Any] | None]:
    """Read the header of an episode, and how it was closed; None if it was not.

    Raises:
        DemosError: If the header is missing or cannot be read.
    """
    file = path / HEADER
    try:
        plain = json.loads(read_file(file, MAX_TEXT_BYTES).decode())
    except FileNotFoundError:
        raise DemosError(f"{path} is not an episode: it has no {HEADER}.") from None
    except OSError as error:
        raise DemosError(f"{file} cannot be read: {error.strerror or error}.") from error
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{file} cannot be read: {error}.") from error
    if not isinstance(plain, dict):
        raise DemosError(f"{file} is not a JSON object.")
    fields = cast("dict[str, Any]", plain)
    closed = fields.get("closed")
    try:
        header = EpisodeHeader.from_json(fields)
    except DemosError as error:
        raise DemosError(f"{file}: {error}") from error
    return header, cast("dict[str, Any]", closed) if isinstance(closed, dict) else None


def episodes_of(data: Path) -> tuple[Path, ...]:
    """Return the folders of the episodes of a recording, oldest first.

    Args:
        data: Folder of a recording, or of one episode.

    Raises:
        DemosError: If the episode does not exist.
    """
    if is_episode(data):
        return (data,)
    if not data.exists():
        raise DemosError(f"There is no recording {data}.")
    if not data.is_dir():
        raise DemosError(f"{data} is a file, but a recording is a folder of episodes.")
    found = sorted(p for p in data.iterdir() if not p.name.startswith(".") and is_episode(p))
    if not found:
        raise DemosError(f"There is no episode in {data}: no folder in it has {HEADER}.")
    return tuple(found)


def episode_at(path: Path) -> Episode:
    """Load the episode of a folder, which may be a recording with a single one."""
    if not path.exists() and path.parent.is_dir():
        known = [episode.name for episode in episodes_of(path.parent)]
        raise UnknownName("episode", path.name, known)
    found = episodes_of(path)
    if len(found) > 1:
        raise DemosError(f"{path} has {len(found)} episodes: name one of them, such as {found[0]}.")
    episode = read_episode(next(iter(found)))
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    return episode


def _assemble(
    path: Path, header: EpisodeHeader, closed: dict[str, Any] | None, lines: list[StepLine]
) -> Episode:
    marks: list[EpisodeMark] = []
    drops: list[Drop] = []
    for line in lines:
        try:
            match line.fields.get("kind"):
                case "mark":
                    marks.append(msgspec.convert(line.fields, EpisodeMark))
                case "drop" | "keep":
                    drops.append(msgspec.convert(line.fields, Drop))
                case _:  # A step, or a kind that a later version added.
                    pass
        except msgspec.ValidationError as error:
            raise _broken(path, f"it has the invalid line {line.fields}") from error
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
        f"{path} is damaged: {why}. `shapechanger demos repair {path}` keeps all complete steps."
    )


_CUT_OFF: Final = "cut off"
"""Outcome of an episode that was not closed before `repair`."""


class Repair(NamedTuple):
    """Result of a repair.

    Attributes:
        kept: Number of valid steps.
        lost: Why each removed line was invalid, as parts of sentences.
        pictures: Number of images that belong to no step.
        was_closed: Whether the episode had been closed before.
    """

    kept: int
    lost: tuple[str, ...]
    pictures: int
    was_closed: bool

    @property
    def changed(self) -> bool:
        """Return whether the repair changed anything."""
        return bool(self.lost or self.pictures or not self.was_closed)


def repair(path: Path) -> Repair:
    """Keep every complete step of an episode, and close the episode.

    Invalid lines and unused images are moved to the folder `lost`, not deleted.

    Args:
        path: Folder of the episode.

    Raises:
        DemosError: If the folder is not an episode, or is being recorded now.
        OutputError: If it cannot be written to; the episode is unchanged then.
    """
    header, closed = read_header(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        lines = _scan(path, header, thorough=True)
        good = [line for line in lines if not line.wrong]
        bad = [line for line in lines if line.wrong]
        used = {line.step.frame for line in good if line.step is not None}
        strays = sorted(p for p in (path / FRAMES).glob("*") if p.name not in used)
        try:
            if bad or strays:
                (path / LOST).mkdir(exist_ok=True)
            if bad:
                lost = free_path(path / LOST, Path(STEPS).stem, Path(STEPS).suffix)
                write_atomic(lost, b"".join(line.raw for line in bad))
                write_atomic(path / STEPS, b"".join(line.raw for line in good))
            for stray in strays:
                stray.rename(free_path(path / LOST, stray.stem, stray.suffix))
        except OutputError:  # Already worded, and a subclass of OSError.
            raise
        except OSError as error:
            raise cannot_write(path, error) from error
        kept = sum(line.step is not None for line in good)
        if closed is None:
            ending = {"steps": kept, "outcome": _CUT_OFF}
            write_header(path, header.to_json() | {"closed": ending})
    finally:
        os.close(fd)
    return Repair(kept, tuple(line.wrong for line in bad), len(strays), closed is not None)


def drop(path: Path, first: int, last: int, why: str) -> None:
    """Exclude steps of an episode.

    Args:
        path: Folder of the episode.
        first: Index of the first step.
        last: Index of the last step, inclusive.
        why: Such as "cut" or "bad".

    Raises:
        DemosError: If there are no such steps, or the episode is being recorded.
        BrokenEpisode: If the episode is damaged.
        OutputError: If it cannot be written to.
    """
    _append(path, {"kind": "drop", "first": first, "last": last, "why": why}, first, last)


def keep(path: Path, first: int, last: int, why: str = "") -> None:
    """Include steps of an episode again; errors as in `drop`.

    Args:
        path: Folder of the episode.
        first: Index of the first step.
        last: Index of the last step, inclusive.
        why: Free text.
    """
    _append(path, {"kind": "keep", "first": first, "last": last, "why": why}, first, last)


def mark(path: Path, step: int, text: str = "") -> None:
    """Mark a step of an episode.

    Args:
        path: Folder of the episode.
        step: Index of the step.
        text: Free text.

    Raises:
        DemosError: If there is no such step, or the episode is being recorded.
        BrokenEpisode: If the episode is damaged.
        OutputError: If it cannot be written to.
    """
    _append(path, {"kind": "mark", "step": step, "text": text}, step, step)


def _append(path: Path, fields: dict[str, Any], first: int, last: int) -> None:
    episode = read_episode(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        if not episode.steps:
            raise DemosError(f"{path} has no steps.")
        least, most = episode.steps[0].index, episode.steps[-1].index
        if not least <= first <= last <= most:
            raise DemosError(f"{path} has the steps {least} to {most}, and not {first} to {last}.")
        write_all(fd, encode_line(fields))
    except OSError as error:
        raise cannot_write(path / STEPS, error) from error
    finally:
        os.close(fd)
