"""Learners of Stable-Baselines3: their settings, exploration, and a single env."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
import torch
from stable_baselines3 import A2C, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.sac.policies import MlpPolicy

import shapechanger  # noqa: F401 - registers the envs.
from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import PolicyError, StudyError
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import (
    LEARNERS,
    learner_settings,
    resolve_learner,
    tuned_on,
    tuning_text,
)
from shapechanger.transfer.learners.sb3 import START_LOG_STD, Sb3Learner
from shapechanger.transfer.learners.settings import (
    ImportedSettings,
    OffPolicySettings,
    PpoSettings,
    Sb3Settings,
)
from tests.transfer.studies import BIG, SMALL, TINY, tiny_plan

HERE = __name__

SHORT: dict[str, Any] = {
    "net_arch": [8],
    "steps": 96,
    "eval_every": 32,
    "eval_episodes": 2,
    "batch_size": 8,
    "learning_starts": 16,
    "buffer_size": 96,
}


def narrow_sac(envs: VecEnv, seed: int, *, width: int = 8) -> BaseAlgorithm:
    """A learner as a function: SAC with one layer."""
    return SAC(
        MlpPolicy,
        envs,
        seed=seed,
        batch_size=8,
        learning_starts=8,
        policy_kwargs={"net_arch": [width]},
        device="cpu",
    )


def not_a_model(envs: VecEnv, seed: int) -> object:
    """A function that returns no model."""
    return "a policy"


class Unstable(A2C):
    """A learner whose weights are NaN after its first update."""

    def train(self) -> None:
        for weight in self.policy.parameters():
            weight.data.fill_(float("nan"))


def settings_of(learner: str) -> Sb3Settings:
    short = {name: SHORT[name] for name in ("steps", "eval_every", "eval_episodes")}
    _, settings = resolve_learner(learner, SHORT if learner in ("sac", "tqc") else short)
    assert isinstance(settings, Sb3Settings)
    return settings


EACH = ("sac", "tqc", "stable_baselines3:A2C", f"{HERE}:narrow_sac")


def trained(learner: str, **options: Any) -> tuple[TrainedPolicy, list[Evaluation], Sb3Settings]:
    settings = settings_of(learner)
    curve: list[Evaluation] = []
    train = Sb3Learner(learner, settings).train
    return train(SMALL, 64, 0, on_evaluation=curve.append, **options), curve, settings


@pytest.mark.parametrize("learner", EACH)
def test_policies_round_trip(learner: str, tmp_path: Path) -> None:
    """Every learner is evaluated at the same steps, and its policy round trips."""
    policy, curve, settings = trained(learner)
    assert [one.steps for one in curve] == [0, *map(settings.whole_updates, (32, 64))]
    path = tmp_path / "policy.safetensors"
    save_policy(policy, path)
    again = Sb3Learner(learner, settings).load(path)
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(again.act(observations), policy.act(observations))
    assert again.card == policy.card


def test_a_file_alone_calls_no_function(tmp_path: Path) -> None:
    policy, _, _ = trained(f"{HERE}:narrow_sac")
    path = tmp_path / "policy.safetensors"
    save_policy(policy, path)
    with pytest.raises(PolicyError, match="a function, which a file may not call"):
        load_policy(path)


def test_a_file_alone_imports_no_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file may not name a module that is not imported yet, unless the caller names it too."""
    (tmp_path / "own_class.py").write_text(
        "from stable_baselines3 import A2C\nclass Own(A2C): pass\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    policy, _, settings = trained("stable_baselines3:A2C")
    own = msgspec.structs.replace(settings, algorithm="own_class:Own")
    path = tmp_path / "policy.safetensors"
    save_policy(policy.carded(settings=own), path)
    with pytest.raises(PolicyError, match=r"^A policy of own_class:Own needs the module own_class"):
        load_policy(path)
    assert "own_class" not in sys.modules
    assert type(load_policy(path, "own_class:Own").model).__name__ == "Own"
    monkeypatch.delitem(sys.modules, "own_class")


@pytest.mark.parametrize("learner", EACH[:3])
def test_a_transplanted_policy_acts_as_the_source(learner: str) -> None:
    policy, curve, settings = trained(learner)
    plan = tiny_plan(settings)
    moved: list[Evaluation] = []
    Sb3Learner(learner, settings).train(
        BIG, 64, 1, on_evaluation=moved.append, start=policy, body_map=plan.body_map
    )
    zero_shot = Sb3Learner(learner, settings).evaluate(BIG, policy, plan.body_map)
    assert moved[0].mean_return == pytest.approx(zero_shot.mean_return)
    assert len(moved) == len(curve)


def test_a_transplanted_policy_is_kept_until_updates_start() -> None:
    policy, _, settings = trained("sac")
    assert isinstance(settings, OffPolicySettings)
    plan = tiny_plan(settings)
    late = msgspec.structs.replace(settings, learning_starts=64)
    moved = Sb3Learner("sac", late).train(SMALL, 64, 1, start=policy, body_map=plan.body_map)
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_allclose(moved.act(observations), policy.act(observations), rtol=1e-5)


def test_a_file_of_settings(tmp_path: Path) -> None:
    """A TOML file names a preset or an algorithm; `--set` takes precedence."""
    path = tmp_path / "mine.toml"
    path.write_text('preset = "sac"\nlearning_rate = 1e-4\ngamma = 0.9\n')
    name, settings = resolve_learner(str(path), {"gamma": 0.95})
    assert isinstance(settings, OffPolicySettings)
    assert (name, settings.learning_rate, settings.gamma) == ("mine", 1e-4, 0.95)
    path.write_text('algorithm = "stable_baselines3:A2C"\nn_steps = 8\nn_envs = 4\n')
    _, settings = resolve_learner(str(path), {})
    assert isinstance(settings, ImportedSettings)
    assert (settings.arguments, settings.update_steps) == ({"n_steps": 8}, 32)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("learning_rate = 1e-4", "must name a starting point"),
        ('# sca\npreset = "sca"', "line 2: No learner matches 'sca'. Did you mean 'sac'"),
        ('preset = "sac"\n\nlearning_rat = 1e-4', "line 3: No setting .*mean 'learning_rate'"),
        ('preset = "sac"\ngamma = "much"', "line 2: The settings of sac are wrong"),
        ("preset = ", "cannot be read"),
        ('algorithm = "no_such_package:Learner"', "no_such_package"),
        ('algorithm = "stable_baselines3:A2C"\nlearning_rat = 1', "Did you mean 'learning_rate'"),
        ('algorithm = "pathlib:Path"', "neither a class of models nor a function"),
    ],
)
def test_a_wrong_file_of_settings_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match=message):
        resolve_learner(str(path), {})


@pytest.mark.parametrize(
    ("name", "message"), [("not_a_model", "returned str"), ("Unstable", "diverged after")]
)
def test_an_unsuitable_algorithm_is_refused(name: str, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        trained(f"{HERE}:{name}")


def test_some_settings_change_and_others_stay() -> None:
    """Values are converted as from TOML: lists to tuples, integers to floats."""
    _, changed = resolve_learner("ppo-run", {"net_arch": [32], "learning_rate": 1})
    assert isinstance(changed, PpoSettings)
    assert (changed.net_arch, changed.learning_rate) == ((32,), 1.0)
    assert changed.n_steps == learner_settings("ppo-run").n_steps  # type: ignore[union-attr]
    assert resolve_learner("ppo-run", {}) == ("ppo-run", learner_settings("ppo-run"))


def test_envs_that_learners_were_tuned_on_exist_and_are_named() -> None:
    """The text states whether an env is one of them, or that the envs are unknown."""
    for learner in LEARNERS:
        for name in tuned_on(learner):
            assert f"shapechanger/{name}-v1" in gym.registry
    assert tuning_text("ppo-swim", "shapechanger/Swimmer-v1") == (
        "The settings were tuned on Swimmer."
    )
    assert tuning_text("ppo-run", "shapechanger/Hopper-v1").endswith("not on Hopper.")
    assert "It is not stated" in tuning_text("mine", "shapechanger/Ant-v1")


_LONG = msgspec.structs.replace(TINY, n_steps=256, eval_every=512, steps=512)


class _Actions(BaseCallback):
    """Collects the deviations of actions from their means in a rollout."""

    def __init__(self) -> None:
        super().__init__()
        self.noise = np.empty(0)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model: Any = self.model
        seen = torch.as_tensor(model.rollout_buffer.observations.reshape(-1, 4))
        with torch.no_grad():
            mean = model.policy.get_distribution(seen).mode().numpy()
        self.noise = model.rollout_buffer.actions.reshape(mean.shape) - mean


def _source(log_std: float) -> TrainedPolicy:
    """A policy whose actions have this logarithm of their standard deviation."""
    policy = Sb3Learner("tiny", TINY).train(SMALL, 32, 0)
    model: Any = policy.model
    model.policy.log_std.data.fill_(log_std)
    return policy


@pytest.mark.parametrize(
    ("source", "of_new", "start"),
    [
        (-4.0, 0.0, START_LOG_STD),
        (-1.3, 0.0, START_LOG_STD),
        (-0.3, 0.0, -0.3),
        (-4.0, -2.0, -2.0),
    ],
)
def test_fine_tuning_explores(source: float, of_new: float, start: float, tmp_path: Path) -> None:
    """A smaller deviation is raised to `START_LOG_STD` or, if that is lower, to a new policy's."""
    before, actions = _source(source), _Actions()
    assert before.card.start_log_std is None
    train = Sb3Learner("tiny", msgspec.structs.replace(_LONG, log_std_init=of_new)).train
    same = BodyMap.identity(*before.card.layouts)
    policy = train(BIG, 512, 0, start=before, body_map=same, callback=actions)
    assert policy.card.start_log_std == (pytest.approx(start),)
    assert actions.noise.std() == pytest.approx(np.exp(start), rel=0.15)
    save_policy(policy, tmp_path / "policy.safetensors")
    assert load_policy(tmp_path / "policy.safetensors").card == policy.card


FINGER = EnvRef("shapechanger/Finger-v1")
_STEPS = 100  # Steps of an episode.


def test_training_and_evaluation_alternate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Training and evaluation share the env; each rollout starts an episode."""
    called: dict[int, list[int | str | None]] = {}
    reset, step = FingerReachEnv.reset, FingerReachEnv.step

    def counted_reset(
        self: FingerReachEnv, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> Any:
        called.setdefault(id(self), []).append(seed)
        return reset(self, seed=seed, options=options)

    def counted_step(self: FingerReachEnv, action: Any) -> Any:
        called[id(self)].append("step")
        return step(self, action)

    monkeypatch.setattr(FingerReachEnv, "reset", counted_reset)
    monkeypatch.setattr(FingerReachEnv, "step", counted_step)
    monkeypatch.setattr(FingerReachEnv, "side_by_side", False, raising=False)
    curve: list[Evaluation] = []
    policy = Sb3Learner("tiny", TINY).train(FINGER, 96, 0, on_evaluation=curve.append)
    assert [evaluation.steps for evaluation in curve] == [0, 32, 64, 96]
    assert policy.card.steps == 96
    (calls,) = called.values()
    # Indices of the resets that start the last episode of each evaluation.
    ends = [i for i, call in enumerate(calls) if call == EVALUATION_SEED + TINY.eval_episodes - 1]
    assert len(ends) == 4
    for i in ends:
        assert set(calls[i + 1 : i + 1 + _STEPS]) == {"step"}
        assert calls[i + 1 + _STEPS :][:1] in ([], [None], [0])  # Never a step after the end.
    assert calls[ends[-1] + 1 + _STEPS :] == []
