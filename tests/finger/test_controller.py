"""The controller with a model of the finger: an upper bound for learners."""

import numpy as np
import pytest

from shapechanger.finger.controller import FingerController
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.finger.tensions import DRIVES
from shapechanger.finger.track import FingerTrackEnv

# Steps until the target is reached: 1.2 s of an episode of 2 s.
_ARRIVES = 60


@pytest.mark.parametrize("actions", DRIVES)
def test_the_controller_reaches_every_target(actions: str) -> None:
    """All 20 targets are reached in each mode, with a median distance below 0.1 mm."""
    env = FingerReachEnv(actions=actions)
    controller = FingerController(env.observation_layout, actions)
    distances: list[float] = []
    for seed in range(20):
        seen, info = env.reset(seed=seed)
        controller.reset()
        for _ in range(_ARRIVES):
            seen, _, _, _, info = env.step(controller(seen))
        assert info["is_success"]
        distances.append(info["distance"])
    assert np.median(distances) < 1e-4


@pytest.mark.parametrize("actions", DRIVES)
def test_the_controller_follows_a_circle(actions: str) -> None:
    """A circle of 12 mm at 1 Hz is followed within 3 mm RMS."""
    env = FingerTrackEnv(actions=actions, path={"kind": "circle", "radius": 0.012, "hz": 1.0})
    controller = FingerController(env.observation_layout, actions)
    seen, info = env.reset(seed=0)
    controller.reset()
    for _ in range(125):
        seen, _, _, _, info = env.step(controller(seen))
    assert info["rms"] < 0.003
    assert info["is_success"]


def test_actions_of_the_controller_are_valid() -> None:
    """Actions are in the action space for distant targets, and deterministic."""
    env = FingerReachEnv()
    seen, _ = env.reset(seed=0, options={"target": (0.3, 0.3, 0.3)})
    first, second = (FingerController(env.observation_layout)(seen) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert env.action_space.contains(first)
