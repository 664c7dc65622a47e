"""Every env of the catalogue sits every exam."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.env_checker import check_env

from shapechanger.envs import CATALOGUE
from shapechanger.testing import PROMISES, MakeEnv, examine

# Bodies that no id names, and arguments that change a space, keep the same promises.
_VARIANTS: dict[str, MakeEnv] = {
    "passive feet": partial(gym.make, "shapechanger/ExtendedAnt-v1", actuated_extension=False),
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
_MAKERS: dict[str, MakeEnv] = {env_id: partial(gym.make, env_id) for env_id in CATALOGUE}


@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.__name__)
@pytest.mark.parametrize("make", (_MAKERS | _VARIANTS).values(), ids=(_MAKERS | _VARIANTS).keys())
def test_an_env_keeps_its_promise(make: MakeEnv, promise: Callable[[MakeEnv], None]) -> None:
    """What learners and studies rely on holds for every body."""
    promise(make)


def test_the_exam_is_all_promises() -> None:
    """Whoever brings an env is told each promise that was kept."""
    kept = list(examine(_MAKERS["shapechanger/InvertedPendulum-v1"]))
    assert len(kept) == len(PROMISES)
    assert kept[0] == "Passes Gymnasium's `check_env`."


# Gymnasium's pendulum takes forces from -3 to 3, and ours are the same.
@pytest.mark.filterwarnings("ignore:We recommend you to use a symmetric and normalized:UserWarning")
@pytest.mark.parametrize("env_id", CATALOGUE)
def test_stable_baselines_takes_it(env_id: str) -> None:
    """The learners of the studies have a checker of their own."""
    with gym.make(env_id) as env:
        check_env(env)


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_envs_come_in_vectors(env_id: str) -> None:
    """Two of a kind step side by side, from starts of their own."""
    envs = gym.make_vec(env_id, num_envs=2)
    try:
        observations, _ = envs.reset(seed=0)
        assert observations.shape == (2, *envs.single_observation_space.shape)
        assert not np.array_equal(*observations)
        envs.action_space.seed(0)
        observations, rewards, *_ = envs.step(envs.action_space.sample())
        assert np.isfinite(observations).all()
        assert rewards.shape == (2,)
    finally:
        envs.close()


def test_a_vector_changes_its_bodies_at_reset() -> None:
    """Options reach every env of the vector."""
    envs = gym.make_vec("shapechanger/Ant-v1", num_envs=2)
    try:
        envs.reset(seed=0, options={"body": "BigAnt"})
        assert [len(body) for body in envs.get_attr("body")] == [1, 1]
    finally:
        envs.close()


def test_an_id_names_the_module_that_registers_it() -> None:
    """A program that does not import us can still make our envs."""
    script = (
        "import gymnasium as gym\n"
        "with gym.make('shapechanger:shapechanger/BigAnt-v1') as env:\n"
        "    print(env.reset(seed=0)[0].shape)"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], check=True, capture_output=True, text=True
    )
    assert run.stdout == "(105,)\n"
