"""A car without sensors, which all attacks share.

It is a twin in real time, with its real supervisor, guard and daemon. In a `scene`, a person has
control, with the robot armed and at rest, so that any accepted command would move a pin. After the
attack the twin's ledger must show no movement, and the robot must serve an honest client.
"""

from collections.abc import Iterator

import pytest

from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robot.client.attacks.scene import CAP, Scene, key_of, movements, settle
from tests.robot.client.attacks.stranger import Stranger
from tests.robots import BLIND_CAR, IN_A_ROOM, changed, write_profile


@pytest.fixture(scope="package")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    folder = tmp_path_factory.mktemp("attacked")
    mix = "mix = {{ throttle = {} }}".format
    profile = write_profile(folder, changed(mix(1.0), mix(CAP), BLIND_CAR))
    with run_robot(profile, folder=folder, arguments=IN_A_ROOM) as served:
        yield served


@pytest.fixture
def scene(robot: RunningRobot) -> Iterator[Scene]:
    """The robot, armed by a person who does not command. It may not move until the test ends."""
    key = key_of(robot)
    before, pids = movements(robot), [robot.pid_of("guard"), robot.pid_of("daemon")]
    with Stranger(robot.port) as operator:
        operator.control(key, "Grace")
        made = Scene(robot, robot.port, key, operator)
        with made.stack:
            yield made
            settle(robot, key)
            assert movements(robot) == before
    assert [robot.pid_of("guard"), robot.pid_of("daemon")] == pids
