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
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Feature, Layout

_Info = dict[str, Any]


class Walk(gym.Env[np.ndarray, np.ndarray]):
    """Point mass on a line that keeps every promise."""

    observation_layout = Layout((Feature("point/x", "m", -1.0, 1.0), Feature("point/vx", "m/s")))
    action_layout = Layout((Feature("point/motor", "1", -1.0, 1.0),))

    def __init__(self) -> None:
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.state = np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: _Info | None = None
    ) -> tuple[np.ndarray, _Info]:
        """Start at rest."""
        super().reset(seed=seed)
        self.state = np.array([self.start(), 0.0])
        return self.seen(), {}

    def start(self) -> float:
        """Return a random start near the middle."""
        return self.np_random.uniform(-0.1, 0.1)

    def seen(self) -> np.ndarray:
        """Return the observation."""
        return self.state.copy()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Push the point for 0.1 s."""
        x, speed = self.state
        speed += 0.1 * float(action[0])
        self.state = np.array([x + 0.1 * speed, speed])
        terms = {"reward_forward": speed, "reward_alive": 1.0}
        return self.seen(), float(sum(terms.values())), bool(abs(x) > 1.0), False, terms


_count = itertools.count()


class Unseeded(Walk):
    """Env whose start ignores the seed."""

    def start(self) -> float:
        """Return a new start at each call."""
        return 1e-3 * next(_count)


class Forgetful(Walk):
    """Env whose second instance ends episodes sooner, with equal numbers until then."""

    made = 0

    def __init__(self) -> None:
        super().__init__()
        type(self).made += 1
        self.left = 20 - type(self).made

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """End when there are no steps left."""
        observation, reward, _, _, info = super().step(action)
        self.left -= 1
        return observation, reward, self.left < 0, False, info


class Moody(Walk):
    """Env with an unpredictable reward."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Add a term from a global counter."""
        observation, reward, terminated, truncated, info = super().step(action)
        info["reward_mood"] = float(next(_count))
        return observation, reward + info["reward_mood"], terminated, truncated, info


class Shared(Walk):
    """Env that returns its own memory."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Overwrite the array that was returned before."""
        memory = self.state
        _, reward, terminated, truncated, info = super().step(action)
        memory[:] = self.state
        self.state = memory
        return memory, reward, terminated, truncated, info


class Nameless(Walk):
    """Env without an observation layout."""

    observation_layout = None


class Short(Walk):
    """Env whose layout names one number of two."""

    observation_layout = Layout((Feature("point/x", "m", -1.0, 1.0),))


class Strong(Walk):
    """Env whose action layout has other bounds than its space."""

    action_layout = Layout((Feature("point/motor", "1", -2.0, 2.0),))


class Chooser(Walk):
    """Env with a discrete action space."""

    def __init__(self) -> None:
        super().__init__()
        self.action_space = gym.spaces.Discrete(3)


class Holding(Walk):
    """Env that cannot be pickled."""

    def __init__(self) -> None:
        super().__init__()
        self.held = (number for number in range(3))


class Changed(Walk):
    """Env whose copies have stronger motors."""

    power = 1.0

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore with more power."""
        self.__dict__.update(state, power=2.0)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Scale the action by the power."""
        return super().step(self.power * action)


class Richer(Changed):
    """Env whose copies move the same and pay twice the reward."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Scale the reward by the power."""
        observation, reward, terminated, truncated, info = Walk.step(self, action)
        info = {name: self.power * value for name, value in info.items()}
        return observation, self.power * reward, terminated, truncated, info


class Brief(Changed):
    """Env whose copies end at once."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Terminate if this is a copy."""
        observation, reward, _, _, info = Walk.step(self, action)
        return observation, reward, self.power > 1.0, False, info


class Vague(Walk):
    """Env that reports no reward terms."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Drop the terms from the info."""
        observation, reward, terminated, truncated, _ = super().step(action)
        return observation, reward, terminated, truncated, {}


class Generous(Walk):
    """Env whose reward exceeds the sum of its terms."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Add a constant."""
        observation, reward, terminated, truncated, info = super().step(action)
        return observation, reward + 1e-3, terminated, truncated, info


class Still(Walk):
    """Env with a constant start."""

    def start(self) -> float:
        """Return the middle."""
        return 0.0


class Outside(Walk):
    """Env that starts outside the range of its layout."""

    def start(self) -> float:
        """Return a start beyond the upper bound."""
        return 1.0 + self.np_random.random()


class Liar(Walk):
    """Env whose observations are not in its space."""

    def seen(self) -> np.ndarray:
        """Append a number."""
        return np.append(self.state, 0.0)


class Single(Walk):
    """Env in single precision that starts at the ends of its range."""

    observation_layout = Layout((Feature("point/x", "m", -0.1, 0.1), Feature("point/vx", "m/s")))

    def __init__(self) -> None:
        super().__init__()
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (2,), np.float32)

    def start(self) -> float:
        """Return an end of the range; 0.1 in single precision is above 0.1."""
        return self.np_random.choice([-0.1, 0.1])

    def seen(self) -> np.ndarray:
        """Convert to single precision."""
        return self.state.astype(np.float32)


class Wild(Walk):
    """Env whose simulation diverges in its third step, after which it reports no terms."""

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, _Info]:
        """Diverge."""
        self.steps = getattr(self, "steps", 0) + 1
        if self.steps < 3:
            return super().step(action)
        return self.seen(), 0.0, True, False, {"diverged": True}


# Each env with the promise that it breaks, and the message of the exam.
_BROKEN: list[tuple[MakeEnv, Callable[[MakeEnv], None], str]] = [
    (Liar, passes_gymnasiums_checker, "Gymnasium's checker says: .*not within the observ"),
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
    (Richer, pickles, "copy of the env behaves differently"),
    (Brief, pickles, "copy of the env behaves differently"),
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
    with pytest.raises(BrokenPromise, match=sentence):
        promise(make)


def test_every_promise_is_broken_by_some_env() -> None:
    assert {promise for _, promise, _ in _BROKEN} == set(PROMISES)


def test_the_exam_ends_at_the_first_broken_promise() -> None:
    kept: list[str] = []
    with pytest.raises(BrokenPromise, match="Every start is the same"):
        kept.extend(examine(Still))
    assert len(kept) == PROMISES.index(starts_where_it_may)


def test_broken_promise_is_an_assertion_error() -> None:
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
