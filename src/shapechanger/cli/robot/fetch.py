"""`shapechanger robot fetch`: download recordings from a robot."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import tyro

from shapechanger.cli.console import counted, say
from shapechanger.demos.episodes.files import (
    FRAMES,
    HEADER,
    STEPS,
    is_episode,
    lock,
    write_all,
)
from shapechanger.demos.episodes.reader import read_header
from shapechanger.demos.episodes.records import Frame, Step, decode_line, split_lines
from shapechanger.errors import DemosError, OutputError, RobotRefused, UnknownName
from shapechanger.files import cannot_write, write_atomic
from shapechanger.robot.client.known_robots import recall
from shapechanger.robot.link.messages import EpisodeSummary, Piece

if TYPE_CHECKING:
    from shapechanger.robot.client.client import RobotClient


@dataclass(frozen=True)
class FetchEpisodes:
    """Download a robot's recordings to this machine, or only what is new."""

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATA")]
    """Folder for the episodes; interrupted downloads there are resumed."""
    episodes: tuple[str, ...] = ()
    """Only these episodes, by their ids; all of them if not given."""

    def run(self) -> None:
        """Download; exit with 1 if an episode failed."""
        from shapechanger.robot.client.client import RobotClient

        failed = 0
        with RobotClient.connect(recall(self.robot), frames=False) as robot:
            there = _episodes_there(robot, self.episodes)
            if not there:
                say(f"{self.robot} has recorded nothing yet.")
            for episode in there:
                busy = robot.recorder
                if busy is not None and busy.recording and busy.episode == episode.id:
                    say(f"{episode.id} is still being recorded: fetch it later.")
                    continue
                try:
                    fetched = fetch_episode(robot, episode.id, self.out)
                except (DemosError, RobotRefused) as error:
                    failed += 1
                    say(f"{episode.id}: {error}", stderr=True)
                    continue
                news = f"{fetched.came} lines came" if fetched.came else "nothing new"
                if fetched.own:
                    news += f", and {counted(fetched.own, 'edit')} made here stay"
                say(f"{episode.id}: {episode.kept} steps kept of {episode.steps}, {news}")
                if read_header(self.out / episode.id)[1] is None:
                    say(f"  it is incomplete: shapechanger demos repair {self.out / episode.id}")
        if failed:
            sys.exit(1)


_PART: Final = ".fetching"
_STEP: Final = b'{"kind":"step",'
_LINES: Final = 1_000


def _episodes_there(robot: RobotClient, wanted: Sequence[str]) -> list[EpisodeSummary]:
    """Return the episodes on a robot, oldest first.

    Args:
        robot: The robot.
        wanted: Ids of the episodes; empty for all.
    """
    found: list[EpisodeSummary] = []
    more = True
    while more:
        page = robot.browse(found[-1].id if found else "")
        found += page.episodes
        more = page.more and bool(page.episodes)
    found.reverse()
    ids = [episode.id for episode in found]
    for name in wanted:
        if name not in ids:
            raise UnknownName("episode", name, ids)
    return [episode for episode in found if not wanted or episode.id in wanted]


class Fetched(NamedTuple):
    """Result of a download.

    Attributes:
        came: Number of new lines of the robot.
        own: Number of marks and edits that were made here, and are kept.
    """

    came: int
    own: int


def fetch_episode(robot: RobotClient, name: str, data: Path) -> Fetched:
    """Download one episode, or the new part of it.

    An incomplete episode is kept in a folder that readers ignore. Marks and edits that were made
    here are kept after those of the robot, so that they override these.

    Args:
        robot: The robot.
        name: Id of the episode.
        data: Folder of the recording.

    Raises:
        DemosError: If the data is damaged, or the local steps are not those of the robot.
        OutputError: If it cannot be written; the part before that is kept.
        LinkError: If the robot does not respond or refuses.
    """
    here, part = data / name, data / f".{name}{_PART}"
    folder = here if is_episode(here) else part
    try:
        (folder / FRAMES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error
    fd = lock(folder / STEPS, f"Somebody else fetches or changes {folder} at this moment.")
    try:
        have = _complete_lines(folder, fd)
        # Lines up to the last step are the robot's; marks and edits of both sides follow.
        begin = 1 + max((n for n, line in enumerate(have) if line.startswith(_STEP)), default=-1)
        edits, theirs = have[begin:], list[bytes]()
        piece = robot.fetch(name, max(begin - 1, 0), _LINES)
        if begin and [line.encode() + b"\n" for line in piece.lines[:1]] != have[begin - 1 : begin]:
            raise DemosError(
                f"{folder} has other steps than {name} on the robot, so it stays as it is: "
                "`--out` with another folder fetches that of the robot."
            )
        while piece.lines:
            lines = _checked(piece, folder)
            new = lines[max(begin - piece.first, 0) :]
            theirs += new
            if not edits:
                write_all(fd, b"".join(new))
            piece = robot.fetch(name, piece.first + len(lines), _LINES)
        own = _without(edits, theirs)
        if edits and (merged := have[:begin] + theirs + own) != have:
            write_atomic(folder / STEPS, b"".join(merged))
        os.fsync(fd)
        _write_header(folder, piece.header)
        if folder is part:
            part.rename(here)
    except OSError as error:
        if isinstance(error, ConnectionError | OutputError):  # Of the link, or worded already.
            raise
        raise cannot_write(folder, error) from error
    finally:
        os.close(fd)
    return Fetched(len(_without(theirs, edits)), len(own))


def _without(lines: Sequence[bytes], others: Sequence[bytes]) -> list[bytes]:
    """Return the lines that are not among others; of equal ones, the last ones remain."""
    left = Counter(others)
    found: list[bytes] = []
    for line in lines:
        if left[line]:
            left[line] -= 1
        else:
            found.append(line)
    return found


def _write_header(folder: Path, content: str) -> None:
    """Write the header of an episode, unless it was closed here, by a repair, and only here."""
    if (folder / HEADER).is_file() and read_header(folder)[1] is not None:
        return
    header = folder / f".{HEADER}.part"
    header.write_bytes(content.encode())
    header.replace(folder / HEADER)
    read_header(folder)


def _complete_lines(folder: Path, fd: int) -> list[bytes]:
    """Return the local lines, after removing a truncated last one."""
    lines = split_lines((folder / STEPS).read_bytes())
    if lines and not lines[-1].endswith(b"\n"):
        if (folder / HEADER).is_file():
            raise DemosError(f"{folder} is not whole: `shapechanger demos repair {folder}` first.")
        os.ftruncate(fd, sum(map(len, lines[:-1])))
        lines.pop()
    return lines


def _checked(piece: Piece, folder: Path) -> list[bytes]:
    """Check the lines of a piece and store their frames."""
    lines = [line.encode() + b"\n" for line in piece.lines]
    if len(piece.frames) != len(lines):
        raise DemosError(f"The robot sent {len(piece.frames)} pictures for {len(lines)} lines.")
    for number, (line, jpeg) in enumerate(zip(lines, piece.frames, strict=True), piece.first + 1):
        try:
            fields = decode_line(line)
            step = Step.from_json(fields) if fields.get("kind") == "step" else None
        except ValueError as error:
            raise DemosError(
                f"Line {number} of {piece.episode} is damaged on the robot, because {error}; "
                "repair it there."
            ) from error
        if step is not None and step.picture is not None:
            _keep_picture(folder / FRAMES, step, step.picture, jpeg)
    return lines


def _keep_picture(frames: Path, step: Step, picture: Frame, jpeg: bytes | None) -> None:
    """Write the frame of a step, unless it exists."""
    # A robot's data must not escape the folder.
    if not (step.frame.endswith(".jpg") and step.frame[:-4].isdecimal()):
        raise DemosError(f"A step names the picture {step.frame!r}.")
    file = frames / step.frame
    if jpeg is None:
        is_here = file.is_file() and file.stat().st_size == picture.size
    else:
        is_here = picture.fits(jpeg)
    if not is_here:
        raise DemosError(f"The picture {step.frame} of step {step.index} is damaged on the robot.")
    if jpeg is not None:
        with contextlib.suppress(FileNotFoundError):
            if file.stat().st_size == len(jpeg) and file.read_bytes() == jpeg:
                return
        file.write_bytes(jpeg)


# s. Time that a memory card may need for the last steps.
_CLOSED_WITHIN_S: Final = 10.0
_LOOK_EVERY_S: Final = 0.1


@contextlib.contextmanager
def recorded(robot: RobotClient, name: str, data: Path | None) -> Generator[None]:
    """Record on the robot for the duration of a block.

    The recording stays on the robot in any case; if the block fails, the message tells how to
    download it.

    Args:
        robot: The robot, connected to as a person.
        name: Its local name.
        data: Folder to download to; None to record nothing.

    Raises:
        RobotRefused: If the robot refuses to record.
        DemosError: If the data is damaged.
        OutputError: If it cannot be written locally.
    """
    if data is None:
        yield
        return

    before = {episode.id for episode in _episodes_there(robot, ())}
    robot.record(on=True)
    try:
        yield
        state = robot.recorder
        if state is not None and state.recording:
            robot.record(on=False)
        for episode in _closed(robot, before):
            fetch_episode(robot, episode.id, data)
            say(f"recorded {episode.kept} steps in {data / episode.id}")
    except BaseException:
        say(
            f"The recording is on the robot: `shapechanger robot fetch {name} --out {data}` "
            "downloads it.",
            stderr=True,
        )
        raise


def _closed(robot: RobotClient, before: set[str]) -> list[EpisodeSummary]:
    """Wait until the robot has written the last steps, and return the new episodes."""
    until_s = time.monotonic() + _CLOSED_WITHIN_S
    while True:
        new = [episode for episode in _episodes_there(robot, ()) if episode.id not in before]
        if all(episode.closed for episode in new) or time.monotonic() > until_s:
            return new
        time.sleep(_LOOK_EVERY_S)
