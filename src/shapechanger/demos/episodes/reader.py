"""Read, repair and edit recorded episodes."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import stat
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

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
)
from shapechanger.demos.episodes.records import (
    DRIVERS,
    Driver,
    Drop,
    Edit,
    EpisodeHeader,
    EpisodeMark,
    Keep,
    Step,
    StepPicture,
    durations_s,
    encode_line,
    parse_line,
    split_lines,
)
from shapechanger.demos.episodes.writer import write_header
from shapechanger.errors import BrokenEpisode, DemosError, UnknownName, translate_errors
from shapechanger.files import write_atomic, writing


@dataclass(frozen=True)
class Episode:
    """A recorded episode.

    Attributes:
        path: Its folder.
        header: Its metadata.
        steps: All steps, including excluded ones.
        marks: In the order in which they were set.
        drops: Ranges of excluded and of included steps, in the order in which they were written;
            later ones override earlier ones.
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
            (gone.difference_update if isinstance(drop, Keep) else gone.update)(reach)
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

    @property
    def origin(self) -> str:
        """Name of its env or robot, as short as possible."""
        header = self.header
        return header.env.split("/")[-1] or header.robot or header.body or header.source

    @cached_property
    def drivers(self) -> dict[Driver, int]:
        """Number of kept steps of each driver, most frequent first."""
        counts = Counter(step.driver for step in self.kept)
        return {d: counts[d] for d in sorted(DRIVERS, key=lambda d: -counts[d]) if counts[d]}

    @property
    def reward(self) -> float | None:
        """Sum of the rewards of the kept steps; None if none has a reward."""
        rewards = [step.reward for step in self.kept if step.reward is not None]
        return sum(rewards) if rewards else None

    def jpeg(self, step: Step) -> bytes | None:
        """Return the image of a step as it was received; None for none.

        Raises:
            BrokenEpisode: If the file is missing or was modified.
        """
        if step.picture is None:
            return None
        with translate_errors(
            OSError, to=lambda _: _broken(self.path, f"the image {step.frame} cannot be read")
        ):
            data = read_file(self.path / FRAMES / step.frame, MAX_PICTURE_BYTES)
        if not step.picture.fits(data):
            raise _broken(self.path, f"the image {step.frame} was changed")
        return data


def read_episode(path: Path) -> Episode:
    """Read an episode; images are read on demand.

    Raises:
        DemosError: If the folder is not an episode, or has another version of the format.
        BrokenEpisode: If a line or an image is damaged or missing.
    """
    header, outcome = read_header(path)
    lines = _scan(path, header, thorough=False)
    for number, line in enumerate(lines, 1):
        if line.wrong:
            raise _broken(path, f"line {number} is invalid, because {line.wrong}")
    return _episode(path, header, outcome, (line.content for line in lines))


class _StepTimes(msgspec.Struct, tag_field="kind", tag="step"):
    """The part of a step that a list of episodes needs; an hour has 72 000 steps."""

    step: int
    captured_ns: int | None = None
    decided_ns: int | None = None


_OUTLINES: Final = msgspec.json.Decoder(_StepTimes | Edit)


def read_outline(path: Path) -> Episode:
    """Read the times and edits of an episode quickly, without checks of lines and images.

    Its steps lack all else, and lines that are incomplete or no valid JSON are left out.

    Raises:
        DemosError: If the header is missing or cannot be read.
        OSError: If the steps cannot be read.
    """
    header, outcome = read_header(path)
    steps: dict[int, Step] = {}
    edits: list[Edit] = []
    with (path / STEPS).open("rb") as lines:
        for raw in lines:
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                line = _OUTLINES.decode(raw)
                if not isinstance(line, _StepTimes):
                    edits.append(line)
                elif raw.endswith(b"\n"):
                    steps[line.step] = Step(
                        index=line.step,
                        driver="program",
                        action=(),
                        captured_ns=line.captured_ns,
                        decided_ns=line.decided_ns,
                    )
    return _episode(path, header, outcome, [*steps.values(), *edits])


def _episode(
    path: Path, header: EpisodeHeader, outcome: str | None, lines: Iterable[Step | Edit | None]
) -> Episode:
    found = [*lines]
    return Episode(
        path=path,
        header=header,
        steps=tuple(line for line in found if isinstance(line, Step)),
        marks=tuple(line for line in found if isinstance(line, EpisodeMark)),
        drops=tuple(line for line in found if isinstance(line, Drop)),
        closed=outcome is not None,
        outcome=outcome or "",
    )


def read_header(path: Path) -> tuple[EpisodeHeader, str | None]:
    """Read the header of an episode, and its outcome; None if the episode was not closed.

    Raises:
        DemosError: If the header is missing or cannot be read.
    """
    try:
        plain = json.loads(read_file(path / HEADER, MAX_TEXT_BYTES).decode())
        if not isinstance(plain, dict):
            raise DemosError("it is not a JSON object.")
        fields = cast("dict[str, Any]", plain)
        header = EpisodeHeader.from_json(fields)
    except FileNotFoundError:
        raise DemosError(f"{path} is not an episode: it has no {HEADER}.") from None
    except (OSError, ValueError, RecursionError) as error:
        reason = str(getattr(error, "strerror", None) or error).rstrip(".")
        raise DemosError(f"{path / HEADER} cannot be read: {reason}.") from error
    closed = fields.get("closed")
    if not isinstance(closed, dict):
        return header, None
    return header, str(cast("dict[str, Any]", closed).get("outcome", ""))


class _ScannedLine(NamedTuple):
    """A line of `steps.jsonl`, what it holds, and why it is invalid; "" if it is valid."""

    raw: bytes
    content: Step | Edit | None
    wrong: str


def _scan(path: Path, header: EpisodeHeader, *, thorough: bool) -> list[_ScannedLine]:
    """Check every line of an episode, and the image that it names."""
    try:
        content = read_file(path / STEPS, MAX_TEXT_BYTES)
    except OSError as error:
        raise DemosError(f"{path / STEPS} cannot be read: {error.strerror or error}.") from error
    sizes = header.action_size, header.state_size
    lines: list[_ScannedLine] = []
    wrong_with = functools.cache(functools.partial(_wrong_with, path / FRAMES, thorough=thorough))
    newest = -1
    for raw in split_lines(content):
        line, wrong = None, ""
        try:
            line = parse_line(raw)
        except ValueError as error:
            wrong = str(error)
        if isinstance(line, Step):
            wrong = line.refusal(*sizes)
            if not wrong and line.index <= newest:
                wrong = f"it comes after step {newest}"
            wrong = wrong or wrong_with(line.picture)
            newest = max(newest, line.index)
        lines.append(_ScannedLine(raw, line, wrong))
    return lines


def _wrong_with(frames: Path, picture: StepPicture | None, *, thorough: bool) -> str:
    """Return what is wrong with the image of a step, as part of a sentence; "" for nothing."""
    if picture is None:
        return ""
    name = picture.name
    try:
        found = (frames / name).stat()
        if not stat.S_ISREG(found.st_mode):
            return f"its image {name} is not a regular file"
        if found.st_size != picture.size:
            return f"its image {name} has {found.st_size} bytes instead of {picture.size}"
        if thorough and not picture.fits(read_file(frames / name, MAX_PICTURE_BYTES)):
            return f"its image {name} was changed"
    except FileNotFoundError:
        return f"its image {name} is missing"
    except OSError as error:
        return f"its image {name} cannot be read ({error.strerror})"
    return ""


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
    header, outcome = read_header(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        lines = _scan(path, header, thorough=True)
        good = [line for line in lines if not line.wrong]
        bad = [line for line in lines if line.wrong]
        kept = [line.content for line in good if isinstance(line.content, Step)]
        used = {step.frame for step in kept}
        strays = sorted(p for p in (path / FRAMES).glob("*") if p.name not in used)
        with writing(path):
            if bad or strays:
                (path / LOST).mkdir(exist_ok=True)
            if bad:
                lost = free_path(path / LOST, Path(STEPS).stem, Path(STEPS).suffix)
                write_atomic(lost, b"".join(line.raw for line in bad))
                write_atomic(path / STEPS, b"".join(line.raw for line in good))
            for stray in strays:
                stray.rename(free_path(path / LOST, stray.stem, stray.suffix))
        if outcome is None:
            write_header(path, header, {"steps": len(kept), "outcome": _CUT_OFF})
    finally:
        os.close(fd)
    return Repair(len(kept), tuple(line.wrong for line in bad), len(strays), outcome is not None)


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
    _append(path, Drop(first, last, why), first, last)


def keep(path: Path, first: int, last: int, why: str = "") -> None:
    """Include steps of an episode again; arguments and errors as in `drop`."""
    _append(path, Keep(first, last, why), first, last)


def mark(path: Path, step: int, text: str = "") -> None:
    """Mark a step of an episode, with free text; errors as in `drop`."""
    _append(path, EpisodeMark(step, text), step, step)


def _append(path: Path, line: Edit, first: int, last: int) -> None:
    episode = read_episode(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        if not episode.steps:
            raise DemosError(f"{path} has no steps.")
        least, most = episode.steps[0].index, episode.steps[-1].index
        if not least <= first <= last <= most:
            raise DemosError(f"{path} has the steps {least} to {most}, and not {first} to {last}.")
        with writing(path / STEPS):
            write_all(fd, encode_line(line))
    finally:
        os.close(fd)
