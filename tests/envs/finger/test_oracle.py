"""The controller that knows the finger: what no learner need better, and a test of the env."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shapechanger.bodies.finger import DRIVES, NOMINAL
from shapechanger.envs.finger import FingerReachEnv, FingerTrackEnv
from shapechanger.envs.finger.oracle import FingerOracle

# Steps after which it has arrived: 1.2 s, of the 2 s that an episode lasts.
_ARRIVES = 60


def _reached(actions: str, episodes: int, **arguments: Any) -> tuple[int, list[float]]:
    """How many targets were reached, and how far from each the fingertip was at last, m."""
    env = FingerReachEnv(actions=actions, **arguments)
    oracle = FingerOracle(env.observation_layout, actions)
    successes, distances = 0, []
    for seed in range(episodes):
        seen, info = env.reset(seed=seed)
        oracle.reset()
        for _ in range(_ARRIVES):
            seen, _, _, _, info = env.step(oracle(seen))
        successes += info["is_success"]
        distances.append(info["distance"])
    return successes, distances


@pytest.mark.parametrize("actions", DRIVES)
def test_it_reaches_every_target(actions: str) -> None:
    """40 of 40 in each mode, and in the middle within a tenth of a millimetre."""
    successes, distances = _reached(actions, 40)
    assert successes == 40
    assert np.median(distances) < 1e-4


@pytest.mark.parametrize("actions", DRIVES)
def test_it_follows_a_circle(actions: str) -> None:
    """Of 12 mm, once a second, within 3 mm root mean square."""
    env = FingerTrackEnv(actions=actions, path={"kind": "circle", "radius": 0.012, "hz": 1.0})
    oracle = FingerOracle(env.observation_layout, actions)
    for seed in range(2):
        seen, info = env.reset(seed=seed)
        oracle.reset()
        for _ in range(125):
            seen, _, _, _, info = env.step(oracle(seen))
        assert info["rms"] < 0.003
        assert info["is_success"]


def test_a_finger_that_it_does_not_know_is_harder() -> None:
    """What it is told of the finger is what it goes by: arms that are off cost accuracy."""
    arms = NOMINAL.arms * np.random.default_rng(1).uniform(0.85, 1.15, (7, 4))
    other = NOMINAL.replace(moment_arms=tuple(map(tuple, arms.tolist())))
    env = FingerReachEnv(parameters=other)
    found = {}
    for name, believed in (("wrong", NOMINAL), ("right", other)):
        oracle = FingerOracle(env.observation_layout, parameters=believed)
        distances = []
        for seed in range(5):
            seen, info = env.reset(seed=seed)
            oracle.reset()
            for _ in range(_ARRIVES):
                seen, _, _, _, info = env.step(oracle(seen))
            distances.append(info["distance"])
        found[name] = float(np.median(distances))
    assert found["right"] < 1e-4 < found["wrong"]


def test_its_actions_are_actions() -> None:
    """Within -1 to 1 however far the target is, and the same for the same observation."""
    env = FingerReachEnv()
    seen, _ = env.reset(seed=0, options={"target": (0.3, 0.3, 0.3)})
    first, second = (FingerOracle(env.observation_layout)(seen) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert env.action_space.contains(first)
