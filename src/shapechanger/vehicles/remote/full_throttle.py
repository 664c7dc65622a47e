"""A program that drives a robot at full throttle, and fails when it receives a signal.

Trials of a robot run this program; see `shapechanger.robot.twin.check.driver`.
"""

from __future__ import annotations

import math
import signal
import sys
import time
from typing import Any, Final

import numpy as np

from shapechanger.errors import LinkError
from shapechanger.layout import Layout
from shapechanger.policy import CloneNetwork, Framing, PolicyCard
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.twin.check.driver import FAILURES, asked_robot, print_time
from shapechanger.vehicles.remote.pilot import PolicyDriver

# Delay of a late action, s, longer than the age at which a robot refuses an action.
_LATE_S: Final = 0.5


class FullThrottle:
    """A policy without inputs that returns full throttle, until a signal makes it fail."""

    def __init__(self, actions: Layout, state: Layout) -> None:
        self.net = CloneNetwork(
            framing=Framing(), channels=(1,), features=1, eyes="none", nerves=(1,)
        )
        self.card = PolicyCard(learner="none", observation=state, action=actions, clone=self.net)
        self._throttle = np.array([float(name == "throttle") for name in actions.names], np.float32)
        self._failing = ""
        for number in FAILURES.values():
            signal.signal(number, self._fail)

    def predict(self, picture: object, state: object = None) -> object:
        """Return full throttle, unless a signal has chosen a failure."""
        del picture, state
        while self._failing == "hangs":
            time.sleep(_LATE_S)
        if self._failing == "is late":
            time.sleep(_LATE_S)
        if self._failing == "gives NaN":
            return math.nan * self._throttle
        print_time()
        return self._throttle

    def _fail(self, number: int, _: object) -> None:
        self._failing = next(how for how, one in FAILURES.items() if one == number)


def main() -> None:
    """Drive until the link or this process ends."""
    robot = asked_robot()
    with RobotClient.connect(robot, frames=False) as client:
        actions = Layout.from_json(client.welcome.action_layout)
        state = Layout.from_json(client.welcome.state_layout)
    policy: Any = FullThrottle(actions, state)
    PolicyDriver(policy, "policy", robot).run()


if __name__ == "__main__":
    try:
        main()
    except LinkError as error:
        sys.exit(str(error))
