"""A robot that is served on its twin, and somebody who drives it command by command."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, Literal

from shapechanger.layout import Layout
from shapechanger.link.messages import Observation
from shapechanger.remote.client import RobotClient
from shapechanger.twin.oracle import propelled
from shapechanger.twin.robot import Operator, RunningRobot
from shapechanger.twin.signals import read_ledger
from shapechanger.twin.wiring import TwinWiring
from tests.twin.robots import until

Clock = Literal["twin", "real"]


class Served:
    """A robot on its twin, armed, with a driver in lockstep.

    Attributes:
        robot: Its processes.
        client: Who drives.
        operator: Who stands beside it.
        seen: The newest observation.
    """

    def __init__(
        self, robot: RunningRobot, client: RobotClient, operator: Operator, clock: Clock
    ) -> None:
        self.robot = robot
        self.client = client
        self.operator = operator
        self._clock = clock
        names = Layout.from_json(client.welcome.state_layout).names
        self._places = {name: place for place, name in enumerate(names)}
        self.seen: Observation = client.ask().message

    def step(self, *values: float) -> Observation:
        """Command once, and look."""
        self.client.command(values, answers=self.seen.seq)
        self.seen = self.client.observation(self.seen.seq).message
        return self.seen

    def drive(self, *values: float, steps: int) -> Observation:
        """Command the same again and again."""
        for _ in range(steps):
            self.step(*values)
        return self.seen

    def drive_until(
        self, done: Callable[[Observation], bool], *values: float, at_most: int = 60
    ) -> int:
        """Command the same until something is seen.

        Returns:
            How many commands it took.
        """
        for count in range(1, at_most + 1):
            if done(self.step(*values)):
                return count
        raise AssertionError(f"It was not seen in {at_most} commands, but {self.seen}")

    def state(self, name: str) -> float:
        """What a sensor says."""
        return self.seen.state[self._places[name]]

    def rest_ns(self, wiring: TwinWiring) -> int:
        """Wait for all that propels to rest, without any command; when it did, by the ledger."""
        if self._clock == "twin":
            self.operator.advance(1.0)
            # The daemon learns what time it is by letting some go by.
            self.step(*self.seen.action_applied)
        ends: list[float] = []

        def rests() -> bool:
            ends[:] = [i.end_ns for i in propelled(read_ledger(self.robot.ledger_path), wiring)]
            return max(ends) < float("inf")

        until(rests)
        return int(max(ends))


@contextmanager
def driving(robot: RunningRobot, clock: Clock, **options: Any) -> Generator[Served]:
    """Put a robot at its start and arm it."""
    with (
        robot.operator() as operator,
        robot.client(role="person", pace="lockstep", **options) as client,
    ):
        operator.place(0)
        client.take()
        client.arm()
        yield Served(robot, client, operator, clock)
