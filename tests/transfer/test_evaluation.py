"""Evaluation of policies, in envs with known returns, and the shipped references."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.contract.env_ref import FORWARD_SPEED, EnvRef, measures_of
from shapechanger.envs.catalogue import CATALOGUE, default_learner
from shapechanger.errors import UnknownName
from shapechanger.policy import load_policy
from shapechanger.transfer.identities import ENV, identify, known
from shapechanger.transfer.learners.evaluation import (
    EVALUATION_SEED,
    evaluate,
    evaluation_seed,
    random_actions,
)
from shapechanger.transfer.references import FOLDER, load_references, reference_of, reference_policy


@given(st.sets(st.integers(0, 99_999), min_size=2, max_size=2), st.integers(1, 10_000))
def test_fingers_are_evaluated_with_different_seeds(pair: set[int], many: int) -> None:
    first, second = (
        evaluation_seed(EnvRef("shapechanger/Finger-v1", {"gap": "wide", "finger_seed": i}), many)
        for i in sorted(pair)
    )
    assert EVALUATION_SEED <= first <= second - many
    assert second + many < 2**32


@pytest.mark.parametrize("seed", [0, 99_999, 100_000, 2**32 - 1])
@pytest.mark.parametrize("kwargs", [{}, {"finger_seed": None}])
def test_evaluation_seeds_of_a_finger_are_valid(seed: int, kwargs: dict[str, Any]) -> None:
    """Seeds of episodes stay below 2^32; an env without `finger_seed` has the common seed."""
    env = EnvRef("shapechanger/Finger-v1", kwargs)
    assert evaluation_seed(env, 60) == EVALUATION_SEED
    assert 0 <= evaluation_seed(env.having({"finger_seed": seed}), 10**9) < 2**32


class Countdown(gym.Env[NDArray[np.float64], NDArray[np.float32]]):
    """Env whose episodes last `seed` steps; the reward of a step is its action plus 1."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (1,), np.float64)
    action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        assert seed is not None
        self.left = seed
        return np.array([float(self.left)]), {}

    def step(self, action: Any) -> Any:
        self.left -= 1
        terms = {"reward_action": float(action[0]), "reward_alive": 1.0}
        return np.array([float(self.left)]), sum(terms.values()), self.left == 0, False, terms


def test_returns_lengths_and_terms_are_means_over_episodes() -> None:
    """Episodes have 3, 4 and 5 steps with a reward of 1.5 each."""
    envs = [Countdown() for _ in range(3)]
    result = evaluate(lambda observations: np.full((len(observations), 1), 0.5), envs, 3, 7)
    assert result.steps == 7
    assert result.mean_length == 4.0
    assert result.mean_return == 6.0
    np.testing.assert_allclose(result.terms["reward_action"], 2.0)
    np.testing.assert_allclose(result.terms["reward_alive"], 4.0)


def test_random_actions_come_from_the_seed() -> None:
    observations = np.zeros((4, 1))
    first = random_actions(Countdown().action_space, 1)(observations)
    np.testing.assert_array_equal(first, random_actions(Countdown().action_space, 1)(observations))
    assert not np.array_equal(first, random_actions(Countdown().action_space, 2)(observations))
    assert first.shape == (4, 1)
    assert np.abs(first).max() <= 1.0


def test_one_env_plays_several_episodes() -> None:
    result = evaluate(lambda o: np.zeros((len(o), 1)), [Countdown()], 3, 7, episodes=3)
    many = evaluate(lambda o: np.zeros((len(o), 1)), [Countdown() for _ in range(3)], 3, 7)
    assert result == many
    assert result.mean_length == 4.0


class Succeeding(Countdown):
    """Env that reports the successes in a list, one at each step."""

    def __init__(self, successes: list[bool]) -> None:
        self.successes = successes

    def step(self, action: Any) -> Any:
        info = {"is_success": self.successes.pop(0)} if self.successes else {}
        return np.zeros(1), 0.0, not self.successes, False, info


def test_the_last_success_counts() -> None:
    """Success is the mean over episodes of their last value; None if no episode reports it."""
    assert evaluate(lambda o: np.zeros((len(o), 1)), [Countdown()], 1).success is None
    envs = [Succeeding(successes) for successes in ([False, True], [True, False], [True], [])]
    result = evaluate(lambda o: np.zeros((len(o), 1)), envs, 1)
    assert result.success == pytest.approx(2 / 3)


class Runner(Countdown):
    """Env that runs at 2 m/s until it falls, with a reward term of a NumPy type."""

    measures = (FORWARD_SPEED,)
    spec = EnvSpec("Runner-v0", max_episode_steps=8)

    def step(self, action: Any) -> Any:
        observation, _, fallen, truncated, _ = super().step(action)
        info = {"x_velocity": np.float64(2.0), "reward_ctrl": np.float32(-0.5)}
        return observation, -0.5, fallen, truncated, info


def test_a_fallen_runner_stands_still_for_the_rest() -> None:
    """Four of eight steps at 2 m/s are 1 m/s; terms of any numeric type count."""
    result = evaluate(lambda o: np.zeros((len(o), 1)), [Runner()], 4)
    assert result.measures == {"forward speed": 1.0}
    assert result.terms == {"reward_ctrl": -2.0}
    assert result.value("forward speed") == 1.0
    assert result.value("reward_ctrl") == result.value("return") == -2.0
    with pytest.raises(UnknownName, match="forward speed"):
        result.value("forward sped")


def test_the_standing_share_of_a_vehicle_is_reported() -> None:
    """A car that never moves stands in all steps, and one at full throttle in few."""
    with closing(gym.make("shapechanger/CarRanges-v1", max_episode_steps=40)) as car:
        still = evaluate(lambda seen: np.zeros((len(seen), 2), np.float32), [car], 5)
        fast = evaluate(lambda seen: np.tile(np.float32([0.0, 1.0]), (len(seen), 1)), [car], 5)
    assert still.standing == 1.0
    assert fast.standing is not None
    assert 0.0 < fast.standing < 0.2
    countdown = evaluate(lambda seen: np.zeros((len(seen), 1)), [Countdown()], 5)
    assert countdown.standing is None


REFERENCES = load_references()


def test_every_env_of_the_catalogue_has_a_reference() -> None:
    assert set(REFERENCES) == set(CATALOGUE)
    assert set(FOLDER.glob("*.safetensors")) == {reference_policy(env) for env in REFERENCES}


@pytest.mark.parametrize("env_id", REFERENCES)
def test_a_reference_policy_performs_as_stated(env_id: str) -> None:
    """The card has the reference's numbers; an episode covers over 25 % from floor to end."""
    env, reference = EnvRef(env_id), REFERENCES[env_id]
    policy = load_policy(reference_policy(env_id))
    assert policy.card.env == env
    assert (policy.card.steps, policy.card.seed) == (reference.steps, reference.policy_seed)
    assert policy.card.learner == reference.learner
    assert policy.card.identity == known({ENV: identify(env)})
    # Policies of single pendulums were trained when learners' actions were forces in N.
    in_newtons = "Pendulum" in env_id and "Double" not in env_id
    assert default_learner(env) == ("ppo-pendulum" if in_newtons else reference.learner)
    with closing(env.make()) as made:
        measures = [measure.name for measure in measures_of(made)]
        found = evaluate(policy.act, [made], EVALUATION_SEED, episodes=1)
    assert list(reference.ends) == measures
    measure = measures[0]
    floor = max(values[measure] for values in reference.floor.values())
    end = reference.ends[measure][reference.seeds.index(reference.policy_seed)]
    assert found.value(measure) > floor + 0.25 * (end - floor)


def test_other_bodies_have_no_reference() -> None:
    assert reference_of(EnvRef("shapechanger/Ant-v1")) is not None
    assert reference_of(EnvRef("shapechanger/Ant-v1", {"body": "BigAnt"})) is None
    assert reference_of(EnvRef("Ant-v5")) is None
    with pytest.raises(UnknownName, match="reference policy"):
        reference_policy("shapechanger/Car-v1")
