"""A robot served on its twin, with a client that drives it command by command."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, Literal

from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.twin.ledger import TwinWiring, propelled, read_ledger
from shapechanger.robot.twin.robot import Operator, RunningRobot
from tests.robot.twin.robots import until

Clock = Literal["twin", "real"]


class Served:
    """An armed robot on its twin, with a client in lockstep.

    Attributes:
        robot: The processes of the robot.
        client: The client that drives.
        operator: The operator of the twin.
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
        """Send a command and wait for the observation after it."""
        self.client.command(values, answers=self.seen.seq)
        self.seen = self.client.observation(self.seen.seq).message
        return self.seen

    def drive(self, *values: float, steps: int) -> Observation:
        for _ in range(steps):
            self.step(*values)
        return self.seen

    def drive_until(
        self, done: Callable[[Observation], bool], *values: float, at_most: int = 60
    ) -> int:
        """Repeat a command until an observation satisfies `done`.

        Returns:
            The number of commands.
        """
        for count in range(1, at_most + 1):
            if done(self.step(*values)):
                return count
        raise AssertionError(f"not seen within {at_most} commands; last observation: {self.seen}")

    def state(self, name: str) -> float:
        return self.seen.state[self._places[name]]

    def rest_ns(self, wiring: TwinWiring) -> int:
        """Wait until no output propels the robot; return the ledger's time of this, ns."""
        if self._clock == "twin":
            self.operator.advance(1.0)
            # The daemon receives the advanced time only with its next step.
            self.step(*self.seen.action_applied)
        ends: list[float] = []

        def rests() -> bool:
            ends[:] = [i.end_ns for i in propelled(read_ledger(self.robot.ledger_path), wiring)]
            return max(ends) < float("inf")

        until(rests)
        return int(max(ends))


@contextmanager
def driving(robot: RunningRobot, clock: Clock, **options: Any) -> Generator[Served]:
    """Place a robot at its start and arm it."""
    with (
        robot.operator() as operator,
        robot.client(role="person", pace="lockstep", **options) as client,
    ):
        operator.place(0)
        client.take()
        client.arm()
        yield Served(robot, client, operator, clock)
