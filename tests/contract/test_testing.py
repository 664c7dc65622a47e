"""The exam of envs: each promise has an env that breaks it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.contract.testing import (
    PROMISES,
    BrokenPromise,
    MakeEnv,
    examine,
    is_deterministic,
    names_every_number,
    passes_gymnasiums_checker,
    pickles,
    reward_is_the_sum_of_its_terms,
    shares_no_memory,
    starts_where_it_may,
)
from shapechanger.errors import LayoutError, ShapechangerError
from shapechanger.layout import Feature, Layout


def _box(size: int, dtype: Any, bound: float = np.inf) -> gym.spaces.Box:
    return gym.spaces.Box(-bound, bound, (size,), dtype)


class Walk(gym.Env[np.ndarray, np.ndarray]):
    """Point mass on a line that keeps every promise; each env in `_BROKEN` breaks one or more."""

    observation_layout = Layout((Feature("point/x", "m", -1.0, 1.0), Feature("point/vx", "m/s")))
    action_layout = Layout((Feature("point/motor", "1", -1.0, 1.0),))
    observation_space = _box(2, np.float64)
    action_space = _box(1, np.float32, 1.0)
    power, pay, limit = 1.0, 1.0, 1.0

    def __init__(self) -> None:
        self.state = np.zeros(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, Any]:
        super().reset(seed=seed)
        self.state[:] = self.start(), 0.0
        return self.seen(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, Any]:
        self.state[1] += 0.1 * self.power * float(action[0])
        self.state[0] += 0.1 * self.state[1]
        info = self.info()
        return self.seen(), self.reward(info), self.ends(), False, info

    def start(self) -> float:
        return self.np_random.uniform(-0.1, 0.1)

    def seen(self) -> np.ndarray:
        return self.state.copy()

    def info(self) -> dict[str, Any]:
        return {"reward_forward": self.pay * float(self.state[1]), "reward_alive": self.pay}

    def reward(self, info: dict[str, Any]) -> float:
        return float(sum(info.values()))

    def ends(self) -> bool:
        return bool(abs(self.state[0]) > self.limit)


class Forgetful(Walk):
    """Env whose second instance ends episodes sooner, with equal numbers until then."""

    made = 0

    def __init__(self) -> None:
        super().__init__()
        type(self).made += 1
        self.left = 20 - type(self).made

    def ends(self) -> bool:
        self.left -= 1
        return self.left < 0


class Wild(Walk):
    """Env whose simulation diverges in its third step, after which it reports no terms."""

    steps = 0

    def info(self) -> dict[str, Any]:
        self.steps += 1
        return super().info() if self.steps < 3 else {"diverged": True}


def _env(name: str, **attributes: Any) -> type[Walk]:
    """Return a subclass of `Walk` with other attributes or methods, which pickle finds by name."""
    return type(name, (Walk,), {**attributes, "__module__": __name__})


def _restored(**changes: Any) -> Any:
    """Return a `__setstate__` that gives copies of an env other attributes."""
    return lambda self, state: self.__dict__.update(state, **changes)


_count = itertools.count()
_low = Layout((Feature("point/x", "m", -0.1, 0.1), Feature("point/vx", "m/s")))
_line = Layout((Feature("point/x", "m", -1.0, 1.0),))
Unseeded = _env("Unseeded", start=lambda self: 1e-3 * next(_count))
Moody = _env("Moody", reward=lambda self, info: sum(info.values()) + next(_count))
Shared = _env("Shared", seen=lambda self: self.state)
Nameless = _env("Nameless", observation_layout=None)
Short = _env("Short", observation_layout=_line)
_strong = Layout((Feature("point/motor", "1", -2.0, 2.0),))
Strong = _env("Strong", action_layout=_strong)
Chooser = _env("Chooser", action_space=gym.spaces.Discrete(3))
Holding = _env("Holding", __getstate__=lambda self: (number for number in range(3)))
Changed = _env("Changed", __setstate__=_restored(power=2.0))
Vague = _env("Vague", info=lambda self: {})
Generous = _env("Generous", reward=lambda self, info: sum(info.values()) + 1e-3)
Still = _env("Still", start=lambda self: 0.0)
Outside = _env("Outside", start=lambda self: 1.0 + self.np_random.random())
Liar = _env("Liar", seen=lambda self: np.append(self.state, 0.0))
# Starts at the ends of the range: 0.1 in single precision is above 0.1.
Single = _env(
    "Single",
    observation_layout=_low,
    observation_space=_box(2, np.float32),
    start=lambda self: self.np_random.choice([-0.1, 0.1]),
    seen=lambda self: self.state.astype(np.float32),
)

# Each env with the promise that it breaks, and the message of the exam.
_BROKEN: list[tuple[MakeEnv, Callable[[MakeEnv], None], str]] = [
    (Liar, passes_gymnasiums_checker, "Gymnasium's checker reports: .*not within the observ"),
    (Unseeded, is_deterministic, "same seed and actions differ"),
    (Moody, is_deterministic, "same seed and actions differ"),
    (Forgetful, is_deterministic, "same seed and actions differ"),
    (Shared, shares_no_memory, "share memory"),
    (Nameless, names_every_number, "Nameless publishes no observation_layout"),
    (Short, names_every_number, "observation layout has 1 numbers, its space Box"),
    (Strong, names_every_number, "bounds of the action layout"),
    (Chooser, names_every_number, "action layout has 1 numbers, its space Discrete"),
    (Holding, pickles, "cannot be copied: cannot pickle 'generator' object"),
    (Changed, pickles, "copy of the env behaves differently"),
    (Vague, reward_is_the_sum_of_its_terms, "reports no reward terms"),
    (Wild, reward_is_the_sum_of_its_terms, "diverges at step 3 of random actions: give the act"),
    (Generous, reward_is_the_sum_of_its_terms, "its terms add up to"),
    (Still, starts_where_it_may, "Every start is the same"),
    (Outside, starts_where_it_may, "Starts out of range: point/x"),
    (Nameless, starts_where_it_may, "Nameless publishes no observation_layout"),
]


@pytest.mark.filterwarnings("ignore:.*value is -?infinity:UserWarning")
@pytest.mark.parametrize("make", [Walk, Single])
def test_an_env_that_keeps_its_promises_passes(make: MakeEnv) -> None:
    sentences = list(examine(make))
    assert len(sentences) == len(PROMISES)
    assert all(sentence.endswith(".") for sentence in sentences)


@pytest.mark.parametrize(("make", "promise", "sentence"), _BROKEN)
def test_a_broken_promise_is_found(
    make: MakeEnv, promise: Callable[[MakeEnv], None], sentence: str
) -> None:
    with pytest.raises((BrokenPromise, LayoutError), match=sentence):
        promise(make)


def test_the_exam_ends_at_the_first_broken_promise() -> None:
    """`_BROKEN` has an env for each promise; the error is an AssertionError."""
    kept: list[str] = []
    with pytest.raises(BrokenPromise, match="Every start is the same"):
        kept.extend(examine(Still))
    assert len(kept) == PROMISES.index(starts_where_it_may)
    assert {promise for _, promise, _ in _BROKEN} == set(PROMISES)
    assert issubclass(BrokenPromise, AssertionError)
    assert issubclass(BrokenPromise, ShapechangerError)


def test_a_spec_that_makes_another_env_is_found() -> None:
    gym.register("testing_test/Walk-v0", f"{__name__}:Walk")
    try:

        def make() -> gym.Env[Any, Any]:
            env = gym.make("testing_test/Walk-v0", disable_env_checker=True)
            assert env.unwrapped.spec is not None
            env.unwrapped.spec.entry_point = f"{__name__}:Generous"
            return env

        with pytest.raises(BrokenPromise, match="behaves differently"):
            pickles(make)
    finally:
        del gym.registry["testing_test/Walk-v0"]
