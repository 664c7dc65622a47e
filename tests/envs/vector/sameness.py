"""Bitwise comparison of two vector envs, and random bodies for it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Body, Mass, Stretch

MODES = ["NextStep", "SameStep", "Disabled"]


def require_same(ours: Any, theirs: Any, where: str = "") -> None:
    """Assert equal bits, types, keys and order of keys."""
    assert type(ours) is type(theirs), f"{where}: {type(ours)} and {type(theirs)}"
    if isinstance(theirs, dict):
        assert list(ours) == list(theirs), where
        for key, value in theirs.items():
            require_same(ours[key], value, f"{where}/{key}")
    elif isinstance(theirs, list | tuple):
        assert len(ours) == len(theirs), where
        for i, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            require_same(one, other, f"{where}/{i}")
    elif isinstance(theirs, np.ndarray):
        assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape), where
        if theirs.dtype == np.object_:
            require_same(ours.tolist(), theirs.tolist(), where)
        else:
            assert ours.tobytes() == theirs.tobytes(), where
    else:
        assert ours == theirs, f"{where}: {ours} and {theirs}"


def play_side_by_side(ours: Any, theirs: Any, steps: int, mode: str, seed: int = 0) -> int:
    """Step two vector envs with the same random actions; return the number of ended episodes."""
    for name in ("observation_space", "action_space"):
        for whole in (name, f"single_{name}"):
            assert getattr(ours, whole) == getattr(theirs, whole)
    rng = np.random.default_rng(seed)
    space = ours.single_action_space
    require_same(ours.reset(seed=seed), theirs.reset(seed=seed), "reset")
    ended = 0
    for step in range(steps):
        actions = rng.uniform(space.low, space.high, ours.action_space.shape).astype(space.dtype)
        result = ours.step(actions)
        require_same(result, theirs.step(actions), f"step {step}")
        over = result[2] | result[3]
        ended += int(over.sum())
        if mode == "Disabled" and over.any():
            again, expected = (
                envs.reset(options={"reset_mask": over.copy()}) for envs in (ours, theirs)
            )
            require_same(again, expected, f"reset after step {step}")
    return ended


def random_bodies(env_id: str, count: int, seed: int = 0) -> list[Body]:
    """Return random bodies of a family with the same spaces.

    Two limbs change their length and one its mass; bodies that do not fit are drawn again.
    """
    rng = np.random.default_rng(seed)
    with gym.make(env_id) as env:
        made: Any = env.unwrapped
        present, model = made.body, made.model
        limbs = [model.body(i).name for i in range(min(2, model.nbody - 1), model.nbody)]
        space = env.observation_space
    bodies: list[Body] = []
    while len(bodies) < count:
        body = present
        for name in rng.choice(limbs, min(2, len(limbs)), replace=False):
            body += (Stretch(str(name), float(rng.uniform(0.7, 1.4))),)
        body += (Mass(str(rng.choice(limbs)), scale=float(rng.uniform(0.5, 2.0))),)
        try:
            with gym.make(env_id, body=body) as env:
                assert env.observation_space == space
        except MorphologyError:
            continue
        bodies.append(body)
    return bodies
