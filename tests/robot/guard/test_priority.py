"""The priority of processes that a robot's own start."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from shapechanger.robot.guard.priority import run_normally


@pytest.mark.parametrize(("before", "after"), [(-10, [0]), (0, []), (10, [])])
def test_a_child_runs_normally(
    before: int, after: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    changes: list[int] = []
    monkeypatch.setattr(os, "getpriority", lambda *_: before)
    monkeypatch.setattr(os, "setpriority", lambda _kind, _pid, value: changes.append(value))
    run_normally(1)
    assert changes == after


def test_a_child_that_has_ended() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    run_normally(child.pid)
