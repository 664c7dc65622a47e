"""After SIGKILL at 200 random moments, `repair` recovers every complete step."""

import os
import random
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from shapechanger.demos.episodes import episodes_of, read_episode, repair
from tests.demos.episodes.making import picture

pytestmark = pytest.mark.system

_TRIALS = 200
_ROOT = Path(__file__).parents[2]


def test_no_complete_step_is_lost_to_sigkill(tmp_path: Path) -> None:
    """Every reported step is on the disk with its frame, in order."""
    chance = random.Random(0)
    command = [sys.executable, "-m", "tests.demos.episodes.recorder", str(tmp_path)]
    kept_in_all = 0
    pipe = subprocess.PIPE
    pipes = {"stdin": pipe, "stdout": pipe, "stderr": pipe}
    with subprocess.Popen(command, cwd=_ROOT, bufsize=0, **pipes) as runner:
        assert runner.stdin is not None
        assert runner.stdout is not None
        assert runner.stderr is not None
        steps = runner.stderr.fileno()
        for trial in range(_TRIALS):
            runner.stdin.write(b"\n")
            pid = int(runner.stdout.readline())
            reported = 0
            for _ in range(chance.randrange(1, 40)):
                reported += len(os.read(steps, 1))
            for _ in range(chance.randrange(3000)):  # Wait for a random time.
                pass
            os.kill(pid, signal.SIGKILL)
            assert runner.stdout.readline() == b"dead\n"
            while select.select([steps], [], [], 0.0)[0]:
                reported += len(os.read(steps, 4096))
            (episode,) = episodes_of(tmp_path / str(trial))
            kept_in_all += _kept(episode, reported)
        runner.stdin.close()
    assert kept_in_all > _TRIALS


def _kept(path: Path, reported: int) -> int:
    """Return the number of steps after repair, which is at least the number reported."""
    repair(path)
    episode = read_episode(path)
    kept = len(episode.steps)
    assert kept >= reported
    assert [step.index for step in episode.steps] == list(range(kept))
    assert all(episode.jpeg(step) == picture(step.index) * 20 for step in episode.steps)
    return kept
