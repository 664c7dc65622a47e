"""A twin in real time, next to other work on a busy machine."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import run_robot

pytestmark = [pytest.mark.realtime, pytest.mark.system]

_BUSY = "while True: sum(range(10**5))"
_SHORT_S = 0.05  # Shorter than the board needs to lay out a course.


def test_a_busy_machine_does_not_cost_the_guard(tmp_path: Path) -> None:
    """On busy cores the board is held up for longer than the deadline, and nothing fails.

    Without the privilege of real time, as most users are, and as a training next to it leaves them.
    """
    profile = tmp_path / "lab-car.toml"
    text = find_profile("lab-car").read_text()
    profile.write_text(f"{text}\n[limits]\ndeadline_ms = {_SHORT_S * 1e3:.0f}\n")
    with contextlib.ExitStack() as stack:
        robot = stack.enter_context(run_robot(profile, arguments=("--world", "corridor"), seed=1))
        for _ in range(os.cpu_count() or 1):
            busy = subprocess.Popen([sys.executable, "-c", _BUSY])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        operator = stack.enter_context(robot.operator())
        client = stack.enter_context(robot.client())
        client.take()
        client.arm()
        guard = robot.pid_of("guard")
        began_s = time.monotonic()
        for seed in (101, 102, 103):
            operator.lay_out(seed)
            seen = client.observation()
            client.command((0.2, 0.2), answers=seen.message.seq)
        assert time.monotonic() - began_s > 3 * _SHORT_S, "the board was not held up"
        assert robot.pid_of("guard") == guard
        assert client.observation().message.armed
        assert "starts afresh" not in robot.log_text()
