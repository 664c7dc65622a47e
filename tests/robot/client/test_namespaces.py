"""A cut cable between network namespaces."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.twin.check.driver import Driver
from shapechanger.robot.twin.judge import propelled
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.wiring import TwinWiring
from tests.drawing import missing
from tests.robot.twin.robots import until
from tests.robots import IN_A_ROOM, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

DEADLINE_MS: Final = 250.0
LATE_MS: Final = 200.0  # Ten times the time on a quiet machine.
NAME: Final = f"sc{os.getpid() % 100_000}"
ROBOT, DRIVER = "10.213.77.1", "10.213.77.2"


def ip(*arguments: str) -> None:
    """Run `ip`, and raise if it fails."""
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def namespace() -> Iterator[str]:
    """A network namespace with a veth pair to this one, removed after the module."""
    if sys.platform != "linux" or os.geteuid() != 0:
        missing("Network namespaces need Linux and root")
    try:
        ip("netns", "add", NAME)
    except (OSError, subprocess.CalledProcessError) as error:
        missing(f"No network namespace can be made here: {error}")
    near, far = f"{NAME}a", f"{NAME}b"
    try:
        try:
            ip("link", "add", near, "type", "veth", "peer", "name", far, "netns", NAME)
        except subprocess.CalledProcessError as error:
            missing(f"No pair of interfaces can be made here: {error.stderr}")
        ip("address", "add", f"{ROBOT}/24", "dev", near)
        ip("link", "set", near, "up")
        ip("-n", NAME, "address", "add", f"{DRIVER}/24", "dev", far)
        ip("-n", NAME, "link", "set", far, "up")
        yield NAME
    finally:
        subprocess.run(["ip", "link", "del", near], check=False, capture_output=True)
        ip("netns", "del", NAME)


def there(robot: RunningRobot) -> KnownRobot:
    """Return the robot with its address on the veth pair."""
    return robot.known_at(f"{ROBOT}:{robot.port}")


def reaches(namespace: str, port: int) -> bool:
    """Return whether the robot can be reached; a new link needs a moment."""
    code = f"import socket; socket.create_connection(({ROBOT!r}, {port}), 1.0)"
    command = ["ip", "netns", "exec", namespace, sys.executable, "-c", code]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def test_the_cable_is_cut(namespace: str, tmp_path: Path) -> None:
    profile = write_profile(tmp_path)
    wiring = TwinWiring(profile.guard_plan(), None)
    within = ("ip", "netns", "exec", namespace)
    with (
        run_robot(profile, arguments=("--host", ROBOT, *IN_A_ROOM)) as robot,
        robot.operator() as operator,
    ):

        def drives() -> bool:
            outputs = wiring.read(operator.levels(), 0)
            return not all(outputs[name].at_rest for name in wiring.propelling)

        until(lambda: reaches(namespace, robot.port))
        operator.place(0)
        with Driver(there(robot), within) as driver:
            driver.await_commands(8)
            until(drives)
            cut_ns = time.monotonic_ns()
            ip("link", "set", f"{namespace}a", "down")
            until(lambda: not drives())
            ends = [i.end_ns for i in propelled(read_ledger(robot.ledger_path), wiring)]
            assert max(ends) - cut_ns <= (DEADLINE_MS + LATE_MS) * 1e6
            # It stays stopped, whatever the driver sends.
            later_ns = operator.where().t + 2e6 * DEADLINE_MS
            until(lambda: operator.where().t > later_ns)
            again = [i.end_ns for i in propelled(read_ledger(robot.ledger_path), wiring)]
            assert again == ends
            assert not drives()
        ip("link", "set", f"{namespace}a", "up")
        until(lambda: reaches(namespace, robot.port))
        operator.place(0)
        with Driver(there(robot), within) as driver:
            driver.await_commands(8)
            until(drives)
