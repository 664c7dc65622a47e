"""The examples of docs/remote.md."""

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shapechanger.robot.client.known_robots import remember
from tests.robot.client.robot import Robot

pytestmark = pytest.mark.realtime

PAGE = Path(__file__).parents[3] / "docs" / "remote.md"


def test_the_examples_drive_a_robot(
    run: Callable[..., Robot], capsys: pytest.CaptureFixture[str]
) -> None:
    robot = run(control_hz=100.0, clock="real")
    remember(dataclasses.replace(robot.known, name="new-bright"))
    names: dict[str, Any] = {"__name__": "__main__"}
    blocks = re.findall(r"```(?:py|python)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) == 4
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
        if "env" in names:
            names["env"].close()
    assert capsys.readouterr().out.startswith("(0.0, 0.3)")
