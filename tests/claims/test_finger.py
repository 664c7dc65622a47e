"""Documented properties of the finger, on few episodes; `python -m benchmarks.run` has more."""

from __future__ import annotations

import contextlib
from typing import Any

import gymnasium as gym
import numpy as np

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.finger.controller import FingerController
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.policy_file import TrainedPolicy

FINGER = "shapechanger/Finger-v1"
TRACK = "shapechanger/FingerTrack-v1"
# First seed of the tests; training and tuning used lower seeds.
FIRST_SEED = 2_000_000
_CIRCLE = {"kind": "circle", "radius": 0.012, "hz": 0.5}


def _alone(policy: TrainedPolicy) -> Any:
    """Return a policy that acts in a single env."""
    return lambda observation: policy.act(np.asarray(observation)[None])[0]


def _ends(act: Any, env: str, episodes: int, **arguments: Any) -> list[dict[str, Any]]:
    infos: list[dict[str, Any]] = []
    with gym.make(env, **arguments) as made:
        for i in range(episodes):
            observation, info = made.reset(seed=FIRST_SEED + i)
            ended = False
            while not ended:
                observation, _, terminated, ended, info = made.step(act(observation))
                assert not terminated
            infos.append(info)
    return infos


def _controller(env: str, mode: str, **arguments: Any) -> FingerController:
    with contextlib.closing(gym.make(env, actions=mode, **arguments)) as made:
        layout: Any = made.get_wrapper_attr("observation_layout")
        return FingerController(layout, mode)


def test_the_shipped_policy_reaches() -> None:
    """The policy reaches nine of ten targets, and its card names the env."""
    policy = load_policy(POLICIES["reach"])
    assert policy.card.env.id == FINGER
    infos = _ends(_alone(policy), FINGER, 10)
    assert np.mean([info["is_success"] for info in infos]) >= 0.9


def test_the_shipped_policy_follows() -> None:
    """The policy's RMS error on a circle at 0.5 Hz is at most twice the controller's."""
    policy = load_policy(POLICIES["track"])
    assert policy.card.env.id == TRACK
    infos = _ends(_alone(policy), TRACK, 1, path=_CIRCLE)
    oracle = _ends(_controller(TRACK, "impedance"), TRACK, 1, path=_CIRCLE)
    errors = [np.mean([info["rms"] for info in some]) for some in (infos, oracle)]
    assert errors[0] <= 2.0 * errors[1]


def test_the_gap_halves_the_success() -> None:
    """On real-like fingers, the shipped policy reaches fewer than half of the targets."""
    act = _alone(load_policy(POLICIES["reach"]))
    infos: list[dict[str, Any]] = []
    for finger in range(3):
        infos += _ends(act, FINGER, 3, gap="real-like", finger_seed=finger)
    assert np.mean([info["is_success"] for info in infos]) < 0.5
