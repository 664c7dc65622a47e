"""Fixtures with Chromium and a served twin."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser, sync_playwright

from shapechanger.twin.robot import RunningRobot, run_robot
from tests.drawing import missing
from tests.robot.console.browser import CHROMIUM_ARGUMENTS, Console
from tests.robots import CAR, IN_A_ROOM, write_profile


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """A browser without a screen; it ends with the module, and with it Playwright's event loop."""
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        missing("There is no Chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served_car(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A car with a camera on its twin, for all tests of a module.

    Its time goes by while a page looks, so that a busy machine changes nothing.
    """
    with _served(tmp_path_factory.mktemp("car"), "twin") as robot:
        yield robot


@pytest.fixture
def car(served_car: RunningRobot) -> RunningRobot:
    """The same, put back to the start: at a wall it refuses to drive on, and rightly so.

    Tests leave it disarmed or stopped.
    """
    with served_car.operator() as operator:
        operator.place(0)
    return served_car


@pytest.fixture
def hasty_car(tmp_path: Path) -> Iterator[RunningRobot]:
    """The same in real time, which waits for no page."""
    with _served(tmp_path, "real") as robot:
        yield robot


def _served(folder: Path, clock: Literal["twin", "real"]) -> RunningRobot:
    arguments = (*IN_A_ROOM, "--recordings", str(folder / "recordings"))
    return run_robot(write_profile(folder, CAR), clock=clock, folder=folder, arguments=arguments)


@pytest.fixture
def visit(chromium: Browser) -> Iterator[Callable[..., Console]]:
    """Open the console of a robot; the page ends with the test, and must not have complained."""
    with contextlib.ExitStack() as stack:
        opened: list[Console] = []

        def made(robot: RunningRobot, **how: object) -> Console:
            console = stack.enter_context(Console(chromium, robot, **how))
            opened.append(console)
            return console

        yield made
        assert [said for console in opened for said in console.complaints] == []


@pytest.fixture
def recordings(car: RunningRobot) -> Path:
    """Where the car keeps its recordings."""
    return car.folder / "recordings"
