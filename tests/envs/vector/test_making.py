"""Making of vector envs, and their interface besides stepping."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers

import shapechanger
from shapechanger.envs import CATALOGUE
from shapechanger.envs import make_vec as entry_points
from shapechanger.envs.checks import require_same_boxes
from shapechanger.envs.vector import ThreadVectorEnv
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.errors import SpaceMismatch
from shapechanger.morphology import Stretch
from tests.envs.vector.sameness import require_same


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_gymnasium_makes_the_same_envs(env_id: str) -> None:
    ours = shapechanger.make_vec(env_id, 2, threads=1)
    envs: list[Any] = [ours, gym.make_vec(env_id, num_envs=2, threads=1)]
    envs += [gym.make_vec(one.spec) for one in envs]
    expected = ours.reset(seed=1)
    for one in envs:
        assert isinstance(one, ThreadVectorEnv)
        assert one.num_envs == 2
        assert one.threads == 1
        assert one.spec is not None
        assert one.spec.id == env_id
        assert one.spec.max_episode_steps == 1000
        assert one.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        require_same(one.reset(seed=1), expected)
        one.close()


def test_the_spec_of_worlds_on_a_device_makes_an_equal_env() -> None:
    bodies = ["InvertedPendulum", "BigInvertedPendulum"]
    envs = shapechanger.make_vec(
        "InvertedPendulum", 2, backend="warp", device="cpu", bodies=bodies, max_episode_steps=7
    )
    assert isinstance(envs, WarpVectorEnv)
    again: Any = gym.make_vec(envs.spec)
    assert isinstance(again, WarpVectorEnv)
    assert again.bodies == envs.bodies
    assert again.max_episode_steps == envs.max_episode_steps == 7


def test_a_spec_round_trips_through_json() -> None:
    """The vector entry point is a string that names the id."""
    spec = gym.spec("shapechanger/BigAnt-v1")
    again = gym.envs.registration.EnvSpec.from_json(spec.to_json())
    assert again == spec
    envs = gym.make_vec(again, num_envs=2)
    assert len(envs.get_attr("body")[0]) == 1
    envs.close()
    assert not hasattr(entry_points, "_private")


def test_each_env_may_have_a_body_of_its_own() -> None:
    bodies = [
        "Ant",
        "BigAnt",
        Stretch("shank_1", 1.3),
        '[{"edit":"cut","body":"shank_4","keep":0.5}]',
    ]
    for envs in (
        shapechanger.make_vec("Ant", 4, bodies=bodies),
        gym.make_vec("shapechanger/Ant-v1", num_envs=4, bodies=bodies),
    ):
        lengths = [
            [model.geom_size[model.body(f"shank_{leg}").geomadr[0], 1] for leg in (1, 4)]
            for model in envs.get_attr("model")
        ]
        plain = lengths[0][0]
        parts = np.array(lengths) / plain
        np.testing.assert_allclose(parts, [[1.0, 1.0], [2.0, 2.0], [1.3, 1.0], [1.0, 0.5]])
        for given, expected in (("fair", ("fair",) * 4), (list("abcd"), tuple("abcd"))):
            envs.set_attr("mood", given)
            assert envs.get_attr("mood") == expected
        envs.set_attr("describe", lambda *args, **kwargs: (args, kwargs))
        assert envs.call("describe", 1, speed=2) == (((1,), {"speed": 2}),) * 4
        envs.close()


def test_bodies_of_odrl_are_made_by_either_name() -> None:
    """The name is `odrl/NAME` as on the command line, `odrl-NAME`, or an id of Gymnasium."""
    name = "odrl-hopper-gravity-0.5"
    for envs in (
        shapechanger.make_vec(name.replace("odrl-", "odrl/"), 1),
        shapechanger.make_vec(name, 1),
        gym.make_vec(f"shapechanger/{name}-v1", num_envs=1),
    ):
        assert envs.get_attr("model")[0].opt.gravity[2] == -4.905
        envs.close()


@pytest.mark.parametrize("copy", [True, False])
def test_observations_are_copies_if_asked_for(copy: bool) -> None:
    """`copy=False` reuses the memory of observations, like Gymnasium."""
    envs = shapechanger.make_vec("InvertedPendulum", 2, copy=copy)
    first, _ = envs.reset(seed=0)
    before = first.copy()
    second, *_ = envs.step(np.ones((2, 1), np.float32))
    assert np.may_share_memory(first, second) is not copy
    assert np.array_equal(first, before) is copy
    envs.close()


def test_gymnasiums_vector_wrappers_work() -> None:
    envs: Any = shapechanger.make_vec(
        "InvertedPendulum", 2, max_episode_steps=4, autoreset_mode="SameStep"
    )
    envs = wrappers.NormalizeReward(wrappers.RecordEpisodeStatistics(envs))
    envs.reset(seed=0)
    for _ in range(4):
        *_, infos = envs.step(np.zeros((2, 1), np.float32))
    assert infos["episode"]["l"].tolist() == [4, 4]
    envs.close()


@pytest.mark.gl
def test_render_returns_a_frame_per_env(gl: None) -> None:
    """Each frame shows its own body."""
    envs = shapechanger.make_vec(
        "Ant", 2, bodies=["Ant", "BigAnt"], render_mode="rgb_array", width=64, height=64
    )
    envs.reset(seed=0)
    envs.step(np.zeros((2, 8), np.float32))
    frames = envs.render()
    assert [frame.shape for frame in frames] == [(64, 64, 3)] * 2
    assert not np.array_equal(*frames)
    envs.close()


def test_importing_make_vec_loads_no_simulator() -> None:
    script = "import sys\nfrom shapechanger import make_vec\nprint('mujoco' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert run.stdout == "False\n"


class _Bounded(gym.Env[Any, Any]):
    """Env without a body, a layout or a spec."""

    def __init__(self, high: float) -> None:
        self.observation_space = gym.spaces.Box(-high, high, (2,))
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,))


def test_other_bounds_are_refused() -> None:
    """The error names the class of an env without a body."""
    require_same_boxes([_Bounded(1.0), _Bounded(1.0)])
    with pytest.raises(SpaceMismatch, match=r"env 1 \(_Bounded\) has Box.* and not Box"):
        require_same_boxes([_Bounded(1.0), _Bounded(2.0)])
