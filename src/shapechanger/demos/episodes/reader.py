"""Read, repair, edit and merge recorded episodes."""

from __future__ import annotations

import io
import json
import math
import os
import shutil
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from shapechanger.demos.episodes.records import (
    DRIVERS,
    FRAMES,
    HEADER,
    MAX_TEXT_BYTES,
    STEPS,
    Driver,
    Drop,
    Edit,
    EpisodeHeader,
    EpisodeMark,
    Keep,
    Step,
    append,
    encode_line,
    free_path,
    is_episode,
    lock,
    longest_period_s,
    parse_line,
    write_header,
)
from shapechanger.errors import BrokenEpisode, DemosError, OutputError, UnknownName
from shapechanger.files import read_file, reading, write_atomic, writing

_LOST: Final = "lost"  # Folder of an episode for lines and images that `repair` moves aside.


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
        outcome: How it ended; "" if unspecified or not closed.
    """

    path: Path
    header: EpisodeHeader
    steps: tuple[Step, ...]
    marks: tuple[EpisodeMark, ...]
    drops: tuple[Drop, ...]
    closed: bool
    outcome: str

    @cached_property
    def excluded(self) -> dict[int, str]:
        """Why each excluded step is excluded, keyed by its index."""
        why: dict[int, str | None] = {}
        indexes = [step.index for step in self.steps]
        for drop in self.drops:
            # A line may name a range far beyond the steps that exist.
            reach = indexes[bisect_left(indexes, drop.first) : bisect_right(indexes, drop.last)]
            why |= dict.fromkeys(reach, None if isinstance(drop, Keep) else drop.why)
        return {index: text for index, text in why.items() if text is not None}

    @cached_property
    def kept(self) -> tuple[Step, ...]:
        """The steps that were not excluded."""
        return tuple(step for step in self.steps if step.index not in self.excluded)

    @cached_property
    def durations_s(self) -> tuple[float, ...]:
        """How long each step lasted, until the time of the next one, s.

        A step lasts one period if it is the last one, if a pause follows, if its time or the next
        one is unknown, or if time runs backwards.
        """
        hz = self.header.control_hz
        passed = (_passed_s(one, two) for one, two in pairwise(self.steps))
        lasted = (s if 0.0 <= s <= longest_period_s(hz) else 1.0 / hz for s in passed)
        return (*lasted, 1.0 / hz) if self.steps else ()

    @property
    def gaps_s(self) -> list[float]:
        """Times between consecutive kept steps on the robot's clock, s.

        Steps without a time, and pairs with dropped steps in between, are left out.
        """
        pairs = ((one, two) for one, two in pairwise(self.kept) if two.index == one.index + 1)
        return [gap for one, two in pairs if not math.isnan(gap := _passed_s(one, two))]

    @property
    def seconds(self) -> float:
        """Duration of the kept steps, s."""
        lasted = zip(self.steps, self.durations_s, strict=True)
        return math.fsum(seconds for step, seconds in lasted if step.index not in self.excluded)

    @property
    def origin(self) -> str:
        """Short name of its env, or else its robot, kind of robot or source."""
        header = self.header
        return header.env.split("/")[-1] or header.robot or header.body or header.source

    @cached_property
    def drivers(self) -> dict[Driver, int]:
        """Number of kept steps of each driver, most frequent first."""
        counts = Counter(step.driver for step in self.kept)
        return {d: counts[d] for d in sorted(DRIVERS, key=lambda d: -counts[d]) if counts[d]}

    @property
    def reward(self) -> float | None:
        """Sum of the rewards of the kept steps; None if no kept step has a reward."""
        rewards = [step.reward for step in self.kept if step.reward is not None]
        return sum(rewards) if rewards else None

    def jpeg(self, step: Step) -> bytes | None:
        """Return the image of a step as it was received; None without an image.

        Raises:
            BrokenEpisode: If the file is missing or was modified.
        """
        if step.picture is None:
            return None
        try:
            return step.picture.read(self.path / FRAMES)
        except ValueError as error:
            raise _broken(self.path, f"{error}, at step {step.index}") from error


def _passed_s(one: Step, two: Step) -> float:
    """Return the time from one step to the next, s; NaN if a time is unknown."""
    now, later = one.clock_ns, two.clock_ns
    return math.nan if now is None or later is None else (later - now) / 1e9


def _broken(path: Path, why: str) -> BrokenEpisode:
    return BrokenEpisode(
        f"{path} is damaged: {why}. `shapechanger demos repair {path}` keeps all complete steps."
    )


def read_episode(path: Path) -> Episode:
    """Read an episode; images are read on demand.

    Raises:
        DemosError: If the folder is not an episode, or has another version of the format.
        BrokenEpisode: If a line is damaged, or an image is missing or has another size.
    """
    header, outcome = read_header(path)
    lines: list[Step | Edit | None] = []
    for number, (_, line, wrong) in enumerate(_checked_lines(path, header), 1):
        if wrong:
            raise _broken(path, f"line {number} is invalid, because {wrong}")
        lines.append(line)
    return _episode(path, header, outcome, lines)


class _StepTimes(msgspec.Struct, tag_field="kind", tag="step"):
    """Index and times of a step, enough for a list of episodes; an hour has 72 000 steps."""

    index: int = msgspec.field(name="step")
    captured_ns: int | None = None
    decided_ns: int | None = None


_OUTLINES: Final = msgspec.json.Decoder(_StepTimes | Edit)


def read_outline(path: Path) -> Episode:
    """Read the times and edits of an episode quickly, without checks of lines and images.

    Other fields of steps are not read; lines that are incomplete or not valid JSON are left out.

    Raises:
        DemosError: If the header is missing or cannot be read.
        OSError: If the steps cannot be read.
    """
    header, outcome = read_header(path)
    found: list[Step | Edit] = []
    with (path / STEPS).open("rb") as lines:
        for raw in lines:
            with suppress(msgspec.MsgspecError, UnicodeDecodeError):
                line = _OUTLINES.decode(raw if raw.endswith(b"\n") else b"")
                if isinstance(line, _StepTimes):
                    line = Step(driver="program", action=(), **msgspec.structs.asdict(line))
                found.append(line)
    return _episode(path, header, outcome, found)


def _episode(
    path: Path, header: EpisodeHeader, outcome: str | None, lines: Sequence[Step | Edit | None]
) -> Episode:
    return Episode(
        path=path,
        header=header,
        steps=tuple(line for line in lines if isinstance(line, Step)),
        marks=tuple(line for line in lines if isinstance(line, EpisodeMark)),
        drops=tuple(line for line in lines if isinstance(line, Drop)),
        closed=outcome is not None,
        outcome=outcome or "",
    )


def read_header(path: Path) -> tuple[EpisodeHeader, str | None]:
    """Read the header of an episode, and its outcome; None if the episode was not closed.

    Raises:
        DemosError: If the header is missing or cannot be read.
    """
    try:
        fields: Any = json.loads(read_file(path / HEADER, MAX_TEXT_BYTES).decode())
        if not isinstance(fields, dict):
            raise DemosError("it is not a JSON object.")
        header = EpisodeHeader.from_json(cast("dict[str, Any]", fields))
    except FileNotFoundError:
        raise DemosError(f"{path} is not an episode: it has no {HEADER}.") from None
    except (OSError, ValueError, RecursionError) as error:
        reason = str(getattr(error, "strerror", None) or error).rstrip(".")
        raise DemosError(f"{path / HEADER} cannot be read: {reason}.") from error
    closed: Any = cast("dict[str, Any]", fields).get("closed")
    is_closed = isinstance(closed, dict)
    return header, str(cast("Any", closed).get("outcome", "")) if is_closed else None


def _checked_lines(
    path: Path, header: EpisodeHeader, *, thorough: bool = False
) -> Iterator[tuple[bytes, Step | Edit | None, str]]:
    """Yield each line of an episode, its content, and why it or its image is invalid, or ""."""
    with reading(path / STEPS, DemosError):
        content = read_file(path / STEPS, MAX_TEXT_BYTES)
    sizes = header.action_layout.size, header.state_layout.size
    newest, sound = -1, None  # Index of the newest step, and the newest image that is sound.
    for raw in io.BytesIO(content):
        line, wrong = None, ""
        try:
            line = parse_line(raw)
            if isinstance(line, Step):
                wrong = line.refusal(*sizes)
                if not wrong and line.index <= newest:
                    wrong = f"it comes after step {newest}"
                newest = max(newest, line.index)
                if not wrong and line.picture and line.picture != sound:
                    line.picture.read(path / FRAMES, checksum=thorough)
                    sound = line.picture
        except ValueError as error:
            wrong = str(error)
        yield raw, line, wrong


def episodes_of(data: Path) -> tuple[Path, ...]:
    """Return the folders of the episodes of a recording by name: oldest first unless renamed.

    Args:
        data: Folder of a recording, or of one episode.

    Raises:
        DemosError: If there is no episode.
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
    """Load an episode from its folder, or from a recording with a single episode."""
    if not path.exists() and path.parent.is_dir():
        known = [episode.name for episode in episodes_of(path.parent)]
        raise UnknownName("episode", path.name, known)
    first, *others = episodes_of(path)
    if others:
        raise DemosError(
            f"{path} has {1 + len(others)} episodes: name one of them, such as {first}."
        )
    episode = read_episode(first)
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    return episode


def repair(path: Path) -> str:
    """Keep every complete step of an episode, and close the episode.

    Invalid lines and unused images are moved to the folder `lost`, not deleted.

    Args:
        path: Folder of the episode.

    Returns:
        The number of steps, and the repairs, as the end of a sentence.

    Raises:
        DemosError: If the folder is not an episode, or is being recorded now.
        OutputError: If it cannot be written to; no line and no image is lost then.
    """
    header, outcome = read_header(path)
    done: list[str] = []
    with lock(path / STEPS, f"{path} is being recorded at this moment."), writing(path):
        lines = list(_checked_lines(path, header, thorough=True))
        kept = [line for _, line, wrong in lines if isinstance(line, Step) and not wrong]
        wrongs = [wrong for _, _, wrong in lines if wrong]
        strays = {*(path / FRAMES).glob("*")} - {path / FRAMES / step.frame for step in kept}
        if wrongs or strays:
            (path / _LOST).mkdir(exist_ok=True)
        if wrongs:
            lost = free_path(path / _LOST, "steps", ".jsonl")
            write_atomic(lost, b"".join(raw for raw, _, wrong in lines if wrong))
            write_atomic(path / STEPS, b"".join(raw for raw, _, wrong in lines if not wrong))
            more = f" and {len(wrongs) - 1} more" if len(wrongs) > 1 else ""
            done.append(f"moved a line{more} aside, because {wrongs[0]}")
        for stray in sorted(strays):
            stray.rename(free_path(path / _LOST, stray.stem, stray.suffix))
        if strays:
            done.append(f"moved aside unused images: {len(strays)}")
        if outcome is None:
            write_header(path, header, {"steps": len(kept), "outcome": "cut off"})
            done.append("closed it")
    return ", ".join([f"kept {len(kept)} steps", *(done or ["found no damage"])])


def edit(path: Path, line: Edit) -> None:
    """Mark a step of an episode, or exclude or include steps; recorded lines stay as they are.

    Args:
        path: Folder of the episode.
        line: The mark, or the range of steps.

    Raises:
        DemosError: If there are no such steps, or the episode is being recorded.
        BrokenEpisode: If the episode is damaged.
        OutputError: If it cannot be written to.
    """
    first, last = (line.step,) * 2 if isinstance(line, EpisodeMark) else (line.first, line.last)
    steps = read_episode(path).steps
    with lock(path / STEPS, f"{path} is being recorded at this moment.") as file:
        if not steps:
            raise DemosError(f"{path} has no steps.")
        least, most = steps[0].index, steps[-1].index
        if not least <= first <= last <= most:
            raise DemosError(f"{path} has the steps {least} to {most}, and not {first} to {last}.")
        with writing(path / STEPS):
            append(file, encode_line(line))


def merge(sources: Sequence[Path], out: Path) -> list[tuple[Path, Path]]:
    """Copy episodes into one recording; the sources are not changed, and no file is overwritten.

    All episodes are read before the first one is copied. A taken name gets the next free number.

    Args:
        sources: Recordings, or single episodes.
        out: Folder of the target recording; created if missing.

    Returns:
        Source and target folder of each episode.

    Raises:
        DemosError: If there are no episodes, or one is still being recorded, already in `out`, or
            has links.
        BrokenEpisode: If an episode is damaged.
        OutputError: If an episode cannot be copied; those copied before are complete.
    """
    if not sources:
        raise DemosError("There is nothing to merge: give at least one recording.")
    if is_episode(out):
        raise DemosError(f"{out} is an episode, but a recording is a folder of episodes.")
    episodes = [read_episode(path) for source in sources for path in episodes_of(source)]
    is_new = not out.exists() or (out.is_dir() and not any(out.iterdir()))
    there = [] if is_new else [read_episode(path) for path in episodes_of(out)]
    known = {_identity(episode): episode.path for episode in there}
    for episode in episodes:
        if not episode.closed:
            raise DemosError(f"{episode.path} is still recorded, or needs `demos repair`.")
        if (same := known.setdefault(_identity(episode), episode.path)) is not episode.path:
            raise DemosError(f"{episode.path} and {same} are the same episode.")
        # A link would copy a file or a folder of another place into the recording.
        if link := next((path for path in episode.path.rglob("*") if path.is_symlink()), None):
            raise DemosError(f"{link} is a link, but an episode has only files: remove it.")
    return [(episode.path, _copied(episode.path, out)) for episode in episodes]


def _identity(episode: Episode) -> tuple[object, ...]:
    """Return fields that identify an episode, and that marks and drops do not change."""
    first = episode.steps[0] if episode.steps else None
    seen = (first.wall_ns, first.captured_ns, first.picture, first.action) if first else ()
    return (episode.header.created, len(episode.steps), *seen)


def _copied(source: Path, out: Path) -> Path:
    """Copy an episode atomically."""
    part, target = out / f".{source.name}.{os.getpid()}.part", free_path(out, source.name)
    try:
        with writing(target):
            out.mkdir(parents=True, exist_ok=True)
            shutil.copytree(source, part)
            part.rename(target)
    except OutputError:
        shutil.rmtree(part, ignore_errors=True)
        raise
    return target
