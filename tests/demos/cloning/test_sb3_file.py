"""Export of a clone to Stable-Baselines3."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
from stable_baselines3 import PPO, SAC

from shapechanger.demos.cloning.learn import Inputs, learn
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.cloning.sb3 import as_ppo, as_sac
from shapechanger.errors import PolicyError
from shapechanger.layout import Layout
from tests.demos.cloning.data import KEYS, QUICK, STEERS, stripes

_SIZE = (33, 50)
_SHORT = msgspec.structs.replace(QUICK, fewest_steps=20, most_steps=20)


class _World(gym.Env[Any, Any]):
    """An env that shows stripes and rewards the second value of an action."""

    def __init__(self, layout: Layout, inputs: Inputs) -> None:
        self._data, self._inputs, self._at = stripes(20, 9, layout), inputs, 0
        seen = gym.spaces.Box(0, 255, (*_SIZE, 3), np.uint8)
        felt = gym.spaces.Box(-np.inf, np.inf, (3,), np.float32)
        both = gym.spaces.Dict({"image": seen, "state": felt})
        self.observation_space = {"picture": seen, "state": felt, "both": both}[inputs]
        low, high = (limits.astype(np.float32) for limits in (layout.low, layout.high))
        self.action_space = gym.spaces.Box(low, high)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action)
        self._at = (self._at + 1) % 20
        return self._observation(), float(action[1]), False, self._at == 0, {}

    def _observation(self) -> Any:
        return _observations(self._data, self._inputs, slice(self._at, self._at + 1), squeeze=True)


def _observations(data: Any, inputs: Inputs, which: slice, *, squeeze: bool = False) -> Any:
    seen, felt = data.pictures[which], data.states[which]
    seen, felt = (seen[0], felt[0]) if squeeze else (seen, felt)
    return {"picture": seen, "state": felt, "both": {"image": seen, "state": felt}}[inputs]


def _policy(layout: Layout, inputs: Inputs = "picture") -> CameraPolicy:
    return learn(stripes(60, 0, layout), settings=_SHORT, inputs=inputs)[0]


@pytest.mark.parametrize("inputs", ["picture", "state", "both"])
@pytest.mark.parametrize("kind", [SAC, PPO])
def test_a_model_predicts_like_the_clone_and_learns(
    kind: type[SAC | PPO], inputs: Inputs, tmp_path: Path
) -> None:
    policy, data = _policy(STEERS, inputs), stripes(16, 1, STEERS)
    size = None if inputs == "state" else _SIZE
    if kind is SAC:
        made: SAC | PPO = as_sac(policy, size, batch_size=8, buffer_size=64, gamma=0.9)
    else:
        made = as_ppo(policy, size, n_steps=8, batch_size=8, n_epochs=1, gamma=0.9)
    made.save(tmp_path / "model.zip")
    model = kind.load(tmp_path / "model.zip", env=_World(STEERS, inputs))
    assert (model.gamma, model.batch_size) == (0.9, 8)
    raw = _observations(data, inputs, slice(None))
    expected = policy.act(raw)
    np.testing.assert_allclose(model.predict(raw, deterministic=True)[0], expected, atol=2e-4)
    one = _observations(data, inputs, slice(0, 1), squeeze=True)
    np.testing.assert_allclose(model.predict(one, deterministic=True)[0], expected[0], atol=2e-4)
    model.learn(16)
    learned = model.predict(raw, deterministic=True)[0]
    assert np.isfinite(learned).all()
    assert not np.allclose(learned, expected, atol=1e-6)


def test_ppo_chooses_the_classes_of_a_clone(tmp_path: Path) -> None:
    policy, data = _policy(KEYS), stripes(16, 1)
    as_ppo(policy, _SIZE, n_steps=8, batch_size=8, n_epochs=1).save(tmp_path / "ppo.zip")
    classes = np.asarray(policy.net.classes, np.float32)
    space = gym.spaces.Discrete(len(classes))
    env = gym.wrappers.TransformAction(_World(KEYS, "picture"), classes.__getitem__, space)
    model = PPO.load(tmp_path / "ppo.zip", env=env)
    chosen = model.predict(data.pictures, deterministic=True)[0]
    np.testing.assert_array_equal(classes[chosen], policy.predict_many(data.pictures))
    model.learn(16)


def test_sac_refuses_classes_and_names_ppo() -> None:
    with pytest.raises(PolicyError, match="use PPO"):
        as_sac(_policy(KEYS), _SIZE)
