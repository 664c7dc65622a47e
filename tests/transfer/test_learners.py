"""Learners of Stable-Baselines3 besides PPO: SAC, TQC, named classes, and functions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from stable_baselines3 import A2C, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.sac.policies import MlpPolicy

from shapechanger.errors import PolicyError, StudyError
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.export import export_onnx
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import ImportedSettings, OffPolicySettings, Sb3Settings
from tests.transfer.studies import BIG, SMALL, tiny_plan

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
    """A function that returns something else."""
    del envs, seed
    return "a policy"


class Unstable(A2C):
    """A learner whose weights are NaN after its first update."""

    def train(self) -> None:
        """Set the weights to NaN."""
        for weight in self.policy.parameters():
            weight.data.fill_(float("nan"))


def settings_of(learner: str) -> Sb3Settings:
    """Return small settings of each kind of learner."""
    if learner in ("sac", "tqc"):
        _, settings = resolve_learner(learner, SHORT)
    else:
        short = {name: SHORT[name] for name in ("steps", "eval_every", "eval_episodes")}
        _, settings = resolve_learner(learner, short)
    assert isinstance(settings, Sb3Settings)
    return settings


def _ignore(evaluation: Evaluation) -> None:
    del evaluation


LEARNERS = ("sac", "tqc", "stable_baselines3:A2C", f"{HERE}:narrow_sac")


def trained(learner: str, **options: Any) -> tuple[TrainedPolicy, list[Evaluation], Sb3Settings]:
    """Return a policy trained for a second."""
    settings = settings_of(learner)
    curve: list[Evaluation] = []
    policy = Sb3Learner(learner, settings).train(
        SMALL, 64, 0, on_evaluation=curve.append, **options
    )
    return policy, curve, settings


@pytest.mark.parametrize("learner", LEARNERS)
def test_policies_round_trip(learner: str, tmp_path: Path) -> None:
    """Every learner is evaluated at the same steps, and its policy round trips."""
    policy, curve, settings = trained(learner)
    update = settings.update_steps
    assert [one.steps for one in curve] == [
        0,
        -(-32 // update) * update,
        settings.whole_updates(64),
    ]
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
    (tmp_path / "own_a2c.py").write_text(
        "from stable_baselines3 import A2C\nclass Own(A2C): pass\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    policy, _, settings = trained("stable_baselines3:A2C")
    own = msgspec.structs.replace(settings, algorithm="own_a2c:Own")
    path = tmp_path / "policy.safetensors"
    save_policy(policy.carded(settings=own), path)
    with pytest.raises(PolicyError, match=r"^A policy of own_a2c:Own needs the module own_a2c"):
        load_policy(path)
    assert "own_a2c" not in sys.modules
    assert type(load_policy(path, "own_a2c:Own").model).__name__ == "Own"
    monkeypatch.delitem(sys.modules, "own_a2c")


@pytest.mark.parametrize("learner", LEARNERS[:3])
def test_a_transplanted_policy_acts_as_the_source(learner: str) -> None:
    """Before its first update it acts as the source, instead of at random."""
    policy, curve, settings = trained(learner)
    plan = tiny_plan(settings)
    moved: list[Evaluation] = []
    Sb3Learner(learner, settings).train(
        BIG,
        64,
        1,
        on_evaluation=moved.append,
        start=policy,
        body_map=plan.body_map,
    )
    zero_shot = Sb3Learner(learner, settings).evaluate(BIG, policy, plan.body_map)
    assert moved[0].mean_return == pytest.approx(zero_shot.mean_return)
    assert len(moved) == len(curve)


def test_a_transplanted_policy_is_kept_until_updates_start() -> None:
    policy, _, settings = trained("sac")
    assert isinstance(settings, OffPolicySettings)
    plan = tiny_plan(settings)
    late = msgspec.structs.replace(settings, learning_starts=64)
    moved = Sb3Learner("sac", late).train(
        SMALL, 64, 1, on_evaluation=_ignore, start=policy, body_map=plan.body_map
    )
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_allclose(moved.act(observations), policy.act(observations), rtol=1e-5)


@pytest.mark.parametrize("learner", LEARNERS[:3])
def test_an_exported_policy_acts_the_same(learner: str, tmp_path: Path) -> None:
    """ONNX Runtime computes the same actions to 1e-5."""
    policy, _, _ = trained(learner)
    export_onnx(policy, tmp_path / "policy.onnx")
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_allclose(
        load_policy(tmp_path / "policy.onnx").act(observations), policy.act(observations), atol=1e-5
    )


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
        ('preset = "sca"', "Did you mean 'sac'"),
        ('preset = "sac"\nlearning_rat = 1e-4', "Did you mean 'learning_rate'"),
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


def test_a_function_that_builds_something_else_is_refused() -> None:
    with pytest.raises(StudyError, match="returned str"):
        trained(f"{HERE}:not_a_model")


def test_a_training_that_diverges_is_refused() -> None:
    with pytest.raises(StudyError, match="diverged after"):
        trained(f"{HERE}:Unstable")
