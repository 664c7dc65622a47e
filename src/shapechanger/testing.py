"""The exam that every env sits, for the tests of Shapechanger and of those who bring an env.

>>> from shapechanger.testing import examine
>>> for promise in examine(lambda: gym.make("shapechanger/Ant-v1")):
...     print(promise)
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env

from shapechanger.errors import ShapechangerError
from shapechanger.transfer.env_ref import layouts_of

__all__ = ["PROMISES", "BrokenPromise", "MakeEnv", "examine"]

# Makes a fresh env.
MakeEnv = Callable[[], gym.Env[Any, Any]]

_STEPS: Final = 50
_SEED: Final = 7


class BrokenPromise(ShapechangerError, AssertionError):
    """An env does not do what learners rely on."""


def _require(kept: bool, sentence: str) -> None:
    if not kept:
        raise BrokenPromise(sentence)


def passes_gymnasiums_checker(make: MakeEnv) -> None:
    """Passes Gymnasium's `check_env`."""
    env = make()
    with warnings.catch_warnings():
        # Advice on spaces of another range than -1 to 1 is not about a broken promise.
        warnings.filterwarnings("ignore", message=".*symmetric and normalized space.*")
        warnings.filterwarnings("ignore", message=".*(minimum|maximum) value is -?infinity.*")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()


def is_deterministic(make: MakeEnv) -> None:
    """The same seed and actions give the same numbers."""
    first, second = _rollout(make()), _rollout(make())
    _require(len(first) == len(second), "One of two equal rollouts ended earlier.")
    for (a, reward_a), (b, reward_b) in zip(first, second, strict=True):
        same = np.array_equal(a, b) and reward_a == reward_b
        _require(same, "Two rollouts with the same seed and actions differ.")


def shares_no_memory(make: MakeEnv) -> None:
    """A learner may keep an observation: the next step does not change it."""
    observations = [observation for observation, _ in _rollout(make())]
    for before, after in pairwise(observations):
        _require(not np.may_share_memory(before, after), "Two observations share memory.")


def names_every_number(make: MakeEnv) -> None:
    """Layouts have the sizes and bounds of the spaces."""
    env = make()
    observation, action = layouts_of(env)
    for side, layout, space in (
        ("observation", observation, env.observation_space),
        ("action", action, env.action_space),
    ):
        _require(
            isinstance(space, gym.spaces.Box) and space.shape == (layout.size,),
            f"The {side} layout has {layout.size} numbers, its space {space}.",
        )
    box = env.action_space
    assert isinstance(box, gym.spaces.Box)
    _require(
        np.allclose(box.low, action.low) and np.allclose(box.high, action.high),
        "The bounds of the action layout are not those of the action space.",
    )
    env.close()


def pickles(make: MakeEnv) -> None:
    """A pickled env, and one made from the spec's JSON, is the same env."""
    env = make()
    again = [pickle.loads(pickle.dumps(env))]
    if env.spec is not None:
        again.append(gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json())))
    played = _rollout(env)
    for other in again:
        same = all(
            np.array_equal(x, y) for (x, _), (y, _) in zip(played, _rollout(other), strict=True)
        )
        _require(same, "A copy of the env does something else.")
    env.close()


def reward_is_the_sum_of_its_terms(make: MakeEnv) -> None:
    """The reward is the sum of the terms that `info` reports."""
    env = make()
    env.reset(seed=_SEED)
    env.action_space.seed(_SEED)
    for _ in range(_STEPS):
        _, reward, terminated, truncated, info = env.step(env.action_space.sample())
        terms = [float(value) for name, value in info.items() if name.startswith("reward_")]
        _require(bool(terms), "info reports no reward terms.")
        _require(
            bool(np.isclose(float(reward), sum(terms), rtol=1e-9, atol=1e-12)),
            f"The reward is {reward}, its terms add up to {sum(terms)}.",
        )
        if terminated or truncated:
            break
    env.close()


def starts_where_it_may(make: MakeEnv) -> None:
    """Starts differ from seed to seed and lie within the ranges that the layout states."""
    env = make()
    observation, _ = layouts_of(env)
    starts = [env.reset(seed=seed)[0] for seed in range(20)]
    _require(
        not any(np.array_equal(starts[0], start) for start in starts[1:]),
        "Every start is the same.",
    )
    # A float that was an angle in another unit may be a rounding beyond its limit.
    slack = 1e-9
    for start in starts:
        within = (start >= observation.low - slack) & (start <= observation.high + slack)
        names = [name for name, places in observation.slices.items() if not within[places].all()]
        _require(not names, f"Starts out of range: {', '.join(names)}.")
    env.close()


PROMISES: Final[tuple[Callable[[MakeEnv], None], ...]] = (
    passes_gymnasiums_checker,
    is_deterministic,
    shares_no_memory,
    names_every_number,
    pickles,
    reward_is_the_sum_of_its_terms,
    starts_where_it_may,
)


def examine(make: MakeEnv) -> Iterator[str]:
    """Put an env through its exam.

    Args:
        make: Makes a fresh env; called several times.

    Yields:
        Each promise, in words, when it was found kept.

    Raises:
        BrokenPromise: At the first that is not.
    """
    for promise in PROMISES:
        promise(make)
        yield (promise.__doc__ or "").split("\n")[0]


def _rollout(env: gym.Env[Any, Any]) -> list[tuple[Any, float]]:
    """Observations and rewards under the same random actions."""
    observation, _ = env.reset(seed=_SEED)
    env.action_space.seed(_SEED)
    result = [(observation, 0.0)]
    for _ in range(_STEPS):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        result.append((observation, float(reward)))
        if terminated or truncated:
            break
    return result
