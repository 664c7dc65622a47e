"""Demonstrators of the vehicle envs."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from shapechanger.envs.vehicle import VehicleEnv
from shapechanger.transfer.env_ref import TaskDemonstrator
from shapechanger.worlds.course import HOME


@pytest.mark.parametrize("vehicle", HOME)
def test_a_disturbed_demonstrator_makes_progress(vehicle: str) -> None:
    """It makes mistakes and drives without collisions."""
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
    """Mistakes are a function of seed and episode."""
    shown: list[list[list[float]]] = []
    with closing(VehicleEnv("car", image=False)) as env:
        for seed in (1, 1, 2):
            driver = env.demonstrator(seed)
            for episode in range(2):
                env.reset(seed=2)
                driver.begin()
                done: list[list[float]] = []
                for _ in range(30):
                    action = driver.act()[1]
                    done.append(action.tolist())
                    env.step(action)
                if episode or seed != 2:
                    shown.append(done)
    first, second, again, again_second, other_second = shown
    assert first == again
    assert second == again_second
    assert first != second
    assert second != other_second


def test_begin_takes_the_present_course() -> None:
    """The demonstrator follows the course of the last reset."""
    with closing(VehicleEnv("car", image=False)) as env:
        driver = env.demonstrator(1)
        for course in (3, 4):
            _, info = env.reset(options={"course": course, "start": 1})
            driver.begin()
            for _ in range(40):
                _, _, terminated, _, info = env.step(driver.act()[1])
                assert not terminated
            assert info["progress"] > 0.3
