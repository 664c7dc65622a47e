"""Fixtures with a served twin and its console."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser

from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robot.console.browser import Console
from tests.robots import CAR, IN_A_ROOM, write_profile


@pytest.fixture(scope="module")
def served_car(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A car with a camera, for a module; its time advances with the page's observations."""
    with _served(tmp_path_factory.mktemp("car"), "twin") as robot:
        yield robot


@pytest.fixture
def car(served_car: RunningRobot) -> RunningRobot:
    """The car of `served_car`, put at its start. Each test must leave it disarmed or stopped."""
    with served_car.operator() as operator:
        operator.place(0)
    return served_car


@pytest.fixture
def hasty_car(tmp_path: Path) -> Iterator[RunningRobot]:
    with _served(tmp_path, "real") as robot:
        yield robot


def _served(folder: Path, clock: Literal["twin", "real"]) -> RunningRobot:
    arguments = (*IN_A_ROOM, "--recordings", str(folder / "recordings"))
    return run_robot(write_profile(folder, CAR), clock=clock, folder=folder, arguments=arguments)


@pytest.fixture
def visit(chromium: Browser) -> Iterator[Callable[..., Console]]:
    """Open the console of a robot. After the test, the page is closed, and must have no errors."""
    with contextlib.ExitStack() as stack:
        opened: list[Console] = []

        def made(robot: RunningRobot, **how: object) -> Console:
            console = stack.enter_context(Console(chromium, robot, **how))
            opened.append(console)
            return console

        yield made
        assert [error for console in opened for error in console.errors] == []
