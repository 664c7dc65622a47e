"""The thread that writes: what it takes, it writes; a disk that is too slow ends the episode."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shapechanger.demos.episodes import EpisodeHeader, Step, episodes_of, read_episode, repair
from shapechanger.robot.daemon.recorder import DISK_TOO_SLOW, EpisodeThread, StepWithFrame
from tests.robot.daemon.plans import ACTIONS, picture

HEADER = EpisodeHeader(action_layout=ACTIONS.to_json())
WITHIN_S = 20.0


def step(number: int) -> StepWithFrame:
    """A step that tells its number."""
    return StepWithFrame(
        Step(action=(0.0, number / 1e6), driver="person", captured_ns=number * 50_000_000),
        picture(number % 5),
    )


def test_everything_is_written_in_the_order_in_which_it_was_told(tmp_path: Path) -> None:
    """And the episode is closed with its outcome."""
    reports: list[tuple[str, str]] = []
    answers: list[str] = []
    scribe = EpisodeThread(tmp_path, HEADER, lambda *said: reports.append(said))
    scribe.mark("too early", answers.append)
    scribe.undo(5.0, answers.append)
    assert all(scribe.add(step(number)) for number in range(40))
    scribe.mark("here", answers.append)
    scribe.undo(0.5, answers.append)
    scribe.end("time")
    assert scribe.add(step(41))  # Too late: it has ended well, and this is no trouble.
    assert scribe.join(WITHIN_S)
    assert reports == [("begun", ""), ("ended", "")]
    assert answers == [
        "There is no step yet that could be marked.",
        "There is nothing to undo.",
        "",
        "",
    ]
    episode = read_episode(tmp_path / scribe.progress.episode)
    assert (episode.closed, episode.outcome) == (True, "time")
    assert [s.action[1] for s in episode.steps] == [number / 1e6 for number in range(40)]
    assert (len(episode.kept), scribe.progress.dropped) == (30, 10)
    assert [mark.step for mark in episode.marks] == [39]


@pytest.mark.parametrize("bytes_each", [0, 1 << 20])
def test_a_disk_that_is_too_slow_ends_the_episode_and_keeps_what_it_took(
    tmp_path: Path, bytes_each: int
) -> None:
    """Neither steps nor bytes of pictures pile up without end; here the disk is busy elsewhere."""
    busy = EpisodeThread(tmp_path, HEADER, lambda *_: None)
    reports: list[tuple[str, str]] = []
    scribe = EpisodeThread(tmp_path, HEADER, lambda *said: reports.append(said), after=busy)
    taken = 0
    large = b"\xff\xd8" + bytes(bytes_each)
    while scribe.add(StepWithFrame(step(taken).step, large)):
        taken += 1
        assert taken < 10_000
    busy.end()
    assert scribe.join(WITHIN_S)
    assert reports == [("begun", ""), ("ended", "")]
    episode = read_episode(tmp_path / scribe.progress.episode)
    assert episode.outcome == DISK_TOO_SLOW
    assert len(episode.steps) == taken == (15 if bytes_each else 256)


def test_what_the_disk_says_is_reported(tmp_path: Path) -> None:
    """Once, and it does not begin."""
    (tmp_path / "kept").write_text("in the way")
    reports: list[tuple[str, str]] = []
    scribe = EpisodeThread(tmp_path / "kept", HEADER, lambda *said: reports.append(said))
    assert scribe.join(WITHIN_S)
    ((what, trouble),) = reports
    assert (what, scribe.progress.episode) == ("ended", "")
    assert "Cannot write" in trouble


_WRITES_FOR_EVER = """
import sys
from pathlib import Path
from tests.robot.daemon.test_scribe import HEADER, step
from shapechanger.robot.daemon.recorder import Scribe

scribe, number = Scribe(Path(sys.argv[1]), HEADER, lambda *_: None), 0
while True:
    if scribe.progress.steps >= number - 100:
        scribe.add(step(number))
        number += 1
    if number % 20 == 0:
        print(scribe.progress.steps, flush=True)
"""


def test_what_a_killed_daemon_leaves_can_be_finished(tmp_path: Path) -> None:
    """SIGKILL at random moments: every step that was complete is there after repair."""
    rng = random.Random(5)
    for number in range(2):
        folder = tmp_path / str(number)
        writing = subprocess.Popen(
            [sys.executable, "-c", _WRITES_FOR_EVER, str(folder)], stdout=subprocess.PIPE, text=True
        )
        assert writing.stdout is not None
        enough, told = rng.randrange(1, 400), 0
        until_s = time.monotonic() + WITHIN_S
        while told < enough and time.monotonic() < until_s:
            told = int(writing.stdout.readline())
        os.kill(writing.pid, signal.SIGKILL)
        told = max([told, *(int(line) for line in writing.stdout.read().split("\n")[:-1])])
        writing.wait()
        writing.stdout.close()
        (path,) = episodes_of(folder)
        repair(path)
        episode = read_episode(path)
        assert told >= enough
        assert len(episode.steps) >= told
        assert [s.index for s in episode.steps] == list(range(len(episode.steps)))
        assert all(episode.jpeg(s) == picture(s.index % 5) for s in episode.steps)
