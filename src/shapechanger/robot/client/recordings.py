"""Recordings of a robot: list, download, record and replay."""

from __future__ import annotations

import contextlib
import io
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import Episode
from shapechanger.demos.episodes.reader import read_header
from shapechanger.demos.episodes.records import (
    FRAMES,
    HEADER,
    STEPS,
    Step,
    append,
    is_episode,
    is_same_rate,
    lock,
    parse_line,
    rate_jitter,
)
from shapechanger.errors import (
    DemosError,
    LinkError,
    OutputError,
    RobotRefused,
    require_known,
    translate_errors,
)
from shapechanger.files import cannot_write, write_atomic
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import recall
from shapechanger.robot.client.teleop import Terminal
from shapechanger.robot.link.messages import EpisodeSummary, Piece, Welcome

_STEP: Final = b'{"kind":"step",'
_CLOSED_WITHIN_S: Final = 10.0  # Time that a memory card may need for the last steps, s.
_LOOK_EVERY_S: Final = 0.1


def episodes_there(robot: RobotClient, wanted: Sequence[str] = ()) -> list[EpisodeSummary]:
    """Return the episodes on a robot, or the `wanted` ones, oldest first."""
    page = robot.browse()
    found = list(page.episodes)
    while page.more and page.episodes:
        page = robot.browse(found[-1].id)
        found += page.episodes
    found.reverse()
    ids = [episode.id for episode in found]
    require_known("episode", ids, *wanted)
    return [episode for episode in found if not wanted or episode.id in wanted]


def fetch_episode(robot: RobotClient, name: str, data: Path) -> tuple[int, int]:
    """Download an episode, or its new part; return the numbers of new lines and of local edits.

    An incomplete episode is kept in a folder that readers ignore. Marks and edits from this machine
    are placed after the robot's, so that they take precedence.
    """
    here, part = data / name, data / f".{name}.fetching"
    folder = here if is_episode(here) else part
    with translate_errors(OSError, to=lambda error: cannot_write(folder, error)):
        (folder / FRAMES).mkdir(parents=True, exist_ok=True)
    file = lock(folder / STEPS, f"Another program fetches or changes {folder} at this moment.")
    try:
        have = _complete_lines(folder, file)
        # Lines up to the last step come from the robot; marks and edits of both sides follow.
        begin = 1 + max((n for n, line in enumerate(have) if line.startswith(_STEP)), default=-1)
        edits, theirs = have[begin:], list[bytes]()
        piece = robot.fetch(name, max(begin - 1, 0))
        if begin and [line.encode() + b"\n" for line in piece.lines[:1]] != have[begin - 1 : begin]:
            raise DemosError(
                f"{folder} has other steps than {name} on the robot, so it stays as it is: "
                "`--out` with another folder fetches the robot's."
            )
        while piece.lines:
            lines = _kept(piece, folder / FRAMES)
            new = lines[max(begin - piece.first, 0) :]
            theirs += new
            if not edits:
                append(file, b"".join(new))
            piece = robot.fetch(name, piece.first + len(lines))
        own = _without(edits, theirs)
        if edits and (merged := have[:begin] + theirs + own) != have:
            write_atomic(folder / STEPS, b"".join(merged))
        os.fsync(file.fileno())
        # Keep a closed header: a repair may have closed it on this machine only.
        if not (folder / HEADER).is_file() or read_header(folder)[1] is None:
            write_atomic(folder / HEADER, piece.header.encode())
            read_header(folder)
        if folder is part:
            part.rename(here)
    except OSError as error:
        if isinstance(error, ConnectionError | OutputError):  # Already a clear message.
            raise
        raise cannot_write(folder, error) from error
    finally:
        file.close()
    return len(_without(theirs, edits)), len(own)


def _without(lines: Sequence[bytes], others: Sequence[bytes]) -> list[bytes]:
    """Return the lines that are not in `others`; of duplicates, the last ones remain."""
    left = Counter(others)
    found: list[bytes] = []
    for line in lines:
        if left[line]:
            left[line] -= 1
        else:
            found.append(line)
    return found


def _complete_lines(folder: Path, file: io.FileIO) -> list[bytes]:
    """Return the local lines; remove a truncated last one of an unfinished download."""
    lines = io.BytesIO((folder / STEPS).read_bytes()).readlines()
    if lines and not lines[-1].endswith(b"\n"):
        if (folder / HEADER).is_file():
            raise DemosError(f"{folder} is damaged: `shapechanger demos repair {folder}` first.")
        file.truncate(sum(map(len, lines[:-1])))
        lines.pop()
    return lines


def _kept(piece: Piece, frames: Path) -> list[bytes]:
    """Check the lines of a piece, write their frames, and return the lines."""
    lines = [line.encode() + b"\n" for line in piece.lines]
    if len(piece.frames) != len(lines):
        raise DemosError(f"The robot sent {len(piece.frames)} images for {len(lines)} lines.")
    for number, (line, jpeg) in enumerate(zip(lines, piece.frames, strict=True), piece.first + 1):
        damaged = f"Line {number} of {piece.episode} is damaged on the robot, because "
        with translate_errors(
            ValueError, to=lambda error, why=damaged: DemosError(f"{why}{error}; repair it there.")
        ):
            step = parse_line(line)
        if not isinstance(step, Step) or (picture := step.picture) is None:
            continue
        file = frames / step.frame
        known = file.read_bytes() if file.is_file() else b""
        if not (len(known) == picture.size if jpeg is None else picture.fits(jpeg)):
            raise DemosError(
                f"The image {step.frame} of step {step.index} is damaged on the robot."
            )
        if jpeg is not None and known != jpeg:
            file.write_bytes(jpeg)
    return lines


def begin_recording(robot: RobotClient) -> set[str]:
    """Begin to record on a robot, as a person, and return the ids of the episodes before."""
    before = {episode.id for episode in episodes_there(robot)}
    robot.record(on=True)
    return before


def end_recording(robot: RobotClient, before: set[str]) -> list[EpisodeSummary]:
    """End a recording, if it has not ended by itself, and return its episodes."""
    state = robot.recorder
    if state is not None and state.recording:
        robot.record(on=False)
    until_s = time.monotonic() + _CLOSED_WITHIN_S
    while True:
        new = [episode for episode in episodes_there(robot) if episode.id not in before]
        if all(episode.closed for episode in new) or time.monotonic() > until_s:
            return new
        time.sleep(_LOOK_EVERY_S)


def play_on_robot(episode: Episode, name: str, say: Callable[[str], None]) -> None:
    """Replay an episode on a robot after a person at this terminal has armed it.

    The robot's caps, reflexes and deadline apply as usual. Any key or error stops the replay.
    """
    known = recall(name)
    with Terminal() as terminal, RobotClient.connect(known, role="person", frames=False) as robot:
        _require_fit(episode, robot.welcome)
        terminal.keys(0.0)  # Discard keys that were pressed before the prompt was shown.
        say(
            f"{episode.seconds:.1f} s of {episode.path.name}, replayed without sensors: "
            f"{robot.welcome.robot} starts from its present place.\n"
            "E arms it and starts · any other key cancels; during the replay, any key stops it."
        )
        while not (keys := terminal.keys(0.5)):
            robot.acknowledge()  # Keeps the link alive.
        if keys != ["e"]:
            say("cancelled; no step was played")
            return
        with contextlib.ExitStack() as leaving:
            leaving.callback(lambda: (robot.disarm(), robot.release()) if robot.alive else None)
            robot.take()
            robot.arm()
            ended = _play(robot, terminal, episode)
        say(ended)


def _require_fit(episode: Episode, welcome: Welcome) -> None:
    recorded = episode.header.action_layout
    moved = Layout.from_json(welcome.action_layout)
    layouts = recorded, moved
    ranges = [[(f.name, f.unit, f.shape, f.low, f.high) for f in each] for each in layouts]
    if ranges[0] != ranges[1]:
        told = [", ".join(f"{f} from {f.low:g} to {f.high:g}" for f in each) for each in layouts]
        raise DemosError(
            f"{welcome.robot} takes {told[1]}, and {episode.path.name} was recorded with {told[0]}."
        )
    rate, own = episode.header.control_hz, welcome.control_hz
    if not is_same_rate(rate, own, rate_jitter(episode.gaps_s, rate)):
        raise DemosError(
            f"{welcome.robot} takes {own:g} commands a second, and {episode.path.name} has "
            f"{rate:g} steps a second."
        )
    if welcome.clock == "twin":
        raise DemosError(
            f"The time of {welcome.robot} moves only in steps (`serve --clock twin`), so no one "
            "could stop it in time: serve it with `--clock real`."
        )


def _play(robot: RobotClient, terminal: Terminal, episode: Episode) -> str:
    """Send step after step until the end or a key press, and describe the outcome."""
    period_s = 1.0 / robot.welcome.control_hz
    steps = episode.kept
    seen = robot.ask().message
    due_s = time.monotonic()
    for number, step in enumerate(steps):
        if terminal.keys(max(0.0, due_s - time.monotonic())):
            robot.emergency_stop("A person pressed a key.")
            return f"stopped by a key after {number} of {len(steps)} steps: emergency stop"
        if not (seen.mine and seen.armed):
            why = seen.stop_reason or f"{seen.holder or 'no one'} commands it now"
            return f"stopped after {number} of {len(steps)} steps: {why}"
        # The applied actions include the caps at that time; the current caps apply on top.
        robot.command(step.action if step.applied is None else step.applied, answers=seen.seq)
        try:
            seen = robot.observation(seen.seq).message
        except RobotRefused:
            raise
        except LinkError as error:
            raise LinkError(f"After {number} of {len(steps)} steps: {error}") from error
        # A late step delays all later ones.
        due_s = max(due_s + period_s, time.monotonic())
    terminal.keys(max(0.0, due_s - time.monotonic()))  # The last command gets a full period, too.
    return f"played {len(steps)} steps"
