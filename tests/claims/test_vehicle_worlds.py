"""Documented properties of vehicles in simulated worlds."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.operator import Whereabouts
from shapechanger.robot.twin.robot import run_robot
from shapechanger.vehicles.world import MujocoWorld
from tests.robot.twin.in_process import InProcessRobot
from tests.robots import write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

_COURSE, _START = 5, 11


def test_swapped_pins_drive_a_car_backward(tmp_path: Path) -> None:
    """Robots in process also act through the pins of their profile."""
    path = find_profile("lab-car")
    text = Path(path).read_text()
    forward, backward = "forward = 22 ", "backward = 27 "
    assert text.count(forward) == text.count(backward) == 1
    swapped = text.replace(forward, "forward = 27 ").replace(backward, "backward = 22 ")
    progress: list[float] = []
    for wiring in (text, swapped):
        with closing(MujocoWorld("car", seed=_COURSE, size=None)) as world:
            attached = write_profile(tmp_path, wiring).guard_plan()
            robot = InProcessRobot(load_profile(path), world, pictures=False, wired_as=attached)
            robot.start(lambda world=world: world.place(_START))
            for _ in range(20):
                robot.step((0.0, 0.5))
            robot.close()
            progress.append(world.progress_m)
    assert progress[0] > 0.2
    assert progress[1] < -0.2


def _actions() -> list[tuple[float, ...]]:
    rng = np.random.default_rng(3)
    drawn = rng.uniform((-0.3, 0.2), (0.3, 0.7), (100, 2)).astype(np.float32)
    return [tuple(action.tolist()) for action in drawn]


def test_the_in_process_car_equals_the_served_car() -> None:
    """With the same course, start and actions, all poses are bitwise equal.

    The served car has guard, daemon and board in separate processes, driven over TLS.
    """
    _compare(image=False)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_rendering_does_not_change_the_drive() -> None:
    """Rendering takes no time on the twin's clock."""
    _compare(image=True)


def _compare(*, image: bool) -> None:
    """Drive both cars, and compare their poses after each action."""
    served = _drive_served(_actions(), image)
    profile = load_profile(find_profile("lab-car"))
    with (
        closing(MujocoWorld("car", seed=_COURSE)) as world,
        closing(InProcessRobot(profile, world, pictures=image)) as robot,
    ):
        robot.start(lambda: world.place(_START))
        driven = [_place(world)]
        for action in _actions():
            robot.step(action)
            driven.append(_place(world))
        progress = world.progress_m
    assert progress > 2.0
    assert [(one.x, one.y, one.heading) for one in served] == driven
    assert served[-1].truth["progress_m"] == progress


def _place(world: MujocoWorld) -> tuple[float, float, float]:
    return world.pose.x, world.pose.y, world.pose.heading


def _drive_served(actions: Sequence[Sequence[float]], image: bool) -> list[Whereabouts]:
    """Return the poses of a served car at its start and after each action."""
    profile = load_profile(find_profile("lab-car"))
    with (
        run_robot(profile, clock="twin", arguments=("--world", "corridor")) as robot,
        robot.operator() as operator,
        robot.client(role="person", pace="lockstep", frames=image) as client,
    ):
        operator.lay_out(_COURSE)
        client.take()
        client.arm()
        operator.place(_START)
        seen = client.ask().message
        found = [operator.where()]
        for action in actions:
            client.command(action, answers=seen.seq)
            seen = client.observation(seen.seq).message
            found.append(operator.where())
    return found
