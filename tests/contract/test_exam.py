"""Envs of families, files, vehicles and fingers pass the checks of `contract.testing`."""

from __future__ import annotations

from collections.abc import Container
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import gymnasium.envs.mujoco as mujoco_assets
import numpy as np
import pytest
from stable_baselines3.common.env_checker import check_env

from shapechanger.contract.testing import PROMISES, MakeEnv, examine
from shapechanger.envs import CATALOGUE
from shapechanger.envs.catalogue import (
    FINGER_ENVS,
    OWN_ROBOT,
    RANGES_ENVS,
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
)
from shapechanger.envs.own_tasks import RobotState

# Bodies without an id, and arguments that change a space.
_VARIANTS: dict[str, MakeEnv] = {
    "passive feet": partial(gym.make, "shapechanger/ExtendedAnt-v1", body="ExtendedAntPassive"),
    "place seen, contacts unseen": partial(
        gym.make,
        "shapechanger/Ant-v1",
        exclude_current_positions_from_observation=False,
        include_cfrc_ext_in_observation=False,
    ),
    "five legs, one stiff": partial(
        gym.make,
        "shapechanger/Ant-v1",
        body='[{"edit": "add_limb", "like": "aux_1", "suffix": "_5", "angle": 0.8},'
        ' {"edit": "lock", "joint": "ankle_3"}]',
    ),
}
# A robot from a file, with the built-in task and with a custom one.
_FILE = str(Path(mujoco_assets.__file__).parent / "assets" / "humanoid.xml")
_OWN: dict[str, MakeEnv] = {
    "a file": partial(gym.make, OWN_ROBOT, path=_FILE),
    "a file and a task": partial(gym.make, OWN_ROBOT, path=_FILE, task=f"{__name__}:Roll"),
}


class Roll:
    """Roll over."""

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {"turn": 1.0 - robot.up}


_MAKERS: dict[str, MakeEnv] = {env_id: partial(gym.make, env_id) for env_id in CATALOGUE}
# Without images, no renderer is needed. A truck's default world is so open that its sensors read
# the same at each start.
_BLIND: dict[str, MakeEnv] = {
    env_id: partial(gym.make, env_id, image=False, world="corridor" if "Truck" in env_id else None)
    for env_id in VEHICLE_ENVS
}
_RANGES: dict[str, MakeEnv] = {
    env_id: partial(gym.make, env_id, courses=(0, 1)) for env_id in RANGES_ENVS
}
_FINGER, _TRACK = FINGER_ENVS
_FINGERS: dict[str, MakeEnv] = {
    **{env_id: partial(gym.make, env_id) for env_id in FINGER_ENVS},
    "finger by tensions": partial(gym.make, _FINGER, actions="tension"),
    "finger by lengths": partial(gym.make, _FINGER, actions="length"),
    "finger with goals": partial(gym.make, _FINGER, goal=True),
    "a real-like finger": partial(gym.make, _FINGER, gap="real-like", finger_seed=3),
    "another finger each time": partial(gym.make, _FINGER, gap="wide"),
    "a finger with parameters": partial(gym.make, _FINGER, parameters={"tendon_friction": 1.0}),
    "another path each time": partial(gym.make, _TRACK, path="random"),
    "an eight": partial(gym.make, _TRACK, path={"kind": "figure-eight", "hz": 0.25}),
}
_ALL = _MAKERS | _VARIANTS | _OWN | _BLIND | _RANGES | _FINGERS
_SMALL = (32, 24)
_SEEING: dict[str, MakeEnv] = {
    **{env_id: partial(gym.make, env_id, size=_SMALL) for env_id in VEHICLE_ENVS},
    **{env_id: partial(gym.make, env_id, courses=(0, 1)) for env_id in WAYPOINT_ENVS},
    "image and state": partial(gym.make, "shapechanger/Car-v1", size=_SMALL, state=True),
    "random light": partial(gym.make, "shapechanger/Car-v1", size=_SMALL, randomise=True),
}
# Vehicles only differ in body and world; these two envs render everything that can be drawn.
_QUICK = {"shapechanger/BoatWaypoint-v1", "random light"}


def _params(makers: dict[str, MakeEnv], slow: Container[str]) -> list[Any]:
    return [
        pytest.param(make, id=name, marks=[pytest.mark.slow] if name in slow else [])
        for name, make in makers.items()
    ]


@pytest.mark.parametrize("make", _params(_ALL, ("shapechanger/Tank-v1", "shapechanger/Truck-v1")))
def test_an_env_keeps_its_promises(make: MakeEnv) -> None:
    assert len(list(examine(make))) == len(PROMISES)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("make", _params(_SEEING, _SEEING.keys() - _QUICK))
def test_an_env_with_images_keeps_its_promises(make: MakeEnv) -> None:
    """Image observations are deterministic and not shared."""
    assert len(list(examine(make))) == len(PROMISES)


# As in Gymnasium, the pendulum's forces are from -3 to 3.
@pytest.mark.filterwarnings("ignore:We recommend you to use a symmetric and normalized:UserWarning")
@pytest.mark.parametrize("env_id", CATALOGUE)
def test_stable_baselines3_accepts_the_env(env_id: str) -> None:
    with gym.make(env_id) as env:
        check_env(env)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize(
    ("mode", "options"), [("sync", {}), ("async", {"context": "spawn"})], ids=["sync", "async"]
)
def test_vehicles_with_images_can_be_vectorized(mode: str, options: dict[str, str]) -> None:
    """After rendering in the parent, subprocesses must be spawned, not forked."""
    envs: Any = gym.make_vec(
        "shapechanger/Car-v1",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs=options,
        size=_SMALL,
    )
    with closing(envs):
        observations, infos = envs.reset(seed=0)
        assert observations.shape == (2, *envs.single_observation_space.shape)
        assert infos["course"][0] != infos["course"][1]
        envs.action_space.seed(0)
        observations, rewards, *_ = envs.step(envs.action_space.sample())
        assert np.isfinite(observations).all()
        assert rewards.shape == (2,)
