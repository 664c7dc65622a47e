"""Checks that every env must pass, for the tests of Shapechanger and of third-party envs.

>>> from shapechanger.contract.testing import examine
>>> for check in examine(lambda: gym.make("shapechanger/Ant-v1")):
...     print(check)
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from itertools import pairwise, product
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from shapechanger.contract.env_ref import is_reward_term, layouts_of
from shapechanger.errors import ShapechangerError

MakeEnv = Callable[[], gym.Env[Any, Any]]
"""Makes a new env."""

# Observations and rewards of a start and its steps.
_Rollout = list[tuple[Any, float]]

_STEPS: Final = 50
_SEED: Final = 7
# Relative tolerance for limits, because numbers are rounded to single precision.
_ROUNDING: Final = 1e-6


class BrokenPromise(ShapechangerError, AssertionError):
    """An env breaks a rule that learners rely on."""


def _require(kept: bool, sentence: str) -> None:
    if not kept:
        raise BrokenPromise(sentence)


def passes_gymnasiums_checker(make: MakeEnv) -> None:
    """Passes Gymnasium's `check_env`."""
    with warnings.catch_warnings(), make() as env:
        # Warnings about ranges of spaces are not failures.
        warnings.filterwarnings("ignore", message=".*symmetric and normalized space.*")
        warnings.filterwarnings("ignore", message=".*(minimum|maximum) value is -?infinity.*")
        try:
            check_env(env.unwrapped, skip_render_check=True)
        except (AssertionError, gym.error.Error) as error:
            raise BrokenPromise(f"Gymnasium's checker reports: {error}") from error


def is_deterministic(make: MakeEnv) -> None:
    """The same seed and actions give the same numbers."""
    same = _same(_rollout(make()), _rollout(make()))
    _require(same, "Two rollouts with the same seed and actions differ.")


def shares_no_memory(make: MakeEnv) -> None:
    """Successive observations share no memory, so a learner may keep them."""
    observations = [observation for observation, _ in _rollout(make())]
    for before, after in pairwise(observations):
        for x, y in product(_arrays(before), _arrays(after)):
            _require(not np.may_share_memory(x, y), "Two observations share memory.")


def names_every_number(make: MakeEnv) -> None:
    """Layouts have the sizes of the spaces, and the action layout the bounds of its space."""
    with make() as env:
        observation, action = layouts_of(env)
        for side, layout, space, kinds in (
            # An image, or an entry of a Dict, is one feature of a layout.
            ("observation", observation, env.observation_space, (gym.spaces.Box, gym.spaces.Dict)),
            ("action", action, env.action_space, (gym.spaces.Box,)),
        ):
            _require(
                isinstance(space, kinds) and gym.spaces.flatdim(space) == layout.size,
                f"The {side} layout has {layout.size} numbers, its space {space}.",
            )
        box = cast("Any", env.action_space)
        _require(
            np.allclose(box.low, action.low) and np.allclose(box.high, action.high),
            "The bounds of the action layout differ from the action space's.",
        )


def pickles(make: MakeEnv) -> None:
    """Copies of the env, from its pickle and from the JSON of its spec, behave like it."""
    env = make()
    try:
        again = [pickle.loads(pickle.dumps(env))]
        if env.spec is not None:
            again.append(gym.make(EnvSpec.from_json(env.spec.to_json())))
    except Exception as error:  # Any attribute of the env may fail in its own way.
        raise BrokenPromise(f"The env cannot be copied: {error}") from error
    played = _rollout(env)
    for other in again:
        _require(_same(played, _rollout(other)), "A copy of the env behaves differently.")


def reward_is_the_sum_of_its_terms(make: MakeEnv) -> None:
    """The reward is the sum of the terms in `info`.

    Their names are `reward_...`, or `..._penalty` for negative costs, like those of Gymnasium.
    """
    infos: list[dict[str, Any]] = []
    for step, (_, reward) in enumerate(_rollout(make(), infos)[1:]):
        info = infos[step]
        _require(
            not info.get("diverged"),
            f"The simulation diverges at step {step + 1} of random actions: give the actuators a "
            "narrower range, motors of a rig a smaller gear, or the model a shorter time step.",
        )
        # A mapping is not a term: `reward_terms` has all terms, and `reward_sources` their sensors.
        named = (value for name, value in info.items() if is_reward_term(name))
        terms = [float(value) for value in named if not isinstance(value, Mapping)]
        _require(bool(terms), "info reports no reward terms.")
        _require(
            bool(np.isclose(reward, sum(terms), rtol=1e-9, atol=1e-12)),
            f"The reward is {reward}, its terms add up to {sum(terms)}.",
        )


def starts_where_it_may(make: MakeEnv) -> None:
    """Starts are not the same for all seeds, and are within the ranges of the layout."""
    with closing(make()) as env:
        layout, space = layouts_of(env)[0], env.observation_space
        seen = [np.asarray(gym.spaces.flatten(space, env.reset(seed=i)[0])) for i in range(20)]
    starts = np.stack(seen)
    _require(
        not np.array_equal(starts, starts[:1].repeat(len(seen), 0)), "Every start is the same."
    )
    low = layout.low - _ROUNDING * np.maximum(1.0, np.abs(layout.low))
    high = layout.high + _ROUNDING * np.maximum(1.0, np.abs(layout.high))
    outside = (starts < low) | (starts > high)
    names = [name for name, places in layout.slices.items() if outside[:, places].any()]
    _require(not names, f"Starts out of range: {', '.join(names)}.")


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
    """Check an env.

    Args:
        make: Makes a new env; called several times.

    Yields:
        A description of each check that the env has passed.

    Raises:
        BrokenPromise: If the env fails a check.
        LayoutError: If it publishes no layouts.
    """
    for promise in PROMISES:
        promise(make)
        yield (promise.__doc__ or "").split("\n")[0]


def _same(first: _Rollout, second: _Rollout) -> bool:
    """Return whether two rollouts have the same length and equal numbers."""
    return len(first) == len(second) and all(
        all(map(np.array_equal, _arrays(x), _arrays(y))) and reward_x == reward_y
        for (x, reward_x), (y, reward_y) in zip(first, second, strict=True)
    )


def _arrays(observation: Any) -> list[Any]:
    """Return the arrays of an observation; an observation of a Dict space has several."""
    if isinstance(observation, Mapping):
        parts = cast("Mapping[str, Any]", observation)
        return [array for name in sorted(parts) for array in _arrays(parts[name])]
    return [observation]


def _rollout(env: gym.Env[Any, Any], infos: list[dict[str, Any]] | None = None) -> _Rollout:
    """Return observations and rewards under seeded random actions, and close the env.

    The info of each step is appended to `infos`.
    """
    with closing(env):
        result: _Rollout = [(env.reset(seed=_SEED)[0], 0.0)]
        env.action_space.seed(_SEED)
        for _ in range(_STEPS):
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
            result.append((observation, float(reward)))
            if infos is not None:
                infos.append(info)
            if terminated or truncated:
                break
    return result
