"""A robot on its twin, a person who drives it, and separate folders for all programs."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

# LeRobot reads these when it is imported, and the programs that the tests start inherit them.
_HOME = tempfile.TemporaryDirectory(prefix="shapechanger-lerobot-")
os.environ["HF_LEROBOT_HOME"] = str(Path(_HOME.name) / "lerobot")
os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["XDG_CONFIG_HOME"] = str(Path(_HOME.name) / "config")

from shapechanger.robot.client.known_robots import remember  # noqa: E402
from shapechanger.robot.link.messages import Observation  # noqa: E402
from shapechanger.robot.profile.load import find_profile  # noqa: E402
from shapechanger.robot.twin.robot import RunningRobot, run_robot  # noqa: E402

LAB_CAR = "lab-car"


class Person:
    """A person at a robot's console, who holds the stick.

    Attributes:
        seen: Observations that answered the person's commands.
    """

    def __init__(self, robot: RunningRobot) -> None:
        self.client = robot.client(role="person", name="Grace", frames=False)
        self.seen: list[Observation] = []
        self._let_go = threading.Event()
        self._thread: threading.Thread | None = None

    def drive(self, values: Sequence[float]) -> None:
        """Take control once another client has it, and hold the stick in a thread."""
        self._let_go.clear()
        self._thread = threading.Thread(target=self._hold, args=(tuple(values),))
        self._thread.start()

    def let_go(self) -> None:
        """Release the stick, and keep control."""
        self._let_go.set()
        if self._thread is not None:
            self._thread.join()

    def let_a_program_drive(self) -> None:
        """Give control back, and arm the robot for the program that takes control, as P does."""
        self.let_go()
        self.client.release()
        while self.client.ask().message.holder_role != "program":
            pass
        self.client.arm()

    def _hold(self, values: tuple[float, ...]) -> None:
        received = self.client.ask()
        while not (received.message.holder or self._let_go.is_set()):
            received = self.client.ask()
        self.client.take()
        self.client.arm()
        while not self._let_go.is_set():
            received = self.client.exchange(values, received)
            self.seen.append(received.message)


@contextlib.contextmanager
def served() -> Iterator[RunningRobot]:
    """Serve the twin of a lab-car in the plain room, and store it as a known robot."""
    with (
        tempfile.TemporaryDirectory() as folder,
        run_robot(
            find_profile(LAB_CAR), folder=Path(folder), arguments=("--world", "room")
        ) as robot,
    ):
        remember(dataclasses.replace(robot.known, name=LAB_CAR))
        yield robot


@pytest.fixture(scope="session")
def running() -> Iterator[RunningRobot]:
    """A lab-car for all tests."""
    with served() as robot:
        yield robot


@pytest.fixture
def robot(running: RunningRobot) -> RunningRobot:
    """The lab-car, disarmed at its start and stored as a known robot."""
    remember(dataclasses.replace(running.known, name=LAB_CAR))
    with running.operator() as operator:
        operator.place(0)
    return running


@pytest.fixture
def person(robot: RunningRobot) -> Iterator[Person]:
    """A person at the lab-car's console."""
    person = Person(robot)
    yield person
    person.let_go()
    person.client.close()


@pytest.fixture
def until() -> Callable[[Callable[[], bool]], None]:
    """Call a function until it returns true."""

    def repeat(is_true: Callable[[], bool]) -> None:
        for _ in range(1_000):
            if is_true():
                return
            threading.Event().wait(0.01)
        pytest.fail("The condition did not hold within 1000 attempts.")

    return repeat
