"""Studies with a given source policy: a clone, or a policy of PPO."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.errors import PolicyError, SpaceMismatch, StudyError
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners import SharedFile
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.metrics import Summary, summarise
from shapechanger.transfer.plan import Plan, Run, TransferTask
from shapechanger.transfer.study import make_plan, run_study
from shapechanger.vehicles.cloning import CloneLearner
from tests.transfer.lane import DRY, ICY, QUICK_CLONING, WET
from tests.transfer.studies import SMALL, TINY, tiny_plan


@pytest.fixture(scope="module")
def clone_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clone of the demonstrator on the dry lane."""
    folder = tmp_path_factory.mktemp("clone")
    policy = CloneLearner("cloning", QUICK_CLONING).train(
        DRY,
        40,
        3,
        demonstrations=SharedFile(folder / "shown.npz", 3),
        on_evaluation=lambda evaluation: None,
    )
    policy.save(folder / "dry.safetensors")
    return folder / "dry.safetensors"


@pytest.fixture(scope="module")
def ppo_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a policy of a pendulum trained with PPO."""
    path = tmp_path_factory.mktemp("ppo") / "pole.safetensors"
    policy = Sb3Learner("tiny", TINY).train(SMALL, 32, 3, on_evaluation=lambda evaluation: None)
    save_policy(policy, path)
    return path


def _plan(source_policy: Path, **more: Any) -> Plan:
    task = more.pop("task", TransferTask(DRY, ICY))
    settings = more.pop("settings", QUICK_CLONING)
    return make_plan(task, "cloning", settings, seeds=2, source_policy=source_policy, **more)


def test_a_study_starts_from_a_given_clone(clone_file: Path, tmp_path: Path) -> None:
    """No source is trained; zero-shot is the clone, and every seed starts from it."""
    plan = _plan(clone_file)
    assert plan.source_steps == 40
    study = run_study(plan, tmp_path / "study", source_policy=clone_file, executor=Serial())
    assert not study.of("source")
    assert study.source_return == ()
    (unchanged,) = study.of("zero-shot")
    learner = CloneLearner("cloning", QUICK_CLONING)
    worth = learner.evaluate(ICY, learner.load(clone_file)).mean_return
    assert unchanged.curve[0].mean_return == worth
    for tuned in study.of("fine-tune"):
        assert tuned.curve[0].mean_return == worth
        assert [evaluation.steps for evaluation in tuned.curve] == [0, 20, 40]


def test_a_study_resumes_with_its_planned_clone_only(clone_file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.safetensors"
    load_policy(clone_file).described(command="again").save(other)
    with pytest.raises(StudyError, match="not the one that this study was planned with"):
        run_study(_plan(clone_file), tmp_path / "study", source_policy=other, executor=Serial())


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (WET, r"was trained in .*Dry-v1, and the source is .*Wet-v1"),
        (msgspec.structs.replace(DRY, kwargs={"grip": 0.1}), r"is .*Dry-v1 \(grip=0\.1\)"),
    ],
)
def test_a_clone_of_another_source_is_refused(clone_file: Path, source: EnvRef, text: str) -> None:
    """The message names the env that it was trained in."""
    with pytest.raises(SpaceMismatch, match=text):
        _plan(clone_file, task=TransferTask(source, ICY))


def test_ppo_refuses_a_clone(clone_file: Path) -> None:
    with pytest.raises(PolicyError, match=r"dry\.safetensors is a clone .* tiny cannot train"):
        tiny_plan(source_policy=clone_file)


def test_a_clone_of_recordings_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "found.safetensors"
    CameraPolicy.fresh(QUICK_CLONING.clone, 0).save(path)
    with pytest.raises(PolicyError, match="learned from recordings without an env"):
        _plan(path)


def test_a_missing_policy_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"There is no policy file .*none\.safetensors"):
        _plan(tmp_path / "none.safetensors")


def test_source_steps_are_those_of_arms_that_train_their_own(
    ppo_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a given policy they count if another policy learns in the source."""
    counted: list[int] = []

    def summarised(*arguments: Any, source_steps: int, **more: Any) -> Summary:
        counted.append(source_steps)
        return summarise(*arguments, source_steps=source_steps, **more)

    monkeypatch.setattr("shapechanger.transfer.study.summarise", summarised)
    arms = ("scratch", "zero-shot", "randomised")
    plan = tiny_plan(source_policy=ppo_file, source_steps=64, arms=arms)
    assert (plan.source_steps, plan.own_steps) == (32, 64)
    assert [plan.source_steps_of(arm) for arm in ("zero-shot", "randomised")] == [32, 64]
    assert [plan.steps_of(kind) for kind in ("zero-shot", "randomised")] == [0, 64]
    run_study(plan, tmp_path / "study", source_policy=ppo_file, executor=Serial())
    trained = load_policy(Run("randomised", 0).policy_file(tmp_path / "study"))
    assert trained.card.steps == 64
    assert counted == [32, 64]  # In total steps an arm is behind scratch by its source steps.
    with pytest.raises(StudyError, match="no arm trains its own policy"):
        tiny_plan(source_policy=ppo_file, source_steps=64)
