"""Fixtures that start robots and clients, and check that no thread remains."""

import contextlib
import os
import pty
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.teleop import Terminal
from tests.robot.client.robot import Robot, eventually


@pytest.fixture(scope="session")
def credentials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("credentials")


@pytest.fixture(autouse=True)
def _no_thread_remains() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    eventually(lambda: set(threading.enumerate()) <= before)


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def run(credentials: Path) -> Iterator[Callable[..., Robot]]:
    with contextlib.ExitStack() as stack:
        yield lambda **what: stack.enter_context(Robot(**what).running(credentials))


@pytest.fixture
def connect() -> Iterator[Callable[..., RobotClient]]:
    with contextlib.ExitStack() as stack:

        def made(robot: Robot, **how: Any) -> RobotClient:
            return stack.enter_context(RobotClient.connect(robot.known, **how))

        yield made


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, Terminal]]:
    """A terminal at a pseudo-terminal, and the end at which to type."""
    ours, theirs = pty.openpty()
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, ours)
        monkeypatch.setattr(sys, "stdin", stack.enter_context(os.fdopen(theirs)))
        yield ours, stack.enter_context(Terminal())
