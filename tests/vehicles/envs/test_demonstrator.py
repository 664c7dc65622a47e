"""Demonstrators of the vehicle envs."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from shapechanger.contract.env_ref import TaskDemonstrator
from shapechanger.errors import ProfileError
from shapechanger.robot.profile.load import find_profile
from shapechanger.vehicles.courses.course import HOME
from shapechanger.vehicles.envs import VehicleEnv, WaypointEnv


@pytest.mark.parametrize("vehicle", HOME)
def test_a_disturbed_demonstrator_makes_progress(vehicle: str) -> None:
    """The demonstrator makes mistakes and drives without collisions."""
    with closing(VehicleEnv(vehicle, image=False)) as env:
        driver: TaskDemonstrator = env.demonstrator(3)
        env.reset(seed=2)
        driver.begin()
        mistakes = 0
        for _ in range(100):
            meant, done = driver.act()
            assert env.action_space.contains(meant)
            assert env.action_space.contains(done)
            mistakes += not np.array_equal(meant, done)
            _, _, terminated, _, info = env.step(done)
            assert not terminated
        assert info["progress"] > 1.0
        assert mistakes > 0


def test_mistakes_follow_from_the_seed() -> None:
    with closing(VehicleEnv("car", image=False)) as env:

        def mistakes(seed: int) -> list[list[float]]:
            driver = env.demonstrator(seed)
            shown: list[list[float]] = []
            for _ in range(2):
                env.reset(seed=2)
                driver.begin()
                shown.append([float(x) for _ in range(30) for x in np.subtract(*driver.act())])
            return shown

        first, second = mistakes(1)
        assert mistakes(1) == [first, second]
        assert first != second != mistakes(2)[1]


def test_put_back_it_goes_on_as_from_a_start() -> None:
    """The demonstrator forgets the manoeuvre that would have freed the vehicle."""
    with closing(VehicleEnv("car", image=False)) as env:
        driver = env.demonstrator(1)
        env.reset(options={"course": 3, "start": 1})
        driver.begin()
        # Without steps it drives in vain, until it backs away.
        throttles = [driver.act()[0][1] for _ in range(20)]
        assert throttles[0] > 0.5
        assert throttles[-1] < 0.0
        env.world.put_back()
        assert driver.act()[0][1] > 0.5


def test_another_control_rate_is_refused(tmp_path: Path) -> None:
    """The experts count in steps of 1/20 s."""
    text = find_profile("lab-car").read_text()
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("control_hz = 20", "control_hz = 10"))
    assert slow.read_text() != text
    with closing(VehicleEnv("car", robot=slow, image=False)) as env:
        with pytest.raises(ProfileError, match=r"control_hz = 10.*20 actions a second"):
            env.demonstrator(1)
        with pytest.raises(ProfileError, match=r"control_hz = 10.*20 actions a second"):
            env.expert()
        with pytest.raises(ProfileError, match=r"set control_hz = 20"):
            env.taught_by(lambda seen: seen[:, :2], 1)
    with closing(WaypointEnv("car", robot=slow)) as env, pytest.raises(ProfileError, match="20"):
        env.demonstrator(1)
