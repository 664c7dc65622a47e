"""The exam that every env sits, for the tests of Shapechanger and of those who bring an env.

>>> from shapechanger.testing import examine
>>> for promise in examine(lambda: gym.make("shapechanger/Ant-v1")):
...     print(promise)
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise, product
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from shapechanger.errors import LayoutError, ShapechangerError
from shapechanger.layout import Layout
from shapechanger.transfer.env_ref import layouts_of

# Makes a fresh env.
MakeEnv = Callable[[], gym.Env[Any, Any]]

# Observations, each with the reward that came with it.
_Rollout = list[tuple[Any, float]]

_STEPS: Final = 50
_SEED: Final = 7
# A number of single precision may be a rounding beyond its limit.
_ROUNDING: Final = 1e-6


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
        try:
            check_env(env.unwrapped, skip_render_check=True)
        except (AssertionError, gym.error.Error) as error:
            raise BrokenPromise(f"Gymnasium's checker says: {error}") from error
    env.close()


def is_deterministic(make: MakeEnv) -> None:
    """The same seed and actions give the same numbers."""
    same = _same(_rollout(make()), _rollout(make()))
    _require(same, "Two rollouts with the same seed and actions differ.")


def shares_no_memory(make: MakeEnv) -> None:
    """A learner may keep an observation: the next step does not change it."""
    observations = [observation for observation, _ in _rollout(make())]
    for before, after in pairwise(observations):
        for x, y in product(_arrays(before), _arrays(after)):
            _require(not np.may_share_memory(x, y), "Two observations share memory.")


def names_every_number(make: MakeEnv) -> None:
    """Layouts have the sizes and bounds of the spaces."""
    env = make()
    observation, action = _layouts(env)
    for side, layout, space in (
        ("observation", observation, env.observation_space),
        ("action", action, env.action_space),
    ):
        # A picture is one block of a layout, and so is what is in a Dict.
        kinds = (gym.spaces.Box, gym.spaces.Dict)[: 2 if side == "observation" else 1]
        _require(
            isinstance(space, kinds) and gym.spaces.flatdim(space) == layout.size,
            f"The {side} layout has {layout.size} numbers, its space {space}.",
        )
    box = cast("Any", env.action_space)
    _require(
        np.allclose(box.low, action.low) and np.allclose(box.high, action.high),
        "The bounds of the action layout are not those of the action space.",
    )
    env.close()


def pickles(make: MakeEnv) -> None:
    """A pickled env, and one made from the spec's JSON, is the same env."""
    env = make()
    try:
        again = [pickle.loads(pickle.dumps(env))]
        if env.spec is not None:
            again.append(gym.make(EnvSpec.from_json(env.spec.to_json())))
    except Exception as error:  # Whatever the env holds may refuse in its own way.
        raise BrokenPromise(f"The env cannot be copied: {error}") from error
    played = _rollout(env)
    for other in again:
        _require(_same(played, _rollout(other)), "A copy of the env does something else.")


def reward_is_the_sum_of_its_terms(make: MakeEnv) -> None:
    """The reward is the sum of the terms that `info` reports.

    Those are called `reward_...`, or `..._penalty` as Gymnasium calls costs that are below zero.
    """
    env = make()
    env.reset(seed=_SEED)
    env.action_space.seed(_SEED)
    for _ in range(_STEPS):
        _, reward, terminated, truncated, info = env.step(env.action_space.sample())
        terms = [
            float(value)
            for name, value in info.items()
            if (name.startswith("reward_") or name.endswith("_penalty"))
            and not isinstance(value, Mapping)  # Such as all terms in one, or what they rest on.
        ]
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
    observation, _ = _layouts(env)
    space = env.observation_space
    starts = [np.asarray(gym.spaces.flatten(space, env.reset(seed=i)[0])) for i in range(20)]
    _require(
        not all(np.array_equal(starts[0], start) for start in starts[1:]),
        "Every start is the same.",
    )
    low, high = (
        bound + sign * _ROUNDING * np.maximum(1.0, np.abs(bound))
        for sign, bound in ((-1.0, observation.low), (1.0, observation.high))
    )
    for start in starts:
        within = (start >= low) & (start <= high)
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


def _layouts(env: gym.Env[Any, Any]) -> tuple[Layout, Layout]:
    """Return the layouts of the env."""
    try:
        return layouts_of(env)
    except LayoutError as error:
        raise BrokenPromise(str(error)) from error


def _same(first: _Rollout, second: _Rollout) -> bool:
    """Return whether two rollouts are the same to the last bit, and equally long."""
    return len(first) == len(second) and all(
        all(map(np.array_equal, _arrays(x), _arrays(y))) and reward_x == reward_y
        for (x, reward_x), (y, reward_y) in zip(first, second, strict=True)
    )


def _arrays(observation: Any) -> list[Any]:
    """The arrays of an observation, of which a Dict has several."""
    if isinstance(observation, Mapping):
        parts = cast("Mapping[str, Any]", observation)
        return [array for name in sorted(parts) for array in _arrays(parts[name])]
    return [observation]


def _rollout(env: gym.Env[Any, Any]) -> _Rollout:
    """Observations and rewards under the same random actions; the env is closed."""
    observation, _ = env.reset(seed=_SEED)
    env.action_space.seed(_SEED)
    result: _Rollout = [(observation, 0.0)]
    for _ in range(_STEPS):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        result.append((observation, float(reward)))
        if terminated or truncated:
            break
    env.close()
    return result
