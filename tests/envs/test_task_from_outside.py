"""A user defines a task with a body of the catalogue in one file, and trains it with a preset."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import gymnasium as gym
import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.runs import learner_of

_TASK = '''
"""A hopper that is rewarded for its height."""

import gymnasium as gym

from shapechanger.envs.runners import HopperEnv


class HighHopper(HopperEnv):
    """A hopper of any body, rewarded for its torso's height divided by its standing height."""

    def _get_rew(self, x_velocity, action):
        height = float(self.data.qpos[1]) / self.standing_height
        return height, {"reward_height": height}


gym.register("outside/HighHopper-v0", HighHopper, max_episode_steps=30)
'''
_PRESET = """
preset = "ppo-planar"
n_envs = 1
n_steps = 64
batch_size = 32
n_epochs = 1
eval_every = 64
eval_episodes = 1
"""


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Make the module of the task importable, and return `module:id` of the task."""
    (tmp_path / "high_hopper.py").write_text(_TASK)
    monkeypatch.syspath_prepend(tmp_path)
    yield "high_hopper:outside/HighHopper-v0"
    gym.registry.pop("outside/HighHopper-v0", None)
    sys.modules.pop("high_hopper", None)


def test_a_task_keeps_bodies_layouts_and_certificates(task: str) -> None:
    """A task of another module has a layout, edits of the body, and a certificate of a shift."""
    source, target = EnvRef(task).make(), EnvRef(task, {"body": "odrl-hopper-morph-torso-easy"})
    shifted = target.make()
    with source, shifted:
        assert source.unwrapped.observation_layout.names[0] == "rootz/position"
        assert source.unwrapped.certify_shift(source, shifted).changes
        source.reset(seed=0)
        _, reward, _, _, info = source.step(source.action_space.sample())
        assert info["reward_height"] == reward > 0.5


def test_a_preset_trains_the_task(task: str, tmp_path: Path) -> None:
    file = tmp_path / "high.toml"
    file.write_text(_PRESET)
    learner = learner_of(*resolve_learner(str(file), {}))
    curve = []
    learner.train(EnvRef(task), 64, 0, on_evaluation=curve.append)
    assert [evaluation.steps for evaluation in curve] == [0, 64]
